"""Paired and grouped differences: tests, effect sizes, equivalence, repeatability (ICC)."""

from dataclasses import dataclass

import numpy as np
from scipy.special import chdtri, fdtri, gammaln, nctdtrinc, stdtr, stdtrit

#: Below this share of its size a spread is rounding.
_ROUNDING = 1e-12
_HUGE_T = 1000.0
_CI_LEVEL, _TWO_SIDED_95 = 0.95, 0.975
#: Probability of each side outside an interval.
_TAIL = (1.0 - _CI_LEVEL) / 2.0


class NoSpreadError(ValueError):
    """The values do not vary, so that there is no error to test against."""


@dataclass(frozen=True, slots=True)
class MeanDifference:
    """A mean difference with its t test and effect size."""

    difference: float  # mean of the first values minus mean of the second
    se: float
    df: float
    t: float
    p: float
    ci_low: float
    ci_high: float
    # Hedges' g_z of pairs, or g of groups; None for two pairs, which leave no degree of freedom for
    # the correction
    effect_size: float | None
    effect_low: float | None
    effect_high: float | None

    def equivalence_p(self, margin: float) -> float:
        """Return the p of two one-sided tests that the difference lies within a margin.

        Schuirmann 1987, J. Pharmacokinet. Biopharm. 15, 657-680: the larger one. Below 0.05
        the 90 % interval lies within the margin.
        """
        lower = stdtr(self.df, -(self.difference + margin) / self.se)
        upper = stdtr(self.df, (self.difference - margin) / self.se)
        return float(max(lower, upper))


def paired_difference(first: np.ndarray, second: np.ndarray) -> MeanDifference:
    """Return the mean difference of the same people measured twice.

    The effect size is g_z: mean over standard deviation of the differences, times Hedges'
    correction for n - 1 degrees of freedom. Its interval, from the noncentral t distribution,
    is exact for normal differences, and of the population's value. It grows with the
    correlation of the two measurements: it is not to be compared with g between groups.
    """
    a, b = _finite(first), _finite(second)
    if a.shape != b.shape or a.size < 2:
        raise ValueError(f"paired_difference: expected two pairs or more, got {a.size}, {b.size}")
    d = a - b
    sd, n = float(d.std(ddof=1)), int(d.size)
    if sd <= _ROUNDING * float(max(np.abs(a).max(), np.abs(b).max())):
        raise NoSpreadError("paired_difference: all differences are the same")
    df, reach = float(n - 1), n**-0.5
    return _tested(float(d.mean()), sd * reach, df, effect=(df, reach, sd * reach))


def group_difference(first: np.ndarray, second: np.ndarray) -> MeanDifference:
    """Return the mean difference of different people, with variances of their own.

    Welch's t. The effect size is Hedges' g: the difference over the pooled standard
    deviation, times the correction for n + m - 2 degrees of freedom; its interval, from the
    noncentral t distribution, assumes equal variances, which Welch's does not.
    """
    a, b = _finite(first), _finite(second)
    n, m = a.size, b.size
    if n < 2 or m < 2:
        raise ValueError(f"group_difference: expected two people in a group, got {n} and {m}")
    va, vb = float(a.var(ddof=1)), float(b.var(ddof=1))
    if np.sqrt(max(va, vb)) <= _ROUNDING * float(max(np.abs(a).max(), np.abs(b).max())):
        raise NoSpreadError("group_difference: nothing varies in either group")
    se = float(np.sqrt(va / n + vb / m))
    df = se**4 / ((va / n) ** 2 / (n - 1) + (vb / m) ** 2 / (m - 1))
    pooled_df = float(n + m - 2)
    pooled = np.sqrt(((n - 1) * va + (m - 1) * vb) / pooled_df)
    reach = float(np.sqrt(1.0 / n + 1.0 / m))
    effect = (pooled_df, reach, float(pooled) * reach)
    return _tested(float(a.mean() - b.mean()), se, float(df), effect=effect)


def _finite(values: np.ndarray) -> np.ndarray:
    array = np.asarray(values, dtype=float)
    if array.ndim != 1 or not np.isfinite(array).all():
        raise ValueError("expected one row of finite values")
    return array


def _tested(
    difference: float, se: float, df: float, *, effect: tuple[float, float, float]
) -> MeanDifference:
    """Return test, interval and effect size; ``effect`` is df, reach and error of its t."""
    half = se * float(stdtrit(df, (1.0 + _CI_LEVEL) / 2.0))
    effect_df, reach, effect_se = effect
    size: tuple[float | None, float | None, float | None] = (None, None, None)
    if effect_df > 1.0:
        effect_t = difference / effect_se
        low, high = _noncentrality(effect_t, effect_df)
        size = (hedges_correction(effect_df) * effect_t * reach, low * reach, high * reach)
    t = difference / se
    return MeanDifference(
        difference, se, df, t, float(2.0 * stdtr(df, -abs(t))), difference - half,
        difference + half, *size,
    )  # fmt: skip


