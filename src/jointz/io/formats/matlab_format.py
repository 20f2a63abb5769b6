"""MATLAB files in and out (written as version 5, which every MATLAB and GNU Octave load).

What is written is one variable, the struct ``jointz``::

    jointz.version              2
    jointz.groups.NAME          one struct a group
        .name                   as the file spelled it, where NAME had to differ
        .rate_hz                of a uniform clock, else []
        .start_s                time of the first sample on a uniform clock
        .time                   n x 1, s; [] where there is no clock
        .n                      samples
        .signals.NAME           one struct a signal
            .name .unit .description
            .positive           what positive means, where it is known
            .values             n x 1 double, or n x 1 cell array of text
    jointz.events               .time_s .duration_s (m x 1), .label (m x 1 cell array)
    jointz.metadata             .key .value (cell arrays)

``positive`` comes from the metadata ``positive.SIGNAL``, else ``positive``; of one of several
recordings in ``GROUP.positive.SIGNAL``, else ``GROUP.positive``. A whole study
(:mod:`jointz.conversion.matlab_study`) has ``jointz.recordings(k)`` instead of groups; it is
read as a group a recording, and one more for its pulses.
"""

import io
import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from jointz.core.acquisition import Acquisition, Event, Signal, SignalGroup
from jointz.core.study import FilesSpec
from jointz.io.formats.columns import (
    RawTable,
    TableRequest,
    damaged,
    file_error,
    make_table,
    missing_columns,
)
from jointz.io.formats.losses import is_plain, listed, lost_letters, plainly, text_array, words_of
from jointz.io.formats.matlab_variables import load_variables, series_at, series_names, value_at
from jointz.io.text.column_names import READING, is_time, unique_names, with_clock

ROOT = "jointz"
#: ``jointz.version`` of an acquisition, and of a whole study.
_VERSION, STUDY = 2.0, 3.0
_DAMAGE = (KeyError, ValueError, TypeError, IndexError, AttributeError)


_OBJECT_HINT = (
    "The file holds MATLAB objects (table, timetable, string, categorical), which only MATLAB "
    "reads; save table2struct(T, 'ToScalar', true), and text as cellstr."
)
#: namelengthmax of MATLAB; scipy writes no longer field.
LONGEST_NAME = 63
_NO_LETTER = re.compile(r"\W", re.ASCII)
_KEYWORDS = frozenset(
    [
        *("break", "case", "catch", "classdef", "continue", "else", "elseif", "end", "for"),
        *("function", "global", "if", "otherwise", "parfor", "persistent", "return", "spmd"),
        *("switch", "try", "while"),
    ]
)


