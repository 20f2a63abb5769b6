"""Means over people, with intervals over people, never over replicates."""

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np
import pandas as pd
from scipy.special import stdtrit

from jointz.core.codes import Failure
from jointz.core.gait_phases import mean_phase
from jointz.results.estimates import ESTIMATE_COLUMNS, CellEstimate, decides
from jointz.results.log_posterior import LogPosterior
from jointz.results.statistics.pooled_estimates import has_budget
from jointz.results.study_analysis import PopulationEstimate
from jointz.stats.log_pooling import LogMean, log_means
from jointz.stats.partial_pooling import pool_people

_LEVEL = 0.95
_FEWEST_PEOPLE = 2
_IMPEDANCE = ("stiffness", "damping", "inertia")
_ONSET = ("stiffness_onset", "damping_onset")
_PER_MASS = "_per_mass"


def population_means(
    cells: Sequence[CellEstimate],
    posteriors: Sequence[LogPosterior] = (),
    masses_kg: Mapping[str, float] | None = None,
) -> tuple[PopulationEstimate, ...]:
    """Return the mean of every parameter at every timing point over participants.

    The unit of analysis is the person: replicates and pulses of one person are
    no people (SCIENCE trap 15). Of a method that gives posteriors, means are those of
    :func:`jointz.stats.log_pooling.log_means`, to which undecided people belong.
    """
    if any(has_budget(cell) for cell in cells):
        return pool_people(cells).population
    rows = pd.DataFrame(
        [row for cell in cells for row in cell.rows()], columns=list(ESTIMATE_COLUMNS)
    )
    groups = rows.groupby(["timing_point", "parameter"], sort=False)
    means = _log_means(posteriors, masses_kg or {})
    return tuple(_mean(group, means if posteriors else None) for _, group in groups)


def _log_means(
    posteriors: Sequence[LogPosterior], masses_kg: Mapping[str, float]
) -> dict[tuple[str, str], LogMean]:
    """Return timing point and parameter -> mean, values per kg and at the onset included."""
    weighed = [p for p in posteriors if p.participant in masses_kg]
    log_masses = {person: float(np.log(mass)) for person, mass in masses_kg.items()}
    per_mass = log_means(weighed, _IMPEDANCE[:2], log_scale=log_masses)
    return {
        **log_means(posteriors, _IMPEDANCE),
        **{(point, name + _PER_MASS): mean for (point, name), mean in per_mass.items()},
        **log_means(posteriors, _ONSET),
    }


def _mean(
    rows: pd.DataFrame, means: Mapping[tuple[str, str], LogMean] | None
) -> PopulationEstimate:
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
    if means is not None:
        found = _with_log_mean(row, means.get((row.timing_point, row.parameter)))
        undecided = int((rows["status"] == "undecided").sum())
        # Where nobody's data count, people are there: it is the data that do not decide.
        nobody = found.status == row.status and undecided >= _FEWEST_PEOPLE
        return replace(found, status="undecided") if nobody else found
    if n < _FEWEST_PEOPLE:
        return row
    mean = decided_mean(values, level=_LEVEL)
    if mean is None:
        return replace(row, status="undecided")
    value, low, high = mean
    sd = float(values.std(ddof=1))
    return replace(row, value=value, sd=sd, ci_low=low, ci_high=high, status="ok")


def _with_log_mean(row: PopulationEstimate, mean: LogMean | None) -> PopulationEstimate:
    """Return a row with the mean of the likelihoods; without one it stays failed."""
    if mean is None:
        return row
    if not mean.decided:
        return replace(row, n_participants=mean.n_people, status="undecided")
    return replace(
        row,
        value=mean.value,
        sd=mean.sd,
        ci_low=mean.ci_low,
        ci_high=mean.ci_high,
        n_participants=mean.n_people,
        status="ok",
    )


def decided_mean(values: np.ndarray, *, level: float) -> tuple[float, float, float] | None:
    """Return mean and Student's interval over people, None if they are undecided."""
    mean, sd, n = float(values.mean()), float(values.std(ddof=1)), values.size
    half = float(stdtrit(n - 1, (1 + level) / 2) * sd / np.sqrt(n))
    return (mean, mean - half, mean + half) if mean > 0.0 and decides(mean, half) else None
