"""Means over people, with intervals over people, never over replicates."""

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np
import pandas as pd
from scipy.special import stdtrit

from jointz.core.codes import Failure
from jointz.core.gait_phases import mean_phase
from jointz.results.estimates import ESTIMATE_COLUMNS, REACH_95, CellEstimate, decides
from jointz.results.statistics.pooled_estimates import has_budget
from jointz.results.study_analysis import PopulationEstimate
from jointz.stats.partial_pooling import pool_people

_LEVEL = 0.95
_FEWEST_PEOPLE = 2
#: Method -> relative sd of the error of its model, which no number of people averages out.
_SHARED_ERROR: Mapping[str, Mapping[str, float]] = {
    "strapped": {"stiffness": 0.08, "damping": 0.08, "inertia": 0.04}
}


def population_means(cells: Sequence[CellEstimate]) -> tuple[PopulationEstimate, ...]:
    """Return the mean of every parameter at every timing point over participants.

    The unit of analysis is the person: replicates and pulses of one person are
    no people (SCIENCE trap 15).
    """
    if any(has_budget(cell) for cell in cells):
        return pool_people(cells).population
    rows = pd.DataFrame(
        [row for cell in cells for row in cell.rows()], columns=list(ESTIMATE_COLUMNS)
    )
    groups = rows.groupby(["timing_point", "parameter"], sort=False)
    return tuple(_mean(group) for _, group in groups)


def _mean(rows: pd.DataFrame) -> PopulationEstimate:
    standing = rows[rows["status"].isin(["ok", "at_bound"])]
    values = standing["value"].to_numpy(dtype=float)
    onsets = standing["onset_gait_pct"].dropna().to_numpy(dtype=float)
    first, n = rows.iloc[0], values.size
    row = PopulationEstimate(
        timing_point=str(first["timing_point"]),
        onset_gait_pct=mean_phase(onsets),
        parameter=str(first["parameter"]),
        value=None,
        unit=str(first["unit"]),
        sd=None,
        ci_low=None,
        ci_high=None,
        n_participants=n,
        method=str(first["method"]),
        status=Failure.TOO_FEW_PARTICIPANTS.status,
        ci_level=_LEVEL,
    )
    shared_sd = _SHARED_ERROR.get(str(first["method"]), {}).get(_absolute(str(first["parameter"])))
    if shared_sd is not None and (rows["status"] == "undecided").any():
        # A mean of the decided people alone would be chosen by its own result.
        return replace(row, status="undecided")
    if n < _FEWEST_PEOPLE:
        return row
    mean = decided_mean(values, level=_LEVEL, shared_sd=shared_sd or 0.0)
    if mean is None:
        return replace(row, status="undecided")
    value, low, high = mean
    sd = float(values.std(ddof=1))
    return replace(row, value=value, sd=sd, ci_low=low, ci_high=high, status="ok")


def _absolute(parameter: str) -> str:
    return parameter.removesuffix("_per_mass").removesuffix("_onset")


def decided_mean(
    values: np.ndarray, *, level: float, shared_sd: float = 0.0
) -> tuple[float, float, float] | None:
    """Return mean and Student's interval over people, None if they are undecided.

    ``shared_sd`` is the relative sd of an error that is the same in all people.
    """
    mean, sd, n = float(values.mean()), float(values.std(ddof=1)), values.size
    half = float(stdtrit(n - 1, (1 + level) / 2) * sd / np.sqrt(n))
    half = float(np.hypot(half, REACH_95 * shared_sd * mean)) if shared_sd else half
    return (mean, mean - half, mean + half) if mean > 0.0 and decides(mean, half) else None
