"""Spread of numbers with strangers among them."""

import numpy as np

from jointz.kernels.robust_spread import robust_sd


def test_of_normal_numbers_it_is_their_sd():
    values = 3.0 + 2.0 * np.random.default_rng(1).standard_normal((200_000, 2))

    np.testing.assert_allclose(robust_sd(values), 2.0, rtol=0.01)


def test_strangers_do_not_move_it():
    values = np.random.default_rng(2).standard_normal(1001)
    strange = values.copy()
    strange[:20] = 1e6

    np.testing.assert_allclose(robust_sd(strange), robust_sd(values), rtol=0.05)
