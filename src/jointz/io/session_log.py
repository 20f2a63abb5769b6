"""Read the crash-safe log of a session (:mod:`jointz.core.session_log`)."""

import zlib
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from jointz.core.errors import DataError
from jointz.core.session_log import decode_header

#: So many bad records at the end are what a crash left of it, more are damage; zeros, which
#: a disk without power leaves, may be any number.
_MOST_TORN = 100


@dataclass(frozen=True, slots=True, eq=False)
class SessionLog:
    """A log as read.

    Parameters
    ----------
    header : dict
        Its first line.
    records : (n,) structured array
        Fields of the layout of :mod:`jointz.core.session_log` that the header names.
    whole_bytes, torn_bytes : int
        Of the header and the records, and of what follows them: a record that was cut off,
        or an end that the disk never got right.
    """

    header: dict[str, Any]
    records: np.ndarray
    whole_bytes: int
    torn_bytes: int


def read_log(path: Path) -> SessionLog:
    """Read a log, all records up to where it was cut off.

    Parameters
    ----------
    path : pathlib.Path
        The log.

    Returns
    -------
    SessionLog
        Header and records.

    Raises
    ------
    DataError
        When the file is no log, is of another version, or a record in its middle
        is damaged.
    """
    line, _, body = path.read_bytes().partition(b"\n")
    try:
        header, layout = decode_header(line)
    except ValueError as exc:
        raise DataError(f"{path}: {exc}", path=str(path)) from exc
    size = layout.record_bytes
    records = np.frombuffer(body, dtype=layout.dtype, count=len(body) // size)
    records = records[: _whole_records(path, body, records["crc"], size=size)]
    kept = records.size * size
    return SessionLog(header, records, len(line) + 1 + kept, len(body) - kept)


def _whole_records(path: Path, body: bytes, expected: np.ndarray, *, size: int) -> int:
    """Return how many records stand before the torn end; refuse damage before that."""
    view = memoryview(body)
    crc32 = zlib.crc32
    found = np.fromiter(
        (crc32(view[at : at + size - 4]) for at in range(0, expected.size * size, size)),
        dtype=np.uint32,
        count=expected.size,
    )
    bad = np.flatnonzero(found != expected)
    whole = expected.size - bad.size
    torn = bad.size <= _MOST_TORN or not any(view[whole * size :])
    if bad.size and not (bad[0] == whole and torn):
        raise DataError(
            f"{path}: record {bad[0] + 1} of {expected.size} is damaged ({bad.size} in all): its "
            "checksum does not fit. Restore the file from a copy.",
            path=str(path),
            row=int(bad[0]) + 1,
        )
    return whole
