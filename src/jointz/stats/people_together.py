"""People together: means, spreads and differences over people from everybody's likelihoods."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from jointz.kernels.statistics.people_model import PeopleData, draw_people
from jointz.results.estimates import FEWEST_PEOPLE, REACH_95, decides
from jointz.results.value_scale import ValueScale
from jointz.stats.people_likelihoods import (
    PER_MASS,
    PeopleLikelihoods,
    PeopleResults,
    Place,
    base,
    people_likelihoods,
)

#: Half-normal priors of the sd between people, relative: level of a person, own of a point.
#: Knees of adults differ by so much (docs/estimator.md); wider than any of the published tables.
LEVEL_SD: Mapping[str, float] = {"stiffness": 0.35, "damping": 0.4, "inertia": 0.35}
POINT_SD: Mapping[str, float] = {"stiffness": 0.25, "damping": 0.25, "inertia": 0.1}
#: Powers of body mass: K and B are given per kg in the literature, J grows with mass times the
#: square of a length (geometric similarity).
_MASS_POWER: Mapping[str, float] = {"stiffness": 1.0, "damping": 1.0, "inertia": 5.0 / 3.0}
_MASS_POWER_SD = 0.5
#: Error of the model that no number of people averages out, over a typical person's own error. In
#: legs of a simulator that shares nothing with the method, 8, 8 and 4 % of K, B and J had to be
#: added to means, where a person's own sds were 17, 15 and 7 %.
SHARED = 0.5
_TAILS = (2.5, 97.5)


@dataclass(frozen=True, slots=True)
class PeopleMean:
    """Mean over people of one parameter at one timing point."""

    value: float  # arithmetic mean, SI
    sd: float  # between people, SI
    ci_low: float  # SI
    ci_high: float  # SI
    n_people: int  # people whose data count
    decided: bool


@dataclass(frozen=True, slots=True)
class PeopleDifference:
    """Difference of two means over people: first minus second."""

    value: float  # SI
    ci_low: float  # SI
    ci_high: float  # SI
    p: float  # two-sided: twice the smaller probability of either sign
    effect: float  # over the sd between people of the true differences, or of the groups
    effect_low: float
    effect_high: float
    n_first: int
    n_second: int
    p_equivalence: float | None  # probability of lying outside the margin on the likelier side
    decided: bool  # whether its sign is known, or that it is small


@dataclass(frozen=True, slots=True, eq=False)
class _Fitted:
    """Draws of the population of one or two conditions."""

    places: tuple[tuple[int, Place], ...]  # condition, and place, of each element
    whole: np.ndarray  # (draw, d) SI: means over people, the device's own part included
    size: np.ndarray  # (draw, d) SI: of a change of the scale by 1
    relative_sd: np.ndarray  # (draw, d): between people, over ``size``
    level_variance: np.ndarray  # (draw, d): of that, what a person has at all places
    response_variance: np.ndarray  # (draw, d): of that, a person's own response to the condition
    intrinsic: np.ndarray  # (d,) SI
    logarithmic: np.ndarray  # (d,) bool
    unit: np.ndarray  # (d,) SI: of the scale of the model; 0 where a logarithm
    own_sd: np.ndarray  # (d,): error of a typical person's own estimate, on that scale
    n_people: np.ndarray  # (d,)
    gain_sd: float
    correlations: Mapping[tuple[str, str], tuple[float, float, float]]  # value, low, high
    session_sd: Mapping[str, float]


class PopulationModel:
    """A population of people: of one condition, of two, or of two groups.

    Made by :func:`together`. An element is a condition or group (from 0) with a place: timing point
    and parameter.

    Parameters
    ----------
    fits : sequence of _Fitted
        Draws of the population; of each group if people are not the same.

    Notes
    -----
    Logarithms of impedance (method ``strapped``), or K, B and log J (``rigid``), are normal over
    people about means that depend on body mass. People differ by a level at all timing points, by
    an own deviation at each, and between two conditions by an own response; the correlations of
    their levels of K, B and J are estimated. Everybody counts by the likelihood of the data: a
    prior is not data, and counts once for nobody. What all people share, gains of the calibration
    and half of a typical person's own error for the method, does not average out, and is added. A
    mean is not decided where its interval reaches further than half of it, or that of a typical
    person's data alone does.
    """

    def __init__(self, fits: Sequence[_Fitted]) -> None:
        self._fits = fits
        self._of = {element: (f, k) for f, fit in enumerate(fits)
                    for k, element in enumerate(fit.places)}  # fmt: skip
        rng = np.random.default_rng(0)
        draws = fits[0].whole.shape[0]
        # One error of the model for a parameter at a point, whoever is measured; one of the
        # gains for people who were measured by one instrument.
        places = dict.fromkeys(place for fit in fits for _, place in fit.places)
        self._model = {place: rng.standard_normal(draws) for place in places}
        self._gains = [fit.gain_sd * rng.standard_normal(draws) for fit in fits]

    @property
    def elements(self) -> tuple[tuple[int, Place], ...]:
        """Condition and place of every element."""
        return tuple(self._of)

    @property
    def correlations(self) -> Mapping[tuple[str, str], tuple[float, float, float]]:
        """Pair of parameters -> correlation of people's levels, with its interval."""
        return self._fits[0].correlations

    @property
    def session_sd(self) -> Mapping[str, float]:
        """Parameter -> relative sd between sessions and sides of a person, if there are several."""
        return self._fits[0].session_sd

    def _draws(self, element: tuple[int, Place]) -> np.ndarray:
        """Return draws of a mean with the errors that everybody shares, SI."""
        f, k = self._of[element]
        fit = self._fits[f]
        wrong = SHARED * fit.own_sd[k] * self._model[element[1]]
        whole, gain, unit = fit.whole[:, k], np.exp(self._gains[f]), float(fit.unit[k])
        linear = not fit.logarithmic[k]
        whole = whole + unit * wrong if linear else ValueScale(unit).moved(whole, wrong).clip(0.0)
        return np.asarray(whole * gain - fit.intrinsic[k])

    def mean(self, condition: int, place: Place) -> PeopleMean | None:
        """Return the mean of a parameter at a timing point, SI; None below three people."""
        element = (condition, place)
        if element not in self._of:
            return None
        f, k = self._of[element]
        fit = self._fits[f]
        if fit.n_people[k] < FEWEST_PEOPLE:
            return None
        value = float(np.median(fit.whole[:, k])) - float(fit.intrinsic[k])
        low, high = np.percentile(self._draws(element), _TAILS).tolist()
        reach, unit = REACH_95 * fit.own_sd[k], float(fit.unit[k])
        sized = ValueScale(unit).slope(value) * np.sinh(reach)
        typical = sized if fit.logarithmic[k] else unit * reach
        half = max((high - low) / 2.0, float(typical))
        return PeopleMean(
            value=value,
            sd=float(np.median(np.abs(fit.size[:, k]) * fit.relative_sd[:, k])),
            ci_low=low,
            ci_high=high,
            n_people=int(fit.n_people[k]),
            decided=value > 0.0 and low > 0.0 and bool(decides(value, half)),
        )

    def difference(
        self,
        first: tuple[int, Place],
        second: tuple[int, Place],
        *,
        margin_share: float | None = None,
    ) -> PeopleDifference | None:
        """Return first minus second, SI; None below three people.

        Each is a condition or group, from 0, with timing point and parameter; ``margin_share`` is
        the margin of equivalence, as a share of the second mean.
        """
        if first not in self._of or second not in self._of:
            return None
        counts = [int(self._fits[f].n_people[k]) for f, k in (self._of[first], self._of[second])]
        if min(counts) < FEWEST_PEOPLE:
            return None
        a, b = self._draws(first), self._draws(second)
        off = a - b
        low, high = np.percentile(off, _TAILS).tolist()
        effect = np.percentile(off / self._spread(first, second), (50.0, *_TAILS)).tolist()
        size = abs(float(np.median(b)))
        outside = None
        if margin_share is not None:
            margin = margin_share * np.abs(b)
            outside = max(_share(off > margin), _share(off < -margin))
        return PeopleDifference(
            value=float(np.median(off)),
            ci_low=low,
            ci_high=high,
            p=min(1.0, 2.0 * min(_share(off > 0.0), _share(off < 0.0))),
            effect=effect[0],
            effect_low=effect[1],
            effect_high=effect[2],
            n_first=counts[0],
            n_second=counts[1],
            p_equivalence=outside,
            decided=not low <= 0.0 <= high or bool(decides(size, (high - low) / 2.0)),
        )

    def _spread(self, first: tuple[int, Place], second: tuple[int, Place]) -> np.ndarray:
        """Return the sd over people of their differences; of groups, their own sd."""
        (f, a), (g, b) = self._of[first], self._of[second]
        fit, other = self._fits[f], self._fits[g]
        x, y = fit.size[:, a], other.size[:, b]
        if f != g:
            squares = (x * fit.relative_sd[:, a]) ** 2 + (y * other.relative_sd[:, b]) ** 2
            return np.asarray(np.sqrt(squares / 2.0))
        whole, response = fit.relative_sd[:, a] ** 2, fit.response_variance[:, a]
        # Of two conditions all but the response is common; of two points, a person's level.
        common = whole - response if first[0] != second[0] else fit.level_variance[:, a]
        own = whole - common
        return np.asarray(np.sqrt((x - y) ** 2 * common + (x**2 + y**2) * own))


