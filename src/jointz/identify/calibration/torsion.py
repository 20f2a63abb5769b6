"""How much angle the goniometer shows when torque twists it and the joint stands still."""

import numpy as np

from jointz.core.study import Calibrated
from jointz.identify.calibration.steady_fit import (
    RefusedError,
    SteadyFit,
    checked_channels,
    linear_fit,
    thinned,
)
from jointz.results.bench.calibration_failure import CalibrationFailure
from jointz.results.bench.calibration_fit import CalibrationFit, CalibrationSeries, decided, failed

_NAMES = ("angle_per_torque",)
_KNOWN_GAIN = Calibrated(value=1.0, sd=0.0)
_LEAST_TORQUE_NM = 2.0
#: Torque of one direction must reach this share of that of the other.
_BOTH_WAYS = 0.3
#: Motion of the encoder below this is of no account, rad/(N*m): 0.05 deg at 17 N*m.
_STILL = float(np.radians(0.05) / 17.0)
#: Beyond it the check decides nothing: 0.25 deg at 17 N*m.
_LARGEST_SD = float(np.radians(0.25) / 17.0)
_CLEAR_SDS = 3.0
_METHOD = "regression of the angle on the torque without friction; block sandwich"


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
    try:
        channels = {"angle": angle, "torque": torque}
        if motor_angle is not None:
            channels["motor_angle"] = motor_angle
        return _fitted(checked_channels(time, **channels), torque_gain)
    except RefusedError as refused:
        return CalibrationFit("torsion", failed(_NAMES, refused.code, refused.detail))


def _fitted(channels: tuple[np.ndarray, ...], torque_gain: Calibrated) -> CalibrationFit:
    time, angle, torque = channels[:3]
    _check_torque(torque)
    true_torque = torque / torque_gain.value
    fit = _slope(time, angle, true_torque)
    shown = float(fit.values[0])
    parts = {"noise": fit.sd(0), "torque_gain": abs(shown) * torque_gain.sd / torque_gain.value}
    reported = []
    if len(channels) > 3:
        moved, moved_sd = _motion(channels[3], true_torque)
        reported = [decided("motion_per_torque", moved, {"noise": moved_sd})]
        joint_moved = _joint_motion(shown, fit.sd(0), moved)
        parts["joint_motion"] = abs(joint_moved) / np.sqrt(12.0)
        shown -= 0.5 * joint_moved
    line = fit.values[1] + fit.values[0] * true_torque
    return CalibrationFit(
        step="torsion",
        entries=(decided("angle_per_torque", shown, parts, largest_sd=_LARGEST_SD),),
        reported=tuple(reported),
        method=_METHOD,
        n_samples=time.size,
        notes=() if reported else ("Without an encoder nothing tells whether the joint moved.",),
        settings={"torque_gain": torque_gain.value, "torque_gain_sd": torque_gain.sd},
        series=CalibrationSeries(
            x=thinned(true_torque),
            measured=thinned(np.degrees(angle)),
            modelled=thinned(np.degrees(line)),
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
    detail = (
        f"per N*m the encoder moves {np.degrees(moved):.3g} deg, the angle "
        f"{np.degrees(shown):.3g} deg"
    )
    raise RefusedError(CalibrationFailure.JOINT_MOVED, detail)


def _slope(time: np.ndarray, angle: np.ndarray, torque: np.ndarray) -> SteadyFit:
    return linear_fit(time, angle, np.column_stack([torque, np.ones(time.size)]))


def _motion(encoder: np.ndarray, torque: np.ndarray) -> tuple[float, float]:
    """Return what the encoder moves per torque, and an sd as if what is left were one error.

    What is left is steps of the encoder, friction in the lock or slack: nothing that averages.
    """
    columns = np.column_stack([torque, np.ones(torque.size)])
    values = np.linalg.lstsq(columns, encoder, rcond=None)[0]
    left = encoder - columns @ values
    return float(values[0]), float(np.std(left)) / float(np.std(torque))


def _check_torque(torque: np.ndarray) -> None:
    high, low = float(np.quantile(torque, 0.98)), float(np.quantile(torque, 0.02))
    if high - low < _LEAST_TORQUE_NM:
        detail = f"torque from {low:.3g} to {high:.3g} N*m, expected {_LEAST_TORQUE_NM:g} or more"
        raise RefusedError(CalibrationFailure.NO_TORQUE, detail)
    if high < _BOTH_WAYS * -low or -low < _BOTH_WAYS * high:
        detail = f"torque from {low:.3g} to {high:.3g} N*m"
        raise RefusedError(CalibrationFailure.ONE_DIRECTION, detail)
