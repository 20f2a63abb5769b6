"""Power of t tests by the noncentral t distribution."""

from functools import cache
from typing import Literal

import numpy as np
from scipy.stats import nct
from scipy.stats import t as students_t

_LARGEST_EFFECT, _BISECTIONS = 1e4, 60


def t_power(
    effect: float, n: int, *, design: Literal["paired", "groups"] = "paired", alpha: float = 0.05
) -> float:
    """Return the power of a two-sided t test of people with themselves, or of two equal groups.

    ``effect`` is the mean difference over the sd of the differences (paired), or over the sd
    within a group; ``n`` people, in each group.
    """
    degrees = n - 1 if design == "paired" else 2 * (n - 1)
    if degrees < 1:
        return 0.0
    shift = abs(effect) * np.sqrt(n if design == "paired" else n / 2.0)
    limit = float(students_t.ppf(1.0 - alpha / 2.0, degrees))
    beyond = float(nct.sf(limit, degrees, shift))
    below = float(nct.cdf(-limit, degrees, shift))
    # Far out the library's tail may be NaN where it is zero.
    return min(1.0, beyond + (below if np.isfinite(below) else 0.0))


@cache
def smallest_effect(
    n: int, power: float, *, design: Literal["paired", "groups"] = "paired"
) -> float:
    """Return the smallest effect that n people, in each group, find with a power, at 5 %."""
    low, high = 0.0, 1.0
    while t_power(high, n, design=design) < power:
        high *= 2.0
        if high > _LARGEST_EFFECT:
            return np.inf
    for _ in range(_BISECTIONS):
        middle = 0.5 * (low + high)
        reached = t_power(middle, n, design=design) >= power
        low, high = (low, middle) if reached else (middle, high)
    return high
