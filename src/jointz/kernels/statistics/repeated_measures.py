"""Repeated-measures analysis of variance of a complete table, and paired t tests."""

from dataclasses import dataclass

import numpy as np
from scipy.special import fdtrc, stdtr

from jointz.kernels.statistics.anova import FTest


@dataclass(frozen=True, slots=True)
class RepeatedMeasures:
    """Analysis of variance of participants by levels.

    Parameters
    ----------
    test : FTest
        Levels against the interaction with participants; exact under sphericity.
    epsilon : float
        Greenhouse and Geisser's, from 1 / (levels - 1) to 1.
    p_epsilon : float
        Probability with both degrees of freedom times ``epsilon``.
    """

    test: FTest
    epsilon: float
    p_epsilon: float


def repeated_measures_anova(values: np.ndarray) -> RepeatedMeasures:
    """Return the F test of the levels of a complete table, with Greenhouse and Geisser's p.

    Parameters
    ----------
    values : (n, k) float
        One row a participant, one column a level; no value missing.

    Raises
    ------
    ValueError
        When the table has fewer than two rows or columns, a value is not finite, or nothing
        varies beside participants and levels.

    Notes
    -----
    Greenhouse and Geisser 1959, doi:10.1007/BF02289823. The epsilon is biased low in small
    groups, so its p is somewhat cautious.

    Examples
    --------
    >>> made = repeated_measures_anova(np.array([[1.0, 2.0], [3.0, 5.0], [2.0, 2.0]]))
    >>> round(made.test.statistic, 6), made.test.df_num, made.test.df_den, made.epsilon
    (3.0, 1.0, 2.0, 1.0)
    """
    Y = np.asarray(values, dtype=float)
    if Y.ndim != 2 or min(Y.shape) < 2 or not np.isfinite(Y).all():
        raise ValueError(
            f"repeated_measures_anova: expected finite values of two participants and two levels "
            f"at least, got {Y.shape}"
        )
    n, k = Y.shape
    centred = Y - Y.mean()
    levels = centred.mean(axis=0)
    rest = centred - centred.mean(axis=1, keepdims=True) - levels
    between, error = n * float(levels @ levels), float((rest**2).sum())
    if error <= 1e-20 * float((centred**2).sum()) or error == 0:
        raise ValueError(
            "repeated_measures_anova: expected values that vary beside participants and levels"
        )
    df_num, df_den = float(k - 1), float((n - 1) * (k - 1))
    f = between / df_num / (error / df_den)
    # rest is doubly centred: its cross products are the doubly centred covariance.
    cross = rest.T @ rest
    epsilon = min(float(np.trace(cross) ** 2 / (df_num * (cross**2).sum())), 1.0)
    return RepeatedMeasures(
        test=FTest(f, df_num, df_den, float(fdtrc(df_num, df_den, f))),
        epsilon=epsilon,
        p_epsilon=float(fdtrc(epsilon * df_num, epsilon * df_den, f)),
    )


@dataclass(frozen=True, slots=True)
class PairedT:
    """A paired t test.

    Parameters
    ----------
    difference, se : float
        Mean difference and its standard error.
    df, t, p : float
        Degrees of freedom, statistic and two-sided probability.
    """

    difference: float
    se: float
    df: float
    t: float
    p: float


def paired_t_test(first: np.ndarray, second: np.ndarray) -> PairedT:
    """Return the paired t test of first minus second.

    Parameters
    ----------
    first, second : (n,) float
        Finite values of the same participants.

    Raises
    ------
    ValueError
        When there are fewer than two pairs or the differences do not vary.

    Examples
    --------
    >>> test = paired_t_test(np.array([2.0, 5.0, 2.0]), np.array([1.0, 3.0, 2.0]))
    >>> round(test.t, 6), test.df
    (1.732051, 2.0)
    """
    d = np.asarray(first, dtype=float) - np.asarray(second, dtype=float)
    if d.size < 2 or not np.isfinite(d).all():
        raise ValueError(f"paired_t_test: expected two finite pairs at least, got {d.size}")
    mean, df = float(d.mean()), float(d.size - 1)
    se = float(d.std(ddof=1) / np.sqrt(d.size))
    if se <= 1e-14 * float(np.abs(d).max()):
        raise ValueError("paired_t_test: expected differences that vary, all are the same")
    t = mean / se
    return PairedT(mean, se, df, t, float(2.0 * stdtr(df, -abs(t))))
