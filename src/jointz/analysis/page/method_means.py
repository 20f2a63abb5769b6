"""Means of a method over people, made alike for all methods from the estimates that stand."""

from collections.abc import Iterable, Sequence

import numpy as np

from jointz.results.estimates import CellEstimate, ParameterEstimate
from jointz.results.person_estimates import person_cells
from jointz.results.study_analysis import StudyAnalysis
from jointz.stats.population import decided_mean


def cells_by_method(analysis: StudyAnalysis) -> dict[str, list[CellEstimate]]:
    """Return the cells of every method, one a person and timing point, the chosen one first.

    A case that the chosen method could not estimate stands in for it, and once more in the
    comparison, under the method that could: it counts once.
    """
    found: dict[str, dict[tuple[str, str], CellEstimate]] = {}
    for cell in (*analysis.cells, *analysis.comparison):
        found.setdefault(cell.method, {}).setdefault((cell.label, cell.timing_point), cell)
    chosen = analysis.settings.get("method")
    order = sorted(found, key=lambda method: method != chosen)
    return {method: list(person_cells([*found[method].values()])) for method in order}


def standing(
    cells: Iterable[CellEstimate], parameter: str, timing_point: str
) -> list[ParameterEstimate]:
    """Return the estimates of a parameter at a timing point that stand."""
    at_point = (c.parameter(parameter) for c in cells if c.timing_point == timing_point)
    return [p for p in at_point if p is not None and p.stands and p.value is not None]


def method_mean(
    analysis: StudyAnalysis, method: str, estimates: Sequence[ParameterEstimate], timing_point: str
) -> tuple[float, float, float]:
    """Return mean over people and ends of its interval, NaN where there is none or undecided."""
    if len(estimates) > 1 and method == analysis.settings.get("method"):
        for row in analysis.population:
            if (row.timing_point, row.parameter) == (timing_point, estimates[0].name):
                ends = (row.value, row.ci_low, row.ci_high)
                value, low, high = (np.nan if e is None else e for e in ends)
                return value, low, high
    return _students_mean(estimates)


def _students_mean(estimates: Sequence[ParameterEstimate]) -> tuple[float, float, float]:
    values = np.array([p.value for p in estimates], dtype=float)
    if values.size == 0:
        return np.nan, np.nan, np.nan
    if values.size == 1:
        low, high = (
            np.nan if e is None else e for e in (estimates[0].ci_low, estimates[0].ci_high)
        )
        return float(values[0]), low, high
    return decided_mean(values, level=estimates[0].ci_level) or (np.nan, np.nan, np.nan)