def _share(true: np.ndarray) -> float:
    """Return the share of draws; never less than one of them."""
    return float(max(true.mean(), 1.0 / true.size))


def together(
    conditions: Sequence[PeopleResults], parameters: Sequence[str], *, same_people: bool
) -> PopulationModel | None:
    """Fit one model to all people; its means and differences hold for the population.

    Parameters
    ----------
    conditions : sequence of PeopleResults
        One condition; or two conditions or groups.
    parameters : sequence of str
        Names of parameters, such as ``stiffness`` or ``damping_per_mass``; all in one model.
    same_people : bool
        Whether equal ids are the same people in two conditions; otherwise they are groups, each
        with means, spread and calibration of its own.

    Returns
    -------
    PopulationModel or None
        The population; None if a result states no errors of the estimates.

    Notes
    -----
    Draws have a fixed seed. See :class:`PopulationModel` for the model.
    """
    likelihoods, masses = [], [results.masses_kg for results in conditions]
    for results in conditions:
        if (likelihood := people_likelihoods(results, parameters)) is None:
            return None
        likelihoods.append(likelihood)
    if same_people:
        return PopulationModel([_fit(likelihoods, masses, first=0)])
    groups = zip(likelihoods, masses, strict=True)
    return PopulationModel([_fit([one], [kg], first=k) for k, (one, kg) in enumerate(groups)])


