"""XDF: the streams of Lab Streaming Layer, each with time stamps on one common clock."""

import io
import logging
import re
import struct
import warnings
from collections import Counter
from collections.abc import Iterator, Mapping
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from logging.handlers import BufferingHandler
from pathlib import Path
from typing import Any

import numpy as np

from jointz.core.acquisition import Acquisition, Event, Signal, SignalGroup
from jointz.core.errors import DataError, install_advice
from jointz.core.study import FilesSpec
from jointz.io.formats.columns import damage_errors, damaged, file_error
from jointz.io.formats.group_format import GroupFormat
from jointz.io.formats.losses import text_array
from jointz.io.text.column_names import READING, distinct_names
from jointz.io.xdf.xdf_chunks import Stream, walk

_LIBRARY_ERRORS = (
    *(ValueError, ArithmeticError, LookupError, TypeError, AttributeError, RuntimeError),
    *(MemoryError, EOFError, SyntaxError, struct.error),
)
#: What pyxdf logs where offsets of a clock lead to no correction.
_UNUSED = re.compile(r"Stream (\d+): Clock offsets .* cannot be used for synchronization")
#: What became groups and signals, or is made by pyxdf, and is not told again as metadata.
_TOLD = frozenset(
    ("name", "channel_count", "channel_format", "nominal_srate", "stream_id", "effective_srate")
)
_NOT_IN_HEADER = ("segments", "clock_segments")
#: Second channel of markers that last, as earlier versions of jointz wrote them.
_DURATION = "duration_s"
_LARGEST_EXACT = 2**53
_MOST_RECORDS = 2**31  # of a logger; the buffer is never emptied
_BY_HAND = "Read it with pyxdf, and write the samples as csv with the times that you know."


class XdfFormat(GroupFormat):
    """A group a stream; streams of markers are events too."""

    name = "XDF"

    def read(self, path: Path, files: FilesSpec) -> Acquisition:  # noqa: ARG002
        """Return the streams of a file, each under its name.

        Time stamps are those of the recording computer: where the file has measured offsets of
        a stream's clock they are put to account by pyxdf, and nothing is smoothed or
        interpolated. Streams of one name are told apart by source, else by number. Streams of
        texts at no nominal rate are markers, and each text is an event as well.
        """
        content = path.read_bytes()
        walked, end = walk(path, content)
        loaded = _load(path, content[:end])
        with damage_errors(path, ValueError):  # a number in a description that is none
            return _acquisition(path, walked, loaded, n_unread=len(content) - end)


@dataclass(frozen=True, slots=True)
class _Loaded:
    """Result of pyxdf: streams by number, header, and how often offsets led to no correction."""

    streams: dict[int, dict[str, Any]]  # number -> stream
    header: Mapping[str, Any]
    unused: Counter[int]  # number of a stream -> parts whose clock offsets led to no correction


def _acquisition(
    path: Path, walked: Mapping[int, Stream], loaded: _Loaded, *, n_unread: int
) -> Acquisition:
    names = _names(loaded.streams)
    groups: list[SignalGroup] = []
    events: list[Event] = []
    info = loaded.header.get("info")
    metadata = _flat(info) if isinstance(info, Mapping) else {}
    metadata.pop("version", None)
    if n_unread:
        stops = f"The recording stops in a chunk: its last {n_unread} bytes are not read."
        metadata[f"{READING}end"] = stops
    for number, stream in loaded.streams.items():
        name = names[number]
        group = _group(path, name, stream, _clock(path, walked[number], stream))
        remarks = _remarks(walked[number], stream, group)
        remarks += _synchronised(path, walked[number], stream, loaded.unused[number])
        groups.append(group)
        metadata |= _described(stream, name)
        metadata |= {f"{READING}{name}": " ".join(remarks)} if remarks else {}
        irregular = float(_first(stream, "nominal_srate")) == 0
        if irregular and _first(stream, "channel_format") == "string":
            events += _events_of(group)
    events.sort(key=lambda event: event.time_s)
    return Acquisition(tuple(groups), tuple(events), metadata)


