import numpy as np
import pytest
from scipy import linalg, signal

from jointz.kernels.resampling import resample_weights
from jointz.kernels.series.ensemble_response import (
    cross_predicted,
    ensemble_response,
    fit_segments,
    without_mean,
)

TRUE = np.array([0.0, 1.0, 0.6, 0.2])
COEFFICIENTS = np.array([80.0, 1.0, 0.05])


def make_ensemble(
    seed: int = 0, *, count: int = 60, n: int = 9, noise: float = 0.0
) -> tuple[np.ndarray, np.ndarray]:
    rng = np.random.default_rng(seed)
    x = signal.lfilter([1.0], [1.0, -0.7], rng.standard_normal((count, n + TRUE.size - 1)), axis=1)
    lagged = np.lib.stride_tricks.sliding_window_view(x, TRUE.size, axis=1)[:, :, ::-1]
    inputs = without_mean(lagged)
    own = noise * np.cumsum(rng.standard_normal((count, n)), axis=1)
    return inputs, without_mean(inputs @ TRUE + own)


def make_segments(
    seed: int = 0, *, count: int = 80, n: int = 9, own: float = 1.0, white: float = 0.05
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return regressors, target and instruments; what the joint did moves regressors too."""
    rng = np.random.default_rng(seed)
    scale = np.array([0.03, 0.5, 10.0])
    instruments = scale * rng.standard_normal((count, n, 3))
    slow = own * (rng.standard_normal((count, 1)) + white * rng.standard_normal((count, n)))
    regressors = instruments + 0.3 * slow[:, :, np.newaxis] * scale
    target = regressors @ COEFFICIENTS - slow
    return without_mean(regressors), without_mean(target), without_mean(instruments)


def slow_fit(
    regressors: np.ndarray, target: np.ndarray, instruments: np.ndarray, weights: list[np.ndarray]
) -> np.ndarray:
    gram, moment = np.zeros((3, 3)), np.zeros(3)
    for i in range(len(target)):
        gram += instruments[i].T @ weights[i % 2] @ regressors[i]
        moment += instruments[i].T @ weights[i % 2] @ target[i]
    return np.linalg.solve(gram, moment)


def outer(left: np.ndarray) -> np.ndarray:
    return sum(np.outer(row, row) for row in left) / len(left)


# --- impulse responses ---------------------------------------------------------------------------


def test_it_is_generalised_least_squares_where_every_direction_is_kept():
    inputs, output = make_ensemble(noise=0.1)
    flat = inputs.reshape(-1, TRUE.size)
    plain = linalg.lstsq(flat, output.ravel())[0]
    left = output - inputs @ plain
    weight = np.linalg.inv(outer(left) + 0.05 * np.mean(left**2) * np.eye(9))
    every = linalg.block_diag(*[weight] * len(output))

    found = ensemble_response(inputs, output)

    slow = np.linalg.solve(flat.T @ every @ flat, flat.T @ every @ output.ravel())
    assert found.n_kept == TRUE.size
    assert found.response == pytest.approx(slow, abs=1e-9)


def test_the_sd_is_the_scatter_also_where_noise_is_correlated_over_the_segment():
    found = [ensemble_response(*make_ensemble(seed, noise=0.3)) for seed in range(150)]

    scatter = np.std([f.response for f in found], axis=0)

    assert np.mean([f.sd for f in found], axis=0) == pytest.approx(scatter, rel=0.25)


def test_a_prediction_holds_nothing_of_the_realisation_itself():
    inputs, output = make_ensemble(noise=0.3)
    moved = output.copy()
    moved[4] += 100.0

    before = cross_predicted(inputs, output[:, :, np.newaxis])[:, :, 0]
    after = cross_predicted(inputs, moved[:, :, np.newaxis])[:, :, 0]

    even = slice(0, None, 2)
    unmoved = (after - before)[even] - (after - before)[even].mean(axis=0)
    assert np.abs(unmoved).max() < 1e-9
    assert np.abs(after - before)[1::2].max() > 0.1


@pytest.mark.parametrize("inputs", [np.ones((3, 5, 2)), np.ones((10, 5)), np.zeros((10, 5, 2))])
def test_ensembles_without_a_response_are_refused(inputs):
    with pytest.raises(ValueError, match=r"realisations|constant"):
        ensemble_response(inputs, np.ones(inputs.shape[:2]))


# --- coefficients --------------------------------------------------------------------------------


def test_a_replicate_is_the_fit_of_the_strides_drawn():
    """A slow fit, stride by stride, of the drawn strides with the weights of the whole."""
    regressors, target, instruments = make_segments()
    weights = resample_weights(80, 3, np.random.default_rng(1))

    fit = fit_segments(regressors, target, instruments, resampling=weights)

    left = target - regressors @ slow_fit(regressors, target, instruments, [np.eye(9)] * 2)
    ridge = 0.05 * np.mean(left**2) * np.eye(9)
    inverse = [np.linalg.inv(outer(left[1 - f :: 2]) + ridge) for f in (0, 1)]
    assert fit.values == pytest.approx(slow_fit(regressors, target, instruments, inverse))
    for row, replicate in zip(weights, fit.replicates, strict=True):
        drawn = np.repeat(np.arange(80), np.rint(row * 80).astype(int))
        weighed = without_mean(np.stack([inverse[i % 2] @ instruments[i] for i in drawn]))
        X, y = without_mean(regressors[drawn]), without_mean(target[drawn])
        gram = sum(w.T @ x for w, x in zip(weighed, X, strict=True))
        moment = sum(w.T @ one for w, one in zip(weighed, y, strict=True))
        assert replicate == pytest.approx(np.linalg.solve(gram, moment))


def test_segments_that_cannot_be_fitted_are_refused():
    regressors, target, instruments = make_segments()
    once = np.full((1, 80), 1 / 80)
    twice = np.concatenate([regressors, 2.0 * regressors[:, :, :1]], axis=2)

    with pytest.raises(ValueError, match="singular"):
        fit_segments(twice, target, twice, resampling=once)
    with pytest.raises(ValueError, match="expected regressors and instruments"):
        fit_segments(regressors, target[:-1], instruments, resampling=once)