class MatlabFormat:
    """Reads series of any .mat file by length, and its own layout exactly; writes all.

    A column is a dotted name through structs, ``data.knee.angle``; ``data.signals.3`` is the
    third column of a matrix (samples in rows), or the third element of a struct or cell array.
    """

    name = "MATLAB .mat"

    def read(self, path: Path, files: FilesSpec) -> Acquisition:  # noqa: ARG002
        """Return numeric and text series; those of one length make a group."""
        content, has_objects = load_variables(path, None)
        struct = content.get(ROOT)
        version = struct.get("version") if isinstance(struct, Mapping) else None
        if isinstance(struct, Mapping) and version in (_VERSION, STUDY):
            try:
                return _jointz_content(struct) if version == _VERSION else _study(struct)
            except _DAMAGE as exc:
                raise damaged(path, exc) from exc
        return _foreign(path, content, has_objects=has_objects)

    def read_columns(self, path: Path, request: TableRequest) -> RawTable:
        """Return the requested series, flattened."""
        names = [str(c) for c in request.columns]
        content, has_objects = load_variables(path, {name.partition(".")[0] for name in names})
        values = {name: value_at(content, name.split(".")) for name in names}
        missing = [name for name, value in values.items() if value is None]
        if missing:
            content, has_objects = load_variables(path, None)
            hint = _OBJECT_HINT if has_objects else ""
            raise missing_columns(path, missing, list(series_names(content)), hint)
        return make_table(path, request, lambda c: series_at(path, c, values[c]), {})

    def list_columns(self, path: Path, files: FilesSpec) -> list[str] | None:  # noqa: ARG002
        """Return None: the names inside structs are known only after reading all."""
        return None

    def losses(self, content: Acquisition) -> list[str]:
        """Name what version 5 cannot hold: NUL and half letters."""
        lost = lost_letters(content.groups)
        odd = [repr(word) for word in words_of(content) if not is_plain(word)]
        if odd:
            lost.append(f"It cannot hold as they are (NUL, half letters): {listed(odd)}.")
        return lost

    def encode(self, content: Acquisition, path: Path) -> bytes:
        """Return the struct ``jointz`` (layout: this module's docstring)."""
        names = field_names([group.name or "data" for group in content.groups])
        groups = {
            name: _group(group, content.metadata)
            for name, group in zip(names, content.groups, strict=True)
        }
        events = np.array([(e.time_s, e.duration_s) for e in content.events]).reshape(-1, 2)
        struct = {
            "version": _VERSION,
            "groups": groups,
            "events": {
                "time_s": events[:, :1],
                "duration_s": events[:, 1:],
                "label": cells(event.label for event in content.events),
            },
            "metadata": {"key": cells(content.metadata), "value": cells(content.metadata.values())},
        }
        return struct_bytes(struct, path)


def struct_bytes(content: Mapping[str, Any], path: Path) -> bytes:
    """Return a version 5 file of one struct ``jointz``, compressed."""
    from scipy.io import savemat
    from scipy.io.matlab import MatWriteError

    stream = io.BytesIO()
    variables = {ROOT: dict(content)}
    try:
        savemat(stream, variables, long_field_names=True, do_compression=True, oned_as="column")
    except (MatWriteError, OverflowError) as exc:
        raise file_error(
            path,
            f"a .mat file of version 5 cannot hold it ({exc}). Write fewer signals, or .nc.",
        ) from exc
    return stream.getvalue()


def field_names(names: Sequence[str]) -> list[str]:
    """Return a field name of MATLAB for each name; they differ where the names do not."""
    # The number of a repeated name may not make it too long.
    longest = LONGEST_NAME - len(f"_{len(names) + 1}")
    return unique_names([_identifier(name, longest) for name in names])


def _identifier(name: str, longest: int) -> str:
    word = _NO_LETTER.sub("_", name)
    if not word[:1].isalpha():
        word = f"x{word}"
    return f"{word}_" if word in _KEYWORDS else word[:longest]


def column(values: np.ndarray) -> np.ndarray:
    """Return samples as MATLAB has them: a column of doubles."""
    return values.reshape(-1, 1)


def cells(texts: Iterable[str]) -> np.ndarray:
    """Return a column of cells with a text each."""
    return text_array(plainly(str(text)) for text in texts).reshape(-1, 1)


def number_or_empty(value: float | None) -> Any:
    """Return a number, or ``[]`` where there is none."""
    return np.empty((0, 0)) if value is None else float(value)


# --- the layout of jointz ---------------------------------------------------------------------


def _group(group: SignalGroup, metadata: Mapping[str, str]) -> dict[str, Any]:
    time = group.times_s()
    names = field_names([signal.name for signal in group.signals])
    clock = "none" if group.time_s is None else "stamps"
    return {
        "name": plainly(group.name),
        "rate_hz": number_or_empty(group.rate_hz),
        "start_s": float(group.start_s),
        "time": np.empty((0, 0)) if time is None else column(time),
        "clock": "rate" if group.rate_hz is not None else clock,
        "n": float(group.n_samples),
        "signals": {
            name: _signal(signal, _positive(group.name, signal.name, metadata))
            for name, signal in zip(names, group.signals, strict=True)
        },
    }


