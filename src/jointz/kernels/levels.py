"""Levels of a signal that switches between two, and its runs at the upper one."""

import numpy as np

from jointz.kernels.robust_spread import robust_sd

_LEVEL_SAMPLES = 50_000
_MOST_STEPS, _SETTLED = 30, 1e-3


def thinned(x: np.ndarray) -> np.ndarray:
    """Return at most ``_LEVEL_SAMPLES`` samples, evenly spread."""
    return x[:: 1 + x.size // _LEVEL_SAMPLES]


def level(x: np.ndarray) -> tuple[float, float]:
    """Return the median and the standard deviation that its median deviation stands for."""
    return float(np.median(x)), float(robust_sd(x))


def middle_of_levels(x: np.ndarray) -> float:
    """Return the middle between the medians of the samples above and below it.

    The search starts between the extremes, so the upper level may fill any share of the record.
    """
    low, high = float(x.min()), float(x.max())
    middle = 0.5 * (low + high)
    for _ in range(_MOST_STEPS):
        above = x >= middle
        if above.all() or not above.any():
            break
        before = middle
        middle = 0.5 * float(np.median(thinned(x[above])) + np.median(thinned(x[~above])))
        if abs(middle - before) <= _SETTLED * (high - low):
            break
    return middle


def two_levels(x: np.ndarray, middle: float, *, separation: float) -> tuple[float, float] | None:
    """Return the levels below and above a middle, or None if there is one level.

    The upper level may have steps of its own, so the spread about it counts by half, and never
    less than that about the lower level. Levels closer than ``separation`` spreads are one.
    """
    above = x >= middle
    if above.all() or not above.any():
        return None
    (low, low_spread), (high, high_spread) = level(thinned(x[~above])), level(thinned(x[above]))
    spread = max(low_spread, 0.5 * (low_spread + high_spread))
    return None if high - low <= separation * spread else (low, high)


def block_count(t: np.ndarray, block_s: float) -> int:
    """Return the number of blocks of about ``block_s`` in a record."""
    return max(1, min(t.size, round(float(t[-1] - t[0]) / block_s)))


def schmitt_states(
    x: np.ndarray, low: float, high: float
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return where a sample changes sides, the side there and the state of the trigger there.

    The side is -1 below ``low``, 0 between and 1 from ``high``; the state is True from a crossing
    of ``high`` to one of ``low``, and where the record begins between them.
    """
    side = (x >= high).astype(np.int8) - (x < low)
    start = np.append(0, np.flatnonzero(side[1:] != side[:-1]) + 1)
    side_at_start = side[start]
    decided = np.maximum.accumulate(np.where(side_at_start != 0, np.arange(start.size), -1))
    return start, side_at_start, (decided < 0) | (side_at_start[decided] > 0)


def joined_runs(on: np.ndarray, off: np.ndarray, shortest: float) -> tuple[np.ndarray, np.ndarray]:
    """Join runs that are apart by less than ``shortest``."""
    apart = on[1:] - off[:-1] >= shortest
    return on[np.append(True, apart)[: on.size]], off[np.append(apart, True)[-off.size :]]
