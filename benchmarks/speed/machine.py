"""Processor, cores, memory and system of this machine; nothing that names it."""

import os
import platform
from pathlib import Path


def machine() -> str:
    """Return the machine in words."""
    memory_gb = os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES") / 1e9
    cores = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count()
    system = f"{platform.system()}, {platform.machine()}"
    return f"{_cpu()}, {cores} core(s), {memory_gb:.1f} GB of memory, {system}"


def _cpu() -> str:
    try:
        lines = Path("/proc/cpuinfo").read_text(encoding="utf-8").splitlines()
    except OSError:
        lines = []
    names = [line.partition(":")[2].strip() for line in lines if line.startswith("model name")]
    return next(filter(None, [*names, platform.processor()]), "unknown processor")
