"""Clocks, noise and coverage for calibration tests; nothing of the package's own simulation."""

from collections.abc import Callable

import numpy as np
import pytest
from scipy.signal import lfilter
from scipy.stats import binom


def clock(duration_s: float, rate_hz: float, rng: np.random.Generator) -> np.ndarray:
    """Return time stamps that jitter by 10 % of the period, at a rate 3 % off the nominal one."""
    period_s = 1.03 / rate_hz
    n = int(duration_s / period_s)
    return period_s * (np.arange(n) + 0.1 * rng.uniform(-1.0, 1.0, n))


def coloured(
    n: int, *, sd: float, time_s: float, period_s: float, rng: np.random.Generator
) -> np.ndarray:
    """Return an Ornstein-Uhlenbeck process."""
    keep = np.exp(-period_s / time_s)
    drive = sd * np.sqrt(1.0 - keep**2) * rng.standard_normal(n)
    drive[0] = sd * rng.standard_normal()
    return lfilter([1.0], [1.0, -keep], drive)


def goniometer_noise(time: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    """Return white and coloured noise, rad."""
    period_s = float(np.median(np.diff(time)))
    slow = coloured(time.size, sd=np.radians(0.15), time_s=0.1, period_s=period_s, rng=rng)
    return slow + np.radians(0.3) * rng.standard_normal(time.size)


def check_coverage(find: Callable[[int], tuple[float, float, float]], seeds: int = 80) -> None:
    """Check that |value - truth| < 1.96 sd as often as 95 % intervals do, without a bias.

    Bounds are the 0.1 and 99.9 % points of the binomial distribution of 95 %, the upper one
    left open: an sd may be larger than the scatter where known errors are in it.
    """
    scores = []
    for seed in range(seeds):
        value, sd, truth = find(seed)
        scores.append((value - truth) / sd)
    inside = int((np.abs(scores) < 1.96).sum())
    assert inside >= binom.ppf(0.001, seeds, 0.95), f"{inside} of {seeds}"
    assert abs(np.mean(scores)) < 3.3 / np.sqrt(seeds), f"mean score {np.mean(scores):.2f}"


class Makers:
    clock = staticmethod(clock)
    coloured = staticmethod(coloured)
    goniometer_noise = staticmethod(goniometer_noise)
    check_coverage = staticmethod(check_coverage)


@pytest.fixture(scope="session")
def make() -> type[Makers]:
    """Clocks, noise and the check of coverage."""
    return Makers
