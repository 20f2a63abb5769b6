"""Covariance of an estimate whose residuals are correlated in time.

Residuals of a joint are slow (muscle, drift), so the textbook formula, which
takes every sample as independent, gives intervals several times too narrow.
Sums over blocks much longer than the correlation are nearly independent.
"""

import numpy as np
from scipy import fft

#: A block spans at least this many correlation times of the residuals.
CORRELATION_TIMES_PER_BLOCK = 10.0
#: Shortest block wanted, s; gives way before the number of blocks falls under ``FEWEST_BLOCKS``.
SHORTEST_BLOCK_S = 1.0
#: Fewer blocks give no useful interval.
FEWEST_BLOCKS = 10
MOST_BLOCKS = 60


def block_sandwich(scores: np.ndarray, bread: np.ndarray, n_blocks: int) -> np.ndarray:
    """Return the covariance of the root of estimating equations by batch means.

    With scores ``psi_t = z_t r_t`` summed over consecutive blocks to ``g_b``
    and bread ``A = sum z_t x_t'``, the covariance is
    ``A^-1 (sum_b g_b g_b') A^-T n_b / (n_b - 1)``. Use Student's t with
    ``n_blocks - 1`` degrees of freedom; with p parameters and few blocks,
    ``n_blocks - p`` in both places.

    Parameters
    ----------
    scores : (n, p) float
        Instrument (or regressor) times residual, in the order of time.
    bread : (p, p) float
        Sum of instrument times regressor.
    n_blocks : int
        Number of blocks; their lengths differ by one sample at most.

    Returns
    -------
    (p, p) float
        Covariance of the p parameters.

    Raises
    ------
    ValueError
        When shapes disagree, ``n_blocks`` does not lie between 2 and n, or the
        bread is singular.

    Notes
    -----
    Heteroskedasticity and autocorrelation robust: Liang and Zeger 1986,
    doi:10.1093/biomet/73.1.13, with blocks of time as clusters.

    Examples
    --------
    The mean of four numbers, each its own block, has the usual variance:

    >>> x = np.array([1.0, 2.0, 3.0, 4.0])
    >>> cov = block_sandwich((x - x.mean())[:, None], np.array([[4.0]]), 4)
    >>> bool(np.isclose(cov[0, 0], x.var(ddof=1) / 4))
    True
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
    covariance: np.ndarray = half @ half.T * (n_blocks / (n_blocks - 1))
    return covariance


def autocorrelation(x: np.ndarray) -> np.ndarray:
    """Return the autocorrelation of a signal about its mean, one at lag zero.

    Parameters
    ----------
    x : (n,) float
        The signal.

    Returns
    -------
    (n,) float
        Lags 0 to n - 1, biased (divided by n at every lag); zero throughout
        for a constant.

    Examples
    --------
    >>> autocorrelation(np.array([1.0, -1.0, 1.0, -1.0])).round(3).tolist()
    [1.0, -0.75, 0.5, -0.25]
    """
    centred = np.asarray(x, dtype=float) - np.mean(x)
    power = float(centred @ centred)
    if power == 0.0:
        return np.zeros_like(centred)
    padded = fft.next_fast_len(2 * centred.size, real=True)
    spectrum = np.abs(fft.rfft(centred, padded)) ** 2
    correlation: np.ndarray = fft.irfft(spectrum, padded)[: centred.size] / power
    return correlation


def correlation_time(residual: np.ndarray, *, rate_hz: float) -> float:
    """Return the integral correlation time of a signal, in s.

    The autocorrelation of the centred signal is summed from lag zero (half
    weight) to its first crossing of zero.

    Parameters
    ----------
    residual : (n,) float
        The signal.
    rate_hz : float
        Sampling rate.

    Returns
    -------
    float
        s; zero for a signal that is zero.

    Examples
    --------
    >>> round(correlation_time(np.array([1.0, -1.0, 1.0, -1.0]), rate_hz=1.0), 3)
    0.5
    """
    correlation = autocorrelation(residual)
    if correlation[0] == 0:
        return 0.0
    negative = np.flatnonzero(correlation <= 0)
    end = int(negative[0]) if negative.size else correlation.size
    return (float(correlation[:end].sum()) - 0.5) / rate_hz


def count_blocks(duration_s: float, *, correlation_time_s: float) -> int:
    """Return how many blocks a record makes; 0 where it is too short for an interval.

    A block lasts at least one second and ten correlation times, and there are
    10 to 60 of them. In a short record the second gives way, the ten
    correlation times do not.

    Parameters
    ----------
    duration_s : float
        Length of the record.
    correlation_time_s : float
        Of the residuals, from :func:`correlation_time`.

    Examples
    --------
    >>> count_blocks(30.0, correlation_time_s=0.02)
    30
    >>> count_blocks(5.0, correlation_time_s=0.02)
    10
    >>> count_blocks(5.0, correlation_time_s=0.2)
    0
    """
    independent_s = CORRELATION_TIMES_PER_BLOCK * correlation_time_s
    if duration_s < FEWEST_BLOCKS * independent_s:
        return 0
    wanted = int(duration_s / max(independent_s, SHORTEST_BLOCK_S))
    return min(max(wanted, FEWEST_BLOCKS), MOST_BLOCKS)
