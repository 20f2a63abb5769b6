"""Likelihoods of every person's impedance, from the results of any method that states errors."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np

from jointz.core.errors import DataError
from jointz.results.estimates import CellEstimate
from jointz.results.log_posterior import LogPosterior
from jointz.results.statistics.pooled_estimates import (
    estimate_without_priors,
    has_budget,
    unbounded_estimate,
)
from jointz.results.value_scale import ValueScale

#: Timing point and parameter.
Place = tuple[str, str]
PARAMETERS = ("stiffness", "damping", "inertia")
PER_MASS = "_per_mass"
_ONSET = "_onset"
#: Least information of the data over that of the prior; with less a person does not count.
_LEAST_INFORMATION = 0.01
#: Of a logarithm: nobody is known to 0.001 %, and equations of people become singular.
_LEAST_VARIANCE = 1e-10


@dataclass(frozen=True, slots=True)
class PeopleResults:
    """Results of the people of one condition or group.

    Parameters
    ----------
    posteriors : sequence of LogPosterior
        Of a method that gives them.
    cells : sequence of CellEstimate
        Estimates of one method; used if there are no posteriors.
    masses_kg : mapping of str to float
        Participant -> body mass, kg; used as a covariate if all are known.
    """

    posteriors: Sequence[LogPosterior] = ()
    cells: Sequence[CellEstimate] = ()
    masses_kg: Mapping[str, float] = field(default_factory=dict)

    def __post_init__(self) -> None:
        if wrong := [name for name, kg in self.masses_kg.items() if not 0.0 < kg < np.inf]:
            raise DataError(f"masses_kg: expected more than 0 kg; correct {', '.join(wrong)}.")
        for posterior in self.posteriors:
            variances = np.diag(posterior.covariance)
            if ((variances > 0.0) & (variances < _LEAST_VARIANCE)).any():
                raise DataError(
                    f"log posterior of {posterior.label}: expected variances of at least "
                    f"{_LEAST_VARIANCE:g}, got {variances.min():.3g}. State the whole error."
                )

    @property
    def have_errors(self) -> bool:
        """True if the method states the errors of its estimates."""
        return bool(self.posteriors) or any(has_budget(cell) for cell in self.cells)


@dataclass(frozen=True, slots=True, eq=False)
class PeopleLikelihoods:
    """Likelihoods of people about values on the scale of the model.

    The scale is relative to ``unit``: values / ``unit``; or, if ``logarithmic``, that of
    ``ValueScale(unit)``: a logarithm, or asinh.
    """

    people: tuple[str, ...]
    places: tuple[Place, ...]
    logarithmic: np.ndarray  # (d,) bool
    unit: np.ndarray  # (d,) SI; 0 where a logarithm
    precision: np.ndarray  # (n, d, d)
    weighted: np.ndarray  # (n, d): precision times mean
    own_sd: np.ndarray  # (n, d): of each person's estimate, on the scale; NaN without one
    counts: np.ndarray  # (n, d) bool: whose data say anything
    intrinsic: np.ndarray  # (d,) SI: the device's own part, which values include
    gain_sd: float  # relative, of calibrations that all people share
    session_sd: Mapping[str, float]  # parameter -> sd between sessions and sides of a person


@dataclass(frozen=True, slots=True, eq=False)
class _Unit:
    """Estimates of a session and side of a person, by place in the list of all places."""

    participant: str
    at: np.ndarray  # (k,) places
    mean: np.ndarray  # (k,)
    covariance: np.ndarray  # (k, k)
    prior: tuple[np.ndarray, np.ndarray] | None = None  # its mean and covariance, if it has one

    def only(self, places: Sequence[int]) -> "_Unit":
        """Return the estimates of some places."""
        own = [int(np.flatnonzero(self.at == p)[0]) for p in places]
        square = np.ix_(own, own)
        prior = None if self.prior is None else (self.prior[0][own], self.prior[1][square])
        return _Unit(self.participant, self.at[own], self.mean[own], self.covariance[square], prior)

    @property
    def valid(self) -> bool:
        """True if there are places, with finite numbers and covariances that can be inverted."""
        parts = (self.mean, self.covariance, *(self.prior or ()))
        if not self.at.size or not all(np.isfinite(part).all() for part in parts):
            return False
        squares = (self.covariance, *((self.prior[1],) if self.prior else ()))
        return all(np.linalg.eigvalsh(square)[0] > 0.0 for square in squares)

    def informed(self, precision: np.ndarray) -> np.ndarray:
        """Return where the data say more than a hundredth of what the prior does."""
        if self.prior is None:
            return np.ones(self.at.size, dtype=bool)
        return np.asarray(np.diag(precision) * np.diag(self.prior[1]) > _LEAST_INFORMATION)

    def likelihood(self) -> tuple[np.ndarray, np.ndarray]:
        """Return precision, and precision times mean: posterior over prior."""
        inverse = np.linalg.inv(self.covariance)
        if self.prior is None:
            return inverse, inverse @ self.mean
        prior_inverse = np.linalg.inv(self.prior[1])
        values, vectors = np.linalg.eigh(inverse - prior_inverse)
        own = vectors.T @ (inverse @ self.mean - prior_inverse @ self.prior[0])
        # What the clipped directions hold is no information either.
        return (vectors * values.clip(0.0)) @ vectors.T, vectors @ ((values > 0.0) * own)


def people_likelihoods(
    results: PeopleResults, parameters: Sequence[str]
) -> PeopleLikelihoods | None:
    """Return everybody's likelihoods; None where the results state no errors, or hold nothing."""
    if results.posteriors:
        return _assembled(results, *_of_posteriors(results, parameters))
    return _assembled(results, *_of_cells(results, parameters)) if results.have_errors else None


