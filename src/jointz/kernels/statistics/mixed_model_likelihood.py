"""Linear model with one random intercept: its variances by REML.

``y = X beta + Z u + e`` with Z the indicator of the group of every row, ``u ~ N(0, s_g)`` and
``e ~ N(0, s_e)``. With ``H = I + ratio Z Z'``, ``ratio = s_g / s_e``, everything the likelihood
needs is a sum over rows or over groups, so no n x n matrix is formed.
"""

from dataclasses import dataclass

import numpy as np
from scipy.optimize import brentq

#: Ratios of variance, times the mean rows a group, between which roots of the score are sought.
_RATIO_GRID = np.concatenate([[0.0], np.geomspace(1e-4, 1e8, 37)])
#: Residual sums of squares under this share of the total are rounding.
_ROUNDING = 1e-20


@dataclass(frozen=True, slots=True)
class _Sums:
    """Sums of the data that the likelihood uses."""

    X: np.ndarray
    y: np.ndarray
    index: np.ndarray
    size: np.ndarray
    X_group: np.ndarray
    y_group: np.ndarray


@dataclass(frozen=True, slots=True)
class _Step:
    """The likelihood at one ratio of the variances."""

    variance: float
    score: float
    deviance: float


def random_intercept_variances(
    design: np.ndarray, response: np.ndarray, group: np.ndarray
) -> np.ndarray:
    """Return the variance of the groups and of the residual by restricted maximum likelihood.

    Arguments as in :func:`jointz.kernels.statistics.mixed_model_components.fit_random_intercept`.
    The ratio of the variances is the root of the profile REML score with the smallest deviance, or
    0, also where the data say nothing about it.
    """
    sums = _check(design, response, group)
    ratio = _reml_ratio(sums) if _ratio_is_identified(sums) else 0.0
    return np.array([ratio, 1.0]) * _evaluate(sums, ratio).variance


def _check(design: np.ndarray, response: np.ndarray, group: np.ndarray) -> _Sums:
    X, y = np.asarray(design, dtype=float), np.asarray(response, dtype=float)
    labels = np.asarray(group)
    if X.ndim != 2 or y.shape != X.shape[:1] or labels.shape != y.shape:
        raise ValueError(
            f"fit_random_intercept: expected design (n, p), response (n,), group (n,); "
            f"got {X.shape}, {y.shape}, {labels.shape}"
        )
    if not (np.isfinite(X).all() and np.isfinite(y).all()):
        raise ValueError("fit_random_intercept: expected finite values in design and response")
    if np.linalg.matrix_rank(X) < X.shape[1]:
        raise ValueError(
            "fit_random_intercept: expected independent columns in the design; leave out others"
        )
    _, index = np.unique(labels, return_inverse=True)
    sums = _Sums(
        X=X,
        y=y,
        index=index,
        size=np.bincount(index).astype(float),
        X_group=_by_group(X, index),
        y_group=_by_group(y[:, None], index)[:, 0],
    )
    if _residual_share(y, X) < _ROUNDING:
        raise ValueError(
            "fit_random_intercept: expected values that vary about the fixed effects, none is left"
        )
    return sums


def _by_group(values: np.ndarray, index: np.ndarray) -> np.ndarray:
    total = np.zeros((index.max() + 1, values.shape[1]))
    np.add.at(total, index, values)
    return total


def _residual_share(y: np.ndarray, X: np.ndarray) -> float:
    centred = y - y.mean()
    total = float(y @ y)
    residual = centred - X @ np.linalg.lstsq(X, centred, rcond=None)[0]
    return float(residual @ residual) / total if total > 0 else 0.0


def _ratio_is_identified(sums: _Sums) -> bool:
    n, p = sums.X.shape
    Z = (sums.index[:, None] == np.arange(sums.size.size)).astype(float)
    both = np.hstack([sums.X, Z])
    rank = int(np.linalg.matrix_rank(both))
    if sums.size.size == 1 or sums.size.max() == 1:
        return False
    if rank == p:
        raise ValueError(
            "fit_random_intercept: expected more groups: the fixed effects take up all between them"
        )
    if rank == n or _residual_share(sums.y, both) < _ROUNDING:
        raise ValueError(
            "fit_random_intercept: expected values that vary inside the groups, none does"
        )
    return True


def _evaluate(sums: _Sums, ratio: float) -> _Step:
    shrunk = 1.0 / (1.0 + ratio * sums.size)
    weighted = (ratio * shrunk)[:, None] * sums.X_group
    XHX = sums.X.T @ sums.X - sums.X_group.T @ weighted
    C = np.linalg.inv(XHX)
    beta = C @ (sums.X.T @ sums.y - weighted.T @ sums.y_group)
    residual = sums.y - sums.X @ beta
    r_group = sums.y_group - sums.X_group @ beta
    quadratic = float(residual @ residual - ratio * shrunk @ r_group**2)
    G, u = shrunk[:, None] * sums.X_group, shrunk * r_group
    ZPZ = np.diag(sums.size * shrunk) - G @ C @ G.T
    residual_df = sums.y.size - sums.X.shape[1]
    variance = quadratic / residual_df
    log_determinants = -np.log(shrunk).sum() + np.linalg.slogdet(XHX)[1]
    return _Step(
        variance=variance,
        score=float(u @ u / variance - np.trace(ZPZ)),
        deviance=float(residual_df * np.log(variance) + log_determinants),
    )


def _reml_ratio(sums: _Sums) -> float:
    grid = _RATIO_GRID / sums.size.mean()
    scores = np.array([_evaluate(sums, ratio).score for ratio in grid])
    candidates = [0.0] if scores[0] <= 0 else []
    # Maxima of the likelihood: the score falls through 0.
    falls = np.flatnonzero((scores[:-1] > 0) & (scores[1:] <= 0))
    candidates += [
        float(brentq(lambda r: _evaluate(sums, r).score, *grid[k : k + 2], xtol=1e-14, rtol=1e-12))
        for k in falls
    ]
    if not candidates:
        raise ValueError(
            "fit_random_intercept: expected values that vary inside the groups, next to none do"
        )
    return float(min(candidates, key=lambda ratio: _evaluate(sums, ratio).deviance))
