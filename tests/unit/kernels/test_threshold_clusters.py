"""Clusters by hand."""

import numpy as np
import pytest

from jointz.kernels.statistics.threshold_clusters import threshold_clusters


def test_ends_are_where_the_line_crosses():
    (cluster,) = threshold_clusters(np.array([0.0, 3.0, 5.0, 6.0, 2.0, 0.0]), 4.0)

    assert (cluster.start_node, cluster.end_node) == (1.5, 3.5)
    assert cluster.extent_nodes == 2.0
    assert (cluster.peak_node, cluster.peak) == (3, 6.0)


def test_a_cluster_at_the_curves_end_ends_there():
    first, last = threshold_clusters(np.array([5.0, 3.0, 0.0, 3.0, 5.0]), 4.0)

    assert (first.start_node, first.end_node) == (0.0, 0.5)
    assert (last.start_node, last.end_node) == (3.5, 4.0)


def test_neighbours_on_both_sides_of_zero_are_two_clusters_in_order():
    below, above = threshold_clusters(np.array([0.0, -6.0, 6.0, 0.0]), 4.0)

    assert (below.peak, above.peak) == (-6.0, 6.0)
    assert below.end_node < above.start_node


def test_the_sign_of_the_curve_does_not_move_clusters():
    curve = np.random.default_rng(0).standard_normal(200).cumsum()
    plus, minus = threshold_clusters(curve, 3.0), threshold_clusters(-curve, 3.0)
    assert len(plus) > 2
    ends = [[(c.start_node, c.end_node, c.peak_node) for c in found] for found in (plus, minus)]
    assert ends[0] == ends[1]


def test_a_curve_at_the_threshold_is_not_beyond_it():
    assert threshold_clusters(np.array([0.0, 4.0, -4.0]), 4.0) == ()


@pytest.mark.parametrize("threshold", [0.0, -1.0, np.nan])
def test_a_threshold_is_positive(threshold):
    with pytest.raises(ValueError, match="positive threshold"):
        threshold_clusters(np.zeros(5), threshold)
