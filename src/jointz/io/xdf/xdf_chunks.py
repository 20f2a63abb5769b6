"""Chunks of an XDF file, checked one by one before anything is read.

pyxdf jumps over what it cannot read and says so in a log; a file that is cut off or damaged
would lose samples in silence, or have it ask for more memory than there is. So every chunk is
checked first: its length, its kind, the stream it belongs to, and each sample in it.
"""

import re
import struct
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from xml.etree import ElementTree

import numpy as np

from jointz.core.errors import DataError

_MAGIC = b"XDF:"
_BOUNDARY = bytes.fromhex("43a546dccbf5410fb30ed5467383cbe4")
_FILE_HEADER, _STREAM_HEADER, _SAMPLES, _CLOCK_OFFSET, _BOUNDARY_TAG, _FOOTER = range(1, 7)
#: Bytes of a number in each format of channels; 0 where a value has a length of its own.
_VALUE_BYTES: Mapping[str, int] = {
    "double64": 8,
    "int64": 8,
    "float32": 4,
    "int32": 4,
    "int16": 2,
    "int8": 1,
    "string": 0,
}
_STAMPED = 8
_OFFSET_BYTES = 16
_LENGTHS = {1: "<B", 4: "<I", 8: "<Q"}
_WHOLE = re.compile(r"\s*-?\d{1,18}\s*", re.ASCII)
_MOST_CHANNELS = 65_536


@dataclass(slots=True)
class Stream:
    """Summary of the chunks of one stream."""

    name: str  # as in its header
    n_channels: int  # number of values in a sample
    value_bytes: int  # bytes of a value, 0 for texts
    n_samples: int = 0  # number of samples in the chunks
    stamped: int = 0  # number of samples with a time stamp
    first_stamped: bool = False  # whether the first sample has a time stamp
    n_offsets: int = 0  # number of measured offsets of its clock
    # number of samples by its footer; -1 if not stated, None without a footer
    footer_count: int | None = None
    n_garbled: int = 0  # number of texts that are no UTF-8


@dataclass(slots=True)
class _Walk:
    """A way through a file, byte by byte."""

    path: Path
    content: bytes
    streams: dict[int, Stream] = field(default_factory=dict)  # number -> stream
    has_header: bool = False  # whether a file header was found

    def refuse(self, at: int, expected: str, found: object) -> DataError:
        return DataError(
            f"{self.path.name}, byte {at}: expected {expected}, found {found}. It is no XDF file, "
            "or it is damaged. Copy it again; if it was recorded so, cut it off before this byte.",
            path=str(self.path),
        )

    def cut(self, at: int, size: int, end: int) -> bytes:
        if at + size > end:
            raise self.refuse(at, f"{size} more bytes", f"{end - at} to the end of the chunk")
        return self.content[at : at + size]

    def length(self, at: int, end: int) -> tuple[int, int]:
        """Return a number of variable length, and the byte after it."""
        size = self.cut(at, 1, end)[0]
        if size not in _LENGTHS:
            raise self.refuse(at, "a number of 1, 4 or 8 bytes", f"one of {size}")
        return struct.unpack(_LENGTHS[size], self.cut(at + 1, size, end))[0], at + 1 + size


def walk(path: Path, content: bytes) -> tuple[dict[int, Stream], int]:
    """Return the streams of a file by number, and the byte after its last whole chunk.

    A recorder that stops in a chunk leaves it cut off at the end, and is no reason to refuse
    the chunks before it. A later boundary shows that the file goes on, and is damaged.
    """
    file = _Walk(path, content)
    if not content.startswith(_MAGIC):
        raise file.refuse(0, "'XDF:'", repr(content[:4].decode("latin-1")))
    at, end = len(_MAGIC), len(content)
    while at < end:
        if file.streams and _is_cut(content, at):
            break
        size, start = file.length(at, end)
        if size < 2 or start + size > end:
            raise file.refuse(at, f"a chunk of {size} bytes", f"{end - start} to the end")
        _chunk(file, start, start + size)
        at = start + size
    if not file.has_header:
        raise file.refuse(len(_MAGIC), "a file header", "the end of the file")
    return file.streams, at


def _is_cut(content: bytes, at: int) -> bool:
    """Return whether a chunk reaches beyond the file, and no boundary says that it goes on."""
    start = at + 1 + content[at]
    stop = start + int.from_bytes(content[at + 1 : start], "little")
    return content[at] in _LENGTHS and stop > len(content) and _BOUNDARY not in content[at:]


def xml_of(path: Path, at: int, raw: bytes) -> ElementTree.Element:
    """Return the root of a chunk's XML, which is ``info``."""
    try:
        root = ElementTree.fromstring(raw.decode("utf-8", errors="strict"))
    except (ElementTree.ParseError, ValueError) as exc:
        raise _Walk(path, b"").refuse(at, "a description in XML", str(exc)) from exc
    if root.tag != "info":
        raise _Walk(path, b"").refuse(at, "<info>", f"<{root.tag}>")
    return root


