"""Covariance of noise from few realisations."""

import numpy as np
import pytest

from jointz.identify.calibration.leg import shrunk_covariance

N = 54
T = np.arange(N)
APART = np.abs(T[:, None] - T)


def swelling() -> np.ndarray:
    """Noise of a prediction that gets worse, of a sensor, and of its slow part."""
    size = 0.2 + T / N
    slow = np.outer(size, size) * np.exp(-0.5 * (APART / 15.0) ** 2)
    return np.asarray(0.09 * np.eye(N) + slow + 0.02 * 0.9**APART)


def realised(covariance: np.ndarray, count: int, seed: int) -> np.ndarray:
    rng = np.random.default_rng(seed)
    rows = rng.standard_normal((count, N)) @ np.linalg.cholesky(covariance).T
    return np.asarray(np.cov(rows.T))


def errors(covariance: np.ndarray, used: np.ndarray, shape: np.ndarray) -> tuple[float, float]:
    """Return claimed and true variance of the size of a shape, weighted with ``used``."""
    weight = np.linalg.solve(used, shape)
    weight /= weight @ shape
    return float(weight @ used @ weight), float(weight @ covariance @ weight)


@pytest.mark.parametrize("count", [3, 12, 900])
def test_a_shrunk_covariance_can_be_inverted_whatever_the_count(count):
    found = shrunk_covariance(realised(swelling(), count, 1), count)
    assert np.allclose(found, found.T)
    # The sensor's white noise has a variance of 0.09; three realisations see little of it.
    assert np.linalg.eigvalsh(found).min() > (0.02 if count > 3 else 1e-4)


@pytest.mark.parametrize("count", [15, 240])
@pytest.mark.parametrize("beat", [4.0, 10.0, 25.0])
def test_the_error_it_claims_is_about_the_error_it_makes(count, beat):
    true, shape = swelling(), np.exp(-T / 20.0) * np.sin(T / beat)
    pairs = [
        errors(true, shrunk_covariance(realised(true, count, seed), count), shape)
        for seed in range(20)
    ]
    claimed, made = np.sqrt(np.mean(pairs, axis=0))
    best = np.sqrt(1.0 / (shape @ np.linalg.solve(true, shape)))
    assert made < 1.2 * best
    assert 0.8 < claimed / made < 1.25


def test_one_realisation_is_refused():
    with pytest.raises(ValueError, match="two realisations or more, got 1"):
        shrunk_covariance(np.eye(3), 1)


def test_strides_that_hardly_differ_have_a_covariance_too():
    # Two smooth shapes and next to no noise: hardly anything is new in a sample.
    shapes = np.array([np.sin(0.03 * T), np.cos(0.05 * T) ** 2])
    rows = np.random.default_rng(3).standard_normal((40, 2)) @ shapes
    sample = np.cov(rows.T) + 1e-8 * np.eye(N)
    found = shrunk_covariance(sample, 40)
    assert np.allclose(found, found.T)
    assert np.linalg.eigvalsh(found).min() > 0.0
