"""Filtered and calibrated signals of a recording on a uniform clock.

Angle and torque go through the same zero-phase filter, derivatives are taken
of the filtered angle, and only then is anything cut (SCIENCE trap 5): the
second-order model then holds for the filtered signals exactly.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import xarray as xr
from scipy.ndimage import map_coordinates

from jointz.core.codes import Exclusion
from jointz.core.errors import DataError
from jointz.core.study import CalibrationSpec, TorqueModelSpec
from jointz.gait.timestamps import find_gaps, rate_hz, resample_stretch, stretches
from jointz.identify.preparation.calibration import joint_angle, value_of
from jointz.kernels.derivatives import derivative
from jointz.kernels.filtering import SHORTEST_RECORD, lowpass_zero_phase

#: Rows of a stretch's signals.
ANGLE, VELOCITY, ACCELERATION, TORQUE = range(4)
_RATE_TOLERANCE = 1e-3
_SLOWEST_HZ = 10.0


@dataclass(frozen=True, slots=True)
class Stretch:
    """A run of filtered samples without a gap."""

    time: np.ndarray  # time stamps, s; kept because a clock may drift against its nominal rate
    signals: np.ndarray  # angle (rad), velocity (rad/s), acceleration (rad/s^2), torque (N*m)

    def nearest(self, times_s: np.ndarray) -> np.ndarray:
        """Return the index of the sample nearest to each time."""
        after = np.clip(np.searchsorted(self.time, times_s), 1, self.time.size - 1)
        earlier = times_s - self.time[after - 1] < self.time[after] - times_s
        return np.asarray(after - earlier)


@dataclass(frozen=True, slots=True)
class Conditioned:
    """Stretches of a recording from which windows are cut."""

    stretches: tuple[Stretch, ...]  # in order of time
    rate_hz: float  # sampling rate of all stretches
    guard_s: float  # distance of windows from the ends of a stretch, for the filter
    start_s: float  # first time stamp of the recording
    end_s: float  # last time stamp of the recording
    gaps: np.ndarray  # (n, 2) s: start and end of each gap in the time stamps

    def cut(
        self,
        starts_s: np.ndarray,
        *,
        before_s: float,
        after_s: float,
        rows: slice | Sequence[int] = slice(None),
        every: int = 1,
    ) -> tuple[np.ndarray, list[str]]:
        """Return one window for each start, NaN and a code if there is none."""
        starts = np.asarray(starts_s, dtype=float)
        n_before, n_after = (round(s * self.rate_hz) for s in (before_s, after_s))
        all_rows = len(self.stretches[0].signals) if self.stretches else 4
        n_rows = len(range(all_rows)[rows] if isinstance(rows, slice) else rows)
        offsets = np.arange(-n_before, n_after, every)
        windows = np.full((starts.size, n_rows, offsets.size), np.nan)
        codes = [""] * starts.size
        stretch_of = self._stretch_of(
            starts - before_s - self.guard_s, starts + after_s + self.guard_s
        )
        for index in np.unique(stretch_of[stretch_of >= 0]):
            chosen = np.flatnonzero(stretch_of == index)
            stretch = self.stretches[index]
            columns = stretch.nearest(starts[chosen])[:, None] + offsets
            for channel, row in enumerate(stretch.signals[rows]):
                windows[chosen, channel] = row[columns]
        for k in np.flatnonzero(stretch_of < 0):
            codes[k] = self._exclusion(starts[k] - before_s, starts[k] + after_s)
        return windows, codes

    def _stretch_of(self, begins: np.ndarray, ends: np.ndarray) -> np.ndarray:
        """Return the index of the stretch that contains each whole window, else -1."""
        if not self.stretches:
            return np.full(begins.size, -1)
        first = np.array([s.time[0] for s in self.stretches])
        last = np.array([s.time[-1] for s in self.stretches])
        half_a_sample = 0.5 / self.rate_hz
        index = np.searchsorted(first, begins + half_a_sample, side="right") - 1
        inside = (index >= 0) & (ends <= last[np.maximum(index, 0)] + half_a_sample)
        return np.where(inside, index, -1)

    def _exclusion(self, begin: float, end: float) -> str:
        if begin - self.guard_s < self.start_s or end + self.guard_s > self.end_s:
            return Exclusion.EDGE_OF_RECORD.value
        near = (self.gaps[:, 0] < end + self.guard_s) & (self.gaps[:, 1] > begin - self.guard_s)
        return Exclusion.GAP.value if near.any() else Exclusion.NOT_FINITE.value


def condition(
    recording: xr.Dataset,
    *,
    cutoff_hz: float,
    calibration: CalibrationSpec,
    target_rate_hz: float | None = None,
) -> Conditioned:
    """Filter, differentiate and calibrate a recording."""
    time = recording["time"].to_numpy()
    raw = np.stack(_calibrated(recording, calibration))
    own_rate = rate_hz(time)
    if cutoff_hz >= own_rate / 2:
        # Nobody samples a joint so slowly: most likely milliseconds were declared as seconds.
        slow = own_rate < _SLOWEST_HZ
        remedy = "Correct the unit of channels.time (ms?)." if slow else "Lower cutoff_hz."
        raise DataError(
            f"{recording.attrs.get('file')}: cutoff_hz {cutoff_hz:g} needs a sampling rate above "
            f"{2 * cutoff_hz:g} Hz, the recording has {own_rate:.4g} Hz. {remedy}",
            path=str(recording.attrs.get("file")),
        )
    lags = (value_of(calibration.angle_lag_s, 0.0), value_of(calibration.torque_lag_s, 0.0))
    rates_hz = (own_rate, target_rate_hz or own_rate)
    runs = [
        _stretch(time[part], raw[:, part], cutoff_hz=cutoff_hz, lags_s=lags, rates_hz=rates_hz)
        for part in stretches(time, np.isfinite(raw).all(axis=0))
        if part.stop - part.start > SHORTEST_RECORD
    ]
    return Conditioned(
        stretches=tuple(runs),
        rate_hz=target_rate_hz or own_rate,
        guard_s=1.0 / cutoff_hz,
        start_s=float(time[0]),
        end_s=float(time[-1]),
        gaps=find_gaps(time),
    )


def torque_from_current(
    recording: xr.Dataset,
    model: TorqueModelSpec,
    *,
    cutoff_hz: float,
    known: CalibrationSpec | None = None,
) -> tuple[np.ndarray, np.ndarray]:
    """Return joint torque from motor current (equations 3.3 and 4.1), and its friction."""
    current = recording["current"].to_numpy()
    velocity, acceleration = _motor_motion(recording, cutoff_hz)
    size = model.coulomb_friction + model.gear_friction * np.abs(current)
    known = known or CalibrationSpec()
    gain, share = value_of(known.torque_gain, 1.0), value_of(known.friction_gain, 1.0)
    stated = -size * np.sign(velocity) - model.viscous_friction * velocity
    friction = gain * share * stated
    driving = gain * model.bias + model.gear_ratio * model.torque_constant * current
    return driving + friction - gain * model.rotor_inertia * acceleration, friction


def _motor_motion(recording: xr.Dataset, cutoff_hz: float) -> tuple[np.ndarray, np.ndarray]:
    """Return velocity and acceleration of the output, from measured channels if possible.

    The sign of a differentiated velocity is taken after the low-pass; the
    acceleration is left as it is: the torque it goes into is low-passed later,
    with the angle and only once.
    """
    measured = ("motor_velocity", "motor_angle", "velocity", "angle")
    name = next(n for n in measured if n in recording)
    values = recording[name].to_numpy()
    if name.endswith("velocity"):
        velocity, acceleration = values, _derivative(recording, values)
    else:
        velocity = _derivative(recording, values, cutoff_hz=cutoff_hz)
        acceleration = _derivative(recording, _derivative(recording, values))
    if "motor_acceleration" in recording:
        acceleration = recording["motor_acceleration"].to_numpy()
    return velocity, acceleration


def _derivative(
    recording: xr.Dataset, values: np.ndarray, *, cutoff_hz: float | None = None
) -> np.ndarray:
    time = recording["time"].to_numpy()
    rate = rate_hz(time)
    result = np.full_like(values, np.nan)
    for part in stretches(time, np.isfinite(values)):
        if part.stop - part.start > SHORTEST_RECORD:
            run = values[part]
            if cutoff_hz is not None:
                run = lowpass_zero_phase(run, cutoff_hz=cutoff_hz, rate_hz=rate)
            result[part] = derivative(run, rate_hz=rate)
    return result


def _stretch(
    time: np.ndarray,
    raw: np.ndarray,
    *,
    cutoff_hz: float,
    lags_s: Sequence[float],
    rates_hz: tuple[float, float],
) -> Stretch:
    """Return angle and torque (2, n), filtered, with the derivatives of the angle."""
    own_rate, rate = rates_hz
    uniform, even = resample_stretch(time, raw, step_s=1.0 / own_rate)
    signals = np.empty((4, uniform.size))
    signals[[ANGLE, TORQUE]] = lowpass_zero_phase(even, cutoff_hz=cutoff_hz, rate_hz=own_rate)
    signals[VELOCITY] = derivative(signals[ANGLE], rate_hz=own_rate)
    signals[ACCELERATION] = derivative(signals[VELOCITY], rate_hz=own_rate)
    new_time = uniform
    if abs(rate / own_rate - 1) > _RATE_TOLERANCE:
        new_time = np.arange(uniform[0], uniform[-1], 1.0 / rate)
    lag_of_row_s = np.array([lags_s[0]] * 3 + [lags_s[1]])
    if new_time is not uniform or lag_of_row_s.any():
        # A cubic spline: the signals are low-passed, and a straight line would damp them.
        where = (new_time - uniform[0] + lag_of_row_s[:, None]) * own_rate
        signals = np.stack(
            [
                map_coordinates(row, [place], order=3, mode="nearest")
                for row, place in zip(signals, where, strict=True)
            ]
        )
    return Stretch(time=new_time, signals=signals)


def _calibrated(
    recording: xr.Dataset, calibration: CalibrationSpec
) -> tuple[np.ndarray, np.ndarray]:
    """Return angle and torque with their gains divided out; no torque is zero torque."""
    angle = recording["angle"].to_numpy()
    torque = recording["torque"].to_numpy() if "torque" in recording else np.zeros(angle.size)
    return joint_angle(angle, torque, calibration), torque / value_of(calibration.torque_gain, 1.0)
