"""Partial pooling: means over people, and each person's estimate given the others."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np

from jointz.core.codes import Failure
from jointz.core.gait_phases import mean_phase
from jointz.kernels.bounded_normal import bounded_interval
from jointz.kernels.statistics.pooling_posterior import PartialPooling, partial_pooling
from jointz.results.estimates import REACH_95, CellEstimate, ParameterEstimate, decides
from jointz.results.statistics.pooled_estimates import POOLED_METHOD, estimate_without_priors
from jointz.results.study_analysis import PopulationEstimate

_LEVEL = 0.95
_FEWEST_PEOPLE = 2
_MADE = "normal model of people over the estimates of all participants, Jeffreys' prior"


@dataclass(frozen=True, slots=True)
class PooledPeople:
    """The pooled estimates of a study."""

    # mean and spread over people for every timing point and parameter
    population: tuple[PopulationEstimate, ...]
    cells: tuple[CellEstimate, ...]  # pooled estimates of every participant, in the order given


@dataclass(frozen=True, slots=True)
class _Group:
    """One parameter at one timing point, in the scale it is pooled in."""

    timing_point: str
    name: str
    places: tuple[int, ...]
    values: np.ndarray  # SI, or natural logarithms of values in SI; NaN for missing ones
    sds: np.ndarray  # sds of the errors of ``values``
    logarithmic: bool

    def back(self, value: float) -> float:
        """Return a value in SI."""
        return float(np.exp(value)) if self.logarithmic else float(value)

    def sd_back(self, value: float, sd: float) -> float:
        """Return a standard deviation in SI."""
        return float(sd) * (float(np.exp(value)) if self.logarithmic else 1.0)


def pool_people(cells: Sequence[CellEstimate]) -> PooledPeople:
    """Estimate mean and spread over people, and every person's values given the others.

    Parameters
    ----------
    cells : sequence of CellEstimate
        Of the method ``rigid``, one a participant and timing point.

    Returns
    -------
    PooledPeople
        Rows of method ``rigid_pooled``. A failed cell stays failed and counts nowhere.

    Notes
    -----
    Every timing point by itself: an estimate y with standard error s of a person whose true
    value comes from a normal population. The priors of
    each person's K, B and J are taken out of y and s, so that they do not count once per person.
    J is pooled in its logarithm (its mean is the geometric one), K, B and values per kg as they
    are. Undecided cells count by their unbounded estimate and its standard error. Errors that a
    person's timing points share (gain, lag, friction) are in s whole: nothing is averaged over
    the timing points of a person. The unit of analysis is the person (SCIENCE trap 15).

    A mean is ``undecided`` where its interval reaches further than half its value, and where
    that of a typical person's data alone does: what a model gets wrong about everybody does not
    average out over people. Nobody's own value is drawn towards an undecided mean.

    Misleads where all people share an error, such as that of one calibration for the whole
    study: it belongs to the mean in full, and is treated here as if it averaged out over people.
    Also where one person is unlike the rest: who is far out is drawn towards the others by as
    much as the errors say, and widens their spread.
    """
    groups = list(_groups(cells))
    if not groups:
        return PooledPeople((), tuple(cells))
    n = max(len(group.places) for group in groups)
    values, sds = np.full((2, len(groups), n), np.nan)
    for g, group in enumerate(groups):
        values[g, : len(group.places)], sds[g, : len(group.places)] = group.values, group.sds
    pooled = partial_pooling(values, sds, level=_LEVEL)
    population = tuple(_mean(group, pooled, g, cells) for g, group in enumerate(groups))
    pooled_estimates: dict[tuple[int, str], ParameterEstimate] = {}
    for g, group in enumerate(groups):
        for k, place in enumerate(group.places):
            before = cells[place].parameter(group.name)
            if before is not None and np.isfinite(pooled.value[g, k]):
                drawn = population[g].status != "undecided"
                pooled_estimates[place, group.name] = (
                    _pooled_estimate(group, pooled, (g, k), before) if drawn else before
                )
    return PooledPeople(
        population=population,
        cells=tuple(
            replace(
                cell,
                method=POOLED_METHOD,
                parameters=tuple(pooled_estimates.get((i, p.name), p) for p in cell.parameters),
                response=None,
                nuisance=(),
                gravity_corrected=None,
                budget={},
            )
            for i, cell in enumerate(cells)
        ),
    )


def _groups(cells: Sequence[CellEstimate]) -> Iterator[_Group]:
    """Yield every timing point's parameters, in the order they come; NaN for who has none."""
    keys = dict.fromkeys((c.timing_point, p.name) for c in cells for p in c.parameters)
    for point, name in keys:
        places = tuple(i for i, c in enumerate(cells) if c.timing_point == point)
        estimates = [estimate_without_priors(cells[i], name) for i in places]
        values = np.array([np.nan if e is None else e.value for e in estimates])
        sds = np.array([np.nan if e is None else e.sd for e in estimates])
        logarithmic = name == "inertia" and bool((values[np.isfinite(values)] > 0.0).all())
        if logarithmic:
            values, sds = np.log(values), sds / values
        yield _Group(point, name, places, values, sds, logarithmic)


def _mean(
    group: _Group, pooled: PartialPooling, g: int, cells: Sequence[CellEstimate]
) -> PopulationEstimate:
    n = int(np.isfinite(group.values).sum())
    parameter = next(p for i in group.places for p in cells[i].parameters if p.name == group.name)
    onsets = [cells[i].onset_gait_pct for i in group.places]
    row = PopulationEstimate(
        timing_point=group.timing_point,
        onset_gait_pct=mean_phase(onsets),
        parameter=group.name,
        value=None,
        unit=parameter.unit,
        sd=None,
        ci_low=None,
        ci_high=None,
        n_participants=n,
        method=POOLED_METHOD,
        status=Failure.TOO_FEW_PARTICIPANTS.status,
        ci_level=_LEVEL,
    )
    if n < _FEWEST_PEOPLE:
        return row
    mean, typical_sd = float(pooled.mean[g]), float(np.nanmedian(group.sds))
    value, low, high = map(group.back, (mean, pooled.mean_low[g], pooled.mean_high[g]))
    reach = max(group.back(mean + REACH_95 * typical_sd) - value, high - value, value - low)
    if value <= 0.0 or not decides(value, reach):
        return replace(row, status="undecided")
    sd = group.sd_back(mean, float(pooled.spread[g]))
    return replace(row, value=value, sd=sd, ci_low=low, ci_high=high, status="ok")


def _pooled_estimate(
    group: _Group, pooled: PartialPooling, at: tuple[int, int], before: ParameterEstimate
) -> ParameterEstimate:
    """Return a participant's estimate given the others; refused as it would be alone."""
    value, sd = group.back(pooled.value[at]), group.sd_back(pooled.value[at], pooled.sd[at])
    low, high = group.back(pooled.low[at]), group.back(pooled.high[at])
    if not group.logarithmic and low <= 0.0:
        low, high = bounded_interval(value, sd, level=_LEVEL)
    at_bound = low == 0.0
    # Whether a limit at the bound is a small one was judged where the response was seen.
    undecided = before.status != "at_bound" if at_bound else not decides(value, 0.5 * (high - low))
    if undecided:
        return ParameterEstimate(group.name, None, None, None, "undecided", unbounded=value)
    return ParameterEstimate(
        name=group.name,
        value=max(value, 0.0),
        ci_low=low,
        ci_high=high,
        status="at_bound" if at_bound else "ok",
        ci_level=_LEVEL,
        ci_method=_MADE,
        unbounded=value,
    )
