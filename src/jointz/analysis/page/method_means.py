"""Means of each method over people, calculated alike from the available estimates."""

from collections.abc import Iterable, Sequence

import numpy as np

from jointz.results.estimates import CellEstimate, ParameterEstimate
from jointz.results.person_estimates import person_cells
from jointz.results.study_analysis import StudyAnalysis
from jointz.stats.population import student_mean


def cells_by_method(analysis: StudyAnalysis) -> dict[str, list[CellEstimate]]:
    """Return the cells of every method, one for each person and timing point, the chosen first.

    A case that needed another method than the chosen one is in the comparison too; it counts once.
    """
    cells: dict[str, dict[tuple[str, str], CellEstimate]] = {}
    for cell in (*analysis.cells, *analysis.comparison):
        cells.setdefault(cell.method, {}).setdefault((cell.label, cell.timing_point), cell)
    chosen = analysis.settings.get("method")
    order = sorted(cells, key=lambda method: method != chosen)
    return {method: list(person_cells([*cells[method].values()])) for method in order}


def available(
    cells: Iterable[CellEstimate], parameter: str, timing_point: str
) -> list[ParameterEstimate]:
    """Return the available estimates of a parameter at a timing point."""
    at_point = (c.parameter(parameter) for c in cells if c.timing_point == timing_point)
    return [p for p in at_point if p is not None and p.available and p.value is not None]


def method_mean(
    analysis: StudyAnalysis, method: str, estimates: Sequence[ParameterEstimate], timing_point: str
) -> tuple[float, float, float]:
    """Return the mean over people and its interval, NaN if there is none or it is undecided."""
    if len(estimates) > 1 and method == analysis.settings.get("method"):
        for row in analysis.population:
            if (row.timing_point, row.parameter) == (timing_point, estimates[0].name):
                return _or_nan(row.value), _or_nan(row.ci_low), _or_nan(row.ci_high)
    return _t_mean(estimates)


def _t_mean(estimates: Sequence[ParameterEstimate]) -> tuple[float, float, float]:
    """Return the mean with its t interval; of one person, the person's own interval."""
    nothing = (np.nan, np.nan, np.nan)
    if not estimates:
        return nothing
    first = estimates[0]
    if len(estimates) == 1:
        return _or_nan(first.value), _or_nan(first.ci_low), _or_nan(first.ci_high)
    values = np.array([p.value for p in estimates], dtype=float)
    return student_mean(values, level=first.ci_level) or nothing


def _or_nan(value: float | None) -> float:
    return np.nan if value is None else float(value)
