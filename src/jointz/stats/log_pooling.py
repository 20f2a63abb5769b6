"""Means over people from the likelihoods of their logarithms, undecided people included."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from jointz.results.estimates import REACH_95, decides, relative_half_width
from jointz.results.log_posterior import LogPosterior

#: Half-normal priors of the sd between people, of logarithms: level of a person, own of a point.
#: Knees of adults differ by so much (docs/estimator.md); wider than any of the published tables.
_LEVEL_SD: Mapping[str, float] = {"stiffness": 0.35, "damping": 0.4, "inertia": 0.35}
_POINT_SD: Mapping[str, float] = {"stiffness": 0.25, "damping": 0.25, "inertia": 0.1}
#: Sd of the error of the model (of logarithms), which no number of people averages out.
SHARED_SD: Mapping[str, float] = {"stiffness": 0.08, "damping": 0.08, "inertia": 0.04}
#: Steps of the search over the six sds, of which the first quarter is left out.
_STEPS = 4000
_STEP_SIZE = 0.35
_START = 0.7  # of the prior's sd
_SEED = 1
#: A relative sd beyond which a mean has no interval: the device's own part is all of it.
_NO_SD = 5.0
#: Information about a mean that keeps it proper where nobody has any.
_NEARLY_FLAT = 1e-4


@dataclass(frozen=True, slots=True)
class LogMean:
    """Mean over people of one parameter at one timing point."""

    value: float  # arithmetic mean, SI
    sd: float  # between people, SI
    ci_low: float  # NaN, as ci_high, if too uncertain for an interval
    ci_high: float
    n_people: int  # people whose data count
    decided: bool


@dataclass(frozen=True, slots=True, eq=False)
class _Likelihoods:
    """What the data of every person say about all elements; nothing where precision is zero."""

    precision: np.ndarray  # (person, element, element)
    weighted: np.ndarray  # (person, element): precision times mean
    half_widths: np.ndarray  # (person, element): relative, of the posterior; NaN without data


def log_means(
    posteriors: Sequence[LogPosterior],
    parameters: Sequence[str],
    *,
    log_scale: Mapping[str, float] | None = None,
) -> dict[tuple[str, str], LogMean]:
    """Return the mean of each parameter at each timing point over people.

    ``log_scale`` (participant -> logarithm) is subtracted from everybody's logarithms, for values
    per kg. Whom the model does not fit (``doubted``) counts nowhere.

    The logarithms of a person are normal about those of the population. Their covariance has two
    sds for each parameter, one of the person's level, one of every timing point. Each person counts
    by the likelihood, posterior over prior: a prior is not data, and counts once for nobody. The
    sds are drawn by Metropolis, the means integrated out. The error of the model is shared by all
    people and added. A mean is not decided where its interval reaches further than half of it, or
    that of a typical person's data alone does.
    """
    elements = list(dict.fromkeys(
        (point, name)
        for posterior in posteriors
        for point, name in zip(posterior.timing_points, posterior.parameters, strict=True)
        if name in parameters
    ))  # fmt: skip
    elements.sort(key=lambda e: list(parameters).index(e[1]))
    people = list(dict.fromkeys(p.participant for p in posteriors))
    if len(people) < 2 or not elements:
        return {}
    own = [[p for p in posteriors if p.participant == person] for person in people]
    found = _likelihoods(own, elements, log_scale or {})
    kinds = [tuple(parameters).index(name) for _, name in elements]
    drawn = _drawn(found, np.array(kinds), [name.removesuffix("_onset") for name in parameters])
    means, covariance, spread = drawn
    intrinsic = _intrinsic(own, elements, log_scale or {})
    result = {}
    for k, (point, name) in enumerate(elements):
        widths = found.half_widths[:, k]
        n = int(np.isfinite(widths).sum())
        if n < 2:
            continue
        whole = float(np.exp(means[k]))
        value = whole - float(intrinsic[k])
        between = whole * float(np.sqrt(np.expm1(spread[kinds[k]] ** 2)))
        shared = float(np.hypot(SHARED_SD[name.removesuffix("_onset")], _gain_sd(own)))
        sd = float(np.hypot(np.sqrt(covariance[k, k]), shared)) * whole
        if not sd < _NO_SD * value:
            result[point, name] = LogMean(value, between, np.nan, np.nan, n, decided=False)
            continue
        sd /= value
        low, high = value * np.exp([-REACH_95 * sd, REACH_95 * sd])
        half = max((high - low) / 2.0, value * float(np.nanmedian(widths)))
        result[point, name] = LogMean(
            value, between, float(low), float(high), n, bool(decides(value, half))
        )
    return result


def _likelihoods(
    people: Sequence[Sequence[LogPosterior]],
    elements: Sequence[tuple[str, str]],
    log_scale: Mapping[str, float],
) -> _Likelihoods:
    n, d = len(people), len(elements)
    precision, weighted = np.zeros((n, d, d)), np.zeros((n, d))
    half_widths = np.full((n, d), np.nan)
    for i, posteriors in enumerate(people):
        kept, arrays = _of_person(posteriors, elements)
        if not kept.size:
            continue
        mean, covariance, prior_mean, prior_covariance = arrays
        shift = log_scale.get(posteriors[0].participant, 0.0)
        inverse, prior_inverse = np.linalg.inv(covariance), np.linalg.inv(prior_covariance)
        values, vectors = np.linalg.eigh(inverse - prior_inverse)
        place = np.ix_(kept, kept)
        precision[i][place] = (vectors * values.clip(0.0)) @ vectors.T
        own = inverse @ (mean - shift) - prior_inverse @ (prior_mean - shift)
        # What the clipped directions hold is no information either.
        weighted[i, kept] = vectors @ ((values > 0.0) * (vectors.T @ own))
        half_widths[i, kept] = [relative_half_width(sd) for sd in np.sqrt(np.diag(covariance))]
    return _Likelihoods(precision, weighted, half_widths)


def _of_person(
    posteriors: Sequence[LogPosterior], elements: Sequence[tuple[str, str]]
) -> tuple[np.ndarray, tuple[np.ndarray, ...]]:
    """Return a person's elements and moments; sessions and sides are averaged.

    Their errors are taken to be fully shared (instruments, prior, model): covariances are averaged.
    Only sessions with the same elements can be averaged. A session in which some are missing or
    doubted takes these away from the others, or is left out, whichever leaves more values.
    """
    places = [_places(posterior, elements) for posterior in posteriors]
    sets = [frozenset(at) for at in places]
    together = max(
        [frozenset.intersection(*sets), *sets],
        key=lambda kept: len(kept) * sum(kept <= other for other in sets),
    )
    used = [(p, at) for p, at in zip(posteriors, places, strict=True) if together <= set(at)]
    kept = sorted(together)
    moments = []
    for posterior, at in used:
        own = [at[k] for k in kept]
        square = np.ix_(own, own)
        moments.append((
            posterior.mean[own], posterior.covariance[square],
            posterior.prior_mean[own], posterior.prior_covariance[square],
        ))  # fmt: skip
    averaged = tuple(np.mean(parts, axis=0) for parts in zip(*moments, strict=True))
    return np.array(kept, dtype=int), averaged


def _places(posterior: LogPosterior, elements: Sequence[tuple[str, str]]) -> dict[int, int]:
    """Return element -> its place in the posterior, without those that a doubt speaks against."""
    keys = zip(posterior.timing_points, posterior.parameters, strict=True)
    doubted = posterior.doubted or (False,) * len(posterior.parameters)
    found = {key: k for k, key in enumerate(keys) if not doubted[k]}
    return {e: found[element] for e, element in enumerate(elements) if element in found}


def _drawn(
    found: _Likelihoods, kinds: np.ndarray, names: Sequence[str]
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return the log of the arithmetic means, their covariance, and sds between people."""
    rng = np.random.default_rng(_SEED)
    prior = np.array([[_LEVEL_SD[name], _POINT_SD[name]] for name in names])
    log_sds = np.log(_START * prior)
    current = _evidence(found, kinds, log_sds)
    density = current[0] + _log_prior(log_sds, prior)
    means, covariances, spreads = [], [], []
    for step in range(_STEPS):
        moved = rng.random(log_sds.shape) < 0.5
        proposed = log_sds + _STEP_SIZE * rng.standard_normal(log_sds.shape) * moved
        new = _evidence(found, kinds, proposed)
        new_density = new[0] + _log_prior(proposed, prior)
        if np.log(rng.random()) < new_density - density:
            log_sds, current, density = proposed, new, new_density
        if step >= _STEPS // 4:
            variances = np.exp(2.0 * log_sds).sum(axis=1)
            means.append(current[1] + variances[kinds] / 2.0)
            covariances.append(current[2])
            spreads.append(np.sqrt(variances))
    together = np.cov(np.array(means).T) + np.mean(covariances, axis=0)
    return np.mean(means, axis=0), np.atleast_2d(together), np.mean(spreads, axis=0)