def _fit(
    conditions: Sequence[PeopleLikelihoods], masses_kg: Sequence[Mapping[str, float]], *, first: int
) -> _Fitted:
    """Fit the model to the same people in one condition or more."""
    people = list(dict.fromkeys(p for one in conditions for p in one.people))
    names = list(dict.fromkeys(name for one in conditions for _, name in one.places))
    places = [(first + c, place) for c, one in enumerate(conditions) for place in one.places]
    kinds = np.array([names.index(name) for _, (_, name) in places])
    points = list(dict.fromkeys(point for _, (point, _) in places))
    masses = dict(item for own in masses_kg for item in own.items())
    covariate = _log_masses(people, masses)
    data = PeopleData(
        *_stacked(conditions, people),
        kinds=kinds,
        places=np.array([points.index(point) for _, (point, _) in places]),
        level_sd=np.array([LEVEL_SD[base(name)] for name in names]),
        place_sd=np.array([POINT_SD[base(name)] for name in names]),
        conditions=np.array([c for c, _ in places]),
        covariate=covariate,
        slope=np.array([_MASS_POWER[base(n)] - n.endswith(PER_MASS) for n in names]),
        slope_sd=_MASS_POWER_SD,
    )
    return _in_si(conditions, data, places, names, seed=1 + first)


def _stacked(
    conditions: Sequence[PeopleLikelihoods], people: Sequence[str]
) -> tuple[np.ndarray, np.ndarray]:
    """Return precision and weighted mean of everybody over the elements of all conditions."""
    d = sum(len(one.places) for one in conditions)
    precision, weighted = np.zeros((len(people), d, d)), np.zeros((len(people), d))
    start = 0
    for one in conditions:
        own = slice(start, start + len(one.places))
        rows = [people.index(person) for person in one.people]
        precision[rows, own, own] = one.precision
        weighted[rows, own] = one.weighted
        start = own.stop
    return precision, weighted


