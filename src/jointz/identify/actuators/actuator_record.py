"""The samples of an actuator on its bench: checked, plausible, with an acceleration."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
import xarray as xr

from jointz.core.errors import DataError
from jointz.gait import timestamps
from jointz.identify.record.joint_record import Samples, gather_record

#: Largest magnitude an actuator of a joint can show, SI: what lies beyond is an overflow of
#: a sensor or its driver, not a quantity. Ten times what the largest robot joints reach.
LARGEST_PLAUSIBLE: Mapping[str, tuple[float, str]] = {
    "torque": (1e4, "N*m"),
    "current": (1e3, "A"),
    "velocity": (1e3, "rad/s"),
    "acceleration": (1e6, "rad/s^2"),
}

#: Variance of a third difference of white noise, over the noise's.
_THIRD_DIFFERENCE = 20.0


@dataclass(frozen=True, slots=True)
class ActuatorRecord:
    """Checked samples of one bench record, SI, all speeds at the output."""

    torque: np.ndarray  # torque by the sensor, times ``torque_sign``, N*m
    current: np.ndarray  # current of the motor, A
    velocity: np.ndarray | None  # of the output, rad/s
    acceleration: np.ndarray | None  # of the output, rad/s^2
    acceleration_from: str  # ``given``, ``velocity`` (differentiated) or ``none``
    # share of the acceleration's variance that is noise of the velocity; 0 where it was given
    acceleration_noise_share: float
    rate_hz: float | None  # sampling rate, where known
    time: np.ndarray  # s; sample numbers if the rate is unknown
    sha256: str  # hash of the file, where known
    n_gaps: int = 0  # gaps in the time stamps, which are left out then


def gather_actuator(
    recording: Samples | None,
    arrays: Mapping[str, npt.ArrayLike | None],
    *,
    rate_hz: float | None,
    needs_velocity: bool,
    torque_sign: float,
) -> ActuatorRecord:
    """Check the samples and find the acceleration."""
    source = recording if recording is not None else arrays
    has_time = "time" in source and source["time"] is not None
    if rate_hz is not None and has_time:
        raise DataError("identify_actuator: expected time stamps or rate_hz, got both. Drop one.")
    n_gaps = _n_gaps(source["time"]) if has_time else 0
    if n_gaps:
        arrays = {name: values for name, values in arrays.items() if name != "time"}
        has_time = False
    timed = has_time or rate_hz is not None
    record = gather_record(
        recording,
        arrays,
        rate_hz=None if has_time else (1.0 if rate_hz is None else rate_hz),
        where="identify_actuator",
        required=("current", "torque", *(("velocity",) if needs_velocity else ())),
    )
    _check_plausible(source)
    channels = record.channels
    rate = record.rate_hz if timed else None
    velocity = channels.get("velocity")
    acceleration, origin, noise = channels.get("acceleration"), "given", 0.0
    if acceleration is None and velocity is not None and rate is not None and velocity.size > 3:
        acceleration, origin = np.gradient(velocity, 1.0 / rate), "velocity"
        noise = _noise_share(velocity, acceleration, rate)
    return ActuatorRecord(
        torque=torque_sign * channels["torque"],
        current=channels["current"],
        velocity=velocity,
        acceleration=acceleration,
        acceleration_from=origin if acceleration is not None else "none",
        acceleration_noise_share=noise,
        rate_hz=rate,
        time=record.time,
        sha256=record.sha256,
        n_gaps=n_gaps,
    )


def _n_gaps(time: npt.ArrayLike | None) -> int:
    """Return the number of gaps in time stamps that increase; others are refused later."""
    stamps = np.ravel(np.asarray(time))
    if stamps.dtype.kind not in "if" or not (np.diff(stamps) > 0).all():
        return 0
    return len(timestamps.find_gaps(stamps))


def _check_plausible(source: Samples | Mapping[str, npt.ArrayLike | None]) -> None:
    """Refuse values that no actuator reaches, all channels in one message."""
    first_row = int(source.attrs.get("first_row", 1)) if isinstance(source, xr.Dataset) else 1
    problems: list[str] = []
    worst: tuple[str, int] | None = None
    for name, (bound, unit) in LARGEST_PLAUSIBLE.items():
        if name not in source or source[name] is None:
            continue
        values = np.asarray(source[name], dtype=float)
        beyond = np.flatnonzero(np.abs(values) > bound)
        if not beyond.size:
            continue
        row = first_row + int(beyond[0])
        worst = worst or (name, row)
        problems.append(
            f"row {row}: {name} is {values[beyond[0]]:.6g} {unit}; no actuator of a joint goes "
            f"beyond {bound:g} {unit} ({beyond.size} of {values.size} rows do). The sensor or its "
            "driver overflowed, or the unit is wrong: give the unit, or leave the log out."
        )
    if worst is not None:
        raise DataError(" ".join(problems), channel=worst[0], row=worst[1])


def velocity_noise(velocity: np.ndarray) -> float:
    """Return the sd of white noise in a velocity, from its third differences.

    White noise (quantisation is nearly that) shows in third differences, where
    motion hardly does; motion near half the rate counts as noise.
    """
    if velocity.size <= 3:
        return 0.0
    return float(np.sqrt(np.var(np.diff(velocity, 3)) / _THIRD_DIFFERENCE))


def _noise_share(velocity: np.ndarray, acceleration: np.ndarray, rate_hz: float) -> float:
    """Return the share of noise in the variance of the differenced velocity, 0..1."""
    power = float(np.var(acceleration))
    noise = velocity_noise(velocity) ** 2
    return min(0.5 * noise * rate_hz**2 / power, 1.0) if power > 0.0 else 1.0
