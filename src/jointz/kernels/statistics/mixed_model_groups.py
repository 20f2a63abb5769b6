"""Is there variance between groups, and how much: exact, balanced or not."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from scipy.optimize import brentq
from scipy.special import fdtrc, fdtri

from jointz.kernels.statistics.anova import FTest

#: Eigenvalues under this share of the largest are 0.
_RANK = 1e-9
#: Sums of squares under this share are rounding; under its square, of all values.
_ROUNDING = 1e-12
#: Ratios of variance beyond this are not told from infinite.
_LARGEST_RATIO = 1e12


class NoErrorLeftError(ValueError):
    """Groups and fixed effects explain every value exactly."""


@dataclass(frozen=True, slots=True)
class GroupVariance:
    """The exact test of a variance between groups, and the interval of its ratio.

    ``test``: groups against the residual; ``ratio_low``, ``ratio_high``: ends of the interval of
    variance between groups over residual variance.
    """

    test: FTest
    ratio_low: float
    ratio_high: float


def group_variance(
    design: np.ndarray, response: np.ndarray, group: np.ndarray, *, level: float = 0.95
) -> GroupVariance:
    """Return the exact F test of groups and the exact interval of their variance ratio.

    ``design`` (n, p): columns of the fixed effects, or of all that the groups are tested beside;
    ``response``, ``group`` (n,). Exact for one random intercept and normal values, balanced or not:
    with A = Z'MZ, t = Z'My and M the projection off the fixed effects, t has covariance s (A +
    ratio A^2) (Wald 1940, Ann. Math. Stat. 11, 96; Harville and Fenech 1985, doi:10.2307/2530650).
    """
    X, y = np.asarray(design, dtype=float), np.asarray(response, dtype=float)
    Z = (np.asarray(group)[:, None] == np.unique(group)).astype(float)
    left, sizes, _ = np.linalg.svd(X, full_matrices=False)
    basis = left[:, sizes > _RANK * sizes.max()]
    MZ, My = Z - basis @ (basis.T @ Z), y - basis @ (basis.T @ y)
    values, vectors = np.linalg.eigh(MZ.T @ MZ)
    kept = values > _RANK * max(float(values.max()), 1.0)
    values, t = values[kept], vectors[:, kept].T @ (Z.T @ My)
    df_num, df_den = int(kept.sum()), y.size - basis.shape[1] - int(kept.sum())
    residual = float(My @ My - (t**2 / values).sum())
    if df_num < 1 or df_den < 1:
        raise ValueError(
            f"expected more groups or rows, {df_num} degrees of freedom are left between groups "
            f"and {df_den} inside them"
        )
    if residual <= max(_ROUNDING * float(My @ My), _ROUNDING**2 * float(y @ y)):
        raise NoErrorLeftError("expected values that vary inside the groups, none does")

    def pivot(ratio: float) -> float:
        return float((t**2 / (values + ratio * values**2)).sum() / df_num / (residual / df_den))

    f = pivot(0.0)
    test = FTest(f, float(df_num), float(df_den), float(fdtrc(df_num, df_den, f)))
    low, high = (
        _ratio_at(pivot, float(fdtri(df_num, df_den, share)))
        for share in ((1.0 + level) / 2.0, (1.0 - level) / 2.0)
    )
    return GroupVariance(test, low, high)


def _ratio_at(pivot: Callable[[float], float], quantile: float) -> float:
    if pivot(0.0) <= quantile:
        return 0.0
    if pivot(_LARGEST_RATIO) >= quantile:
        return float("inf")
    high = 1.0
    while pivot(high) > quantile:
        high *= 10.0
    return float(brentq(lambda r: pivot(r) - quantile, 0.0, high, xtol=1e-14, rtol=1e-12))