def base(name: str) -> str:
    """Return the parameter that a value per kg or at the onset is of."""
    return name.removesuffix(PER_MASS).removesuffix(_ONSET)


def _assembled(
    results: PeopleResults,
    places: Sequence[Place],
    units: Sequence[_Unit],
    logarithmic: np.ndarray,
    unit: np.ndarray,
) -> PeopleLikelihoods | None:
    # Numbers that are no estimates say nothing about anybody.
    units = [unit for unit in units if unit.valid]
    people = tuple(dict.fromkeys(u.participant for u in units))
    if not places or not people:
        return None
    own = [_alike([u for u in units if u.participant == person]) for person in people]
    names = [name for _, name in places]
    sessions = _session_variances(own, names)
    n, d = len(people), len(places)
    precision, weighted = np.zeros((n, d, d)), np.zeros((n, d))
    own_sd, counts = np.full((n, d), np.nan), np.zeros((n, d), dtype=bool)
    for i, of_person in enumerate(own):
        if not of_person:
            continue
        average = _average(of_person)
        at, square = average.at, np.ix_(average.at, average.at)
        own_precision, own_weighted = average.likelihood()
        between = np.diag([sessions.get(names[p], 0.0) / len(of_person) for p in at])
        spread = np.eye(at.size) + own_precision @ between
        precision[i][square] = np.linalg.solve(spread, own_precision)
        weighted[i, at] = np.linalg.solve(spread, own_weighted)
        own_sd[i, at] = np.sqrt(np.diag(average.covariance))
        counts[i, at] = average.informed(own_precision)
    return PeopleLikelihoods(
        people=people,
        places=tuple(places),
        logarithmic=logarithmic,
        unit=unit,
        precision=precision,
        weighted=weighted,
        own_sd=own_sd,
        counts=counts,
        intrinsic=_intrinsic(results, places),
        gain_sd=_gain_sd(results),
        session_sd={name: float(np.sqrt(v)) for name, v in sessions.items()},
    )


# --- estimates of a session ----------------------------------------------------------------------


def _of_posteriors(
    results: PeopleResults, parameters: Sequence[str]
) -> tuple[list[Place], list[_Unit], np.ndarray, np.ndarray]:
    names = {name: name.removesuffix(PER_MASS) for name in parameters}
    points = dict.fromkeys(t for p in results.posteriors for t in p.timing_points)
    known = {key for p in results.posteriors
             for key in zip(p.timing_points, p.parameters, strict=True)}  # fmt: skip
    places = [(t, name) for name in parameters for t in points if (t, names[name]) in known]
    scales = {place: _common_scale(results, place[1]) for place in places}
    units = [_of_posterior(p, scales, results.masses_kg) for p in results.posteriors]
    scale_units = np.array([scale.unit for scale in scales.values()])
    return places, units, np.ones(len(places), dtype=bool), scale_units


