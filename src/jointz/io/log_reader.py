"""Read the crash-safe log of a session (:mod:`jointz.core.session_log`)."""

import zlib
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from jointz.core.errors import DataError
from jointz.core.session_log import decode_header

#: So many bad records at the end are what a crash left of it, more are damage; zeros, which
#: a disk without power leaves, may be any number.
_MOST_TORN = 100


class Damage(NamedTuple):
    """A stretch of a log that was left out: damaged records."""

    at: int  # number of intact records before it
    n_bytes: int  # size of the stretch


@dataclass(frozen=True, slots=True, eq=False)
class SessionLog:
    """A log as read."""

    header: dict[str, Any]  # content of the header's JSON line
    # (n,), with the fields of the header's layout in :mod:`jointz.core.session_log`
    records: np.ndarray
    whole_bytes: int  # size of the header and all up to the end of the last whole record
    torn_bytes: int  # size of the rest: a record cut off, or an end that was never fully written
    # damaged stretches that were left out, in order; empty unless the log was read to salvage it
    damage: tuple[Damage, ...] = ()
    damaged_copy: str = ""  # damaged copy of the header: ``first`` or ``second``; "" for none


def read_log(path: Path, *, salvage: bool = False) -> SessionLog:
    """Read a log, all records up to where it was cut off.

    Parameters
    ----------
    path : pathlib.Path
        The log.
    salvage : bool
        Whether to leave damaged records out instead of refusing the log.

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
    content = path.read_bytes()
    try:
        header = decode_header(content)
    except ValueError as exc:
        raise DataError(f"{path}: {exc}", path=str(path)) from exc
    size, body = header.layout.record_bytes, memoryview(content)[header.size_bytes :]
    good = _fitting(body, size)
    whole = good.size if good.all() else int(np.argmin(good))
    starts = range(0, whole * size, size)
    if not salvage or good.all():
        _refuse_damage(path, good, body[whole * size :])
        return SessionLog(
            header.values,
            np.frombuffer(body, dtype=header.layout.dtype, count=whole),
            header.size_bytes + whole * size,
            len(body) - whole * size,
            damaged_copy=header.damaged_copy,
        )
    begins = np.array([*starts, *_further_records(body, whole * size, size)], dtype=int)
    ends = np.concatenate([[0], begins + size])
    left_out = begins - ends[:-1]
    rest = body[int(ends[-1]) :]
    if len(rest) // size > _MOST_TORN and any(rest):
        begins, left_out = np.append(begins, len(body)), np.append(left_out, len(rest))
    return SessionLog(
        header.values,
        np.frombuffer(
            b"".join(body[at : at + size] for at in begins[: ends.size - 1]),
            dtype=header.layout.dtype,
        ),
        header.size_bytes + int(ends[-1]),
        len(rest),
        tuple(Damage(int(at), int(left_out[at])) for at in np.flatnonzero(left_out)),
        header.damaged_copy,
    )


def _fitting(body: memoryview, size: int) -> np.ndarray:
    """Return which records fit their checksum, if none was shifted."""
    count, crc32 = len(body) // size, zlib.crc32
    checks = np.frombuffer(
        body, dtype=np.dtype([("body", f"V{size - 4}"), ("crc", "<u4")]), count=count
    )["crc"]
    computed = np.fromiter(
        (crc32(body[at : at + size - 4]) for at in range(0, count * size, size)),
        dtype=np.uint32,
        count=count,
    )
    return np.asarray(computed == checks)


def _further_records(body: memoryview, at: int, size: int) -> Iterator[int]:
    """Yield where intact records begin after a damaged one, at any byte but trailing zeros."""
    last = min(len(bytes(body).rstrip(b"\0")), len(body) - size + 1)
    while at < last:
        check = int.from_bytes(body[at + size - 4 : at + size], "little")
        if zlib.crc32(body[at : at + size - 4]) == check:
            yield at
            at += size
        else:
            at += 1


def _refuse_damage(path: Path, good: np.ndarray, rest: memoryview) -> None:
    """Refuse damage before the torn end."""
    bad = np.flatnonzero(~good)
    if not bad.size:
        return
    at_end = bad.size == good.size - bad[0]
    if at_end and (bad.size <= _MOST_TORN or not any(rest)):
        return
    raise DataError(
        f"{path}: record {bad[0] + 1} of {good.size} is damaged ({bad.size} in all): its "
        "checksum does not fit. Restore the file from a copy, or add --salvage (salvage=True), "
        "which leaves damaged records out.",
        path=str(path),
        row=int(bad[0]) + 1,
    )
