"""Repeated-measures analysis of variance against explicit sums, and paired t against scipy."""

import numpy as np
import pytest
from scipy import stats

from jointz.kernels.statistics.repeated_measures import paired_t_test, repeated_measures_anova


def test_the_test_is_that_of_the_sums_of_squares():
    Y = np.random.default_rng(0).standard_normal((7, 5)) + np.arange(5)

    made = repeated_measures_anova(Y)

    people, levels = Y.mean(axis=1), Y.mean(axis=0)
    between = sum(7 * (m - Y.mean()) ** 2 for m in levels)
    error = sum(
        (Y[i, j] - people[i] - levels[j] + Y.mean()) ** 2 for i in range(7) for j in range(5)
    )
    assert made.test.statistic == pytest.approx(between / 4 / (error / 24))
    assert (made.test.df_num, made.test.df_den) == (4, 24)
    assert made.test.p == pytest.approx(stats.f.sf(made.test.statistic, 4, 24))


def test_epsilon_is_that_of_the_contrasts_of_the_covariance():
    Y = np.random.default_rng(1).standard_normal((9, 4)) * [1.0, 2.0, 5.0, 1.0]
    contrasts = np.linalg.qr(np.eye(4) - 0.25)[0][:, :3]
    S = contrasts.T @ np.cov(Y, rowvar=False) @ contrasts

    made = repeated_measures_anova(Y)

    epsilon = np.trace(S) ** 2 / 3 / np.trace(S @ S)
    assert made.epsilon == pytest.approx(epsilon)
    f = made.test.statistic
    assert made.p_epsilon == pytest.approx(stats.f.sf(f, 3 * epsilon, 24 * epsilon))
    assert made.p_epsilon > made.test.p or f < 1


def test_epsilon_stays_between_its_bounds():
    spread = np.array([[1.0], [-2.0], [0.5]]) * np.array([1.0, 0.0, -1.0, 0.0])

    assert repeated_measures_anova(spread).epsilon == pytest.approx(1 / 3)
    two = repeated_measures_anova(np.random.default_rng(2).standard_normal((5, 2)))
    assert two.epsilon == pytest.approx(1)
    assert two.p_epsilon == pytest.approx(two.test.p)


@pytest.mark.parametrize(
    "values",
    [
        np.ones((3, 3)),
        np.add.outer([1.0, 2.0], [1.0, 5.0]),
        np.ones((1, 4)),
        np.full((3, 3), np.nan),
    ],
)
def test_a_table_without_error_or_with_gaps_is_refused(values):
    with pytest.raises(ValueError, match="repeated_measures_anova: expected"):
        repeated_measures_anova(values)


def test_paired_t_is_that_of_scipy():
    a, b = np.random.default_rng(3).standard_normal((2, 9))

    test = paired_t_test(a, b)

    known = stats.ttest_rel(a, b)
    assert (test.t, test.p, test.df) == pytest.approx((known.statistic, known.pvalue, known.df))
    assert test.difference == pytest.approx((a - b).mean())


@pytest.mark.parametrize("second", [[1.0], [0.0, 1.0, 2.0], [np.nan, 1.0, 2.0]])
def test_differences_without_spread_are_refused(second):
    with pytest.raises(ValueError, match="paired_t_test: expected"):
        paired_t_test(np.arange(len(second)) + 1.0, np.array(second))
