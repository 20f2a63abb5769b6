"""Clusters by hand."""

import numpy as np
import pytest

from jointz.kernels.statistics.threshold_clusters import threshold_clusters


def test_neighbours_on_both_sides_of_zero_are_two_clusters_in_order():
    below, above = threshold_clusters(np.array([0.0, -6.0, 6.0, 0.0]), 4.0)

    assert (below.peak, above.peak) == (-6.0, 6.0)
    assert below.end_node < above.start_node


def test_a_curve_at_the_threshold_is_not_beyond_it():
    assert threshold_clusters(np.array([0.0, 4.0, -4.0]), 4.0) == ()


@pytest.mark.parametrize("threshold", [0.0, -1.0, np.nan])
def test_a_threshold_is_positive(threshold):
    with pytest.raises(ValueError, match="positive threshold"):
        threshold_clusters(np.zeros(5), threshold)
