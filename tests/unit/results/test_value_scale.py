"""Scales of values: a logarithm, and the inverse hyperbolic sine."""

import numpy as np
import pytest

from jointz.results.value_scale import LOGARITHM, ValueScale

ASINH = ValueScale(8.0)
VALUES = np.array([0.5, 8.0, 300.0])


@pytest.mark.parametrize("scale", [LOGARITHM, ASINH])
def test_a_value_comes_back_and_moves_along_its_scale(scale):
    np.testing.assert_allclose(scale.value(scale.of(VALUES)), VALUES)
    np.testing.assert_allclose(scale.of(scale.moved(VALUES, 0.3)), scale.of(VALUES) + 0.3)
    step = 1e-6
    rise = (scale.moved(VALUES, step) - scale.moved(VALUES, -step)) / (2.0 * step)
    np.testing.assert_allclose(scale.slope(VALUES), rise, rtol=1e-6)
    np.testing.assert_allclose(scale.share(VALUES), VALUES / rise, rtol=1e-6)


@pytest.mark.parametrize("scale", [LOGARITHM, ASINH])
def test_a_half_width_is_half_of_the_interval_over_the_value(scale):
    low, high = scale.moved(20.0, np.array([-1.96, 1.96]) * 0.2)
    assert scale.half_width(20.0, 0.2) == pytest.approx((high - low) / 40.0, rel=1e-4)


def test_zero_has_a_place_on_the_inverse_hyperbolic_sine_and_no_relative_error():
    assert ASINH.of(0.0) == ASINH.value(0.0) == 0.0
    assert ASINH.value(ASINH.of(-3.0)) == pytest.approx(-3.0)
    assert ASINH.share(0.0) == ASINH.share(-3.0) == 0.0
    assert ASINH.half_width(0.0, 0.1) == ASINH.half_width(-3.0, 0.1) == np.inf


def test_large_values_have_the_errors_of_a_logarithm():
    assert ASINH.half_width(200.0, 0.2) == pytest.approx(LOGARITHM.half_width(200.0, 0.2), rel=1e-3)
