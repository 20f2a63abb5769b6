r"""People together: a normal model of people whose values are known with unlike errors.

:math:`y_i \sim N(\theta_i, s_i^2)`, :math:`\theta_i \sim N(\mu, \tau^2)` with known :math:`s_i`,
for many groups (timing points) at once. :math:`\mu` is integrated out exactly, :math:`\tau` on a
grid.
"""

from dataclasses import dataclass

import numpy as np
from scipy.special import ndtr, ndtri

_GRID = 200
#: The grid of tau: from this share of the smallest error to so often what values and errors span.
_LOWEST, _HIGHEST = 0.02, 1e4
_HALVINGS = 48
_FEWEST = 2
_TINY = np.finfo(float).tiny


@dataclass(frozen=True, slots=True, eq=False)
class PartialPooling:
    """Means over people and the people's own values, of g groups of n people.

    ``mean``, ``mean_low``, ``mean_high`` (g,): mean of the population and ends of its interval;
    ``spread``, ``spread_low``, ``spread_high`` (g,): median of tau, the sd between people, and ends
    of its interval; ``value``, ``low``, ``high`` (g, n): every person's value given the data of
    all, and ends of its interval; ``sd`` (g, n): of the error of ``value``.
    """

    mean: np.ndarray
    mean_low: np.ndarray
    mean_high: np.ndarray
    spread: np.ndarray
    spread_low: np.ndarray
    spread_high: np.ndarray
    value: np.ndarray
    low: np.ndarray
    high: np.ndarray
    sd: np.ndarray


def partial_pooling(values: np.ndarray, sds: np.ndarray, *, level: float = 0.95) -> PartialPooling:
    """Estimate mean and spread over people, and every person's own value given the others.

    ``values``, ``sds`` (g, n): estimates and standard errors, a row a group, a column a person.
    Flat prior of mu; Jeffreys' of tau for known errors, p(tau) ~ sqrt(sum tau^2 / (s_i^2 +
    tau^2)^2) (Bodnar et al. 2017, Statistics in Medicine 36, 378): proper from two people on. A
    person alone keeps their estimate. Misleads where people are far from normal, share errors, or
    errors grow with the value.
    """
    known = _checked(values, sds, level)
    y, variance = np.where(known, values, 0.0), np.where(known, sds, 1.0) ** 2
    tau = _tau_grid(values, sds, known)
    chance, means, variances = _given_tau(y, variance, known, tau)
    tails = (0.5 - level / 2.0, 0.5 + level / 2.0)
    low, high = (mixture_quantile(means, np.sqrt(variances), chance, tail) for tail in tails)
    middle = np.einsum("gt,gtk->gk", chance, means)
    within = np.einsum("gt,gtk->gk", chance, variances + (means - middle[:, None, :]) ** 2)
    spread, spread_low, spread_high = (_grid_quantile(tau, chance, p) for p in (0.5, *tails))
    several = known.sum(axis=1) >= _FEWEST
    reach = float(ndtri(tails[1]))

    def people(pooled: np.ndarray, lone: np.ndarray) -> np.ndarray:
        return np.asarray(np.where(known, np.where(several[:, None], pooled[:, 1:], lone), np.nan))

    def groups(found: np.ndarray) -> np.ndarray:
        return np.asarray(np.where(several, found, np.nan))

    return PartialPooling(
        mean=groups(middle[:, 0]),
        mean_low=groups(low[:, 0]),
        mean_high=groups(high[:, 0]),
        spread=groups(spread),
        spread_low=groups(spread_low),
        spread_high=groups(spread_high),
        value=people(middle, values),
        low=people(low, values - reach * sds),
        high=people(high, values + reach * sds),
        sd=people(np.sqrt(within), sds),
    )


def _checked(values: np.ndarray, sds: np.ndarray, level: float) -> np.ndarray:
    """Return where there are values."""
    known: np.ndarray = np.isfinite(values)
    if values.ndim != 2 or values.shape != sds.shape or not 0.0 < level < 1.0:
        raise ValueError(
            f"partial_pooling: expected values and sds of one shape (group, person) and 0 < level "
            f"< 1, got {values.shape}, {sds.shape} and {level}."
        )
    if not (np.isfinite(sds[known]) & (sds[known] > 0.0)).all():
        raise ValueError("partial_pooling: expected a positive sd of every value.")
    return known


