"""The control loop beside opensourceleg's SoftRealtimeLoop, in alternating blocks of one run.

Both loops do the same: write down the time, at 500 Hz and at 1 kHz, on the real
clock. The peer runs in both of its modes. Its figures need opensourceleg
(``constraints-osl.txt``); without it only ours are shown. With
``--benchmark-disable`` everything runs once and short, and no figure is asserted.
"""

from collections.abc import Callable
from time import perf_counter_ns

import numpy as np
import pytest
from benchmarks.figures import Figures, at_most, of_package

from jointz.core.clock import RealClock
from jointz.experiment.loop import ControlLoop, undisturbed

RATES_HZ = (500, 1000)
QUANTILES = (50.0, 99.0, 99.9)
BLOCKS, TICKS = 6, 2000
RATE_TOLERANCE = 1e-3  # of the mean rate

try:
    from opensourceleg.utilities.softrealtimeloop import SoftRealtimeLoop
except ImportError:
    SoftRealtimeLoop = None


def ours(rate_hz: int, ticks: int) -> np.ndarray:
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


def peer(rate_hz: int, ticks: int, *, phase: bool) -> np.ndarray:
    stamps = np.zeros(ticks, dtype=np.int64)
    loop = SoftRealtimeLoop(dt=1.0 / rate_hz, report=False, maintain_original_phase=phase)
    for count, _ in enumerate(loop):
        stamps[count] = perf_counter_ns()
        if count + 1 == ticks:
            break
    return stamps


def timing(blocks: list[np.ndarray], rate_hz: int) -> dict[str, float]:
    period_ns = 1e9 / rate_hz
    steps = np.concatenate([np.diff(b[1:]) for b in blocks])
    error_us = np.abs(steps - period_ns) / 1e3
    found = {f"p{q:g}": float(np.percentile(error_us, q)) for q in QUANTILES}
    return {"rate": 1e9 / steps.mean() / rate_hz - 1.0, **found}


def sides() -> dict[str, Callable[[int, int], np.ndarray]]:
    made: dict[str, Callable[[int, int], np.ndarray]] = {"jointz": ours}
    if SoftRealtimeLoop is not None:
        made["peer, default"] = lambda rate, ticks: peer(rate, ticks, phase=False)
        made["peer, phase kept"] = lambda rate, ticks: peer(rate, ticks, phase=True)
    return made


def hand_over(found: dict[str, dict[str, float]], rate_hz: int, figures: Figures) -> None:
    """Give the figures of all loops to the page."""
    mine, what = found["jointz"], f"control loop at {rate_hz} Hz"
    off_pct = 100 * abs(mine["rate"])
    figures.alone(f"{what}: mean rate off by", off_pct, "%", asked=at_most(100 * RATE_TOLERANCE))
    others = [name for name in found if name != "jointz"]
    for q in (f"p{q:g}" for q in QUANTILES):
        error = f"{what}: period error, {q}"
        if not others:
            figures.alone(error, mine[q], "us")
        for name in others:
            peer = of_package(f"SoftRealtimeLoop, {name.split(', ')[1]}", "opensourceleg")
            figures.beside(error, peer, (mine[q], found[name][q]), "us")
    if SoftRealtimeLoop is None:
        figures.left_out(f"{what} beside opensourceleg's", "opensourceleg is not installed")


@pytest.mark.parametrize("rate_hz", RATES_HZ)
def test_the_loop_keeps_its_rate(rate_hz: int, quick: bool, figures: Figures) -> None:
    blocks: dict[str, list[np.ndarray]] = {name: [] for name in sides()}
    for _ in range(1 if quick else BLOCKS):
        for name, run in sides().items():
            blocks[name].append(run(rate_hz, 20 if quick else TICKS))
    found = {name: timing(of, rate_hz) for name, of in blocks.items()}
    print(f"\n{rate_hz} Hz: mean rate and size of the period error, us")
    for name, row in found.items():
        errors = "  ".join(f"p{q:g} {row[f'p{q:g}']:8.1f}" for q in QUANTILES)
        print(f"  {name:<17} rate {100 * row['rate']:+7.3f} %  {errors}")
    hand_over(found, rate_hz, figures)
    if quick:
        return
    assert abs(found["jointz"]["rate"]) < RATE_TOLERANCE
    for name, row in found.items():
        if name != "jointz":
            better = {q: found["jointz"][q] < row[q] for q in row if q != "rate"}
            print(f"  better than {name}: {better}")
