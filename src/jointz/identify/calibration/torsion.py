"""Angle that the goniometer shows when torque twists it and the joint stands still."""

import numpy as np

from jointz.core.study import Calibrated
from jointz.identify.calibration.calibration_step import (
    RefusedError,
    calibration_step,
    check_torque,
    checked_channels,
    step_series,
)
from jointz.identify.calibration.steady_fit import linear_fit
from jointz.results.bench.calibration_failure import CalibrationFailure
from jointz.results.bench.calibration_fit import CalibrationFit, decided

_KNOWN_GAIN = Calibrated(value=1.0, sd=0.0)
#: Motion of the encoder below this is of no account, rad/(N*m): 0.05 deg at 17 N*m.
_STILL = float(np.radians(0.05) / 17.0)
#: Beyond it the check decides nothing: 0.25 deg at 17 N*m.
_LARGEST_SD = float(np.radians(0.25) / 17.0)
_CLEAR_SDS = 3.0
_METHOD = "regression of the angle on the torque without friction; block sandwich"


@calibration_step("torsion", "angle_per_torque")
def fit_torsion(
    time: np.ndarray,
    angle: np.ndarray,
    torque: np.ndarray,
    *,
    motor_angle: np.ndarray | None = None,
    torque_gain: Calibrated = _KNOWN_GAIN,
) -> CalibrationFit:
    r"""Find the angle shown per torque on the joint, with the joint locked.

    Where the encoder moves, the joint moved by some share of that, between none (a strap gave
    way) and all of it (the lock did), but not by more than the angle shows: strap, joint and
    torsion all answer the torque in phase, so that no record tells them apart. Half of what is
    possible is taken off, and its range is in the sd. Where the angle shows nothing, the joint
    stood and a strap gave way. Where the angle goes against an encoder that moves more, nothing
    bounds the motion of the joint: ``joint_moved``.
    """
    channels = {"angle": angle, "torque": torque}
    if motor_angle is not None:
        channels["motor_angle"] = motor_angle
    time, angle, torque, *encoders = checked_channels(time, **channels)
    check_torque(torque)
    true_torque = torque / torque_gain.value
    columns = np.column_stack([true_torque, np.ones(time.size)])
    fit = linear_fit(time, angle, columns)
    shown = float(fit.values[0])
    parts = {"noise": fit.sd(0), "torque_gain": abs(shown) * torque_gain.sd / torque_gain.value}
    reported = []
    if encoders:
        (encoder,) = encoders
        values = np.linalg.lstsq(columns, encoder, rcond=None)[0]
        # The residual is steps of the encoder, friction in the lock or slack: nothing averages.
        moved_sd = float(np.std(encoder - columns @ values)) / float(np.std(true_torque))
        reported = [decided("motion_per_torque", float(values[0]), {"noise": moved_sd})]
        joint_moved = _joint_motion(shown, fit.sd(0), float(values[0]))
        parts["joint_motion"] = abs(joint_moved) / np.sqrt(12.0)
        shown -= 0.5 * joint_moved
    return CalibrationFit(
        step="torsion",
        entries=(decided("angle_per_torque", shown, parts, largest_sd=_LARGEST_SD),),
        reported=tuple(reported),
        method=_METHOD,
        n_samples=time.size,
        notes=() if reported else ("Without an encoder nothing tells whether the joint moved.",),
        settings={"torque_gain": torque_gain.value, "torque_gain_sd": torque_gain.sd},
        series=step_series(
            true_torque,
            np.degrees(angle),
            np.degrees(fit.values[1] + fit.values[0] * true_torque),
            x_label="torque on the joint (N*m)",
            y_label="angle shown (deg)",
        ),
    )


def _joint_motion(shown: float, sd: float, moved: float) -> float:
    """Return by how much the joint may have moved, at most, rad/(N*m)."""
    if abs(moved) <= max(abs(shown), _STILL):
        return moved
    if abs(shown) - _CLEAR_SDS * sd <= _STILL:
        return 0.0  # a strap gave way: of a joint that moved, the angle would show it
    if shown * moved > 0.0:
        return shown  # how much of it a strap, nothing tells
    raise RefusedError(
        CalibrationFailure.JOINT_MOVED,
        f"per N*m the encoder moves {np.degrees(moved):.3g} deg, the angle "
        f"{np.degrees(shown):.3g} deg",
    )
