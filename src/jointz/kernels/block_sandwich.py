"""Covariance of an estimate whose residuals are correlated in time.

Residuals of a joint are slow (muscle, drift), so the textbook formula, which
takes every sample as independent, gives intervals several times too narrow.
Sums over blocks much longer than the correlation are nearly independent.
"""

import numpy as np
from scipy import fft

#: A block spans at least this many correlation times of the residuals.
CORRELATION_TIMES_PER_BLOCK = 10.0
#: Shortest block, s; gives way before the number of blocks falls under ``FEWEST_BLOCKS``.
SHORTEST_BLOCK_S = 1.0
#: Fewer blocks give no useful interval.
FEWEST_BLOCKS = 10
MOST_BLOCKS = 60


def block_sandwich(scores: np.ndarray, bread: np.ndarray, n_blocks: int) -> np.ndarray:
    """Return the covariance of the root of estimating equations by batch means.

    ``scores`` (n, p): instrument times residual z_t r_t in the order of time; ``bread`` (p, p): A =
    sum z_t x_t'. With sums g_b of the scores over n_b blocks it is A^-1 (sum g_b g_b') A^-T n_b /
    (n_b - 1), for Student's t with n_b - 1 degrees of freedom (n_b - p in both places with few
    blocks). Liang and Zeger 1986, doi:10.1093/biomet/73.1.13, blocks of time as clusters.
    """
    scores = np.asarray(scores, dtype=float)
    bread = np.asarray(bread, dtype=float)
    if scores.ndim != 2 or bread.shape != (scores.shape[1],) * 2:
        raise ValueError(
            f"block_sandwich: expected scores (n, p) and bread (p, p), got {scores.shape} "
            f"and {bread.shape}"
        )
    n = scores.shape[0]
    if not 2 <= n_blocks <= n:
        raise ValueError(f"block_sandwich: expected 2 <= n_blocks <= {n}, got {n_blocks}")
    starts = np.arange(n_blocks) * n // n_blocks
    sums = np.add.reduceat(scores, starts, axis=0)
    try:
        half = np.linalg.solve(bread, sums.T)
    except np.linalg.LinAlgError as exc:
        raise ValueError("block_sandwich: the bread is singular") from exc
    return np.asarray(half @ half.T * (n_blocks / (n_blocks - 1)))


def autocorrelation(x: np.ndarray) -> np.ndarray:
    """Return the autocorrelation of a signal about its mean, one at lag zero.

    ``x`` (n,). Returns (n,): lags 0 to n - 1, biased (divided by n at every lag); zero for a
    constant.
    """
    centred = np.asarray(x, dtype=float) - np.mean(x)
    power = float(centred @ centred)
    if power == 0.0:
        return np.zeros_like(centred)
    padded = fft.next_fast_len(2 * centred.size, real=True)
    spectrum = np.abs(fft.rfft(centred, padded)) ** 2
    return np.asarray(fft.irfft(spectrum, padded)[: centred.size] / power)


def correlation_time(residual: np.ndarray, *, rate_hz: float) -> float:
    """Return the integral correlation time of a signal, in s.

    ``residual`` (n,). The autocorrelation is summed from lag zero (half weight) to its first
    crossing of zero; 0 for a signal that is zero.
    """
    correlation = autocorrelation(residual)
    if correlation[0] == 0:
        return 0.0
    negative = np.flatnonzero(correlation <= 0)
    end = int(negative[0]) if negative.size else correlation.size
    return (float(correlation[:end].sum()) - 0.5) / rate_hz


def count_blocks(duration_s: float, *, correlation_time_s: float) -> int:
    """Return how many blocks a record makes; 0 where it is too short for an interval.

    10 to 60 blocks, each of at least one second and ten correlation times of the residuals. In a
    short record the second gives way, the ten correlation times do not.
    """
    independent_s = CORRELATION_TIMES_PER_BLOCK * correlation_time_s
    if duration_s < FEWEST_BLOCKS * independent_s:
        return 0
    n_blocks = int(duration_s / max(independent_s, SHORTEST_BLOCK_S))
    return min(max(n_blocks, FEWEST_BLOCKS), MOST_BLOCKS)
