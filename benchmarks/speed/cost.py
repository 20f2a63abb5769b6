"""Time, CPU time and memory of a process, and figures beside those of a peer."""

import os
import subprocess
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from time import perf_counter
from typing import Any


@dataclass(frozen=True, slots=True)
class Cost:
    """What a command took: time, CPU time of all its processes, memory of the largest one."""

    wall_s: float
    cpu_s: float
    peak_mb: float


@dataclass(frozen=True, slots=True)
class Figure:
    """A measured quantity, a peer's for the same work, and the least ratio peer / jointz."""

    quantity: str
    unit: str
    jointz: float
    peer: str = ""
    peer_value: float | None = None
    least_ratio: float | None = None

    @property
    def ratio(self) -> float | None:
        """Peer / jointz; above 1, jointz needs less."""
        return None if self.peer_value is None else self.peer_value / self.jointz

    @property
    def is_met(self) -> bool | None:
        """Whether the target is met; None without a target."""
        return None if None in (self.ratio, self.least_ratio) else self.ratio >= self.least_ratio


def cost_of(command: Sequence[str], folder: Path) -> Cost:
    """Run a command in a folder; fail with what it printed if its exit status is not 0."""
    start = perf_counter()
    with (folder / "errors.txt").open("w+") as errors:
        process = subprocess.Popen(command, cwd=folder, stdout=subprocess.DEVNULL, stderr=errors)
        _, status, usage = os.wait4(process.pid, 0)
        wall_s = perf_counter() - start
        process.returncode = os.waitstatus_to_exitcode(status)
        if process.returncode:
            errors.seek(0)
            raise RuntimeError(f"{' '.join(command)}: {errors.read()[-2000:]}")
    return Cost(wall_s, usage.ru_utime + usage.ru_stime, usage.ru_maxrss / 1024)


def least(costs: Sequence[Cost]) -> Cost:
    """Return the shortest times and the largest memory of several runs."""
    return Cost(
        min(one.wall_s for one in costs),
        min(one.cpu_s for one in costs),
        max(one.peak_mb for one in costs),
    )


def in_turns(
    first: Callable[[], Any], second: Callable[[], Any], turns: int
) -> tuple[float, float]:
    """Return the shortest time of two functions that take turns, s."""
    times = []
    for _ in range(turns):
        start = perf_counter()
        first()
        middle = perf_counter()
        second()
        times.append((middle - start, perf_counter() - middle))
    ours, theirs = (min(side) for side in zip(*times, strict=True))
    return ours, theirs
