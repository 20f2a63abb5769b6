"""Means over people, with intervals over people, never over replicates."""

from collections.abc import Collection, Mapping, Sequence
from dataclasses import replace

import numpy as np
import pandas as pd
from scipy.special import stdtrit

from jointz.core.codes import Failure
from jointz.core.gait_phases import mean_phase
from jointz.results.estimates import ESTIMATE_COLUMNS, FEWEST_PEOPLE, CellEstimate, decides
from jointz.results.log_posterior import LogPosterior
from jointz.results.person_estimates import person_cells
from jointz.results.study_analysis import PopulationEstimate
from jointz.stats.people_likelihoods import PARAMETERS, PER_MASS, PeopleResults, Place
from jointz.stats.people_together import PeopleMean, PopulationModel, together

_LEVEL = 0.95
#: Parameters that are looked at together; K, B and J with the covariance of their levels.
_TOGETHER = (
    PARAMETERS,
    tuple(name + PER_MASS for name in PARAMETERS[:2]),
    ("stiffness_onset", "damping_onset"),
)


def population_means(
    cells: Sequence[CellEstimate],
    posteriors: Sequence[LogPosterior] = (),
    masses_kg: Mapping[str, float] | None = None,
    *,
    however_wide: bool = False,
) -> tuple[PopulationEstimate, ...]:
    """Return the mean of every parameter at every timing point over participants.

    The unit of analysis is the person: sessions, sides and pulses of one person are not
    independent (SCIENCE trap 15). If the method states its errors, means are those of
    :func:`jointz.stats.people_together.together`, which include undecided people. Plain means are
    undecided if their intervals are too wide, unless values are wanted ``however_wide`` they are.
    """
    results = PeopleResults(posteriors, cells, masses_kg or {})
    models = people_models([results]) if results.have_errors else {}
    means = {place: mean for place, model in models.items() if (mean := model.mean(0, place))}
    rows = pd.DataFrame(
        [row for cell in person_cells(cells) for row in cell.rows()],
        columns=list(ESTIMATE_COLUMNS),
    )
    groups = rows.groupby(["timing_point", "parameter"], sort=False)
    # Posteriors of which none can be used leave no mean; cells without errors have plain means.
    own = means if means or posteriors else None
    return tuple(_mean(group, own, however_wide=however_wide) for _, group in groups)


def people_models(
    conditions: Sequence[PeopleResults],
    *,
    same_people: bool = True,
    parameters: Collection[str] = (),
) -> dict[Place, PopulationModel]:
    """Return timing point and parameter -> its model of all people, by default of all parameters.

    Means over people and comparisons of them use these models, so that both give one number.
    """
    groups = [own for own in _TOGETHER if not parameters or not set(parameters).isdisjoint(own)]
    models = [together(conditions, own, same_people=same_people) for own in groups]
    return {place: model for model in models if model for _, place in model.elements}


def _mean(
    rows: pd.DataFrame, means: Mapping[Place, PeopleMean] | None, *, however_wide: bool
) -> PopulationEstimate:
    available = rows[rows["status"].isin(["ok", "at_bound"])]
    values = available["value"].to_numpy(dtype=float)
    onsets = available["onset_gait_pct"].dropna().to_numpy(dtype=float)
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
        sample_sd=float(values.std(ddof=1)) if n >= FEWEST_PEOPLE else None,
    )
    if means is not None:
        mean_row = _of_people(row, means.get((row.timing_point, row.parameter)))
        n_undecided = int((rows["status"] == "undecided").sum())
        # If nobody's data count, there are people enough, but their data do not decide.
        nobody = mean_row.status == row.status and n_undecided >= FEWEST_PEOPLE
        return replace(mean_row, status="undecided") if nobody else mean_row
    if n < FEWEST_PEOPLE:
        return row
    mean = student_mean(values, level=_LEVEL, however_wide=however_wide)
    if mean is None:
        return replace(row, status="undecided")
    value, low, high = mean
    return replace(row, value=value, sd=row.sample_sd, ci_low=low, ci_high=high, status="ok")


def _of_people(row: PopulationEstimate, mean: PeopleMean | None) -> PopulationEstimate:
    """Return a row with a mean of people together; without one it stays failed."""
    if mean is None:
        return row
    row = replace(row, n_participants=mean.n_people, status="undecided")
    if not mean.decided:
        return row
    return replace(
        row, value=mean.value, sd=mean.sd, ci_low=mean.ci_low, ci_high=mean.ci_high, status="ok"
    )


def student_mean(
    values: np.ndarray, *, level: float, however_wide: bool = False
) -> tuple[float, float, float] | None:
    """Return mean and Student's interval over people, None if it does not decide the mean."""
    mean, sd, n = float(values.mean()), float(values.std(ddof=1)), values.size
    half = float(stdtrit(n - 1, (1 + level) / 2) * sd / np.sqrt(n))
    given = however_wide or (mean > 0.0 and decides(mean, half))
    return (mean, mean - half, mean + half) if given else None
