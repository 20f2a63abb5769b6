"""Sign flips against every flip done one by one."""

from itertools import product

import numpy as np
import pytest
from scipy import stats

from jointz.kernels.statistics.sign_flip_distribution import (
    all_signs,
    cosines,
    critical_cosine,
    drawn_signs,
    flip_p_values,
    largest_cosines,
)


def slow_largest(differences: np.ndarray) -> np.ndarray:
    """Return the largest |t| of every flip, by scipy."""
    signs = product([1.0, -1.0], repeat=differences.shape[0])
    flipped = (np.array(s)[:, np.newaxis] * differences for s in signs)
    return np.array([np.abs(stats.ttest_1samp(f, 0.0).statistic).max() for f in flipped])


@pytest.fixture
def differences() -> np.ndarray:
    rng = np.random.default_rng(4)
    return rng.standard_normal((7, 20)).cumsum(axis=1) + np.linspace(0, 3, 20)


def test_p_is_the_share_of_flips_as_large_and_decides_as_the_threshold(differences):
    scaled = cosines(differences)
    largest = largest_cosines(scaled, all_signs(7))
    observed = scaled.sum(axis=0)
    p = flip_p_values(observed, largest)

    t = np.abs(stats.ttest_1samp(differences, 0.0).statistic)
    slow = slow_largest(differences)
    expected = [(slow >= value * (1 - 1e-9)).mean() for value in t]
    np.testing.assert_allclose(p, expected)
    for alpha in (1 / 64, 2 / 64, 0.05, 0.1, 0.3):
        found = np.abs(observed) > critical_cosine(largest, alpha)
        np.testing.assert_array_equal(found, p <= alpha)


def test_ties_are_never_found_by_rounding():
    """Differences of one size: many flips have the same t, in other orders of summing."""
    sizes = np.array([0.1, 0.1, 0.1, 0.3, 0.3, 0.7, 0.7, 0.7])[:, np.newaxis]
    scaled = cosines(sizes * np.array([1.0, 3.0, 1e-3]))
    p = flip_p_values(scaled.sum(axis=0), largest_cosines(scaled, all_signs(8)))
    assert p.tolist() == [2 / 256] * 3


def test_long_curves_are_done_in_blocks_with_the_same_result():
    differences = np.random.default_rng(0).standard_normal((9, 20_000))
    scaled, signs = cosines(differences), all_signs(9)
    whole = np.abs(signs @ scaled).max(axis=1)
    np.testing.assert_allclose(largest_cosines(scaled, signs), whole, rtol=1e-12)


@pytest.mark.parametrize("make", [lambda: all_signs(0), lambda: drawn_signs(3, 0, None)])
def test_nothing_to_flip_is_refused(make):
    with pytest.raises(ValueError, match="at least 1"):
        make()