def _load(path: Path, content: bytes) -> _Loaded:
    """Have pyxdf read a file; what it would only log is an error here."""
    try:
        import pyxdf
    except ImportError as exc:
        raise file_error(path, f"XDF files need pyxdf. {install_advice('formats')}") from exc
    with (
        damage_errors(path, *_LIBRARY_ERRORS),
        _collected_warnings("pyxdf.pyxdf") as records,
        warnings.catch_warnings(),
        np.errstate(all="ignore"),
    ):
        warnings.simplefilter("ignore")
        streams, header = pyxdf.load_xdf(
            io.BytesIO(content), synchronize_clocks=True, dejitter_timestamps=False
        )
    errors = [record for record in records if record.levelno >= logging.ERROR]
    if errors:
        raise damaged(path, ValueError(errors[0].getMessage()))
    if any("clock_segments" not in stream["info"] for stream in streams):
        raise file_error(
            path,
            "XDF files need pyxdf 1.17.2 or newer, with numpy 2; found an older one. Update it: "
            'pip install --upgrade "jointz[formats]".',
        )
    unused = [match for record in records if (match := _UNUSED.match(record.getMessage()))]
    by_number = {int(stream["info"]["stream_id"]): stream for stream in streams}
    return _Loaded(by_number, header, Counter(int(match[1]) for match in unused))


@contextmanager
def _collected_warnings(name: str) -> Iterator[list[logging.LogRecord]]:
    """Collect the warnings of a logger in the block, and keep them from the terminal."""
    logger, listener = logging.getLogger(name), BufferingHandler(_MOST_RECORDS)
    listener.setLevel(logging.WARNING)
    before = logger.propagate
    logger.addHandler(listener)
    logger.propagate = False
    try:
        yield listener.buffer
    finally:
        logger.removeHandler(listener)
        logger.propagate = before


def _names(streams: Mapping[int, dict[str, Any]]) -> dict[int, str]:
    """Return a name of its own for each stream."""
    plain = {number: _first(stream, "name") for number, stream in streams.items()}
    names: dict[int, str] = {}
    for number, name in plain.items():
        twins = [n for n, other in plain.items() if other == name]
        sources = [_first(streams[n], "source_id") for n in twins]
        apart = all(sources) and len(set(sources)) == len(twins)
        mark = _first(streams[number], "source_id") if apart else str(number)
        unique = f"{name} ({mark})" if len(twins) > 1 else name
        names[number] = unique if unique not in names.values() else f"{unique} #{number}"
    return names


def _first(stream: Mapping[str, Any], tag: str) -> str:
    text = stream["info"].get(tag, [None])[0]
    return text if isinstance(text, str) else ""


def _described(stream: Mapping[str, Any], name: str) -> dict[str, str]:
    """Return what a stream's header says besides groups and signals, as metadata."""
    info = {tag: nodes for tag, nodes in stream["info"].items() if tag not in _NOT_IN_HEADER}
    texts = _flat({tag: nodes for tag, nodes in info.items() if tag not in _TOLD})
    labelled = {
        f"{place}.{tag}"
        for place in _channel_places(stream)
        for tag in ("label", "unit", "description")
    }
    metadata = {f"{name}.{k}": text for k, text in texts.items() if k not in labelled}
    nominal = _first(stream, "nominal_srate")
    if float(nominal) > 0:
        metadata[f"{name}.nominal_srate"] = nominal
    return metadata


def _channel_places(stream: Mapping[str, Any]) -> list[str]:
    count = int(_first(stream, "channel_count"))
    return [f"desc.channels.channel{f'.{i}' if i > 1 else ''}" for i in range(1, count + 1)]


def _clock(path: Path, walked: Stream, stream: Mapping[str, Any]) -> SignalGroup:
    """Return a stream's clock: its stamps, or first stamp and rate where it has no others."""
    stamps = np.array(stream["time_stamps"], dtype=np.float64)
    rate = float(_first(stream, "nominal_srate"))
    only_first = walked.stamped == 1 and walked.first_stamped and walked.n_offsets == 0
    if rate > 0 and only_first:
        return SignalGroup("", (), rate_hz=rate, start_s=float(stamps[0]))
    if walked.n_samples and not walked.stamped + rate:
        return SignalGroup("", ())
    if walked.n_samples and not walked.first_stamped:
        raise _unstamped(path, walked, "its first sample has none to count from")
    if walked.stamped < walked.n_samples and not rate:
        missing = walked.n_samples - walked.stamped
        raise _unstamped(path, walked, f"{missing} of {walked.n_samples} have none, nor a rate")
    return SignalGroup("", (), time_s=stamps)


def _unstamped(path: Path, walked: Stream, found: str) -> DataError:
    problem = f"expected a time stamp a sample, or a first one and a nominal rate; {found}."
    return _bad_stream(path, f"'{walked.name}'", problem)


def _bad_stream(path: Path, stream: str, problem: str) -> DataError:
    return DataError(f"{path.name}, stream {stream}: {problem} {_BY_HAND}", path=str(path))


