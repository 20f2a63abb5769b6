r"""A smooth curve over a cycle through values with errors: a periodic Gaussian process.

Covariance between phases p and q :math:`a^2 \exp(-2 \sin^2(\pi (p - q)) / (2 \pi l)^2)` (MacKay
1998, Introduction to Gaussian processes, equation 47), level unknown; l is integrated over a grid
by its evidence.
"""

from dataclasses import dataclass

import numpy as np
from scipy.special import ndtr

#: Over which part of the cycle a curve may stay alike, cycles; even chances in its logarithm.
_LENGTHS = np.geomspace(0.05, 0.5, 16)
_NUGGET = 1e-6
#: Lengths that are less likely do not count.
_UNLIKELY = 1e-4
_HALVINGS = 48
#: Probabilities of the median and of the ends of a 95 % interval.
_TAILS = (0.5, 0.5 - 0.95 / 2.0, 0.5 + 0.95 / 2.0)


@dataclass(frozen=True, slots=True, eq=False)
class PeriodicCurve:
    """A curve with its pointwise band.

    ``value`` (k,): median; ``low``, ``high`` (k,): ends of the interval.
    """

    value: np.ndarray
    low: np.ndarray
    high: np.ndarray


def periodic_curve(
    phases: np.ndarray,
    values: np.ndarray,
    covariance: np.ndarray,
    *,
    systematic: np.ndarray,
    at: np.ndarray,
    sd: float,
) -> PeriodicCurve:
    """Return a smooth periodic curve through values with errors.

    ``phases`` (n,) cycles, rising; ``values`` (n,) with ``covariance`` (n, n) of their errors;
    ``systematic`` (n,): sd of those alike at neighbouring phases, which must not average out;
    ``at`` (k,) cycles: where the curve is evaluated; ``sd``: that of the process. Length 5 to 50 %
    of the cycle, even chances in the logarithm. Misleads where the curve changes within 5 % of the
    cycle.
    """
    n = values.size
    if n < 2 or phases.shape != (n,) or covariance.shape != (n, n) or (np.diff(phases) < 0).any():
        raise ValueError(
            f"periodic_curve: expected two or more values at rising phases and their covariance, "
            f"got {n} values, {phases.size} phases and a covariance of shape {covariance.shape}."
        )
    apart, beyond = phases[:, None] - phases[None, :], at[:, None] - phases[None, :]
    added, power = np.interp(at, phases, systematic, period=1.0) ** 2, sd**2
    logs, means, variances = [], [], []
    for length in _LENGTHS:
        shape, reach = power * _likeness(apart, length), power * _likeness(beyond, length)
        log, mean, lacking = _kriged(values, covariance, shape, reach)
        logs.append(log)
        means.append(mean)
        variances.append(np.maximum(power + lacking, _NUGGET * power) + added)
    chance = np.exp(np.array(logs) - max(logs))
    kept = chance > _UNLIKELY * chance.sum()
    parts = np.array(means)[kept], np.sqrt(np.array(variances))[kept]
    weights = chance[kept] / chance[kept].sum()
    return PeriodicCurve(*(_mixture_quantile(*parts, weights, tail) for tail in _TAILS))


def _likeness(apart: np.ndarray, length: float) -> np.ndarray:
    width = 2.0 * np.pi * length
    return np.asarray(np.exp(-2.0 * (np.sin(np.pi * apart) / width) ** 2))


def _kriged(
    values: np.ndarray, covariance: np.ndarray, shape: np.ndarray, reach: np.ndarray
) -> tuple[float, np.ndarray, np.ndarray]:
    """Return log evidence, mean, and variance less that of the process, of unknown level.

    Rasmussen and Williams (2006), Gaussian processes for machine learning, section 2.7.
    """
    n = values.size
    even = _NUGGET * float(np.trace(shape)) / n * np.eye(n)
    total = shape + covariance + even
    ones = np.ones(n)
    solved = np.linalg.solve(total, np.column_stack([ones, values, reach.T]))
    weight = float(ones @ solved[:, 0])
    level = float(ones @ solved[:, 1]) / weight
    off = solved[:, 1] - level * solved[:, 0]
    log = -0.5 * float(np.linalg.slogdet(total)[1]) - 0.5 * float(np.log(weight))
    log -= 0.5 * float((values - level) @ off)
    lacking = 1.0 - ones @ solved[:, 2:]
    variance = lacking**2 / weight - np.einsum("kn,nk->k", reach, solved[:, 2:])
    return log, level + reach @ off, variance


def _mixture_quantile(
    means: np.ndarray, sds: np.ndarray, chance: np.ndarray, tail: float
) -> np.ndarray:
    """Return a quantile of mixtures of normals, by bisection.

    ``means``, ``sds`` (t, k): of the normals; ``chance`` (t,): weights of each mixture; ``tail``:
    probability below the quantile. Returns (k,).
    """
    low = (means - 10.0 * sds).min(axis=0)
    high = (means + 10.0 * sds).max(axis=0)
    for _ in range(_HALVINGS):
        middle = 0.5 * (low + high)
        below = chance @ ndtr((middle - means) / sds)
        low, high = np.where(below < tail, middle, low), np.where(below < tail, high, middle)
    return np.asarray(0.5 * (low + high))
