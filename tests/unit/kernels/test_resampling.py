"""Bootstrap weights: a slow implementation, moments, refusals."""

import numpy as np
import pytest

from jointz.kernels.resampling import (
    resample_weights,
    resampled_normal_equations,
    trial_products,
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


@pytest.mark.parametrize("n_trials", [1, 4, 13])
@pytest.mark.parametrize("n_resamples", [0, 1, 300])
def test_products_of_trials_give_the_normal_equations_of_the_averages(n_trials, n_resamples):
    rng = np.random.default_rng(n_trials)
    trials = rng.normal(size=(n_trials, 4, 17))
    weights = resample_weights(n_trials, n_resamples, rng)
    gram, moment = resampled_normal_equations(weights, trial_products(trials))
    averages = np.einsum("rp,pct->rct", weights, trials)
    products = averages @ averages.transpose(0, 2, 1)
    np.testing.assert_allclose(gram, products[:, :3, :3], rtol=1e-12, atol=1e-12)
    np.testing.assert_allclose(moment, products[:, :3, 3], rtol=1e-12, atol=1e-12)


def test_products_refuse_what_does_not_fit():
    with pytest.raises(ValueError, match=r"shape \(P, 4, T\) .* got \(2, 3, 9\)"):
        trial_products(np.ones((2, 3, 9)))
    with pytest.raises(ValueError, match=r"weights of shape \(R, 2\)"):
        resampled_normal_equations(np.ones((4, 3)), trial_products(np.ones((2, 4, 9))))
