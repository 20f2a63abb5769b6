"""Linear model with one random intercept: REML and Satterthwaite's degrees of freedom.

``y = X beta + Z u + e`` with Z the indicator of the group of every row, ``u ~ N(0, s_g)`` and
``e ~ N(0, s_e)``. With ``H = I + ratio Z Z'``, ``ratio = s_g / s_e``, everything the likelihood
needs is a sum over rows or over groups, so no n x n matrix is formed.
"""

from dataclasses import dataclass
from typing import Protocol

import numpy as np
from scipy.optimize import brentq
from scipy.special import fdtrc

from jointz.kernels.statistics.anova import FTest

#: Ratios of variance, times the mean rows a group, between which roots of the score are sought.
_RATIO_GRID = np.concatenate([[0.0], np.geomspace(1e-4, 1e8, 37)])
#: Residual sums of squares under this share of the total are rounding.
_ROUNDING = 1e-20


class FixedEffects(Protocol):
    """Parts of a fit that Satterthwaite's test uses; v variances."""

    @property
    def beta(self) -> np.ndarray:
        """(p,) fixed effects."""

    @property
    def covariance(self) -> np.ndarray:
        """(p, p) of the fixed effects."""

    @property
    def covariance_gradient(self) -> np.ndarray:
        """(v, p, p) of ``covariance`` by the variances."""

    @property
    def variance_covariance(self) -> np.ndarray:
        """(v, v) of the variances."""


@dataclass(frozen=True, slots=True)
class RandomInterceptFit:
    """A fitted model with one random intercept.

    ``beta`` (p,): fixed effects; ``covariance`` (p, p): of their errors, the variances taken as
    known; ``variance_group``, ``variance_residual``: REML estimates; ``covariance_gradient`` (2, p,
    p): derivatives of ``covariance`` by the residual variance and by the ratio of group to residual
    variance; ``variance_covariance`` (2, 2): covariance of the errors of residual variance and
    ratio, from the observed information.
    """

    beta: np.ndarray
    covariance: np.ndarray
    variance_group: float
    variance_residual: float
    covariance_gradient: np.ndarray
    variance_covariance: np.ndarray


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
    """The likelihood and its parts at one ratio of the variances."""

    beta: np.ndarray
    C: np.ndarray
    G: np.ndarray
    ZPZ: np.ndarray
    u: np.ndarray
    variance: float
    score: float
    deviance: float


def fit_random_intercept(
    design: np.ndarray, response: np.ndarray, group: np.ndarray
) -> RandomInterceptFit:
    """Fit fixed effects and one random intercept by restricted maximum likelihood.

    ``design`` (n, p): with the intercept; ``response``, ``group`` (n,), such as the trial of a
    pulse. The ratio of the variances is the root of the profile REML score with the smallest
    deviance, or 0, also where the data say nothing about it; agrees with lme4 (Bates et al. 2015,
    doi:10.18637/jss.v067.i01). Misleads with random slopes, and is somewhat liberal with few groups
    and a variance at 0.
    """
    sums = _check(design, response, group)
    ratio = _reml_ratio(sums) if _ratio_is_identified(sums) else 0.0
    step = _evaluate(sums, ratio)
    residual_df = sums.y.size - sums.X.shape[1]
    information = np.zeros((2, 2))
    information[0, 0] = residual_df / step.variance**2
    gradient = np.stack([step.C, step.variance * step.C @ step.G.T @ step.G @ step.C])
    covariance: np.ndarray = np.zeros((2, 2))
    if ratio > 0:
        information[0, 1] = information[1, 0] = step.u @ step.u / step.variance**2
        information[1, 1] = 2.0 * step.u @ step.ZPZ @ step.u / step.variance - (step.ZPZ**2).sum()
        covariance = 2.0 * np.linalg.inv(information)
    else:
        covariance[0, 0] = 2.0 / information[0, 0]
    return RandomInterceptFit(
        beta=step.beta,
        covariance=step.variance * step.C,
        variance_group=ratio * step.variance,
        variance_residual=step.variance,
        covariance_gradient=gradient,
        variance_covariance=covariance,
    )


def satterthwaite_test(fit: FixedEffects, contrast: np.ndarray) -> FTest:
    """Return the F test that contrasts of the fixed effects are 0.

    ``contrast`` (q, p): one row a contrast; ``df_num`` is their rank. As ``contestMD`` of lmerTest
    (Kuznetsova et al. 2017, doi:10.18637/jss.v082.i13): the contrasts are rotated to be
    uncorrelated, each has 2 v^2 / var(v) degrees of freedom, and the F of them together gets the df
    whose mean matches.
    """
    L = np.atleast_2d(np.asarray(contrast, dtype=float))
    if L.shape[1] != fit.beta.size:
        raise ValueError(
            f"satterthwaite_test: expected contrasts of {fit.beta.size} effects, got {L.shape[1]}"
        )
    variance, rotation = np.linalg.eigh(L @ fit.covariance @ L.T)
    kept = variance > 1e-8 * variance.max()
    if not kept.any():
        raise ValueError("satterthwaite_test: expected a contrast that is not 0 everywhere")
    variance, L = variance[kept], rotation[:, kept].T @ L
    f = float(np.mean((L @ fit.beta) ** 2 / variance))
    gradient = np.einsum("qp,vpr,qr->qv", L, fit.covariance_gradient, L)
    spread = np.einsum("qv,vw,qw->q", gradient, fit.variance_covariance, gradient)
    df_num, df_den = float(variance.size), _joint_df(2.0 * variance**2 / spread)
    return FTest(f, df_num, df_den, float(fdtrc(df_num, df_den, f)))


def sequential_contrasts(design: np.ndarray) -> np.ndarray:
    """Return the basis in which lmerTest tests the effects after the first.

    ``design`` (n, p): columns of the fixed effects, the intercept first. Returns (p - 1, p): rows
    of the unit upper triangle of the Doolittle factors of ``X'X``.
    """
    lower = np.linalg.cholesky(design.T @ design)
    return np.asarray((lower / np.diag(lower)).T[1:])


def _joint_df(df: np.ndarray) -> float:
    if np.ptp(df) < 1e-8:
        return float(df.mean())
    if (df <= 2.0).any():
        return 2.0
    expected = float((df / (df - 2.0)).sum())
    return 2.0 * expected / (expected - df.size)


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
        beta=beta,
        C=C,
        G=G,
        ZPZ=ZPZ,
        u=u,
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
