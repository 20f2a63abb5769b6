"""Means of a method over people, made alike for all methods from the estimates that stand."""

from collections.abc import Iterable, Sequence

import numpy as np
from scipy.special import stdtrit

from jointz.core.analysis import StudyAnalysis
from jointz.core.estimates import CellEstimate, ParameterEstimate
from jointz.core.person_estimates import person_cells


def cells_by_method(analysis: StudyAnalysis) -> dict[str, list[CellEstimate]]:
    """Return the cells of every method, one a person and timing point, the chosen one first.

    Parameters
    ----------
    analysis : StudyAnalysis
        The analysis.

    Notes
    -----
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
    """Return the estimates of a parameter at a timing point that stand.

    Parameters
    ----------
    cells : iterable of CellEstimate
        Of one method.
    parameter, timing_point : str
        Which.
    """
    at_point = (c.parameter(parameter) for c in cells if c.timing_point == timing_point)
    return [p for p in at_point if p is not None and p.stands and p.value is not None]


def mean_over_people(estimates: Sequence[ParameterEstimate]) -> tuple[float, float, float]:
    """Return mean and Student's interval over people, NaN where there is none.

    Parameters
    ----------
    estimates : sequence of ParameterEstimate
        One of each person; that of one person stands with its own interval.

    Returns
    -------
    tuple of float
        Mean, lower and upper end.
    """
    values = np.array([p.value for p in estimates], dtype=float)
    if values.size == 0:
        return np.nan, np.nan, np.nan
    if values.size == 1:
        low, high = (
            np.nan if e is None else e for e in (estimates[0].ci_low, estimates[0].ci_high)
        )
        return float(values[0]), low, high
    quantile = stdtrit(values.size - 1, 0.5 + 0.5 * estimates[0].ci_level)
    half = float(quantile * values.std(ddof=1) / np.sqrt(values.size))
    mean = float(values.mean())
    return mean, mean - half, mean + half