def _tau_grid(values: np.ndarray, sds: np.ndarray, known: np.ndarray) -> np.ndarray:
    """Return the grid of every group, (g, t), even in its logarithm."""
    there = known.any(axis=1)

    def ends(numbers: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        lowest = np.where(known, numbers, np.inf).min(axis=1, initial=np.inf)
        highest = np.where(known, numbers, -np.inf).max(axis=1, initial=-np.inf)
        return np.where(there, lowest, 1.0), np.where(there, highest, 1.0)

    (least, most), (finest, coarsest) = ends(values), ends(sds)
    low, high = _LOWEST * finest, _HIGHEST * (most - least + coarsest)
    share = np.linspace(0.0, 1.0, _GRID)
    return np.asarray(np.exp(np.log(low)[:, None] + np.log(high / low)[:, None] * share))


def _given_tau(
    y: np.ndarray, variance: np.ndarray, known: np.ndarray, tau: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return what holds at every tau: its probability, (g, t), means and variances, (g, t, 1 + n).

    The mean over people comes first, then their own values.
    """
    weight = known[:, None, :] / (variance[:, None, :] + tau[..., None] ** 2)
    total = np.maximum(weight.sum(axis=2), _TINY)[..., None]
    mu = (weight * y[:, None, :]).sum(axis=2, keepdims=True) / total
    off = y[:, None, :] - mu
    chance = _posterior(off, weight, total[..., 0], tau)
    shrunk = variance[:, None, :] * weight
    own = mu + (1.0 - shrunk) * off
    own_variance = variance[:, None, :] * (1.0 - shrunk) + shrunk**2 / total
    means = np.concatenate([mu, own], axis=2)
    return chance, means, np.concatenate([1.0 / total, own_variance], axis=2)


def _posterior(
    off: np.ndarray, weight: np.ndarray, total: np.ndarray, tau: np.ndarray
) -> np.ndarray:
    """Return the probability of every tau of the grid, (g, t)."""
    there = weight > 0.0
    logs = 0.5 * np.log(np.where(there, weight, 1.0)).sum(axis=2) - 0.5 * np.log(total)
    logs -= 0.5 * (weight * off**2).sum(axis=2)
    logs += 0.5 * np.log(np.maximum((weight**2).sum(axis=2), _TINY))
    logs += 2.0 * np.log(tau)  # one of Jeffreys' prior, one because the grid is of log tau
    chance = np.exp(logs - logs.max(axis=1, keepdims=True))
    return np.asarray(chance / chance.sum(axis=1, keepdims=True))


def mixture_quantile(
    means: np.ndarray, sds: np.ndarray, chance: np.ndarray, tail: float
) -> np.ndarray:
    """Return a quantile of mixtures of normals, by bisection.

    ``means``, ``sds`` (g, t, k): of the normals; ``chance`` (g, t): weights of each mixture;
    ``tail``: probability below the quantile. Returns (g, k).
    """
    low = (means - 10.0 * sds).min(axis=1)
    high = (means + 10.0 * sds).max(axis=1)
    for _ in range(_HALVINGS):
        middle = 0.5 * (low + high)
        below = np.einsum("gt,gtk->gk", chance, ndtr((middle[:, None, :] - means) / sds))
        low, high = np.where(below < tail, middle, low), np.where(below < tail, high, middle)
    return np.asarray(0.5 * (low + high))


def _grid_quantile(tau: np.ndarray, chance: np.ndarray, tail: float) -> np.ndarray:
    """Return a quantile of tau, (g,); straight in log tau between points of the grid."""
    sums = np.cumsum(chance, axis=1) - 0.5 * chance
    found = [np.interp(tail, s, np.log(t)) for s, t in zip(sums, tau, strict=True)]
    return np.asarray(np.exp(found))
