"""Course that all calibration steps share: checked channels, refusals, samples of the figure."""

from collections.abc import Callable
from functools import wraps
from typing import ParamSpec

import numpy as np

from jointz.core.errors import DataError
from jointz.results.bench.calibration_failure import CalibrationFailure
from jointz.results.bench.calibration_fit import CalibrationFit, CalibrationSeries, failed

#: More samples without a number than this share, and the record is refused.
_MOST_LOST = 0.1
_FEWEST_SAMPLES = 100
_LEAST_TORQUE_NM = 2.0
#: Torque of one direction must reach this share of that of the other.
_BOTH_WAYS = 0.3
_SERIES_POINTS = 2000

P = ParamSpec("P")


class RefusedError(Exception):
    """A record that gives no result: the code and the detail."""

    def __init__(self, code: CalibrationFailure, detail: str) -> None:
        super().__init__(detail)
        self.code = code
        self.detail = detail


def calibration_step(
    step: str, *entries: str
) -> Callable[[Callable[P, CalibrationFit]], Callable[P, CalibrationFit]]:
    """Give all entries of a step the code of the refusal where its record is refused."""

    def decorate(fit: Callable[P, CalibrationFit]) -> Callable[P, CalibrationFit]:
        @wraps(fit)
        def fit_or_failure(*args: P.args, **kwargs: P.kwargs) -> CalibrationFit:
            try:
                return fit(*args, **kwargs)
            except RefusedError as refusal:
                return CalibrationFit(step, failed(entries, refusal.code, refusal.detail))

        return fit_or_failure

    return decorate


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
    worst = min(values, key=lambda name: np.isfinite(values[name]).sum())
    if lost > _MOST_LOST:
        detail = f"{lost:.0%} of the samples have no number, most in {worst}"
        raise RefusedError(CalibrationFailure.NOT_FINITE, detail)
    if good.sum() < _FEWEST_SAMPLES:
        detail = f"expected {_FEWEST_SAMPLES} samples or more, found {int(good.sum())}"
        raise RefusedError(CalibrationFailure.TOO_SHORT, detail)
    return (time[good], *(channel[good] for channel in values.values()))


def check_torque(torque: np.ndarray) -> None:
    """Refuse a torque that hardly changes, or that acts in one direction only."""
    low, high = (float(v) for v in np.quantile(torque, [0.02, 0.98]))
    reach = f"torque from {low:.3g} to {high:.3g} N*m"
    if high - low < _LEAST_TORQUE_NM:
        detail = f"{reach}, expected {_LEAST_TORQUE_NM:g} or more"
        raise RefusedError(CalibrationFailure.NO_TORQUE, detail)
    if high < _BOTH_WAYS * -low or -low < _BOTH_WAYS * high:
        raise RefusedError(CalibrationFailure.ONE_DIRECTION, reach)


def check_same_sign(angle: np.ndarray, other: np.ndarray, name: str) -> None:
    """Refuse two channels that move against each other."""
    correlation = float(np.corrcoef(angle, other)[0, 1])
    if correlation < 0.0:
        detail = f"correlation of angle and {name} {correlation:.2f}"
        raise RefusedError(CalibrationFailure.OPPOSITE_SIGN, detail)


def middle_range(values: np.ndarray) -> float:
    """Return the range of a channel without the 2 % at either end."""
    return float(np.subtract(*np.quantile(values, [0.98, 0.02])))


def weighted_moments(
    weights: np.ndarray, values: np.ndarray, variances: np.ndarray | float = 0.0
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return mean of weighted candidates, and the sds within and between the candidates."""
    mean = weights @ values
    within = np.sqrt(weights @ np.broadcast_to(variances, values.shape))
    return mean, within, np.sqrt(weights @ (values - mean) ** 2)


def step_series(
    x: np.ndarray, measured: np.ndarray, modelled: np.ndarray, *, x_label: str, y_label: str
) -> CalibrationSeries:
    """Return the samples of a step's figure, thinned."""

    def thinned(values: np.ndarray) -> tuple[float, ...]:
        return tuple(float(v) for v in values[:: max(1, -(-values.size // _SERIES_POINTS))])

    return CalibrationSeries(thinned(x), thinned(measured), thinned(modelled), x_label, y_label)
