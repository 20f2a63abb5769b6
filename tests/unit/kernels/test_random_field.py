"""Random field theory against closed forms and simulated smooth noise."""

import numpy as np
import pytest
from scipy import stats
from scipy.ndimage import gaussian_filter1d
from scipy.special import gamma

from jointz.kernels.statistics.random_field import (
    SearchRegion,
    cluster_probability,
    critical_height,
    crossing_probability,
    expected_crossings,
    search_region,
    set_probability,
)

GAIT = SearchRegion(12.534, 100 / 12.534, 101)
EVERY = np.ones(101, dtype=bool)


def test_the_threshold_of_ten_people_is_the_published_one():
    assert critical_height(0.025, df=9, region=GAIT) == pytest.approx(4.299, abs=5e-4)


def test_the_threshold_is_where_the_crossing_probability_is_what_was_asked():
    for p in (0.2, 0.025, 0.0005):
        for region in (GAIT, SearchRegion(2.0, 50.0, 101), SearchRegion(400.0, 0.25, 101)):
            for df in (2, 9, 40):
                height = critical_height(p, df=df, region=region)
                assert crossing_probability(height, df=df, region=region) == pytest.approx(p)


def test_a_region_of_no_length_is_one_t_test():
    point = SearchRegion(1e9, 0.0, 2)
    height = critical_height(0.025, df=9, region=point)
    assert height == pytest.approx(stats.t.isf(-np.log1p(-0.025), 9))


def test_many_degrees_of_freedom_are_a_gaussian_field():
    """Rice's formula: exp(-u^2 / 2) sqrt(lambda) / (2 pi), lambda = 4 log 2 a squared width."""
    u = 3.0
    rate = np.sqrt(4 * np.log(2)) / (2 * np.pi) * np.exp(-(u**2) / 2)
    expected = stats.norm.sf(u) + GAIT.resels * rate
    assert expected_crossings(u, df=1e7, region=GAIT) == pytest.approx(expected, rel=1e-5)


def test_a_rough_field_falls_back_on_bonferroni():
    rough = SearchRegion(1.0, 100.0, 101)
    assert critical_height(0.025, df=9, region=rough) == pytest.approx(stats.t.isf(0.025 / 101, 9))


def test_each_piece_of_a_region_can_start_above():
    whole, cut = SearchRegion(10.0, 8.0, 81), SearchRegion(10.0, 8.0, 81, n_pieces=2)
    more = expected_crossings(3.0, df=9, region=cut) - expected_crossings(3.0, df=9, region=whole)
    assert more == pytest.approx(stats.t.sf(3.0, 9))


def test_a_cluster_of_no_width_is_a_crossing_and_wide_ones_are_rarer():
    p = [cluster_probability(k, 3.5, df=9, region=GAIT) for k in (0.0, 0.2, 0.5, 1.0)]
    assert p[0] == pytest.approx(-np.expm1(-expected_crossings(3.5, df=9, region=GAIT)))
    assert p == sorted(p, reverse=True)
    assert p[-1] < 0.1 * p[0]


def test_one_cluster_is_a_set_of_one_and_more_are_rarer():
    one = set_probability([0.4], 3.5, df=9, region=GAIT)
    assert one == pytest.approx(cluster_probability(0.4, 3.5, df=9, region=GAIT))
    expected = -np.log1p(-one)
    two = set_probability([0.4, 0.9], 3.5, df=9, region=GAIT)
    assert two == pytest.approx(stats.poisson.sf(1, expected))


def test_the_width_of_smoothed_noise_is_that_of_its_kernel():
    rng = np.random.default_rng(0)
    noise = gaussian_filter1d(rng.standard_normal((400, 401)), 15 / 2.3548, axis=1)[:, 150:251]
    region = search_region(noise - noise.mean(axis=0), EVERY)

    assert region.fwhm_nodes == pytest.approx(15.0, rel=0.02)
    assert region.resels == pytest.approx(100 / region.fwhm_nodes)
    assert (region.n_nodes, region.n_pieces) == (101, 1)


def test_few_curves_read_resels_large_by_what_theory_says():
    """Slopes do not depend on values: the mean of chi times the mean of 1 / chi."""
    rng = np.random.default_rng(1)
    noise = gaussian_filter1d(rng.standard_normal((2000, 10, 241)), 10, axis=2)[:, :, 70:171]
    residuals = noise - noise.mean(axis=1, keepdims=True)
    found = np.mean([search_region(r, EVERY).resels for r in residuals])
    bias = gamma(5.0) * gamma(4.0) / gamma(4.5) ** 2
    # Central differences over two nodes take 1 - sin(x)/x away, x = 1/10: 0.2 %.
    assert found / (100 / (10 * 2.3548)) == pytest.approx(bias, rel=0.006)
    assert bias == pytest.approx(1.064, abs=1e-3)


def test_width_does_not_depend_on_unit_or_order_of_people():
    residuals = np.random.default_rng(2).standard_normal((6, 30)).cumsum(axis=1)
    tested = np.ones(30, dtype=bool)
    region = search_region(residuals, tested)
    again = search_region(-57.3 * residuals[::-1], tested)
    assert again.fwhm_nodes == pytest.approx(region.fwhm_nodes)


def test_a_gap_cuts_the_region_and_its_slope_is_not_used():
    residuals = np.random.default_rng(3).standard_normal((6, 40)).cumsum(axis=1)
    tested = np.ones(40, dtype=bool)
    tested[20:23] = False
    region = search_region(residuals, tested)

    spoiled = residuals.copy()
    spoiled[:, 20:23] = 1e6
    assert search_region(spoiled, tested) == region
    assert (region.n_nodes, region.n_pieces) == (37, 2)
    assert region.resels == pytest.approx(35 / region.fwhm_nodes)


def test_a_lone_node_has_no_length():
    residuals = np.random.default_rng(3).standard_normal((6, 10)).cumsum(axis=1)
    tested = np.array([True, False] + [True] * 8)
    region = search_region(residuals, tested)
    assert (region.n_nodes, region.n_pieces) == (9, 2)
    assert region.resels == pytest.approx(7 / region.fwhm_nodes)


def test_what_has_no_smoothness_is_refused():
    flat = np.array([[1.0] * 10, [-1.0] * 10])
    with pytest.raises(ValueError, match="residuals that change"):
        search_region(flat, np.ones(10, dtype=bool))
    with pytest.raises(ValueError, match="neighbouring nodes"):
        search_region(flat, np.arange(10) % 2 == 0)


@pytest.mark.parametrize("p", [0.0, 0.3, -1.0, np.nan])
def test_a_threshold_needs_a_small_probability(p):
    with pytest.raises(ValueError, match=r"0 to 0\.25"):
        critical_height(p, df=9, region=GAIT)


def test_a_threshold_needs_two_degrees_of_freedom():
    with pytest.raises(ValueError, match="degrees of freedom"):
        critical_height(0.025, df=1, region=GAIT)