def _chunk(file: _Walk, at: int, end: int) -> None:
    (tag,) = struct.unpack("<H", file.content[at : at + 2])
    body = at + 2
    if tag == _FILE_HEADER:
        xml_of(file.path, body, file.content[body:end])
        file.has_header = True
    elif tag == _BOUNDARY_TAG:
        if file.content[body:end] != _BOUNDARY:
            raise file.refuse(body, "the signature of a boundary", "other bytes")
    elif tag in (_STREAM_HEADER, _SAMPLES, _CLOCK_OFFSET, _FOOTER):
        (number,) = struct.unpack("<I", file.cut(body, 4, end))
        _of_stream(file, tag, number, (body + 4, end))
    else:
        raise file.refuse(at, "a chunk of kind 1 to 6", f"kind {tag}")


def _of_stream(file: _Walk, tag: int, number: int, span: tuple[int, int]) -> None:
    at, end = span
    if tag == _STREAM_HEADER:
        if number in file.streams:
            raise file.refuse(at, f"one header of stream {number}", "a second one")
        file.streams[number] = _header(file, at, end)
        return
    stream = file.streams.get(number)
    if stream is None:
        raise file.refuse(at, f"a header of stream {number} before its chunks", "none")
    if tag == _SAMPLES:
        _samples(file, stream, at, end)
    elif tag == _FOOTER:
        count = xml_of(file.path, at, file.content[at:end]).findtext("sample_count") or ""
        stream.footer_count = _whole(count, -1)
    else:
        if end - at != _OFFSET_BYTES:
            raise file.refuse(at, f"a clock offset of {_OFFSET_BYTES} bytes", f"{end - at}")
        if not np.isfinite(np.frombuffer(file.content[at:end], dtype="<f8")).all():
            raise file.refuse(at, "a clock offset", "no number")
        stream.n_offsets += 1


def _header(file: _Walk, at: int, end: int) -> Stream:
    root = xml_of(file.path, at, file.content[at:end])
    name, count, kind, rate = (
        root.findtext(tag) or ""
        for tag in ("name", "channel_count", "channel_format", "nominal_srate")
    )
    if not name:
        raise file.refuse(at, "the name of a stream", "none")
    if kind not in _VALUE_BYTES:
        raise file.refuse(at, f"a channel_format among {', '.join(_VALUE_BYTES)}", repr(kind))
    n_channels = _whole(count, 0)
    if not 0 < n_channels <= _MOST_CHANNELS:
        found = repr(count[:40])
        raise file.refuse(at, f"a channel_count from 1 to {_MOST_CHANNELS}", found)
    try:
        nominal = float(rate)
    except ValueError:
        nominal = np.nan
    if not 0 <= nominal < np.inf:
        raise file.refuse(at, "a nominal_srate from 0 on", repr(rate))
    return Stream(name, n_channels, _VALUE_BYTES[kind])


def _whole(text: str, default: int) -> int:
    """Return the whole number that a text says, of a size that can be counted."""
    return int(text) if _WHOLE.fullmatch(text) else default


def _samples(file: _Walk, stream: Stream, at: int, end: int) -> None:
    """Check that a chunk holds its samples to the last byte; count those with time stamps."""
    n, at = file.length(at, end)
    if n > end - at:
        raise file.refuse(at, f"{n} samples", f"{end - at} bytes")
    flags = _stamps(file, stream, n, (at, end))
    if stream.n_samples == 0 and n:
        stream.first_stamped = bool(flags[0])
    stream.n_samples += n
    stream.stamped += int(np.count_nonzero(flags))


def _stamps(file: _Walk, stream: Stream, n: int, span: tuple[int, int]) -> np.ndarray:
    """Return whether each sample has a stamp; all or none is looked at in one go."""
    at, end = span
    size = stream.n_channels * stream.value_bytes
    for flag in (_STAMPED, 0) if size and n else ():
        step = 1 + flag + size
        if end - at == n * step:
            flags = np.frombuffer(file.content[at:end], dtype=np.uint8)[::step]
            if (flags == flag).all():
                return np.asarray(flags != 0)
    flags = np.zeros(n, dtype=bool)
    for i in range(n):
        flag = file.cut(at, 1, end)[0]
        if flag not in (0, _STAMPED):
            raise file.refuse(at, "a time stamp of 0 or 8 bytes", f"one of {flag}")
        file.cut(at + 1, flag, end)
        flags[i], at = flag == _STAMPED, at + 1 + flag
        at = at + len(file.cut(at, size, end)) if size else _after_texts(file, stream, (at, end))
    if at != end:
        raise file.refuse(at, "the end of the samples", f"{end - at} bytes more")
    return flags


def _after_texts(file: _Walk, stream: Stream, span: tuple[int, int]) -> int:
    """Return the byte after the texts of a sample; count those that are no UTF-8."""
    at, end = span
    for _ in range(stream.n_channels):
        size, at = file.length(at, end)
        stream.n_garbled += not _is_utf8(file.cut(at, size, end))
        at += size
    return at


def _is_utf8(raw: bytes) -> bool:
    try:
        raw.decode("utf-8")
    except UnicodeDecodeError:
        return False
    return True