def _evidence(
    found: _Likelihoods, kinds: np.ndarray, log_sds: np.ndarray
) -> tuple[float, np.ndarray, np.ndarray]:
    """Return log evidence of the sds, and mean and covariance of the population's logarithms."""
    level, point = np.exp(2.0 * log_sds).T
    same = kinds[:, None] == kinds
    between = level[kinds][:, None] * same + np.diag(point[kinds])
    d = kinds.size
    spread = np.eye(d) + found.precision @ between
    information = np.linalg.solve(spread, found.precision)
    pulled = np.linalg.solve(spread, found.weighted[:, :, None])[:, :, 0]
    total = information.sum(axis=0) + _NEARLY_FLAT * np.eye(d)
    covariance = np.linalg.inv((total + total.T) / 2.0)
    mean = covariance @ pulled.sum(axis=0)
    log_evidence = (
        -0.5 * float(np.linalg.slogdet(spread)[1].sum())
        + 0.5 * float(np.einsum("id,de,ie->", found.weighted, between, pulled))
        + 0.5 * float(pulled.sum(axis=0) @ mean)
        - 0.5 * float(np.linalg.slogdet(total)[1])
    )
    return log_evidence, mean, covariance


def _log_prior(log_sds: np.ndarray, prior: np.ndarray) -> float:
    """Return the half-normal prior of the sds, on their logarithms."""
    return float((log_sds - 0.5 * (np.exp(log_sds) / prior) ** 2).sum())


def _intrinsic(
    people: Sequence[Sequence[LogPosterior]],
    elements: Sequence[tuple[str, str]],
    log_scale: Mapping[str, float],
) -> np.ndarray:
    """Return the device's own part of each element, which the torque includes: mean over people."""
    names = [name for _, name in elements]
    rows = [
        np.array([dict(p.intrinsic).get(name, 0.0) for name in names])
        * np.exp(-log_scale.get(p.participant, 0.0))
        for own in people
        for p in own
    ]
    return np.asarray(np.mean(rows, axis=0))


def _gain_sd(people: Sequence[Sequence[LogPosterior]]) -> float:
    """Return the relative sd of the gains, as one calibration for all people has it."""
    return float(np.sqrt(np.mean([p.gain_sd**2 for own in people for p in own])))
