"""Read the crash-safe log of a session (:mod:`jointz.core.session_log`)."""

import json
import zlib
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from jointz.core.errors import DataError
from jointz.core.session_log import LAYOUTS, VERSION, Layout


@dataclass(frozen=True, slots=True, eq=False)
class SessionLog:
    """A log as read.

    Parameters
    ----------
    header : dict
        Its first line.
    records : (n,) structured array
        Fields of the layout of :mod:`jointz.core.session_log` that the header names.
    torn_bytes : int
        Bytes of a last record that was cut off.
    """

    header: dict[str, Any]
    records: np.ndarray
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
    header, layout = _header(path, line)
    whole = len(body) // layout.record_bytes
    records = np.frombuffer(body, dtype=layout.dtype, count=whole)
    _check(path, body, records["crc"], size=layout.record_bytes)
    return SessionLog(header, records, len(body) - whole * layout.record_bytes)


def _header(path: Path, line: bytes) -> tuple[dict[str, Any], Layout]:
    try:
        header = json.loads(line)
        version, size = header["jointz_log"], header["record_bytes"]
        layout = LAYOUTS[header.get("layout", "walking")]  # early logs name none
    except (ValueError, KeyError, TypeError) as exc:
        raise DataError(
            f"{path}: expected a log of jointz, whose first line is JSON with 'jointz_log'. "
            "Give a .jzlog file of a session.",
            path=str(path),
        ) from exc
    if (version, size) != (VERSION, layout.record_bytes):
        raise DataError(
            f"{path}: a log of version {version} with records of {size} bytes; this jointz reads "
            f"version {VERSION} with {layout.record_bytes}. Read it with the jointz that wrote it.",
            path=str(path),
        )
    return dict(header), layout


def _check(path: Path, body: bytes, expected: np.ndarray, *, size: int) -> None:
    view = memoryview(body)
    crc32 = zlib.crc32
    found = np.fromiter(
        (crc32(view[at : at + size - 4]) for at in range(0, expected.size * size, size)),
        dtype=np.uint32,
        count=expected.size,
    )
    bad = np.flatnonzero(found != expected)
    if bad.size:
        raise DataError(
            f"{path}: record {bad[0] + 1} of {expected.size} is damaged ({bad.size} in all): its "
            "checksum does not fit. Restore the file from a copy.",
            path=str(path),
            row=int(bad[0]) + 1,
        )
