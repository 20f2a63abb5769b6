"""Whether goniometer and encoder can sit on one rigid hinge."""

from collections.abc import Callable

import numpy as np

from jointz.identify.calibration.steady_fit import RefusedError, linear_fit
from jointz.results.bench.calibration_failure import CalibrationFailure

_LEAST_SWING_RAD = float(np.radians(3.0))
#: Samples at the end of the range, share of all, and what the encoder does meanwhile, share of
#: its swing.
_CLIPPED_SHARE, _GOES_ON = 0.01, 0.1
_PLAY_RAD, _CLEAR_SDS = float(np.radians(0.25)), 5.0
_SLIP_RAD = float(np.radians(1.0))
#: What is left after the fit, over means of 0.1 s.
_SMOOTH_S, _LEFT_RAD, _LEFT_SHARE = 0.1, float(np.radians(0.6)), 0.08


def check_swing(angle: np.ndarray, encoder: np.ndarray) -> None:
    """Refuse a record without motion, with opposite signs or with a sensor at its end."""
    for name, values in (("angle", angle), ("motor_angle", encoder)):
        swing = float(np.subtract(*np.quantile(values, [0.98, 0.02])))
        if swing < _LEAST_SWING_RAD:
            detail = f"{name} swings by {np.degrees(swing):.2g} deg, expected 3 deg or more"
            raise RefusedError(CalibrationFailure.NO_MOTION, detail)
    together = float(np.corrcoef(angle, encoder)[0, 1])
    if together < 0.0:
        detail = f"correlation of angle and encoder {together:.2f}"
        raise RefusedError(CalibrationFailure.OPPOSITE_SIGN, detail)
    for end, at in (("highest", angle == angle.max()), ("lowest", angle == angle.min())):
        goes_on = float(np.ptp(encoder[at])) / float(np.ptp(encoder))
        if at.mean() > _CLIPPED_SHARE and goes_on > _GOES_ON:
            detail = f"{at.mean():.1%} of the samples have the {end} angle"
            raise RefusedError(CalibrationFailure.CLIPPED, detail)


def check_rigid(time: np.ndarray, encoder: np.ndarray, residual: np.ndarray) -> None:
    """Refuse what no rigid hinge leaves."""
    velocity = np.gradient(encoder, time)
    columns = np.column_stack([np.sign(velocity), velocity, encoder, np.ones(time.size)])
    without = residual - columns @ np.linalg.lstsq(columns, residual, rcond=None)[0]
    apart = float(np.ptp(_block_values(time, without, 1.0, np.median)))
    if apart > _SLIP_RAD:
        detail = f"its difference from the encoder moves by {np.degrees(apart):.2g} deg"
        raise RefusedError(CalibrationFailure.SLIP, detail)
    play = linear_fit(time, residual, columns)
    width, sd = abs(float(play.values[0])), play.sd(0)
    if width > max(_PLAY_RAD, _CLEAR_SDS * sd):
        detail = f"the angle differs by {np.degrees(2.0 * width):.2g} deg between the directions"
        raise RefusedError(CalibrationFailure.PLAY, detail)
    left = float(np.std(_block_values(time, residual, _SMOOTH_S, np.mean)))
    if left > max(_LEFT_RAD, _LEFT_SHARE * float(np.std(encoder))):
        detail = f"{np.degrees(left):.2g} deg RMS are left"
        raise RefusedError(CalibrationFailure.NOT_RIGID, detail)


def _block_values(
    time: np.ndarray, values: np.ndarray, length_s: float, of: Callable[[np.ndarray], float]
) -> np.ndarray:
    blocks = ((time - time[0]) / length_s).astype(int)
    cuts = np.flatnonzero(np.diff(blocks)) + 1
    parts = np.split(values, cuts)
    enough = 0.5 * float(np.median([part.size for part in parts]))
    parts = [part for part in parts if part.size >= enough]
    return np.array([of(part) for part in parts])