def _positive(group: str, name: str, metadata: Mapping[str, str]) -> str:
    """Return what positive means: said of the group's signal, a signal, the group or all."""
    group_key = f"{group}.positive"
    keys = (f"{group_key}.{name}", f"positive.{name}", group_key, "positive")
    return next((metadata[key] for key in keys if key in metadata), "")


def _signal(signal: Signal, positive: str) -> dict[str, Any]:
    return {
        "name": plainly(signal.name),
        "unit": plainly(signal.unit),
        "description": plainly(signal.description),
        "positive": plainly(positive),
        "kind": "text" if signal.is_text else "number",
        "values": cells(signal.values) if signal.is_text else column(signal.values),
    }


def _jointz_content(struct: Mapping[str, Any]) -> Acquisition:
    events, metadata = struct["events"], struct["metadata"]
    times, lengths = _numbers(events["time_s"]), _numbers(events["duration_s"])
    labels = _texts(events["label"], len(times))
    n = len(metadata["key"]) if isinstance(metadata["key"], list) else 1
    pairs = zip(_texts(metadata["key"], n), _texts(metadata["value"], n), strict=True)
    return Acquisition(
        tuple(_jointz_group(name, group) for name, group in (struct["groups"] or {}).items()),
        tuple(
            Event(float(t), label, float(d))
            for t, label, d in zip(times, labels, lengths, strict=True)
        ),
        dict(pairs),
    )


def _jointz_group(field: str, struct: Mapping[str, Any]) -> SignalGroup:
    n, clock = int(struct["n"]), _word(struct["clock"])
    place = f"{ROOT}.groups.{field}"
    signals = tuple(
        Signal(
            _word(signal["name"]),
            _texts(signal["values"], n)
            if _word(signal["kind"]) == "text"
            else _numbers(signal["values"]),
            _word(signal["unit"]),
            _word(signal["description"]),
            f"{place}.signals.{key}.values",
        )
        for key, signal in (struct["signals"] or {}).items()
    )
    return SignalGroup(
        _word(struct["name"]),
        signals,
        float(struct["rate_hz"]) if clock == "rate" else None,
        float(struct["start_s"]),
        _numbers(struct["time"]) if clock == "stamps" else None,
        "" if clock == "none" else f"{place}.time",
    )


def _study(struct: Mapping[str, Any]) -> Acquisition:
    """Return the recordings of a study as groups, and their pulses."""
    recordings = _entries(struct["recordings"])
    keys = ("participant", "condition", "session", "side", "trial")
    labels = [
        "_".join(w for key in keys if (w := _word(recording[key]))) for recording in recordings
    ]
    groups = []
    for k, (name, recording) in enumerate(
        zip(unique_names(labels), recordings, strict=True), start=1
    ):
        number = f".{k}" if len(recordings) > 1 else ""
        place = f"{ROOT}.recordings.signals{number}"
        signals = tuple(
            Signal(
                _word(signal["name"]),
                _numbers(signal["values"]),
                _word(signal["unit"]),
                column=f"{place}.{key}.values",
            )
            for key, signal in (recording["signals"] or {}).items()
        )
        time, column = _numbers(recording["time"]), f"{ROOT}.recordings.time{number}"
        groups.append(SignalGroup(name, signals, time_s=time, time_column=column))
        groups += _pulses(f"{name}.pulses", recording["pulses"])
    metadata = {key: _word(struct[key]) for key in ("kind", "joint", "positive", "study_toml")}
    return Acquisition(tuple(groups), (), metadata)


def _entries(struct: Mapping[str, Any]) -> list[dict[str, Any]]:
    """Return the structs of an array, which is read as a struct of lists."""
    if isinstance(struct["n"], list):
        return [{key: struct[key][k] for key in struct} for k in range(len(struct["n"]))]
    return [dict(struct)]


