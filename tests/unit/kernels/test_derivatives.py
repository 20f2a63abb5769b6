"""Derivatives: polynomials, sines, edges, a slow implementation."""

import numpy as np
import pytest

from jointz.kernels.derivatives import derivative


def naive_derivative(x, rate_hz):
    """Sample by sample: the slope at the sample of the polynomial through its neighbours."""
    n = len(x)
    out = np.empty(n)
    for i in range(n):
        half_width = min(i, n - 1 - i, 4)
        around = np.arange(-half_width, half_width + 1)
        if half_width == 0:
            around = np.arange(3) if i == 0 else -np.arange(3)
        powers = around[:, None] ** np.arange(len(around))[None, :]
        out[i] = np.linalg.solve(powers.astype(float), x[i + around])[1] * rate_hz
    return out


@pytest.mark.parametrize("n", [3, 4, 5, 6, 7, 8, 9, 10, 11, 40])
def test_it_equals_the_slope_of_the_polynomial_through_the_neighbours(n):
    x = np.random.default_rng(n).normal(size=n)
    np.testing.assert_allclose(derivative(x, rate_hz=3.0), naive_derivative(x, 3.0), atol=1e-11)


@pytest.mark.parametrize("n", [3, 4, 5, 8, 9, 30])
def test_polynomials_of_degree_two_are_exact_up_to_the_edges(n):
    time = np.arange(n) / 100.0
    got = derivative(2.0 - 3.0 * time + 5.0 * time**2, rate_hz=100.0)
    np.testing.assert_allclose(got, -3.0 + 10.0 * time, atol=1e-11)


def test_polynomials_of_degree_eight_are_exact_in_the_inside():
    time = np.linspace(-1.0, 1.0, 41)
    got = derivative(time**8, rate_hz=20.0)
    np.testing.assert_allclose(got[4:-4], 8.0 * time[4:-4] ** 7, atol=1e-12)


def test_a_constant_has_no_derivative_at_all():
    assert not derivative(np.full(20, 0.1), rate_hz=1000.0).any()


def test_acceleration_at_20_hz_and_500_hz_is_good_to_a_millionth():
    time = np.arange(500) / 500.0
    omega = 2 * np.pi * 20.0
    angle = np.sin(omega * time)
    acceleration = derivative(derivative(angle, rate_hz=500.0), rate_hz=500.0)
    inside = slice(8, -8)
    error = acceleration[inside] + omega**2 * angle[inside]
    assert np.abs(error).max() < 1e-6 * omega**2
    second_order = np.gradient(np.gradient(angle, time), time)[inside] + omega**2 * angle[inside]
    assert np.abs(second_order).max() > 0.02 * omega**2


def test_time_backwards_turns_the_sign_and_nothing_else():
    x = np.random.default_rng(3).normal(size=50)
    forward = derivative(x, rate_hz=7.0)
    np.testing.assert_array_equal(derivative(x[::-1], rate_hz=7.0)[::-1], -forward)


def test_rows_are_taken_apart_and_the_input_is_left_alone():
    x = np.random.default_rng(4).normal(size=(2, 3, 30))
    before = x.copy()
    got = derivative(x, rate_hz=10.0)
    np.testing.assert_array_equal(x, before)
    np.testing.assert_array_equal(got[1, 0], derivative(x[1, 0], rate_hz=10.0))


def test_integers_are_differentiated_as_numbers():
    np.testing.assert_allclose(derivative(np.arange(5), rate_hz=1.0), np.ones(5), atol=1e-15)


def test_a_missing_sample_spoils_four_samples_either_side_and_no_more():
    x = np.arange(30.0)
    x[15] = np.nan
    spoiled = np.flatnonzero(np.isnan(derivative(x, rate_hz=1.0)))
    # A central formula does not use the sample in its own middle.
    np.testing.assert_array_equal(spoiled, [11, 12, 13, 14, 16, 17, 18, 19])


@pytest.mark.parametrize("x", [np.float64(1.0), np.ones(0), np.ones(2)])
def test_fewer_than_three_samples_are_refused(x):
    with pytest.raises(ValueError, match="at least 3 samples"):
        derivative(x, rate_hz=1.0)


@pytest.mark.parametrize("rate_hz", [0.0, -1.0, float("nan")])
def test_a_rate_that_is_not_positive_is_refused(rate_hz):
    with pytest.raises(ValueError, match="rate_hz > 0"):
        derivative(np.ones(5), rate_hz=rate_hz)
