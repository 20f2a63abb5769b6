"""Interval of a normal mean that cannot be negative, with the coverage it claims everywhere."""

from functools import lru_cache

import numpy as np
from scipy.special import ndtr
from scipy.stats import norm

_STEP = 0.01
#: A measurement further below the bound than this is taken to be here: it says more of the
#: error's size than of the mean.
_LOWEST = -2.0
#: No accepted measurement is so far above its mean; halved so often it leaves rounding.
_FARTHEST, _HALVINGS = 10.0, 55


def bounded_interval(value: float, sd: float, *, level: float = 0.95) -> tuple[float, float]:
    """Return the interval of a mean that is not negative.

    ``value`` may be negative; ``sd`` of its normal error. ``low`` is 0 where the bound is active:
    the interval is then one-sided. Feldman and Cousins 1998, Physical Review D 57, 3873, section
    IV.B: the choice between a limit and an interval is part of the construction, so it costs no
    coverage.
    """
    if not sd > 0.0 or not 0.0 < level < 1.0:
        raise ValueError(
            f"bounded_interval: expected sd > 0 and 0 < level < 1, got {sd} and {level}."
        )
    measured = max(value / sd, _LOWEST)
    reach = float(norm.ppf(0.5 + level / 2.0))
    if measured >= 2.0 * reach:  # from here on the bound is out of sight of the construction
        return sd * (measured - reach), sd * (measured + reach)
    means, lowest, highest = _belts(level)
    low = float(np.interp(measured, highest, means)) if measured > highest[0] else 0.0
    high = float(np.interp(measured, lowest, means))
    return sd * low, sd * high


@lru_cache(maxsize=8)
def _belts(level: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return means, and lowest and highest measurement accepted for each.

    They reach as far as the upper end of a measurement of twice the reach does.
    """
    reach = float(norm.ppf(0.5 + level / 2.0))
    means = np.arange(_STEP, 3.0 * reach + 2.0 * _STEP, _STEP)
    lowest, highest = _accepted(means, level)
    # Where nothing is ordered any more (mean 0) the lowest is minus infinity.
    return (
        np.append(0.0, means),
        np.append(-np.inf, lowest),
        np.append(float(norm.ppf(level)), highest),
    )


def _accepted(means: np.ndarray, level: float) -> tuple[np.ndarray, np.ndarray]:
    """Return the measurements accepted for each mean: those with the largest likelihood ratio."""

    def below(high: np.ndarray) -> np.ndarray:
        mirrored = 2.0 * means - high
        ratio = (means**2 - (high - means) ** 2) / (2.0 * means)
        return np.asarray(np.where(mirrored >= 0.0, mirrored, ratio))

    short, far = means, means + _FARTHEST
    for _ in range(_HALVINGS):
        middle = 0.5 * (short + far)
        enough = ndtr(middle - means) - ndtr(below(middle) - means) >= level
        short, far = np.where(enough, short, middle), np.where(enough, middle, far)
    return below(far), far
