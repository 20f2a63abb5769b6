"""Tests of fixed effects after Kenward and Roger or Satterthwaite."""

from dataclasses import dataclass

import numpy as np
from scipy.special import fdtrc

from jointz.kernels.statistics.anova import FTest
from jointz.kernels.statistics.mixed_model_components import ComponentsFit

#: What pbkrtest takes as 0, and the df about which it does not scale F.
_ZERO = 1e-10
_NEARLY_TWO = 0.01


@dataclass(frozen=True, slots=True)
class Contrasts:
    """Single contrasts of fixed effects: value, standard error and degrees of freedom, (q,)."""

    estimate: np.ndarray
    se: np.ndarray
    df: np.ndarray


def adjusted_covariance(fit: ComponentsFit) -> np.ndarray:
    """Return the covariance of the fixed effects with the variances taken as estimated.

    Returns (p, p): C + 2 C [sum_ab W_ab (Q_ab - P_a C P_b)] C. Kenward and Roger 1997,
    doi:10.2307/2533558, for variances that enter linearly.
    """
    C, P, Q = fit.covariance, fit.information_gradient, fit.information_products
    W = np.linalg.inv(fit.expected_information)
    inner = np.einsum("kl,klpq->pq", W, Q - (P @ C)[:, None] @ P[None])
    return np.asarray(C + C @ (inner + inner.T) @ C)


def kenward_roger_test(fit: ComponentsFit, contrast: np.ndarray) -> FTest:
    """Return the scaled F test that contrasts of the fixed effects are 0.

    ``contrast`` (q, p): independent rows, one a contrast. The scaled F, as ``Ftest`` of
    ``KRmodcomp`` in pbkrtest 0.5: Halekoh and Hojsgaard 2014, doi:10.18637/jss.v059.i09.
    """
    L = np.atleast_2d(np.asarray(contrast, dtype=float))
    q = L.shape[0]
    if np.linalg.matrix_rank(L) < q:
        raise ValueError("kenward_roger_test: expected contrasts that do not depend on each other")
    C, W = fit.covariance, np.linalg.inv(fit.expected_information)
    theta = L.T @ np.linalg.solve(L @ C @ L.T, L)
    U = theta @ C @ fit.information_gradient @ C
    trace = np.einsum("kpp->k", U)
    A1 = float(trace @ W @ trace)
    A2 = float((W * np.einsum("kpq,lqp->kl", U, U)).sum())
    df_den = _denominator_df(A1, A2, q)
    if not 0 < df_den < np.inf:
        raise ValueError(
            f"kenward_roger_test: expected more groups, the method gives {df_den:g} degrees of "
            f"freedom; use Satterthwaite's"
        )
    near_two = abs(df_den - 2.0) < _NEARLY_TWO
    scaling = 1.0 if near_two else df_den * (1.0 - A2 / q) / (df_den - 2.0)
    effects = L @ fit.beta
    wald = effects @ np.linalg.solve(L @ adjusted_covariance(fit) @ L.T, effects)
    f = float(scaling * wald / q)
    return FTest(f, float(q), df_den, float(fdtrc(q, df_den, f)))


def _denominator_df(A1: float, A2: float, q: int) -> float:
    if q == 1:  # A1 is A2, and what follows is this
        return 2.0 / A2
    B = (A1 + 6.0 * A2) / (2.0 * q)
    g = ((q + 1) * A1 - (q + 4) * A2) / ((q + 2) * A2)
    shared = 3.0 * q + 2.0 * (1.0 - g)
    V0 = 1.0 + g / shared * B
    V1 = 1.0 - (q - g) / shared * B
    V2 = 1.0 - (q + 2 - g) / shared * B
    V0 = 0.0 if abs(V0) < _ZERO else V0
    # Both vanish together at 2 degrees of freedom.
    both_zero = max(abs(1.0 - A2 / q), abs(V1)) < _ZERO
    share = 1.0 if both_zero else np.divide(1.0 - A2 / q, V1)
    # As in R, a division by 0 is infinite.
    with np.errstate(divide="ignore", invalid="ignore"):
        rho = share**2 * np.divide(V0, V2) / q
        return float(4.0 + np.divide(q + 2, q * rho - 1.0))


def satterthwaite_test(fit: ComponentsFit, contrast: np.ndarray) -> FTest:
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


def single_contrasts(fit: ComponentsFit, contrast: np.ndarray, *, kenward_roger: bool) -> Contrasts:
    """Return value, standard error and degrees of freedom of contrasts one at a time.

    ``contrast`` (q, p): one row a contrast; degrees of freedom of Kenward and Roger, or of
    Satterthwaite.
    """
    L = np.atleast_2d(np.asarray(contrast, dtype=float))
    plain = np.einsum("qp,pr,qr->q", L, fit.covariance, L)
    gradient = np.einsum("qp,vpr,qr->qv", L, fit.covariance_gradient, L)
    if kenward_roger:
        W = np.linalg.inv(fit.expected_information)
        variance = np.einsum("qp,pr,qr->q", L, adjusted_covariance(fit), L)
    else:
        W, variance = fit.variance_covariance, plain
    spread = np.einsum("qv,vw,qw->q", gradient, W, gradient)
    return Contrasts(L @ fit.beta, np.sqrt(variance), 2.0 * plain**2 / spread)
