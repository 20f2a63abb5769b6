"""Period error of the control loop beside opensourceleg's, in alternating blocks of one run.

Both loops write down the time on the real clock. opensourceleg needs older packages, so that this
module runs in an environment with it: ``python benchmarks/speed/loop.py BLOCKS TICKS`` prints JSON.
"""

import json
import sys
from time import perf_counter_ns

import numpy as np

from jointz.core.clock import RealClock
from jointz.rig.experiment.loop import ControlLoop, undisturbed

RATES_HZ = (500, 1000)


def ours(rate_hz: int, ticks: int) -> np.ndarray:
    """Return the times of the ticks of jointz's loop, ns."""
    stamps = np.zeros(ticks, dtype=np.int64)
    count = 0

    def tick(_slot: int, now_ns: int, _skipped: int) -> bool:
        nonlocal count
        stamps[count] = now_ns
        count += 1
        return count < ticks

    with undisturbed():
        ControlLoop(RealClock(), 1_000_000_000 // rate_hz).run(tick)
    return stamps


def theirs(rate_hz: int, ticks: int) -> np.ndarray:
    """Return the times of the ticks of opensourceleg's loop with its defaults, ns."""
    from opensourceleg.utilities.softrealtimeloop import SoftRealtimeLoop

    stamps = np.zeros(ticks, dtype=np.int64)
    for count, _ in enumerate(SoftRealtimeLoop(dt=1.0 / rate_hz, report=False)):
        stamps[count] = perf_counter_ns()
        if count + 1 == ticks:
            break
    return stamps


def period_error_us(blocks: list[np.ndarray], rate_hz: int) -> float:
    """Return the 99th percentile of the size of the period error, us."""
    periods = np.concatenate([np.diff(block[1:]) for block in blocks])
    return float(np.percentile(np.abs(periods - 1e9 / rate_hz), 99) / 1e3)


def period_errors(blocks: int, ticks: int) -> dict[str, list[float]]:
    """Return the period errors of jointz and the peer by rate."""
    errors = {}
    for rate in RATES_HZ:
        turns = [(ours(rate, ticks), theirs(rate, ticks)) for _ in range(blocks)]
        errors[f"{rate}"] = [period_error_us(list(side), rate) for side in zip(*turns, strict=True)]
    return errors


if __name__ == "__main__":
    print(json.dumps(period_errors(*map(int, sys.argv[1:]))))