def _pulses(name: str, struct: Mapping[str, Any]) -> list[SignalGroup]:
    onset = _numbers(struct["onset_s"])
    if not len(onset):
        return []
    signals = (
        Signal("onset_s", onset, "s"),
        Signal("duration_s", _numbers(struct["duration_s"]), "s"),
        Signal("amplitude", _numbers(struct["amplitude"])),
        Signal("timing_point", _texts(struct["timing_point"], len(onset))),
    )
    return [SignalGroup(name, signals)]


def _numbers(value: Any) -> np.ndarray:
    return np.atleast_1d(np.asarray(value, dtype=np.float64)).ravel()


def _texts(value: Any, n: int) -> np.ndarray:
    """Return a column of cells; MATLAB files keep one cell like the text in it."""
    words = value if isinstance(value, list) and n != 1 else [value]
    texts = np.empty(n, dtype=object)
    texts[:] = [_word(word) for word in words][:n] if n else []
    return texts


def _word(value: Any) -> str:
    """Return a text; an empty one is kept as an empty array."""
    return value if isinstance(value, str) else ""


# --- files of others --------------------------------------------------------------------------


def _foreign(path: Path, content: Mapping[str, Any], *, has_objects: bool) -> Acquisition:
    by_length: dict[int, list[Signal]] = {}
    metadata: dict[str, str] = {}
    left_out: list[str] = []
    for name in series_names(content):
        value = value_at(content, name.split("."))
        values = _series(value)
        if values is not None:
            by_length.setdefault(len(values), []).append(Signal(name, values))
        elif isinstance(value, str | int | float):
            metadata[name] = str(value)
        elif np.size(value):
            left_out.append(name)
    if not by_length:
        hint = " It holds MATLAB objects, which only MATLAB reads." if has_objects else ""
        raise file_error(
            path,
            f"expected series of numbers, found none.{hint} Save vectors or structs of vectors.",
        )
    if has_objects or left_out:
        what = [*left_out, *(["MATLAB objects"] if has_objects else [])]
        metadata[f"{READING}left_out"] = f"no series of samples: {listed(what)}"
    groups = []
    for length, signals in sorted(by_length.items(), reverse=True):
        name = f"n{length}" if len(by_length) > 1 else ""
        names = unique_names([signal.name for signal in signals])
        signals = [replace(s, name=unique) for s, unique in zip(signals, names, strict=True)]
        group, notes = _with_clock(name, signals)
        groups.append(group)
        metadata |= notes
    return Acquisition(tuple(groups), (), metadata)


def _with_clock(name: str, signals: Sequence[Signal]) -> tuple[SignalGroup, dict[str, str]]:
    """Make a group; the time of a struct is its clock where the struct holds all of it."""
    times = [s.name for s in signals if is_time(s.name.rpartition(".")[2])]
    structs = [time[: time.rfind(".") + 1] for time in times]
    shared = [p for p in structs if all(signal.name.startswith(p) for signal in signals)]
    # A series alone, such as times of events, is the clock of nothing.
    prefix = shared[0] if shared and len(signals) > 1 else ""
    bare = [replace(s, name=s.name.removeprefix(prefix), column=s.name) for s in signals]
    group, notes = with_clock(name, bare)
    if times and not shared and group.time_s is None:
        notes[f"{READING}clock.{name}"] = (
            f"not the clock, as its struct does not hold all series of this length: {listed(times)}"
        )
    whole = tuple(replace(signal, name=signal.column, column="") for signal in group.signals)
    return replace(group, signals=whole), notes


def _series(value: Any) -> np.ndarray | None:
    """Return a vector of real numbers or of text; None where it is no series."""
    if isinstance(value, list):
        if len(value) > 1 and all(isinstance(v, int | float) for v in value):
            return np.array(value, dtype=np.float64)
        if len(value) < 2 or not all(isinstance(v, str) for v in value):
            return None
        return _texts(value, len(value))
    if not isinstance(value, np.ndarray) or value.dtype.kind not in "fiub" or value.size < 2:
        return None
    if value.ndim > 1 and max(value.shape) < value.size:
        return None
    return value.ravel().astype(np.float64, copy=False)
