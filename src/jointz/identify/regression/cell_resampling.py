"""Averages of a cell under resampled pulses, unperturbed strides and lags."""

import numpy as np
from scipy.stats import norm
from scipy.stats import t as student_t

from jointz.identify.preparation.calibration import twist_sd
from jointz.identify.preparation.cell_data import FitSettings, Windows, lag_sd
from jointz.identify.preparation.conditioning import TORQUE
from jointz.kernels.derivatives import derivative
from jointz.kernels.resampling import resample_weights

_LEAST_FREEDOM = 4


def redrawn_averages(
    windows: Windows, settings: FitSettings, rng: np.random.Generator, weights: np.ndarray
) -> np.ndarray:
    """Return the averages of filtered responses under exact resampling."""
    baseline, responses = windows.baseline, windows.responses()
    averages = np.asarray(weights @ responses.reshape(len(responses), -1))
    if baseline.has_strides and not settings.as_published:
        n_strides = baseline.n_sources
        draws = resample_weights(n_strides, settings.n_resamples, rng, block=baseline.block)
        # The mean of the drawn strides replaces the subtracted mean.
        change = baseline.weights(draws) - baseline.weights(np.ones((1, n_strides)))
        change *= (weights * windows.turned[:, 0, 0])[:, :, None]
        strides = baseline.windows.reshape(-1, averages.shape[1])
        averages -= change.reshape(len(weights), -1) @ strides
    averages = averages.reshape(len(weights), *responses.shape[1:])
    return _with_instrument_errors(averages, settings, rng)


def linear_averages(windows: Windows, settings: FitSettings) -> np.ndarray:
    """Return the averages under resampling, to first order in what each stride adds.

    A resample's average is that of its pulses minus the effects of its strides on the average of
    all pulses. The product of both changes, smaller by the number of pulses, is neglected, which
    takes a hundredth of the time. Deviations of n pulses are enlarged by ``sqrt(n / (n - 1))``,
    which a bootstrap lacks, and by the quantile of Student's t over the normal one, for fewer than
    five pulses that of five.
    """
    rng = np.random.default_rng(settings.seed)
    responses, baseline = windows.responses(), windows.baseline
    n = len(responses)
    flat = responses.reshape(n, -1)
    weights = resample_weights(n, settings.n_resamples, rng) - 1.0 / n
    averages = flat.mean(axis=0) + _widening(n) * (weights @ flat)
    if baseline.has_strides:
        count = baseline.n_sources
        draws = resample_weights(count, settings.n_resamples, rng, block=baseline.block)
        averages -= (draws * count - 1.0) @ _stride_influence(windows)
    averages = averages.reshape(len(weights), *responses.shape[1:])
    return _with_instrument_errors(averages, settings, rng)


def _widening(n: int) -> float:
    """Return the enlargement of the deviations of n pulses."""
    freedom = max(n - 1, _LEAST_FREEDOM)
    return float(np.sqrt(n / (n - 1)) * student_t.ppf(0.975, freedom) / norm.ppf(0.975))


def _stride_influence(windows: Windows) -> np.ndarray:
    """Return the change of the average baseline by one more stride, (n_sources, 4 * n)."""
    baseline = windows.baseline
    counts = np.maximum(baseline.valid.sum(axis=1), 1)
    share = windows.signs / (len(windows.signs) * counts)
    away = baseline.windows - baseline.mean()[:, None]
    away *= (share[:, None] * baseline.valid)[:, :, None, None]
    influence = np.zeros((baseline.n_sources, away.shape[2] * away.shape[3]))
    np.add.at(influence, baseline.sources.ravel(), away.reshape(-1, influence.shape[1]))
    return influence


def shifted(torque: np.ndarray, sensor_lag_s: np.ndarray, *, rate_hz: float) -> np.ndarray:
    """Return a low-passed torque later by a small time, to second order."""
    rate = derivative(torque, rate_hz=rate_hz)
    curvature = derivative(rate, rate_hz=rate_hz)
    return np.asarray(torque - sensor_lag_s * rate + 0.5 * sensor_lag_s**2 * curvature)


def shown_by(torque: np.ndarray, *, rate_hz: float) -> np.ndarray:
    """Return the apparent motion by 1 rad/(N*m) of torque seen as angle."""
    rate = derivative(torque, rate_hz=rate_hz)
    return np.stack([torque, rate, derivative(rate, rate_hz=rate_hz)], axis=-2)


def _with_instrument_errors(
    averages: np.ndarray, settings: FitSettings, rng: np.random.Generator
) -> np.ndarray:
    """Draw the remaining errors of lag and of torque seen as angle for each resample."""
    count, rate_hz = len(averages), settings.rate_hz
    if sd := lag_sd(settings.calibration):
        late = rng.normal(0.0, sd, size=(count, 1))
        averages[:, TORQUE] = shifted(averages[:, TORQUE], late, rate_hz=rate_hz)
    if sd := twist_sd(settings.calibration):
        twist = rng.normal(0.0, sd, size=(count, 1))
        averages[:, :TORQUE] -= twist[:, None] * shown_by(averages[:, TORQUE], rate_hz=rate_hz)
    return averages
