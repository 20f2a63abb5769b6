"""Limit on the memory that a packed file may take once it is read."""

import os
import re
from contextlib import suppress
from math import inf, isfinite
from pathlib import Path

from jointz.core.errors import DataError, TooLargeError

#: Environment variable that holds the limit, inherited by every worker.
VARIABLE = "JOINTZ_MEMORY_LIMIT"
#: A number takes so many bytes once it is read, whatever it took in the file.
NUMBER_BYTES = 8
#: The same of an array, a text or a link, beside its samples.
OBJECT_BYTES = 200
#: Endings of packed files; the limit does not apply to others.
PACKED = (".gz", ".mat", ".nc", ".parquet", ".xlsx")
#: Where containers and batch systems state their limit (cgroup version 2, and 1).
CGROUP_FILES = (
    Path("/sys/fs/cgroup/memory.max"),
    Path("/sys/fs/cgroup/memory/memory.limit_in_bytes"),
)
_SHARE = 4
_UNKNOWN_MEMORY_BYTES = 8 << 30
_SIZE = re.compile(r"\s*(\d+(?:\.\d*)?)\s*([kMGT]?)i?B?\s*", re.IGNORECASE)
_UNITS = {"": 1, "k": 10**3, "m": 10**6, "g": 10**9, "t": 10**12}


def memory_limit() -> int:
    """Return the limit in bytes: ``JOINTZ_MEMORY_LIMIT``, else a quarter of memory.

    Memory is the physical one, or the limit of the cgroup where that is less.
    """
    stated = os.environ.get(VARIABLE, "")
    if not stated:
        return int(min(_physical_memory(), *_cgroup_limits())) // _SHARE
    size = _SIZE.fullmatch(stated)
    n_bytes = round(float(size[1]) * _UNITS[size[2].lower()]) if size else 0
    if not n_bytes:
        raise DataError(
            f"memory limit ({VARIABLE}, --memory-limit): expected a size such as 8GB or 500MB, "
            f"got '{stated}'. Correct it."
        )
    return n_bytes


def check_unpacked(path: Path, n_bytes: float) -> None:
    """Refuse a file that takes more memory than the limit."""
    limit = memory_limit()
    if n_bytes > limit:
        raise TooLargeError(
            f"{path.name}: unpacks to more than {limit / 1e9:.3g} GB, the limit for one file (a "
            f"quarter of memory unless another is given){_needed(n_bytes)}. If you trust the file, "
            "raise it: "
            f"jointz --memory-limit 16GB COMMAND, or the environment variable {VARIABLE}.",
            path=str(path),
        )


def _needed(n_bytes: float) -> str:
    return f"; it takes {n_bytes / 1e9:.3g} GB or more" if isfinite(n_bytes) else ""


def _physical_memory() -> int:
    try:
        return os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES")
    except (AttributeError, ValueError, OSError):  # Windows
        return _UNKNOWN_MEMORY_BYTES


def _cgroup_limits() -> list[float]:
    limits = [inf]
    for file in CGROUP_FILES:
        with suppress(OSError, ValueError):  # not there, or "max"
            limits.append(int(file.read_text()))
    return limits
