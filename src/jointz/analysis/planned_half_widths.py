"""Half-widths that a plan expected beside those that the analysis reached."""

from collections.abc import Sequence
from typing import Any

import numpy as np

from jointz.core.study import PlannedHalfWidths
from jointz.results.estimates import CellEstimate, ParameterEstimate

_PARAMETERS = 3


def planned_beside_reached(
    planned: PlannedHalfWidths | None, cells: Sequence[CellEstimate]
) -> list[dict[str, Any]]:
    """Return a row for each planned value; ``reached_pct`` is None if undecided."""
    reached, analysed = reached_half_widths(cells), {cell.timing_point for cell in cells}
    return [
        {
            "parameter": name,
            "timing_point": point,
            "planned_pct": float(pct),
            "reached_pct": reached.get(name, {}).get(point),
        }
        for name, points in (planned or {}).items()
        for point, pct in points.items()
        if point in analysed
    ]


def reached_half_widths(cells: Sequence[CellEstimate]) -> dict[str, dict[str, float]]:
    """Return parameter -> timing point -> median half-width over participants, % of the value.

    Undecided values count as wider than any; a median of such is left out.
    """
    found: dict[str, dict[str, list[float]]] = {}
    for cell in cells:
        for p in cell.parameters[:_PARAMETERS]:
            found.setdefault(p.name, {}).setdefault(cell.timing_point, []).append(_half_pct(p))
    medians = {
        name: {point: float(np.median(widths)) for point, widths in points.items()}
        for name, points in found.items()
    }
    return {
        name: {point: pct for point, pct in points.items() if np.isfinite(pct)}
        for name, points in medians.items()
    }


def _half_pct(estimate: ParameterEstimate) -> float:
    value, low, high = estimate.value, estimate.ci_low, estimate.ci_high
    if value is None or low is None or high is None or value == 0.0:
        return np.inf
    return 50.0 * (high - low) / abs(value)
