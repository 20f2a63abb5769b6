"""Differences, effect sizes, equivalence and repeatability against textbooks and scipy."""

import numpy as np
import pytest
from scipy import stats
from scipy.integrate import quad

from jointz.stats.comparison import (
    NoSpreadError,
    group_difference,
    hedges_correction,
    paired_difference,
    repeatability,
)

#: Shrout and Fleiss 1979, Psychol. Bull. 86, table 2: six targets, four judges.
RATED = np.array(
    [[9, 2, 5, 8], [6, 1, 3, 2], [8, 4, 6, 8], [7, 1, 2, 6], [10, 5, 6, 9], [6, 2, 4, 7]], float
)


@pytest.fixture
def pair():
    rng = np.random.default_rng(11)
    first = rng.normal(3.0, 1.0, 9)
    return first, 0.7 * first + rng.normal(0.6, 0.4, 9)


def test_the_same_people_are_compared_by_the_paired_t_test(pair):
    made, known = paired_difference(*pair), stats.ttest_rel(*pair)

    assert (made.t, made.p, made.df) == pytest.approx((known.statistic, known.pvalue, 8.0))
    interval = known.confidence_interval(0.95)
    assert (made.ci_low, made.ci_high) == pytest.approx((interval.low, interval.high))


def test_groups_are_compared_by_welch(pair):
    first, second = pair[0], pair[1][:6] * 3.0
    made, known = group_difference(first, second), stats.ttest_ind(first, second, equal_var=False)

    assert (made.t, made.p, made.df) == pytest.approx((known.statistic, known.pvalue, known.df))
    interval = known.confidence_interval(0.95)
    assert (made.ci_low, made.ci_high) == pytest.approx((interval.low, interval.high))


def test_the_correction_is_the_ratio_of_gamma_functions():
    # Gamma(1) / Gamma(1/2) and Gamma(2) / (sqrt(2) Gamma(3/2)), and Hedges' approximation.
    assert hedges_correction(2.0) == pytest.approx(1 / np.sqrt(np.pi))
    assert hedges_correction(4.0) == pytest.approx(np.sqrt(2 / np.pi))
    assert hedges_correction(50.0) == pytest.approx(1 - 3 / (4 * 50 - 1), abs=1e-4)


def noncentral_t(t, df, noncentrality):
    """Return the probability below t by the integral over the spread: slow and obvious."""

    def integrand(s):
        spread = stats.chi.pdf(s * np.sqrt(df), df) * np.sqrt(df)
        return stats.norm.cdf(t * s - noncentrality) * spread

    return quad(integrand, 0.0, 12.0, limit=400)[0]


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_the_ends_of_g_z_are_the_effects_at_which_its_t_is_as_rare(pair, sign):
    made = paired_difference(sign * pair[0], sign * pair[1])

    ends = np.array([made.effect_low, made.effect_high]) * np.sqrt(9)
    tails = [noncentral_t(made.t, 8.0, end) for end in ends]
    np.testing.assert_allclose(tails, [0.975, 0.025], atol=1e-6)
    d = pair[0] - pair[1]
    assert made.effect_size == pytest.approx(
        sign * hedges_correction(8.0) * d.mean() / d.std(ddof=1)
    )


def test_the_ends_of_g_are_those_of_the_pooled_t_test(pair):
    first, second = pair[0], pair[1][:5]
    made, pooled = group_difference(first, second), stats.ttest_ind(first, second)

    reach = np.sqrt(1 / 9 + 1 / 5)
    ends = np.array([made.effect_low, made.effect_high]) / reach
    tails = [noncentral_t(pooled.statistic, 12.0, end) for end in ends]
    np.testing.assert_allclose(tails, [0.975, 0.025], atol=1e-6)
    assert made.effect_size == pytest.approx(hedges_correction(12.0) * pooled.statistic * reach)


def test_where_people_hardly_differ_the_effect_is_still_found_quickly():
    # Beyond scipy's reach the interval goes on as the spread's alone does.
    rng = np.random.default_rng(1)
    noise = rng.standard_normal(8)
    below, above = (paired_difference(1.0 + s * noise, np.zeros(8)) for s in (2.9e-3, 2.7e-3))
    far = paired_difference(1.0 + 1e-9 * noise, np.zeros(8))

    for made in (above, far):
        assert made.effect_low / made.t == pytest.approx(below.effect_low / below.t, rel=1e-4)
        assert made.effect_high / made.t == pytest.approx(below.effect_high / below.t, rel=1e-4)


def test_equivalence_is_shown_exactly_where_the_90_percent_interval_lies_inside(pair):
    made = paired_difference(*pair)
    half = made.se * stats.t.ppf(0.95, made.df)
    reach = abs(made.difference) + half

    assert made.equivalence_p(reach) == pytest.approx(0.05)
    assert made.equivalence_p(1.01 * reach) < 0.05 < made.equivalence_p(0.99 * reach)


def test_repeatability_is_that_of_shrout_and_fleiss():
    made = repeatability(RATED)

    # Printed there: .29 and .71; their intervals are those that R's psych::ICC has for them.
    np.testing.assert_allclose(made.icc_agreement, (0.2898, 0.0188, 0.7611), atol=5e-5)
    np.testing.assert_allclose(made.icc_consistency, (0.7148, 0.3425, 0.9459), atol=5e-5)
    assert made.sem[0] ** 2 == pytest.approx(1.0194, abs=5e-5)  # their error mean square, 1.02
    assert made.mdc == pytest.approx(stats.t.ppf(0.975, 15) * np.sqrt(2) * np.array(made.sem))


def test_a_shift_between_days_counts_in_agreement_only():
    rng = np.random.default_rng(3)
    people = rng.normal(0.0, 1.0, 30)[:, None] + 0.2 * rng.standard_normal((30, 2))
    still, shifted = repeatability(people), repeatability(people + np.array([0.0, 2.0]))

    assert shifted.icc_consistency == pytest.approx(still.icc_consistency)
    assert shifted.icc_agreement[0] < 0.5 < still.icc_agreement[0]


@pytest.mark.parametrize(
    ("compare", "values", "error", "message"),
    [
        (paired_difference, ([1.1, 2.1, 3.1], [0.1, 1.1, 2.1]), NoSpreadError, "are the same"),
        (group_difference, ([2.0, 2.0], [1.0, 1.0, 1.0]), NoSpreadError, "nothing varies"),
        (repeatability, ([[1.0, 1.0], [2.0, 2.0], [3.0, 3.0]],), NoSpreadError, "nothing varies"),
        (paired_difference, ([1.0], [2.0]), ValueError, "expected"),
        (paired_difference, ([1.0, 2.0], [2.0]), ValueError, "expected"),
        (group_difference, ([1.0], [2.0, 3.0]), ValueError, "expected"),
        (group_difference, ([1.0, np.nan], [2.0, 3.0]), ValueError, "expected"),
        (repeatability, ([[1.0, 2.0]],), ValueError, "expected"),
    ],
)
def test_values_that_do_not_vary_and_too_few_are_refused(compare, values, error, message):
    with pytest.raises(error, match=message):
        compare(*map(np.array, values))
