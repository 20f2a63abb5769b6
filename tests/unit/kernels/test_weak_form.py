"""The integrated equation against derivatives by hand and against noise of known size."""

import numpy as np
import pytest

from jointz.kernels.weak_form import (
    TestFunctions,
    bumps,
    weak_equations,
    weak_fit,
    weak_system,
    whitening,
)

STEP_S = 1e-3
N = 140
TRUTH = np.array([50.0, 1.5, 0.05])
T = np.arange(N) * STEP_S


def motion() -> np.ndarray:
    """Return angle, velocity, acceleration of a sum of two Gaussian bumps, (3, N)."""
    total = np.zeros((3, N))
    for centre, width, height in ((0.05, 0.015, 0.2), (0.09, 0.025, -0.1)):
        z = (T - centre) / width
        g = height * np.exp(-(z**2) / 2)
        total += [g, -g * z / width, g * (z**2 - 1) / width**2]
    return total


@pytest.fixture(scope="module")
def functions() -> TestFunctions:
    return bumps(N, step_s=STEP_S)


@pytest.mark.parametrize(("every", "within"), [(1, 2e-4), (3, 2e-3)])
def test_integration_by_parts_replaces_derivatives_of_the_motion_at_any_rate(every, within):
    functions = bumps(T[::every].size, step_s=every * STEP_S)
    angle, velocity, acceleration = motion()[:, ::every]
    X, _ = weak_system(angle, np.zeros(angle.size), functions)
    for column, signal in enumerate((angle, velocity, acceleration)):
        direct = functions.value @ signal
        np.testing.assert_allclose(X[:, column], direct, atol=within * np.abs(direct).max())


def test_a_joint_comes_back_without_any_derivative(functions):
    signals = motion()
    torque = TRUTH @ signals
    whitener = weak_fit(signals[0], torque, functions, noise_sd=(1e-3, 0.01))
    gram, moment = weak_equations(signals[:1], torque[None], functions, whitener, angle_sd=0.0)
    np.testing.assert_allclose(np.linalg.solve(gram[0], moment[0]), TRUTH, rtol=1e-4)


def test_whitened_noise_has_unit_covariance(functions):
    noise_sd = (2e-3, 0.1)
    rng = np.random.default_rng(0)
    angle = noise_sd[0] * rng.standard_normal((20_000, N))
    torque = noise_sd[1] * rng.standard_normal((20_000, N))
    X, y = weak_system(angle, torque, functions)
    white = (y - X @ TRUTH) @ whitening(TRUTH, functions, noise_sd=noise_sd).T

    covariance = white.T @ white / len(white)
    # The sd of an entry is 0.7 % off the diagonal, 1 % on it.
    np.testing.assert_allclose(covariance, np.eye(len(covariance)), atol=0.05)


def test_impossible_requests_are_refused(functions):
    with pytest.raises(ValueError, match="at least 26 samples"):
        bumps(25, step_s=STEP_S)
    with pytest.raises(ValueError, match="of 140 samples"):
        weak_system(np.zeros(100), np.zeros(100), functions)
    with pytest.raises(ValueError, match="noise >= 0"):
        whitening(TRUTH, functions, noise_sd=(0.0, 0.0))
