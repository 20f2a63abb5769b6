"""Random field theory against closed forms and simulated smooth noise."""

import numpy as np
import pytest

from jointz.kernels.statistics.random_field import (
    SearchRegion,
    critical_height,
    search_region,
)

GAIT = SearchRegion(12.534, 100 / 12.534, 101)


def test_the_threshold_of_ten_people_is_the_published_one():
    assert critical_height(0.025, df=9, region=GAIT) == pytest.approx(4.299, abs=5e-4)


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
