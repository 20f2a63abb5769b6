"""Outlying participants."""

from collections.abc import Mapping, Sequence

import numpy as np

from jointz.kernels.robust_spread import robust_sd
from jointz.results.estimates import CellEstimate

#: Robust sd beyond which somebody is out of line, and people needed to say so (Iglewicz and
#: Hoaglin 1993, How to detect and handle outliers).
_FAR = 3.5
_FEWEST = 5
#: Relative spread that people differ by anyway.
_USUAL = 0.1
_Z = 1.96


def inertias_out_of_line(cells: Sequence[CellEstimate]) -> Mapping[str, float]:
    """Return the participants with outlying inertia, and its ratio to the others' median.

    A participant's inertia is the median over timing points of those that stand. Its logarithm is
    compared with the median of all by their median absolute deviation, or a tenth where that is
    less, and its own error. A leg that is heavier than others by half is nothing unusual; a
    wrong unit, another strap or another joint is.
    """
    values: dict[str, list[tuple[float, float]]] = {}
    for cell in cells:
        p = cell.inertia
        if p is not None and p.value and p.ci_low is not None and p.ci_high is not None:
            sd = (p.ci_high - p.ci_low) / (2.0 * _Z * p.value)
            values.setdefault(cell.participant, []).append((float(np.log(p.value)), sd))
    if len(values) < _FEWEST:
        return {}
    medians = {person: np.median(rows, axis=0) for person, rows in values.items()}
    logs = np.array([log for log, _ in medians.values()])
    middle = float(np.median(logs))
    spread = max(float(robust_sd(logs)), _USUAL)
    return {
        person: float(np.exp(log - middle))
        for person, (log, sd) in medians.items()
        if abs(log - middle) > _FAR * np.hypot(spread, sd)
    }