def _common_scale(results: PeopleResults, name: str) -> ValueScale:
    """Return the scale of a parameter for all people; per kg, that of a person of mean mass."""
    absolute = name.removesuffix(PER_MASS)
    unit = max(p.scale(absolute).unit for p in results.posteriors)
    masses_kg = list(results.masses_kg.values()) if name != absolute else []
    return ValueScale(unit / float(np.exp(np.mean(np.log(masses_kg or [1.0])))))


def _of_posterior(
    posterior: LogPosterior, scales: Mapping[Place, ValueScale], masses_kg: Mapping[str, float]
) -> _Unit:
    """Return a posterior's elements, without those that a doubt speaks against."""
    places = list(scales)
    keys = zip(posterior.timing_points, posterior.parameters, strict=True)
    doubted = posterior.doubted or (False,) * len(posterior.parameters)
    element_of = {key: k for k, key in enumerate(keys) if not doubted[k]}
    weighed = posterior.participant in masses_kg
    at = [
        e
        for e, (point, name) in enumerate(places)
        if (point, name.removesuffix(PER_MASS)) in element_of and (weighed or PER_MASS not in name)
    ]
    own = [element_of[places[e][0], places[e][1].removesuffix(PER_MASS)] for e in at]
    mass_kg = masses_kg.get(posterior.participant, 1.0)
    rows = [
        _moved(posterior, k, scales[places[e]], mass_kg if PER_MASS in places[e][1] else 1.0)
        for k, e in zip(own, at, strict=True)
    ]
    factor, shift = np.array(rows, dtype=float).reshape(-1, 2).T
    square, factors = np.ix_(own, own), np.outer(factor, factor)
    return _Unit(
        posterior.participant,
        np.array(at, dtype=int),
        factor * posterior.mean[own] - shift,
        factors * posterior.covariance[square],
        (factor * posterior.prior_mean[own] - shift, factors * posterior.prior_covariance[square]),
    )


def _moved(
    posterior: LogPosterior, k: int, scale: ValueScale, mass_kg: float
) -> tuple[float, float]:
    """Return by what an element is multiplied, and what is then subtracted, on another scale.

    To first order about its mean.
    """
    own, mean = posterior.scale(posterior.parameters[k]), posterior.mean[k]
    if not scale.unit:
        return 1.0, float(np.log(mass_kg))
    value = own.value(mean)
    factor = own.slope(value) / (mass_kg * scale.slope(value / mass_kg))
    return float(factor), float(factor * mean - scale.of(value / mass_kg))


def _of_cells(
    results: PeopleResults, parameters: Sequence[str]
) -> tuple[list[Place], list[_Unit], np.ndarray, np.ndarray]:
    """Return estimates with their own errors; those of the gains are shared by everybody."""
    rows = list(_cell_rows(results.cells, parameters))
    places = list(dict.fromkeys(row[1] for row in rows))
    places.sort(key=lambda place: parameters.index(place[1]))
    values: dict[Place, np.ndarray] = {
        place: np.array([value for _, at, value, _ in rows if at == place]) for place in places
    }
    logarithmic = np.array(
        [name == "inertia" and bool((values[point, name] > 0.0).all()) for point, name in places],
        dtype=bool,
    )
    typical = np.array([np.median(np.abs(values[place])) for place in places], dtype=float)
    unit = np.where(logarithmic | (typical == 0.0), 1.0, typical)
    order = {place: e for e, place in enumerate(places)}
    units = []
    for key in dict.fromkeys(row[0] for row in rows):
        own = sorted((order[at], value, sd) for k, at, value, sd in rows if k == key)
        at, estimates, sds = (np.array(column) for column in zip(*own, strict=True))
        logs = logarithmic[at]
        positive = np.where(logs, estimates, 1.0)
        mean = np.where(logs, np.log(positive), estimates / unit[at])
        sd = sds / np.where(logs, positive, unit[at])
        units.append(_Unit(key[0], at, mean, np.diag(sd**2)))
    return places, units, logarithmic, np.where(logarithmic, 0.0, unit)