def hedges_correction(df: float) -> float:
    """Return Hedges' correction of a standardised mean difference.

    Hedges 1981, J. Educ. Stat. 6, 107-128, the exact form.
    """
    return float(np.exp(gammaln(df / 2.0) - gammaln((df - 1.0) / 2.0)) * np.sqrt(2.0 / df))


def _noncentrality(t: float, df: float) -> tuple[float, float]:
    """Return the noncentralities at which t is as large, and as small, as the level allows."""
    size = abs(t)  # scipy is more exact at positive t
    if size > _HUGE_T:  # where scipy takes minutes, the standard deviation alone is uncertain
        low = size * float(np.sqrt(chdtri(df, 1.0 - _TAIL) / df))
        high = size * float(np.sqrt(chdtri(df, _TAIL) / df))
    else:
        low = float(nctdtrinc(df, 1.0 - _TAIL, size))
        high = float(nctdtrinc(df, _TAIL, size))
    return (low, high) if t >= 0 else (-high, -low)


# --- repeatability -------------------------------------------------------------------------------


@dataclass(frozen=True, slots=True)
class RepeatedMeasurements:
    """Intraclass correlations of single values, with their error."""

    # ICC(A,1): value, lower and upper end of the interval
    icc_agreement: tuple[float, float, float]
    # ICC(C,1): value, lower and upper end of the interval
    icc_consistency: tuple[float, float, float]
    # standard error of measurement: value, lower and upper end of the interval
    sem: tuple[float, float, float]
    # minimal detectable change of one person at 95 %: value, lower and upper end of the interval
    mdc: tuple[float, float, float]


def repeatability(values: np.ndarray) -> RepeatedMeasurements:
    """Return ICC, standard error of measurement and minimal detectable change.

    ICC(A,1) and ICC(C,1) of McGraw and Wong 1996, Psychol. Methods 1, 30-46 (Shrout and
    Fleiss's ICC(2,1) and ICC(3,1)); both may be negative. The standard error of measurement
    is the square root of the error mean square (Weir 2005, J. Strength Cond. Res. 19,
    231-240): it does not include a shift of all people between days. An ICC is low if people
    are alike, however well their measurements repeat.

    The minimal detectable change is t sqrt(2) SEM, with the 97.5 % quantile of Student's t for
    the (n - 1)(k - 1) degrees of freedom of the SEM: the change of a stable new person exceeds
    it in 5 % of studies. Its interval is that of the SEM, from the chi-square distribution of
    its variance, times the same t sqrt(2).
    """
    y = np.asarray(values, dtype=float)
    if y.ndim != 2 or min(y.shape) < 2 or not np.isfinite(y).all():
        raise ValueError(
            "repeatability: expected finite values of two people and two days at least"
        )
    n, k = y.shape
    rows, columns = y.mean(axis=1), y.mean(axis=0)
    rest = y - rows[:, None] - columns + y.mean()
    error = float((rest**2).sum()) / ((n - 1) * (k - 1))
    people, days = float(k * rows.var(ddof=1)), float(n * columns.var(ddof=1))
    if np.sqrt(error) <= _ROUNDING * float(np.abs(y).max()):
        raise NoSpreadError("repeatability: nothing varies inside people")
    df = float((n - 1) * (k - 1))
    sem = float(np.sqrt(error))
    low, high = (sem * float(np.sqrt(df / chdtri(df, p))) for p in (_TAIL, 1.0 - _TAIL))
    factor = float(stdtrit(df, _TWO_SIDED_95) * np.sqrt(2.0))
    return RepeatedMeasurements(
        icc_agreement=_agreement(people, days, error, shape=(n, k)),
        icc_consistency=_consistency(people / error, n, k),
        sem=(sem, low, high),
        mdc=(factor * sem, factor * low, factor * high),
    )


def _consistency(f: float, n: int, k: int) -> tuple[float, float, float]:
    df = float((n - 1) * (k - 1))
    low = f / float(fdtri(n - 1, df, 1.0 - _TAIL))
    high = f * float(fdtri(df, n - 1, 1.0 - _TAIL))
    value, *ends = ((x - 1.0) / (x + k - 1.0) for x in (f, low, high))
    return value, ends[0], ends[1]


def _agreement(
    people: float, days: float, error: float, *, shape: tuple[int, int]
) -> tuple[float, float, float]:
    n, k = shape
    value = (people - error) / (people + (k - 1) * error + k * (days - error) / n)
    a = k * value / (n * (1.0 - value))
    b = 1.0 + k * value * (n - 1) / (n * (1.0 - value))
    parts = (a * days) ** 2 / (k - 1) + (b * error) ** 2 / ((n - 1) * (k - 1))
    v = (a * days + b * error) ** 2 / parts
    below = float(fdtri(n - 1, v, 1.0 - _TAIL))
    above = float(fdtri(v, n - 1, 1.0 - _TAIL))
    rest = k * days + (k * n - k - n) * error
    low = n * (people - below * error) / (below * rest + n * people)
    high = n * (above * people - error) / (rest + n * above * people)
    return value, low, high
