"""The covariance of estimates whose residuals are correlated in time."""

from itertools import pairwise

import numpy as np
import pytest
from scipy.signal import lfilter

from jointz.kernels.block_sandwich import (
    autocorrelation,
    block_sandwich,
    correlation_time,
    count_blocks,
)


def test_it_equals_a_slow_loop_over_blocks_for_asymmetric_bread() -> None:
    rng = np.random.default_rng(1)
    scores, bread = rng.standard_normal((1003, 3)), rng.standard_normal((3, 3)) + 4 * np.eye(3)
    edges = [b * 1003 // 7 for b in range(8)]
    meat = np.zeros((3, 3))
    for first, last in pairwise(edges):
        g = sum(scores[t] for t in range(first, last))
        meat += np.outer(g, g)
    inverse = np.linalg.inv(bread)
    expected = inverse @ meat @ inverse.T * 7 / 6
    np.testing.assert_allclose(block_sandwich(scores, bread, 7), expected, rtol=1e-10)


@pytest.mark.parametrize(
    ("bread", "n_blocks"),
    [(np.eye(3), 5), (np.eye(2), 1), (np.eye(2), 11), (np.zeros((2, 2)), 5)],
)
def test_impossible_input_is_refused(bread: np.ndarray, n_blocks: int) -> None:
    with pytest.raises(ValueError, match=r"expected|singular"):
        block_sandwich(np.ones((10, 2)), bread, n_blocks)


def test_autocorrelation_equals_the_direct_sum() -> None:
    x = np.random.default_rng(4).standard_normal(101)
    centred = x - x.mean()
    direct = [centred[k:] @ centred[: 101 - k] for k in range(101)] / (centred @ centred)
    np.testing.assert_allclose(autocorrelation(x), direct, atol=1e-13)


def test_correlation_time_of_an_exponential_process_is_its_time_constant() -> None:
    tau_s, rate_hz = 0.05, 1000.0
    rng = np.random.default_rng(5)
    x = lfilter([1.0], [1.0, -np.exp(-1.0 / (tau_s * rate_hz))], rng.standard_normal(600_000))
    assert correlation_time(x, rate_hz=rate_hz) == pytest.approx(tau_s, rel=0.1)


@pytest.mark.parametrize(
    ("duration_s", "correlation_time_s", "blocks"),
    [
        (300.0, 0.01, 60),  # never more than sixty
        (30.0, 0.01, 30),  # blocks of a second
        (60.0, 0.3, 20),  # blocks of ten correlation times
        (4.0, 0.01, 10),  # the second gives way
        (4.0, 0.05, 0),  # ten correlation times do not
    ],
)
def test_blocks_are_long_against_the_correlation(
    duration_s: float, correlation_time_s: float, blocks: int
) -> None:
    assert count_blocks(duration_s, correlation_time_s=correlation_time_s) == blocks
