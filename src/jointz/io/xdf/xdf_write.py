"""Bytes of an XDF 1.0 file, chunk by chunk.

Written from the public specification (https://github.com/sccn/xdf/wiki/Specifications).
"""

import struct
from collections.abc import Iterator
from itertools import pairwise

import numpy as np

from jointz.core.acquisition import SignalGroup
from jointz.io.xdf.xdf_chunks import FILE_HEADER, FOOTER, MAGIC, SAMPLES, STREAM_HEADER
from jointz.io.xdf.xdf_plan import Clock, XdfContent, XdfStream
from jointz.io.xdf.xdf_tree import xml_bytes

_SAMPLES_OF_A_CHUNK = 1 << 16
_STAMPED = 8
_SHORT = 0xFF


def xdf_bytes(content: XdfContent) -> bytes:
    """Return a whole file."""
    head = xml_bytes({"version": ["1.0"], **content.header})
    chunks = [MAGIC, _chunk(FILE_HEADER, head)]
    streams = list(enumerate(content.streams, start=1))
    chunks += [_chunk(STREAM_HEADER, _number(n) + xml_bytes(s.header)) for n, s in streams]
    for number, stream in streams:
        chunks += [_chunk(SAMPLES, _number(number) + body) for body in _samples(stream)]
        chunks.append(_chunk(FOOTER, _number(number) + xml_bytes(_footer(stream.group))))
    return b"".join(chunks)


def _samples(stream: XdfStream) -> Iterator[bytes]:
    """Yield the samples of each chunk; on a uniform clock only the first one has a stamp."""
    group, n = stream.group, stream.group.n_samples
    cuts = [*range(0, n, _SAMPLES_OF_A_CHUNK), n]
    if stream.clock is Clock.UNIFORM and n > 1:
        cuts.insert(1, 1)
    stamps = group.times_s()
    for start, stop in pairwise(cuts):
        stamped = stream.clock is Clock.STAMPS or (stream.clock is Clock.UNIFORM and start == 0)
        part = stamps[start:stop] if stamped and stamps is not None else None
        columns = [signal.values[start:stop] for signal in group.signals]
        write = _texts if group.signals[0].is_text else _numbers
        yield _length(stop - start, short=False) + write(columns, part)


def _numbers(columns: list[np.ndarray], stamps: np.ndarray | None) -> bytes:
    fields: list[tuple[str, str] | tuple[str, str, tuple[int, ...]]] = [("flag", "u1")]
    if stamps is not None:
        fields.append(("stamp", "<f8"))
    fields.append(("values", "<f8", (len(columns),)))
    rows = np.zeros(len(columns[0]), dtype=fields)
    if stamps is not None:
        rows["flag"], rows["stamp"] = _STAMPED, stamps
    rows["values"] = np.stack(columns, axis=1)
    return rows.tobytes()


def _texts(columns: list[np.ndarray], stamps: np.ndarray | None) -> bytes:
    parts = []
    for row in range(len(columns[0])):
        if stamps is None:
            parts.append(b"\0")
        else:
            parts.append(struct.pack("<Bd", _STAMPED, stamps[row]))
        for column in columns:
            raw = column[row].encode("utf-8")
            parts += [_length(len(raw), short=True), raw]
    return b"".join(parts)


def _footer(group: SignalGroup) -> dict[str, list[str]]:
    stamps = group.times_s()
    content = {"sample_count": [str(group.n_samples)]}
    if stamps is not None and len(stamps):
        content["first_timestamp"] = [repr(float(stamps[0]))]
        content["last_timestamp"] = [repr(float(stamps[-1]))]
    return content


def _chunk(tag: int, body: bytes) -> bytes:
    return _length(len(body) + 2, short=False) + struct.pack("<H", tag) + body


def _number(stream: int) -> bytes:
    return struct.pack("<I", stream)


def _length(value: int, *, short: bool) -> bytes:
    """Return a number of variable length: one byte where that will do, else four, else eight."""
    if short and value <= _SHORT:
        return struct.pack("<BB", 1, value)
    if value <= 0xFFFFFFFF:
        return struct.pack("<BI", 4, value)
    return struct.pack("<BQ", 8, value)