def _log_masses(people: Sequence[str], masses_kg: Mapping[str, float]) -> np.ndarray:
    """Return the logarithms of the masses about their mean; empty if any is unknown."""
    if not set(people) <= set(masses_kg):
        return np.empty(0)
    logs = np.log([masses_kg[person] for person in people])
    return np.asarray(logs - logs.mean())


def _in_si(
    conditions: Sequence[PeopleLikelihoods],
    data: PeopleData,
    places: Sequence[tuple[int, Place]],
    names: Sequence[str],
    *,
    seed: int,
) -> _Fitted:
    """Draw the population, and return it in SI."""
    drawn = draw_people(data, seed=seed)
    logarithmic, unit, intrinsic = (
        np.concatenate([getattr(one, key) for one in conditions])
        for key in ("logarithmic", "unit", "intrinsic")
    )
    slope, variance = drawn.slope[:, data.kinds], drawn.variance[:, data.kinds]
    middle, level = drawn.mean, drawn.level[:, data.kinds]
    if data.covariate.size:
        # The mean mass of the sample differs from that of the population.
        mass_variance = float(data.covariate.var(ddof=1)) if data.covariate.size > 1 else 0.0
        off = np.random.default_rng(seed).standard_normal((len(middle), 1))
        middle = middle + slope * off * np.sqrt(mass_variance / data.covariate.size)
        variance, level = (part + slope**2 * mass_variance for part in (variance, level))
    logs = np.where(logarithmic, middle + variance / 2.0, 0.0)
    # Where nobody has data the draws have no limits.
    with np.errstate(over="ignore", divide="ignore", invalid="ignore"):
        whole = np.where(logarithmic, np.exp(logs), unit * middle)
        linear_sd = np.sqrt(variance) / np.abs(middle)
        relative_sd = np.where(logarithmic, np.sqrt(np.expm1(variance)), linear_sd)
        curved = logarithmic & (unit > 0.0)
        asinh_mean, asinh_sd = _of_asinh(middle, variance, unit)
        # A likelihood by few data may lie below zero, where sinh leads far: no stiffness is.
        whole = np.where(curved, np.maximum(asinh_mean, 0.0), whole)
        size = np.where(curved, np.hypot(whole, unit), whole)
        relative_sd = np.where(curved, asinh_sd / size, relative_sd)
    scale = np.where(logarithmic, 1.0, 1.0 / middle**2)
    own_sd = np.concatenate([_typical(one.own_sd) for one in conditions])
    counts = [one.counts.sum(axis=0) for one in conditions]
    return _Fitted(
        places=tuple(places),
        whole=whole,
        size=size,
        relative_sd=relative_sd,
        level_variance=level * scale,
        response_variance=drawn.response[:, data.kinds] * scale,
        intrinsic=intrinsic,
        logarithmic=logarithmic,
        unit=unit,
        own_sd=own_sd,
        n_people=np.concatenate(counts),
        gain_sd=float(np.sqrt(np.mean([one.gain_sd**2 for one in conditions]))),
        correlations=_correlations(drawn.correlation, names),
        session_sd=conditions[0].session_sd,
    )


def _of_asinh(
    middle: np.ndarray, variance: np.ndarray, unit: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Return mean and sd of ``unit * sinh(x)`` of a normal x."""
    mean = unit * np.exp(variance / 2.0) * np.sinh(middle)
    square = np.expm1(variance) * (np.exp(variance) * np.cosh(2.0 * middle) + 1.0) / 2.0
    return mean, unit * np.sqrt(square)


def _typical(own_sd: np.ndarray) -> np.ndarray:
    """Return the median over people, NaN where nobody has data."""
    nobody = ~np.isfinite(own_sd).any(axis=0)
    filled = np.where(nobody, 0.0, own_sd)
    return np.where(nobody, np.nan, np.nanmedian(filled, axis=0))


def _correlations(
    drawn: np.ndarray, names: Sequence[str]
) -> dict[tuple[str, str], tuple[float, float, float]]:
    """Return median and interval of each correlation."""
    correlations = {}
    for j, second in enumerate(names):
        for i, first in enumerate(names[:j]):
            low, value, high = np.percentile(drawn[:, i, j], (_TAILS[0], 50.0, _TAILS[1])).tolist()
            correlations[first, second] = (value, low, high)
    return correlations
