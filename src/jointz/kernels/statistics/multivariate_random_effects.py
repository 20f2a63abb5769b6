r"""Studies together: random-effects meta-analysis of several outcomes with known covariances.

:math:`y_i \sim N(\mu, V_i + T)` over studies :math:`i` with known :math:`V_i`; the covariance
between studies :math:`T` is found by restricted maximum likelihood (REML), 0 included.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from scipy.optimize import minimize
from scipy.special import chdtrc, stdtrit

_FEWEST = 2
_POLISH, _STEP = 30, 1e-5
_FLAT = 1e-6


@dataclass(frozen=True, slots=True, eq=False)
class MultivariateFit:
    """Means and spread over studies of p outcomes together.

    ``mean``, ``low``, ``high``, ``df`` (p,): means over studies, ends of their intervals and
    degrees of freedom; ``covariance`` (p, p): of the errors of the means, model based;
    ``prediction_low``, ``prediction_high`` (p,): ends of the intervals of the true values of one
    more study; ``between`` (p, p): covariance between studies; ``scale``: mean square of the
    weighted residuals, before it is bounded; ``q``, ``q_p``: Cochran's Q of all outcomes and its p;
    ``log_likelihood``: restricted.
    """

    mean: np.ndarray
    covariance: np.ndarray
    low: np.ndarray
    high: np.ndarray
    prediction_low: np.ndarray
    prediction_high: np.ndarray
    between: np.ndarray
    df: np.ndarray
    scale: float
    q: float
    q_p: float
    log_likelihood: float


def multivariate_random_effects(
    values: np.ndarray, covariances: np.ndarray, *, level: float = 0.95, modified: bool = False
) -> MultivariateFit:
    """Estimate means over studies of several outcomes that depend on one another.

    ``values`` (k, p): a row a study, NaN where it has none; ``covariances`` (k, p, p): of their
    errors. REML over the Cholesky factor of the covariance between studies, whose boundary it can
    reach (Jackson, Riley and White 2011, Stat. Med. 30, 2481); intervals: Jackson and Riley 2014,
    Stat. Med. 33, 541, with studies less one as degrees of freedom. Misleads with few studies: p (p
    + 1) / 2 numbers lie between them.
    """
    y = np.asarray(values, dtype=float)
    v = np.asarray(covariances, dtype=float)
    known = _check_several(y, v, level)
    own = [(y[there, j], v[there, j, j]) for j, there in enumerate(known.T)]
    unit = np.array([np.sqrt(error.mean()) + np.ptp(value) for value, error in own])
    model = _Several(np.where(known, y / unit, 0.0), v / np.outer(unit, unit), known)
    factor = model.best_factor()
    between = factor @ factor.T
    at = model.at(between)
    freedom = int(known.sum()) - unit.size
    scale = float(at.square) / freedom
    q = float(model.at(np.zeros_like(between)).square)
    df = known.sum(axis=0) - 1.0
    reach = stdtrit(df, 0.5 + level / 2.0)
    variance = np.diag(at.covariance) * (max(1.0, scale) if modified else scale)
    half, wide = reach * np.sqrt(variance), reach * np.sqrt(variance + np.diag(between))
    n_log_units = (known * np.log(unit)).sum() - np.log(unit).sum()
    return MultivariateFit(
        mean=at.mean * unit,
        covariance=at.covariance * np.outer(unit, unit),
        low=(at.mean - half) * unit,
        high=(at.mean + half) * unit,
        prediction_low=(at.mean - wide) * unit,
        prediction_high=(at.mean + wide) * unit,
        between=between * np.outer(unit, unit),
        df=df,
        scale=scale,
        q=q,
        q_p=float(chdtrc(freedom, q)),
        log_likelihood=float(at.log_likelihood - n_log_units),
    )


def _check_several(y: np.ndarray, v: np.ndarray, level: float) -> np.ndarray:
    """Return where there are values."""
    if y.ndim != 2 or v.shape != (*y.shape, y.shape[-1]) or not 0.0 < level < 1.0:
        told = f"got {y.shape}, {v.shape} and {level}."
        raise ValueError(f"expected values (k, p), covariances (k, p, p) and a level, {told}")
    known: np.ndarray = np.isfinite(y)
    if (known.sum(axis=0) < _FEWEST).any():
        told = f"got {known.sum(axis=0).tolist()}."
        raise ValueError(f"expected every outcome in 2 studies or more, {told}")
    for k, there in enumerate(known):
        own = v[k][np.ix_(there, there)]
        fits = bool(np.isfinite(own).all()) and np.allclose(own, own.T)
        if not fits or np.linalg.eigvalsh(own).min(initial=1.0) <= 0.0:
            told = f"got {own.tolist()}."
            raise ValueError(f"study {k + 1}: expected a positive definite covariance, {told}")
    return known


@dataclass(frozen=True, slots=True, eq=False)
class _At:
    """What holds at a covariance between studies."""

    mean: np.ndarray
    covariance: np.ndarray
    square: float
    log_likelihood: float
    slope: np.ndarray


@dataclass(frozen=True, slots=True, eq=False)
class _Several:
    """The restricted likelihood of several outcomes."""

    y: np.ndarray
    v: np.ndarray
    known: np.ndarray

    def at(self, between: np.ndarray) -> _At:
        """Return means, likelihood and its slope along T."""
        both = self.known[:, :, None] & self.known[:, None, :]
        # Absent outcomes: ones on the diagonal leave determinants, and are no weight after.
        total = np.where(both, self.v + between, np.eye(between.shape[0]))
        w = np.where(both, np.linalg.inv(total), 0.0)
        information = w.sum(axis=0)
        covariance = np.linalg.inv(information)
        mean = covariance @ np.einsum("kij,kj->i", w, self.y)
        off = np.where(self.known, self.y - mean, 0.0)
        weighed = np.einsum("kij,kj->ki", w, off)
        square = float((weighed * off).sum())
        count = self.known.sum(axis=0)
        logs = -np.linalg.slogdet(total)[1].sum() - np.linalg.slogdet(information)[1]
        logs += np.log(count).sum() - square
        logs -= (count.sum() - count.size) * np.log(2.0 * np.pi)
        slope = 0.5 * (weighed.T @ weighed - information + (w @ covariance @ w).sum(axis=0))
        return _At(mean, covariance, square, float(0.5 * logs), slope)

    def best_factor(self) -> np.ndarray:
        """Return the Cholesky factor of T with the largest restricted likelihood."""
        p = self.y.shape[1]
        rows = np.tril_indices(p)

        def factor(x: np.ndarray) -> np.ndarray:
            lower = np.zeros((p, p))
            lower[rows] = x
            return lower

        def loss(x: np.ndarray) -> tuple[float, np.ndarray]:
            lower = factor(x)
            at = self.at(lower @ lower.T)
            return -at.log_likelihood, -2.0 * (at.slope @ lower)[rows]

        starts = [size * np.eye(p)[rows] for size in (0.05, 0.3, 1.0)]
        found = [minimize(loss, x, jac=True, method="BFGS", options={"gtol": 1e-9}) for x in starts]
        best = min(found, key=lambda one: float(one.fun))
        return factor(_polished(best.x, lambda x: loss(x)[1]))


def _polished(x: np.ndarray, slope: Callable[[np.ndarray], np.ndarray]) -> np.ndarray:
    """Return the root of a slope near x, by Newton: a line search ends where the value is flat."""
    gradient = slope(x)
    if np.linalg.norm(gradient) > _FLAT * x.size**2:
        return x
    for _ in range(_POLISH):
        steps = _STEP * np.eye(x.size)
        curvature = np.array([(slope(x + s) - slope(x - s)) / (2.0 * _STEP) for s in steps])
        trial = x - np.linalg.lstsq(curvature, gradient, rcond=1e-9)[0]
        trial_gradient = slope(trial)
        if not np.linalg.norm(trial_gradient) < np.linalg.norm(gradient):
            break
        x, gradient = trial, trial_gradient
    return x
