"""Bootstrap weights: a slow implementation, moments, refusals."""

import numpy as np
import pytest

from jointz.kernels.resampling import resample_weights


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


def test_every_resample_draws_as_many_trials_as_there_are():
    weights = resample_weights(30, 500, np.random.default_rng(6))
    counts = weights * 30
    np.testing.assert_allclose(counts, np.round(counts), atol=1e-12)
    np.testing.assert_array_equal(np.round(counts).sum(axis=1), 30)


def test_counts_have_the_moments_of_a_multinomial():
    n_trials, n_resamples = 10, 20_000
    counts = resample_weights(n_trials, n_resamples, np.random.default_rng(7)) * n_trials
    variance = 1.0 - 1.0 / n_trials
    five_sigma = 5.0 * np.sqrt(variance / n_resamples)
    np.testing.assert_allclose(counts.mean(axis=0), 1.0, atol=five_sigma)
    covariance = np.cov(counts.T)
    expected = np.eye(n_trials) - 1.0 / n_trials
    np.testing.assert_allclose(covariance, expected, atol=5.0 * np.sqrt(3.0 / n_resamples))


def test_the_same_generator_state_gives_the_same_weights():
    first = resample_weights(20, 10, np.random.default_rng(8))
    np.testing.assert_array_equal(first, resample_weights(20, 10, np.random.default_rng(8)))
    assert (first != resample_weights(20, 10, np.random.default_rng(9))).any()


@pytest.mark.parametrize(("n_trials", "n_resamples"), [(0, 5), (-1, 5), (3, -1)])
def test_impossible_sizes_are_refused(n_trials, n_resamples):
    with pytest.raises(ValueError, match="n_trials >= 1 and n_resamples >= 0"):
        resample_weights(n_trials, n_resamples, np.random.default_rng(0))