def _group(path: Path, name: str, stream: Mapping[str, Any], clock: SignalGroup) -> SignalGroup:
    texts = _flat({"desc": stream["info"].get("desc", [])})
    places = _channel_places(stream)
    labels = [texts.get(f"{place}.label", "") for place in places]
    names = distinct_names(labels, len(places), "channel")
    if clock.time_s is not None and not np.isfinite(clock.time_s).all():
        row = int(np.flatnonzero(~np.isfinite(clock.time_s))[0])
        problem = f"expected a time stamp, found {clock.time_s[row]}."
        raise _bad_stream(path, f"'{name}', sample {row + 1}", problem)
    signals = tuple(
        Signal(
            label,
            _column(stream["time_series"], i),
            texts.get(f"{place}.unit", ""),
            texts.get(f"{place}.description", ""),
        )
        for i, (label, place) in enumerate(zip(names, places, strict=True))
    )
    return SignalGroup(name, signals, clock.rate_hz, clock.start_s, clock.time_s)


def _events_of(group: SignalGroup) -> list[Event]:
    """Return an event for each text of a stream of markers."""
    times = group.times_s()
    texts = [signal for signal in group.signals if signal.is_text]
    if times is None or not texts:
        return []
    if [signal.name for signal in texts[1:]] == [_DURATION]:
        with suppress(ValueError):  # else they are texts like any other
            durations = [float(text) for text in texts[1].values]
            return list(map(Event, times.tolist(), texts[0].values, durations))
    return [
        Event(time, signal.values[row])
        for row, time in enumerate(times.tolist())
        for signal in texts
        if signal.values[row]
    ]


def _column(series: Any, i: int) -> np.ndarray:
    """Return a channel as float64, or as texts where float64 cannot hold its whole numbers."""
    if isinstance(series, np.ndarray):
        column = series[:, i]
        if column.dtype.kind == "f" or not (np.abs(column) > _LARGEST_EXACT).any():
            return column.astype(np.float64)
        texts = [str(v) for v in column.tolist()]
    else:
        texts = [row[i] for row in series]
    return text_array(texts)


def _remarks(walked: Stream, stream: Mapping[str, Any], group: SignalGroup) -> list[str]:
    """Return remarks on what looks odd about a stream."""
    remarks = []
    if walked.footer_count is None:
        remarks.append("It has no footer: the recording was not closed.")
    elif walked.footer_count > walked.n_samples:
        remarks.append(f"Its footer counts {walked.footer_count} samples, it holds fewer.")
    if len(stream["time_stamps"]) < walked.n_samples:
        remarks.append("pyxdf left out samples after its end, known to be wrong.")
    if walked.n_garbled:
        remarks.append(f"{walked.n_garbled} texts are no UTF-8; what cannot be read is \ufffd.")
    made_up = walked.n_samples - walked.stamped
    if made_up and group.time_s is not None:
        remarks.append(f"{made_up} of {walked.n_samples} time stamps follow from the nominal rate.")
    return remarks


def _synchronised(
    path: Path, walked: Stream, stream: Mapping[str, Any], n_unused: int
) -> list[str]:
    """Return how the measured offsets of a stream's clock were used."""
    segments = stream["info"]["clock_segments"]
    if not (walked.n_offsets and walked.n_samples):
        return []
    if n_unused and len(segments) > 1:
        found = f"{n_unused} of {len(segments)} parts without"
        problem = f"expected offsets of its clock that pyxdf can use, found {found}."
        raise _bad_stream(path, f"'{walked.name}'", problem)
    if n_unused:
        return [
            f"None of the {walked.n_offsets} offsets of its clock can be used: its time stamps are "
            "NOT on the clock of the other streams."
        ]
    resets = len(segments) - 1
    resets_note = f" Its clock was reset {resets} time(s); each part has a correction of its own."
    return [
        f"Time stamps are corrected by {walked.n_offsets} offsets of its clock."
        + (resets_note if resets > 0 else "")
    ]


def _flat(tree: Any, prefix: str = "") -> dict[str, str]:
    """Return the texts of a tree; the second of two siblings of one name is ``name.2``."""
    texts: dict[str, str] = {}
    for tag, nodes in tree.items():
        for i, node in enumerate(nodes, start=1):
            name = f"{prefix}{tag}" + (f".{i}" if i > 1 else "")
            if isinstance(node, Mapping):
                texts |= _flat(node, f"{name}.")
            elif node is not None and str(node) and str(node).strip():
                texts[name] = str(node)
    return texts
