"""Bootstrap weights: a slow implementation, moments, refusals."""

import numpy as np
import pytest

from jointz.kernels.resampling import (
    resample_weights,
)


def naive_weights(n_trials, n_resamples, rng):
    weights = np.zeros((n_resamples, n_trials))
    for row, draws in enumerate(rng.integers(0, n_trials, size=(n_resamples, n_trials))):
        for trial in draws:
            weights[row, trial] += 1.0
    return weights / n_trials


@pytest.mark.parametrize(("n_trials", "n_resamples"), [(1, 3), (2, 5), (50, 20), (7, 0)])
def test_weights_are_the_counts_of_draws_with_replacement(n_trials, n_resamples):
    got = resample_weights(n_trials, n_resamples, np.random.default_rng(5))
    expected = naive_weights(n_trials, n_resamples, np.random.default_rng(5))
    assert got.dtype == np.float64
    np.testing.assert_array_equal(got, expected)


@pytest.mark.parametrize(("n_trials", "n_resamples"), [(0, 5), (-1, 5), (3, -1)])
def test_impossible_sizes_are_refused(n_trials, n_resamples):
    with pytest.raises(ValueError, match="n_trials >= 1 and n_resamples >= 0"):
        resample_weights(n_trials, n_resamples, np.random.default_rng(0))
