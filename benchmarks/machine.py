"""On which machine and which version of the code something was measured; nothing that names it."""

import os
import platform
import subprocess
from pathlib import Path
from typing import Any

_UNKNOWN = "unknown"
#: What a run of all benchmarks writes itself does not make the code another one.
_WRITTEN = (
    "docs/benchmarks.md",
    "docs/images/benchmarks-growth.svg",
    "docs/tables/benchmarks-*.csv",
)


def machine() -> dict[str, Any]:
    """Return processor, cores, memory and kind of system."""
    return {
        "cpu": _cpu(),
        "cores": _cores(),
        "memory_gb": round(os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES") / 1e9, 1),
        "system": f"{platform.system()}, {platform.machine()}",
    }


def commit(root: Path) -> str:
    """Return the commit that is checked out, and whether anything was changed since.

    Parameters
    ----------
    root : pathlib.Path
        Of the repository.
    """
    try:
        name = _git(root, "rev-parse", "--short=12", "HEAD").strip()
        others = [f":(exclude){file}" for file in _WRITTEN]
        changed = _git(root, "status", "--porcelain", "--", ".", *others)
    except (OSError, subprocess.CalledProcessError):
        return _UNKNOWN
    return f"{name}, with changes" if changed else name


def _git(root: Path, *words: str) -> str:
    command = ["git", "-C", str(root), *words]
    return subprocess.run(command, check=True, capture_output=True, text=True).stdout


def _cpu() -> str:
    try:
        lines = Path("/proc/cpuinfo").read_text(encoding="utf-8").splitlines()
    except OSError:
        lines = []
    names = [line.partition(":")[2].strip() for line in lines if line.startswith("model name")]
    return next(filter(None, [*names, platform.processor()]), _UNKNOWN)


def _cores() -> int:
    if hasattr(os, "sched_getaffinity"):
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1