def _cell_rows(
    cells: Sequence[CellEstimate], parameters: Sequence[str]
) -> Iterator[tuple[tuple[str, str, str], Place, float, float]]:
    """Yield person with session and side, place, value and sd of each estimate, SI."""
    for cell in cells:
        for name in parameters:
            estimate = estimate_without_priors(cell, name)
            if estimate is None:
                continue
            sd = float(np.sqrt(max(estimate.sd**2 - estimate.gain_sd**2, 0.0)))
            if sd > 0.0:
                key = (cell.participant, cell.session, cell.side)
                yield key, (cell.timing_point, name), estimate.value, sd


# --- sessions and sides of a person --------------------------------------------------------------


def _alike(units: Sequence[_Unit]) -> list[_Unit]:
    """Return a person's sessions and sides with the same places.

    A session in which some are missing or doubted takes these away from the others, or is left
    out, whichever leaves more values.
    """
    sets = [frozenset(u.at.tolist()) for u in units]
    together = max(
        [frozenset.intersection(*sets), *sets],
        key=lambda kept: len(kept) * sum(kept <= other for other in sets),
    )
    kept = sorted(together)
    return [u.only(kept) for u, own in zip(units, sets, strict=True) if kept and together <= own]


def _average(units: Sequence[_Unit]) -> _Unit:
    """Return the mean over sessions and sides.

    Their errors are taken to be fully shared (instruments, prior, model): covariances are averaged.
    """
    first = units[0]
    prior = None
    if first.prior is not None:
        priors = [u.prior for u in units if u.prior is not None]
        prior = (np.mean([m for m, _ in priors], axis=0), np.mean([c for _, c in priors], axis=0))
    mean = np.mean([u.mean for u in units], axis=0)
    covariance = np.mean([u.covariance for u in units], axis=0)
    return _Unit(first.participant, first.at, mean, covariance, prior)


def _session_variances(people: Sequence[Sequence[_Unit]], names: Sequence[str]) -> dict[str, float]:
    """Return the variance between sessions and sides of a person, of each parameter.

    From the differences of their estimates, errors included, which is cautious.
    """
    squares, degrees = dict.fromkeys(names, 0.0), dict.fromkeys(names, 0)
    for units in people:
        if len(units) < 2:
            continue
        off = np.array([u.mean for u in units])
        off -= off.mean(axis=0)
        for k, place in enumerate(units[0].at):
            squares[names[place]] += float((off[:, k] ** 2).sum())
            degrees[names[place]] += len(units) - 1
    return {name: squares[name] / n for name, n in degrees.items() if n}


# --- what all people share -----------------------------------------------------------------------


def _intrinsic(results: PeopleResults, places: Sequence[Place]) -> np.ndarray:
    """Return the device's own part, which the torque includes: mean over people."""
    if not results.posteriors:
        return np.zeros(len(places))
    rows = []
    for posterior in results.posteriors:
        own = dict(posterior.intrinsic)
        per_kg = 1.0 / results.masses_kg.get(posterior.participant, np.nan)
        rows.append([
            own.get(name.removesuffix(PER_MASS), 0.0) * (per_kg if name.endswith(PER_MASS) else 1.0)
            for _, name in places
        ])  # fmt: skip
    return np.asarray(np.nanmean(np.array(rows), axis=0))


def _gain_sd(results: PeopleResults) -> float:
    """Return the relative sd of the gains, as one calibration for all people has it."""
    if results.posteriors:
        return float(np.sqrt(np.mean([p.gain_sd**2 for p in results.posteriors])))
    # Of K and B: little of the device's own is taken off them, of J half may be.
    estimates = [unbounded_estimate(c, name) for c in results.cells for name in PARAMETERS[:2]]
    shares = [abs(e.gain_sd / e.value) for e in estimates if e is not None and e.value]
    return float(np.median(shares)) if shares else 0.0
