"""MATLAB files, read: series of any file, and the struct of earlier versions of jointz.

Earlier versions wrote one variable, the struct ``jointz``::

    jointz.version              2
    jointz.groups.NAME          one struct a group
        .name                   as the file spelled it, where NAME had to differ
        .rate_hz                of a uniform clock, else []
        .start_s                time of the first sample on a uniform clock
        .time                   n x 1, s; [] where there is no clock
        .n                      samples
        .signals.NAME           one struct a signal
            .name .unit .description
            .values             n x 1 double, or n x 1 cell array of text
    jointz.events               .time_s .duration_s (m x 1), .label (m x 1 cell array)
    jointz.metadata             .key .value (cell arrays)

A whole study (version 3) has ``jointz.recordings(k)`` instead of groups; it is read as a group a
recording, and one more for its pulses.
"""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from jointz.core.acquisition import Acquisition, Event, Signal, SignalGroup
from jointz.core.study import FilesSpec
from jointz.io.formats.columns import (
    RawTable,
    TableRequest,
    damage_errors,
    file_error,
    make_table,
    missing_columns,
)
from jointz.io.formats.losses import listed
from jointz.io.formats.matlab_variables import (
    column_labels,
    load_variables,
    series_at,
    series_names,
    value_at,
)
from jointz.io.text.column_names import READING, is_time, unique_names, with_clock
from jointz.io.text.text_layout import stated_rate

ROOT = "jointz"
#: ``jointz.version`` of an acquisition, and of a whole study.
_VERSION, _STUDY = 2.0, 3.0
_DAMAGE = (KeyError, ValueError, TypeError, IndexError, AttributeError)
_OBJECT_NOTE = "MATLAB objects (save table2struct(T, 'ToScalar', true) for them)"
_OBJECT_HINT = (
    "The file holds MATLAB objects (table, timetable, string, categorical), which only MATLAB "
    "reads; save table2struct(T, 'ToScalar', true), and text as cellstr."
)


class MatlabFormat:
    """Reads series of any .mat file by length, and the layout of jointz exactly.

    A column is a dotted name through structs, ``data.knee.angle``; ``data.signals.3`` is the
    third column of a matrix (samples in rows), or the third element of a struct or cell array.
    """

    name = "MATLAB .mat"

    def read(self, path: Path, files: FilesSpec) -> Acquisition:  # noqa: ARG002
        """Return numeric and text series; those of one length make a group."""
        content, has_objects = load_variables(path, None)
        struct = content.get(ROOT)
        version = struct.get("version") if isinstance(struct, Mapping) else None
        if isinstance(struct, Mapping) and version in (_VERSION, _STUDY):
            with damage_errors(path, *_DAMAGE):
                return _jointz_content(struct) if version == _VERSION else _study(struct)
        return _foreign(path, content, has_objects=has_objects)

    def read_columns(self, path: Path, request: TableRequest) -> RawTable:
        """Return the requested series, flattened."""
        names = [str(c) for c in request.columns]
        # Cell arrays may state the unit of a matrix's column.
        of_matrix = any(name.rpartition(".")[2].isdecimal() for name in names)
        variables = None if of_matrix else {name.partition(".")[0] for name in names}
        content, has_objects = load_variables(path, variables)
        values = {name: value_at(content, name.split(".")) for name in names}
        missing = [name for name, value in values.items() if value is None]
        if missing:
            content, has_objects = load_variables(path, None)
            hint = _OBJECT_HINT if has_objects else ""
            raise missing_columns(path, missing, list(series_names(content)), hint)
        series = {name: series_at(path, name, value) for name, value in values.items()}
        clocks = _clocks(content, series) if request.several_clocks else {}
        units = {name: unit for name, (_, unit) in column_labels(content) if unit}
        return make_table(path, request, lambda c: series[c], units, clocks=clocks)

    def list_columns(self, path: Path, files: FilesSpec) -> list[str] | None:  # noqa: ARG002
        """Return None: the names inside structs are known only after reading all."""
        return None


def _clocks(content: Mapping[str, Any], series: Mapping[str, np.ndarray]) -> dict[str, np.ndarray]:
    """Return the times of columns of different length: ``time`` of the struct that each is in."""
    if len({len(values) for values in series.values()}) < 2:
        return {}
    structs = {name: name.rpartition(".")[0] for name in series}
    stamps = {}
    for name in series_names(content):
        struct, _, last = name.rpartition(".")
        if struct in structs.values() and is_time(last):
            value = value_at(content, name.split("."))
            stamps[struct] = np.asarray(series_at(Path(name), name, value))
    return {
        name: stamps[struct]
        for name, struct in structs.items()
        if struct in stamps and len(stamps[struct]) == len(series[name])
    }


# --- the layout of jointz ---------------------------------------------------------------------


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
    labels = dict(column_labels(content))
    texts = {text for label in labels.values() for text in label}
    for name in series_names(content):
        value = value_at(content, name.split("."))
        values = _series(value)
        if isinstance(value, list) and texts.issuperset(map(str, value)):
            continue  # names or units of a matrix's columns
        if values is not None:
            title, unit = labels.get(name, ("", ""))
            signal = Signal(title or name, values, unit, column=name)
            by_length.setdefault(len(values), []).append(signal)
        elif isinstance(value, str | int | float):
            metadata[name] = str(value)
        elif np.size(value):
            left_out.append(name)
    if not by_length:
        hint = _OBJECT_HINT if has_objects else "Save vectors or structs of vectors."
        raise file_error(path, f"expected series of numbers, found none. {hint}")
    if has_objects or left_out:
        what = [*left_out, *([_OBJECT_NOTE] if has_objects else [])]
        metadata[f"{READING}left_out"] = f"no series of samples: {listed(what)}"
    lines = [f"{name.rpartition('.')[2]}: {value}" for name, value in metadata.items()]
    rates = {hz for line in lines if (hz := stated_rate(f"{line} Hz") or stated_rate(line))}
    groups = []
    for length, signals in sorted(by_length.items(), reverse=True):
        name = f"n{length}" if len(by_length) > 1 else ""
        names = unique_names([signal.name for signal in signals])
        signals = [replace(s, name=unique) for s, unique in zip(signals, names, strict=True)]
        group, notes = _with_clock(name, signals)
        groups.append(group)
        metadata |= notes
    if len(rates) == 1 and groups[0].time_s is None:  # that of the longest series
        groups[0] = replace(groups[0], rate_hz=rates.pop())
    return Acquisition(tuple(groups), (), metadata)


def _with_clock(name: str, signals: Sequence[Signal]) -> tuple[SignalGroup, dict[str, str]]:
    """Make a group; the time of a struct is its clock where the struct holds all of it."""
    times = [s.column for s in signals if is_time(s.name.rpartition(".")[2])]
    structs = [time[: time.rfind(".") + 1] for time in times]
    shared = [p for p in structs if all(signal.column.startswith(p) for signal in signals)]
    # A series alone, such as times of events, is the clock of nothing.
    prefix = shared[0] if shared and len(signals) > 1 else ""
    bare = [replace(s, name=s.name.removeprefix(prefix)) for s in signals]
    group, notes = with_clock(name, bare)
    if times and not shared and group.time_s is None:
        notes[f"{READING}clock.{name}"] = (
            f"not the clock, as its struct does not hold all series of this length: {listed(times)}"
        )
    own = {signal.column: signal for signal in signals}
    return replace(group, signals=tuple(own[signal.column] for signal in group.signals)), notes


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
