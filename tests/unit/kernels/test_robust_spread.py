"""Spread of numbers with strangers among them."""

import numpy as np
import pytest

from jointz.kernels.robust_spread import robust_moments, robust_sd


def test_of_normal_numbers_it_is_their_sd():
    values = 3.0 + 2.0 * np.random.default_rng(1).standard_normal((200_000, 2))

    np.testing.assert_allclose(robust_sd(values), 2.0, rtol=0.01)


def test_strangers_do_not_move_it():
    values = np.random.default_rng(2).standard_normal(1001)
    strange = values.copy()
    strange[:20] = 1e6

    np.testing.assert_allclose(robust_sd(strange), robust_sd(values), rtol=0.05)


@pytest.mark.parametrize("shape", [(1,), (2,), (5,), (8, 3), (7, 3, 2)])
@pytest.mark.parametrize("spoiled", [0.0, np.nan, np.inf])
def test_middle_is_the_median_that_numpy_finds(shape, spoiled):
    values = np.random.default_rng(3).standard_normal(shape)
    values.flat[0] += spoiled

    with np.errstate(invalid="ignore"):  # infinite minus infinite
        middle, sd = robust_moments(values)
        slow = 1.4826 * np.median(np.abs(values - np.median(values, axis=0)), axis=0)
    np.testing.assert_array_equal(middle, np.median(values, axis=0))
    np.testing.assert_array_equal(sd, slow)
