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


@pytest.mark.parametrize("n", [3, 4, 9, 40])
def test_it_equals_the_slope_of_the_polynomial_through_the_neighbours(n):
    x = np.random.default_rng(n).normal(size=n)
    np.testing.assert_allclose(derivative(x, rate_hz=3.0), naive_derivative(x, 3.0), atol=1e-11)


def test_a_missing_sample_spoils_four_samples_either_side_and_no_more():
    x = np.arange(30.0)
    x[15] = np.nan
    spoiled = np.flatnonzero(np.isnan(derivative(x, rate_hz=1.0)))
    # A central formula does not use the sample in its own middle.
    np.testing.assert_array_equal(spoiled, [11, 12, 13, 14, 16, 17, 18, 19])


@pytest.mark.parametrize(
    ("x", "rate_hz"), [(np.float64(1.0), 1.0), (np.ones(2), 1.0), (np.ones(5), float("nan"))]
)
def test_what_has_no_derivative_is_refused(x, rate_hz):
    with pytest.raises(ValueError, match=r"samples|rate_hz"):
        derivative(x, rate_hz=rate_hz)
