"""Unfiltered signals on an even clock, for estimators that model sensors and noise."""

from collections.abc import Sequence

import numpy as np
import xarray as xr

from jointz.core.channels import MOTION_SENSORS
from jointz.core.study import Calibrated, CalibrationSpec
from jointz.gait.timestamps import find_gaps, rate_hz, resample_stretch, stretches
from jointz.identify.preparation.calibration import value_of
from jointz.identify.preparation.cell_data import PARAMETERS, intrinsic_impedance
from jointz.identify.preparation.conditioning import Conditioned, Stretch
from jointz.identify.preparation.sources import FRICTION_OF_MODEL, Source
from jointz.kernels.derivatives import derivative
from jointz.kernels.filtering import SHORTEST_RECORD

#: Rows of the signals: angle, torque without friction, what friction adds, commanded torque.
RAW_ANGLE, DRIVING, FRICTION, COMMAND = range(4)
#: The two rows whose sum is the torque, and the first row of further sensors.
TORQUE_ROWS, SENSOR_ROWS = slice(DRIVING, FRICTION + 1), COMMAND + 1
#: Sensors of the joint's motion beside the goniometer; the velocity of the joint is the difference
#: of both segments'.
ENCODER, SHANK_VELOCITY, THIGH_VELOCITY = MOTION_SENSORS
JOINT_VELOCITY = "joint_velocity"
#: Faster recordings are averaged down to about this rate, far above the band of a leg.
_RATE_HZ = 500.0
_SAME_RATE = 1e-3
_MOTOR_MOTION = ("motor_velocity", "motor_angle")


def common_rate_hz(sources: Sequence[Source]) -> float:
    """Return the sampling rate to which all perturbed recordings can be brought."""
    perturbed = [s for s in sources if s.input.condition == "perturbed"] or list(sources)
    rates = [rate_hz(s.input.recording["time"].to_numpy()) for s in perturbed]
    return min(rate / max(1, round(rate / _RATE_HZ)) for rate in rates)


def raw_signals(
    source: Source,
    *,
    target_hz: float | None = None,
    sensors: Sequence[str] = (),
) -> Conditioned:
    """Return angle and torque as sampled, gains divided out, neither filtered nor shifted.

    Rows of further sensors follow, less their calibrated lags. The torque is that which moves the
    device's own inertia, too: it is a mass of the model.
    """
    time = source.input.recording["time"].to_numpy()
    rate = rate_hz(time)
    rows = np.stack([*_rows(source), *(sensor_signal(source, name) for name in sensors)])
    new_rate = target_hz or rate / max(1, round(rate / _RATE_HZ))
    every = max(1, round(rate / new_rate))
    runs = []
    for part in stretches(time, np.isfinite(np.delete(rows, COMMAND, axis=0)).all(axis=0)):
        if part.stop - part.start < max(2 * every, SHORTEST_RECORD):
            continue
        even, signals = resample_stretch(time[part], rows[:, part], step_s=1.0 / rate)
        runs.append(_at_rate(_averaged(even, signals, every), rate / every, new_rate))
    return Conditioned(
        stretches=tuple(runs),
        rate_hz=new_rate,
        guard_s=0.0,
        start_s=float(time[0]),
        end_s=float(time[-1]),
        gaps=find_gaps(time),
    )


def intrinsic_left_in(recording: xr.Dataset) -> tuple[str, ...]:
    """Return which of the device's K, B and J remain in the torque.

    The motor's angle gives the torque of stiffness and damping, its velocity that of damping; the
    inertia is part of the model.
    """
    if "motor_angle" in recording:
        return ("inertia",)
    if "motor_velocity" in recording:
        return ("stiffness", "inertia")
    return PARAMETERS


def _rows(source: Source) -> np.ndarray:
    recording, known = source.input.recording, source.input.calibration
    angle = recording["angle"].to_numpy()
    torque = _channel(recording, "torque", angle.size)
    friction = _channel(recording, FRICTION_OF_MODEL, angle.size)
    torque_gain, angle_gain = value_of(known.torque_gain, 1.0), value_of(known.angle_gain, 1.0)
    return np.stack(
        [
            angle / angle_gain,
            (torque - friction) / torque_gain - _intrinsic_torque(source),
            friction / torque_gain,
            np.nan_to_num(_channel(recording, "command", angle.size)),
        ]
    )


def sensor_signal(source: Source, name: str) -> np.ndarray:
    """Return what a sensor shows, its gain divided out, less its calibrated lag."""
    if name == JOINT_VELOCITY:
        thigh = sensor_signal(source, THIGH_VELOCITY)
        return np.asarray(sensor_signal(source, SHANK_VELOCITY) - thigh)
    known, recording = source.input.calibration, source.input.recording
    time = recording["time"].to_numpy()
    values = recording[name].to_numpy() / value_of(getattr(known, f"{name}_gain"), 1.0)
    lag_s = value_of(sensor_lag(known, name), 0.0)
    return np.asarray(values if lag_s == 0.0 else np.interp(time + lag_s, time, values))


def sensor_lag(known: CalibrationSpec, name: str) -> Calibrated | None:
    """Return the calibrated lag of a sensor; one gyroscope's stands for the other's."""
    lag: Calibrated | None = getattr(known, f"{name}_lag_s")
    if name == ENCODER or lag is not None:
        return lag
    return known.shank_velocity_lag_s or known.thigh_velocity_lag_s


def _intrinsic_torque(source: Source) -> np.ndarray:
    """Return the torque of the device's own K and B, N*m, from the motion of its motor."""
    recording = source.input.recording
    (stiffness, damping, _), _ = intrinsic_impedance(source.input.calibration)
    time = recording["time"].to_numpy()
    torque = np.zeros(time.size)
    name = next((n for n in _MOTOR_MOTION if n in recording), None)
    if name is None or not (stiffness or damping):
        return torque
    values = recording[name].to_numpy()
    for part in stretches(time, np.isfinite(values)):
        if part.stop - part.start < SHORTEST_RECORD:
            torque[part] = np.nan
            continue
        rate = rate_hz(time[part])
        velocity = values[part]
        if name == "motor_angle":
            torque[part] += stiffness * values[part]
            velocity = derivative(values[part], rate_hz=rate)
        elif "motor_angle" in recording:
            torque[part] += stiffness * recording["motor_angle"].to_numpy()[part]
        torque[part] += damping * velocity
    torque[~np.isfinite(values)] = np.nan
    return torque


def _channel(recording: xr.Dataset, name: str, n: int) -> np.ndarray:
    return recording[name].to_numpy() if name in recording else np.zeros(n)


def _averaged(time: np.ndarray, signals: np.ndarray, every: int) -> Stretch:
    """Average blocks of ``every`` samples; angle and torque pass the same filter."""
    if every == 1:
        return Stretch(time, signals)
    n = time.size // every
    blocks = signals[:, : n * every].reshape(len(signals), n, every)
    return Stretch(time[: n * every].reshape(n, every).mean(axis=1), blocks.mean(axis=2))


def _at_rate(stretch: Stretch, rate: float, new_rate: float) -> Stretch:
    """Interpolate signals linearly to another rate, if it differs by more than the tolerance."""
    if abs(rate / new_rate - 1.0) < _SAME_RATE:
        return stretch
    time = np.arange(stretch.time[0], stretch.time[-1], 1.0 / new_rate)
    return Stretch(time, np.stack([np.interp(time, stretch.time, row) for row in stretch.signals]))
