"""One-way analysis of variance and Holm's correction, on arrays."""

from dataclasses import dataclass

import numpy as np
from scipy.special import fdtrc


@dataclass(frozen=True, slots=True)
class FTest:
    """An F test.

    ``statistic`` with ``df_num`` and ``df_den`` degrees of freedom; ``p``: probability of an F as
    large under the null.
    """

    statistic: float
    df_num: float
    df_den: float
    p: float


def one_way_anova(response: np.ndarray, group: np.ndarray) -> FTest:
    """Return the F test of equal group means, every row taken as independent.

    ``response`` (n,): finite; ``group`` (n,): the group of every row. k - 1 and n - k degrees of
    freedom for k groups. With several rows a person the rows are not independent, and p is too
    small.
    """
    y, labels = np.asarray(response, dtype=float), np.asarray(group)
    if y.ndim != 1 or labels.shape != y.shape:
        raise ValueError(
            f"one_way_anova: expected two arrays of one length, got {y.shape} and {labels.shape}"
        )
    if not np.isfinite(y).all():
        raise ValueError(
            f"one_way_anova: expected finite values, {int((~np.isfinite(y)).sum())} are not"
        )
    levels, index = np.unique(labels, return_inverse=True)
    k, n = levels.size, y.size
    if k < 2 or n <= k:
        raise ValueError(
            f"one_way_anova: expected two groups and more rows than groups, got {n} rows in {k}"
        )
    size = np.bincount(index)
    # About the grand mean first: sums of squares of large values lose the differences.
    centred = y - y.mean()
    mean = np.bincount(index, weights=centred) / size
    between = float(size @ mean**2)
    within = float(((centred - mean[index]) ** 2).sum())
    if between + within <= (n * np.finfo(float).eps * np.abs(y).max()) ** 2:
        raise ValueError(f"one_way_anova: expected values that vary, all {n} are {y[0]:g}")
    df_num, df_den = float(k - 1), float(n - k)
    f = between / df_num / (within / df_den) if within > 0 else float("inf")
    return FTest(f, df_num, df_den, float(fdtrc(df_num, df_den, f)))


def holm(p: np.ndarray) -> np.ndarray:
    """Return p-values adjusted by Holm's step-down method.

    ``p`` (m,): of one family. Returns (m,) in the same order. Holm 1979, Scandinavian Journal of
    Statistics 6, 65.
    """
    p = np.asarray(p, dtype=float)
    if p.ndim != 1 or not ((p >= 0) & (p <= 1)).all():
        raise ValueError("holm: expected one row of probabilities between 0 and 1")
    order = np.argsort(p, kind="stable")
    steps = np.maximum.accumulate(p[order] * np.arange(p.size, 0, -1))
    adjusted = np.empty_like(p)
    adjusted[order] = np.minimum(steps, 1.0)
    return adjusted
