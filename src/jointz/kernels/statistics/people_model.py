r"""People together: a normal model of people whose likelihoods are known.

:math:`\theta_i \sim N(\mu + x_i \gamma, \Sigma)` for a person i with a covariate x, such as the
logarithm of body mass. What the data say about :math:`\theta_i` is a precision L and L times its
mean; a precision of zero says nothing. :math:`\mu` and :math:`\gamma` are integrated out exactly,
the variances in :math:`\Sigma` are drawn by Metropolis steps.
"""

from collections.abc import Iterator
from dataclasses import dataclass, field

import numpy as np

#: Steps of the search over the variances; the first quarter is left out, then every fifth is kept.
_STEPS, _KEPT = 4000, 5
_STEP_SIZE = 0.35
_START = 0.7  # of the prior's sd
#: Draws of the means for every kept draw of the variances.
_MEANS_PER_DRAW = 50
#: Information about a mean that keeps it proper where nobody has any.
_NEARLY_FLAT = 1e-4
#: Sd of the prior of Fisher's z of each (partial) correlation between kinds.
_CORRELATION_SD = 0.5
#: Sd of the prior of the ratio of a person's own response to a condition to what people differ by.
RESPONSE_SD = 0.5


@dataclass(frozen=True, slots=True, eq=False)
class PeopleData:
    """Likelihoods of n people about d elements, and what the elements are.

    An element is one kind of value (stiffness) at one place (timing point) in one condition. The
    prior of the sds is half-normal, that of the slopes normal.
    """

    precision: np.ndarray  # (n, d, d)
    weighted: np.ndarray  # (n, d): precision times mean
    kinds: np.ndarray  # (d,) from 0
    places: np.ndarray  # (d,) from 0
    level_sd: np.ndarray  # (kind,) scale of the prior: what people differ by at all places
    place_sd: np.ndarray  # (kind,) what they differ by at one place beside it
    conditions: np.ndarray = field(default_factory=lambda: np.empty(0, dtype=int))  # (d,) or empty
    covariate: np.ndarray = field(default_factory=lambda: np.empty(0))  # (n,) or empty
    slope: np.ndarray = field(default_factory=lambda: np.empty(0))  # (kind,) mean of its prior
    slope_sd: float = 1.0

    @property
    def n_kinds(self) -> int:
        """Number of kinds."""
        return self.level_sd.size

    @property
    def with_conditions(self) -> bool:
        """True if there is more than one condition."""
        return np.unique(self.conditions).size > 1


@dataclass(frozen=True, slots=True, eq=False)
class PeopleVariances:
    """Variances of one model of people.

    ``level_sd``, ``place_sd``, ``response`` (kind,): sds, and ratio of a person's own response to
    a condition; ``correlation`` (kind, kind): of the levels.
    """

    level_sd: np.ndarray
    place_sd: np.ndarray
    correlation: np.ndarray
    response: np.ndarray

    def between(self, data: PeopleData) -> np.ndarray:
        """Return the covariance of a person's elements, (d, d)."""
        kinds, places = data.kinds, data.places
        level = self.correlation * np.outer(self.level_sd, self.level_sd)
        same = (kinds[:, None] == kinds) & (places[:, None] == places)
        whole = level[np.ix_(kinds, kinds)] + same * (self.place_sd**2)[kinds][:, None]
        if not data.with_conditions:
            return np.asarray(whole)
        alike = (kinds[:, None] == kinds) & (data.conditions[:, None] == data.conditions)
        return np.asarray(whole * (1.0 + alike * (self.response**2)[kinds][:, None]))


@dataclass(frozen=True, slots=True, eq=False)
class PeopleEvidence:
    """Evidence of given variances, and the means at them."""

    log_evidence: float
    mean: np.ndarray  # (d + slopes,): means of the population, then slopes of the covariate
    covariance: np.ndarray  # of ``mean``


@dataclass(frozen=True, slots=True, eq=False)
class PeopleDraws:
    """Draws of the population; a row is a draw."""

    mean: np.ndarray  # (draw, d)
    slope: np.ndarray  # (draw, kind); zero without a covariate
    variance: np.ndarray  # (draw, kind): between people, without what follows the covariate
    level: np.ndarray  # (draw, kind): of that, of a person's level
    response: np.ndarray  # (draw, kind): of that, of a person's own response to a condition
    correlation: np.ndarray  # (draw, kind, kind): of the people's levels


def people_evidence(data: PeopleData, variances: PeopleVariances) -> PeopleEvidence:
    """Return evidence and means at given variances; up to a constant, the restricted likelihood.

    Written so that the precision L of a person may be singular: the covariance of what the data
    say about theta is L^-1 + Sigma, and its inverse (1 + L Sigma)^-1 L.
    """
    between = variances.between(data)
    spread = np.eye(data.kinds.size) + data.precision @ between
    information = np.linalg.solve(spread, data.precision)
    pulled = np.linalg.solve(spread, data.weighted[:, :, None])[:, :, 0]
    total, weighted = _sums(data, information, pulled)
    covariance = np.linalg.inv((total + total.T) / 2.0)
    mean = covariance @ weighted
    log_evidence = (
        -0.5 * float(np.linalg.slogdet(spread)[1].sum())
        + 0.5 * float(np.einsum("id,de,ie->", data.weighted, between, pulled))
        + 0.5 * float(weighted @ mean)
        - 0.5 * float(np.linalg.slogdet(total)[1])
    )
    return PeopleEvidence(log_evidence, mean, covariance)


