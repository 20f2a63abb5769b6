"""Records checked, and straight-line fits whose sd takes noise that is correlated in time."""

from dataclasses import dataclass

import numpy as np
from scipy.stats import t as student_t

from jointz.core.errors import DataError
from jointz.kernels.block_sandwich import (
    CORRELATION_TIMES_PER_BLOCK,
    block_sandwich,
    correlation_time,
    count_blocks,
)
from jointz.results.bench.calibration_failure import CalibrationFailure
from jointz.results.estimates import REACH_95

#: More samples without a number than this share, and the record is refused.
_MOST_LOST = 0.1
_FEWEST_SAMPLES = 100
_SPARE_BLOCKS = 6
#: Residuals this small against the signal are rounding: their correlation means nothing.
_ROUNDING = 1e-9


class RefusedError(Exception):
    """A record that tells nothing: a code and what was found; caught at the step's door."""

    def __init__(self, code: CalibrationFailure, detail: str) -> None:
        super().__init__(detail)
        self.code = code
        self.detail = detail


@dataclass(frozen=True, slots=True, eq=False)
class SteadyFit:
    """A linear fit."""

    values: np.ndarray  # coefficients
    covariance: np.ndarray  # of their error
    residual: np.ndarray  # measured minus modelled
    n_blocks: int  # independent blocks behind the covariance

    def sd(self, i: int) -> float:
        """Return the sd of a coefficient."""
        return float(np.sqrt(self.covariance[i, i]))


def checked_channels(time: np.ndarray, **channels: np.ndarray) -> tuple[np.ndarray, ...]:
    """Return time and channels where all have a number."""
    time = np.asarray(time, dtype=float)
    values = {name: np.asarray(channel, dtype=float) for name, channel in channels.items()}
    for name, channel in values.items():
        if channel.shape != time.shape or time.ndim != 1:
            raise DataError(
                f"calibration: expected time and {name} of one length, got {time.shape} and "
                f"{channel.shape}. Give channels of one record."
            )
    if not np.isfinite(time).all() or np.any(np.diff(time) <= 0.0):
        raise DataError("calibration: expected time stamps that increase. Sort the record first.")
    good = np.isfinite(list(values.values())).all(axis=0)
    lost = 1.0 - float(good.mean()) if good.size else 0.0
    if lost > _MOST_LOST:
        worst = min(values, key=lambda name: np.isfinite(values[name]).sum())
        detail = f"{lost:.0%} of the samples have no number, most in {worst}"
        raise RefusedError(CalibrationFailure.NOT_FINITE, detail)
    if good.sum() < _FEWEST_SAMPLES:
        detail = f"expected {_FEWEST_SAMPLES} samples or more, found {int(good.sum())}"
        raise RefusedError(CalibrationFailure.TOO_SHORT, detail)
    return (time[good], *(channel[good] for channel in values.values()))


def linear_fit(time: np.ndarray, y: np.ndarray, regressors: np.ndarray) -> SteadyFit:
    """Fit a signal by regressors, least squares, with a block sandwich for the covariance."""
    scale = np.sqrt(np.mean(regressors**2, axis=0))
    scaled = regressors / scale
    values = np.linalg.lstsq(scaled, y, rcond=None)[0]
    residual = y - scaled @ values
    covariance, n_blocks = sandwich(time, scaled, residual, size=float(np.std(y)))
    return SteadyFit(values / scale, covariance / np.outer(scale, scale), residual, n_blocks)


def sandwich(
    time: np.ndarray, derivatives: np.ndarray, residual: np.ndarray, *, size: float
) -> tuple[np.ndarray, int]:
    """Return the covariance of a least-squares fit, and the blocks behind it.

    It is widened to what Student's t asks of so few blocks, so that twice the sd is a 95 %
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


def thinned(values: np.ndarray, most: int = 2000) -> tuple[float, ...]:
    """Return at most so many samples, for a figure."""
    step = max(1, -(-values.size // most))
    return tuple(float(v) for v in values[::step])
