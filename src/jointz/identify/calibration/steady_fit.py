"""Straight-line fits whose sd takes noise that is correlated in time."""

from dataclasses import dataclass

import numpy as np
from scipy.stats import t as student_t

from jointz.identify.calibration.calibration_step import RefusedError
from jointz.kernels.block_sandwich import (
    CORRELATION_TIMES_PER_BLOCK,
    block_sandwich,
    correlation_time,
    count_blocks,
)
from jointz.results.bench.calibration_failure import CalibrationFailure
from jointz.results.estimates import REACH_95

_SPARE_BLOCKS = 6
#: Residuals this small against the signal are rounding: their correlation means nothing.
_ROUNDING = 1e-9


@dataclass(frozen=True, slots=True, eq=False)
class SteadyFit:
    """A linear fit."""

    values: np.ndarray  # coefficients
    covariance: np.ndarray  # of the errors of ``values``
    n_blocks: int  # independent blocks behind the covariance

    def sd(self, i: int) -> float:
        """Return the sd of a coefficient."""
        return float(np.sqrt(self.covariance[i, i]))


def linear_fit(time: np.ndarray, y: np.ndarray, regressors: np.ndarray) -> SteadyFit:
    """Fit a signal by regressors, least squares, with a block sandwich for the covariance."""
    scale = np.sqrt(np.mean(regressors**2, axis=0))
    scaled = regressors / scale
    values = np.linalg.lstsq(scaled, y, rcond=None)[0]
    residual = y - scaled @ values
    covariance, n_blocks = sandwich(time, scaled, residual, size=float(np.std(y)))
    return SteadyFit(values / scale, covariance / np.outer(scale, scale), n_blocks)


def sandwich(
    time: np.ndarray, derivatives: np.ndarray, residual: np.ndarray, *, size: float
) -> tuple[np.ndarray, int]:
    """Return the covariance of a least-squares fit, and the blocks behind it.

    It is widened by Student's t for so few blocks: 1.96 sd reach to the ends of a 95 %
    interval.
    """
    p = derivatives.shape[1]
    n_blocks = blocks_for(time, residual, size=size, fitted=p)
    bread = derivatives.T @ derivatives
    covariance = block_sandwich(derivatives * residual[:, None], bread, n_blocks)
    df = n_blocks - p
    widened = (n_blocks - 1) / df * (float(student_t.ppf(0.975, df)) / REACH_95) ** 2
    return covariance * widened, n_blocks


def blocks_for(time: np.ndarray, residual: np.ndarray, *, size: float, fitted: int) -> int:
    """Return how many independent blocks a residual makes."""
    duration_s = float(time[-1] - time[0])
    rate = (time.size - 1) / duration_s
    exact = float(np.std(residual)) <= _ROUNDING * size
    correlated_s = 0.0 if exact else correlation_time(residual, rate_hz=rate)
    n_blocks = count_blocks(duration_s, correlation_time_s=correlated_s)
    if n_blocks == 0:
        # Blocks of half the usual length; Student's t takes their small number.
        n_blocks = int(duration_s / (0.5 * CORRELATION_TIMES_PER_BLOCK * correlated_s))
    if n_blocks < fitted + _SPARE_BLOCKS:
        detail = (
            f"{duration_s:.3g} s, of which the residual is correlated over {correlated_s:.2g} s"
        )
        raise RefusedError(CalibrationFailure.TOO_SHORT, detail)
    return n_blocks