def _sums(
    data: PeopleData, information: np.ndarray, pulled: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Return the information about means and slopes, and information times their values."""
    total = information.sum(axis=0) + _NEARLY_FLAT * np.eye(data.kinds.size)
    weighted = pulled.sum(axis=0)
    if not data.covariate.size:
        return total, weighted
    x, of_kind = data.covariate, np.eye(data.n_kinds)[data.kinds]
    prior = np.eye(data.n_kinds) / data.slope_sd**2
    cross = np.einsum("i,ide->de", x, information) @ of_kind
    of_slopes = of_kind.T @ np.einsum("i,ide->de", x**2, information) @ of_kind + prior
    slopes = of_kind.T @ (x @ pulled) + prior @ data.slope
    return np.block([[total, cross], [cross.T, of_slopes]]), np.concatenate([weighted, slopes])


def draw_people(data: PeopleData, *, seed: int = 1) -> PeopleDraws:
    """Draw means, slopes and variances of the population, given everybody's likelihoods."""
    rng = np.random.default_rng(seed)
    rows: list[tuple[np.ndarray, ...]] = []
    d, k = data.kinds.size, data.n_kinds
    for variances, at in _kept_steps(data, rng):
        root = np.linalg.cholesky(at.covariance)
        drawn = at.mean + rng.standard_normal((_MEANS_PER_DRAW, at.mean.size)) @ root.T
        slopes = drawn[:, d:] if data.covariate.size else np.zeros((_MEANS_PER_DRAW, k))
        level = variances.level_sd**2
        whole = level + variances.place_sd**2
        response = whole * variances.response**2
        repeated = [
            np.repeat(values[None], _MEANS_PER_DRAW, axis=0)
            for values in (whole + response, level, response, variances.correlation)
        ]
        rows.append((drawn[:, :d], slopes, *repeated))
    return PeopleDraws(*(np.vstack(columns) for columns in zip(*rows, strict=True)))


def _kept_steps(
    data: PeopleData, rng: np.random.Generator
) -> Iterator[tuple[PeopleVariances, PeopleEvidence]]:
    """Yield the kept steps of a random walk over the variances."""
    scale = _prior_scale(data)
    sds = scale.size - data.n_kinds * (data.n_kinds - 1) // 2
    place = np.concatenate([np.log(_START * scale[:sds]), np.zeros(scale.size - sds)])
    evidence = people_evidence(data, _variances(place, data))
    density = evidence.log_evidence + _log_prior(place, scale, sds)
    for step in range(_STEPS):
        moved = rng.random(place.size) < 0.5
        proposed = place + _STEP_SIZE * rng.standard_normal(place.size) * moved
        new = people_evidence(data, _variances(proposed, data))
        new_density = new.log_evidence + _log_prior(proposed, scale, sds)
        if np.log(rng.random()) < new_density - density:
            place, evidence, density = proposed, new, new_density
        if step >= _STEPS // 4 and step % _KEPT == 0:
            yield _variances(place, data), evidence


def _prior_scale(data: PeopleData) -> np.ndarray:
    """Return scales of the priors: of the sds, of the responses if any, of Fisher's z."""
    k = data.n_kinds
    responses = np.full(k if data.with_conditions else 0, RESPONSE_SD)
    pairs = np.full(k * (k - 1) // 2, _CORRELATION_SD)
    return np.concatenate([data.level_sd, data.place_sd, responses, pairs])


def _log_prior(place: np.ndarray, scale: np.ndarray, sds: int) -> float:
    """Return half-normal priors of the sds, on their logarithms, and normal ones of Fisher's z."""
    halves = place[:sds] - 0.5 * (np.exp(place[:sds]) / scale[:sds]) ** 2
    return float(halves.sum() - 0.5 * ((place[sds:] / scale[sds:]) ** 2).sum())


def _variances(place: np.ndarray, data: PeopleData) -> PeopleVariances:
    k = data.n_kinds
    level, rest = np.exp(place[:k]), place[k:]
    point, rest = np.exp(rest[:k]), rest[k:]
    response = np.zeros(k)
    if data.with_conditions:
        response, rest = np.exp(rest[:k]), rest[k:]
    return PeopleVariances(level, point, correlation_of(np.tanh(rest), k), response)


def correlation_of(partial: np.ndarray, k: int) -> np.ndarray:
    """Return the correlations (k, k) whose canonical partial correlations are given, row by row.

    Lewandowski, Kurowicka and Joe 2009, J. Multivariate Anal. 100, 1989-2001.
    """
    root, correlations = np.eye(k), iter(partial)
    for row in range(1, k):
        left = 1.0
        for column in range(row):
            root[row, column] = next(correlations) * np.sqrt(left)
            left -= root[row, column] ** 2
        root[row, row] = np.sqrt(left)
    return np.asarray(root @ root.T)
