"""Perturbation pulses of a recording."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
import pandas as pd
import xarray as xr
from scipy.signal import find_peaks

from jointz.gait.timestamps import rate_hz, stretches
from jointz.kernels.derivatives import derivative
from jointz.kernels.filtering import SHORTEST_RECORD, lowpass_zero_phase
from jointz.kernels.levels import joined_runs, middle_of_levels

#: A command above this share of its largest value is a pulse.
_COMMAND_SHARE = 1e-3
#: A noisy command is a pulse above the first number of standard deviations of its noise where it
#: exceeds the second; it rests for at least this share of the record; longest gap in a pulse, s.
_NOISE_SD, _PULSE_SD, _LEAST_REST, _COMMAND_GAP_S = 3.0, 6.0, 0.6, 0.02
#: Median size of normal numbers, in standard deviations.
_MEDIAN_OF_SD = 0.6745
#: Least speed of a step, as a share of the fastest steps.
_SPEED_SHARE = 0.3
#: A step begins when its speed first exceeds this share of its peak.
_ONSET_SHARE = 0.1
_QUIET_S = 0.06
_BEFORE_S = 0.05
_TYPICAL_PULSE_S = 0.1
_SETTLE_S = (0.03, 0.08)
_QUIET_SHARE = 0.2
#: Longest rise of a step, and its prolongation by the filter in periods of the cut-off.
_RISE_S = 0.1
_SMEAR_PERIODS = 0.5
_SIZE_SHARE = 0.5


@dataclass(frozen=True, slots=True)
class Pulse:
    """One perturbation pulse."""

    onset_s: float  # commanded onset
    duration_s: float
    amplitude: float  # N*m, or rad for a step of the angle; signed, NaN if unknown
    timing_point: str = ""  # as in the pulse table

    @property
    def sign(self) -> float:
        """+1 or -1; responses are turned by it before they are averaged."""
        return -1.0 if self.amplitude < 0 else 1.0


def pulses_from_table(table: pd.DataFrame) -> tuple[Pulse, ...]:
    """Return the pulses of a pulse table, in order of time."""
    ordered = table.sort_values("onset_s", kind="stable")
    numbers = ordered[["onset_s", "duration_s", "amplitude_nm"]].to_numpy(dtype=float)
    points = ordered["timing_point"].astype(str)
    return tuple(
        Pulse(onset, duration, amplitude, point)
        for (onset, duration, amplitude), point in zip(numbers.tolist(), points, strict=True)
    )


def with_measured_amplitudes(pulses: tuple[Pulse, ...], recording: xr.Dataset) -> tuple[Pulse, ...]:
    """Return pulses with measured amplitudes in place of missing ones, whose sign is needed."""
    name = next((n for n in ("command", "torque") if n in recording), None)
    if name is None or not any(np.isnan(p.amplitude) for p in pulses):
        return pulses
    return tuple(
        replace(p, amplitude=measured_amplitude(recording, name, p)) if np.isnan(p.amplitude) else p
        for p in pulses
    )


def measured_amplitude(recording: xr.Dataset, name: str, pulse: Pulse) -> float:
    """Return the mean of a channel during a pulse less that before it, NaN if it has no samples."""
    time, torque = recording["time"].to_numpy(), recording[name].to_numpy()
    length_s = _TYPICAL_PULSE_S if np.isnan(pulse.duration_s) else pulse.duration_s
    moments = [pulse.onset_s - _BEFORE_S, pulse.onset_s, pulse.onset_s + length_s]
    first, onset, end = np.searchsorted(time, moments)
    before, during = torque[first:onset], torque[onset:end]
    before, during = before[np.isfinite(before)], during[np.isfinite(during)]
    return float(during.mean() - before.mean()) if before.size and during.size else np.nan


def pulses_from_command(recording: xr.Dataset) -> tuple[Pulse, ...]:
    """Return the runs in which the commanded torque is not zero."""
    time, samples = recording["time"].to_numpy(), recording["command"].to_numpy()
    if np.isfinite(samples).all():
        return _runs(time, samples)
    command = recording["command"].to_series().where(np.isfinite)
    before, after = command.ffill().fillna(0.0), command.bfill().fillna(0.0)
    return _runs(time, command.fillna(before.where(after != 0.0, 0.0)).to_numpy())


def pulses_from_reference(recording: xr.Dataset, unperturbed: xr.Dataset) -> tuple[Pulse, ...]:
    """Return the runs in which perturbed and unperturbed reference differ.

    The two recordings are aligned at their first samples; only what both cover
    is compared.
    """
    time = recording["time"].to_numpy()
    other = unperturbed["time"].to_numpy()
    since = time - time[0]
    common = since <= other[-1] - other[0]
    plain = np.interp(since, other - other[0], unperturbed["reference"].to_numpy())
    reference = recording["reference"].to_numpy()
    difference = np.nan_to_num(np.where(common, reference - plain, 0.0))
    # Rounding differs between two logs of the same reference.
    noise = 1e-6 * float(np.nanmax(np.abs(reference), initial=0.0))
    difference[np.abs(difference) <= noise] = 0.0
    return _runs(time, difference)


def pulses_from_angle(recording: xr.Dataset, *, cutoff_hz: float) -> tuple[Pulse, ...]:
    """Return the steps of the angle itself, for position perturbations.

    A step is a burst of speed after at least 60 ms of rest. It begins when the speed of the
    filtered angle first exceeds a tenth of its peak, because the filter of the analysis smears a
    step and its whole response must lie inside the window. A rise longer than 0.1 s is a movement.
    """
    time, angle = recording["time"].to_numpy(), recording["angle"].to_numpy()
    rate = rate_hz(time)
    longest = round((_RISE_S + _SMEAR_PERIODS / cutoff_hz) * rate)
    steps: list[Pulse] = []
    for part in stretches(time, np.isfinite(angle)):
        if part.stop - part.start > SHORTEST_RECORD:
            smooth = lowpass_zero_phase(angle[part], cutoff_hz=cutoff_hz, rate_hz=rate)
            speed = derivative(smooth, rate_hz=rate)
            steps += _steps(time[part], angle[part], speed, rate_hz=rate, longest=longest)
    if not steps:
        return ()
    typical = float(np.median([abs(p.amplitude) for p in steps]))
    return tuple(p for p in steps if abs(p.amplitude) > _SIZE_SHARE * typical)


def _runs(time: np.ndarray, command: np.ndarray) -> tuple[Pulse, ...]:
    size = np.abs(command)
    if not size.any():
        return ()
    idle = float(np.median(command))
    noisy = _noisy_runs(time, command - idle) if np.mean(command == idle) <= 0.5 else ()
    if noisy:
        return noisy
    # Not the maximum: a single spike must not hide the pulses.
    largest = float(np.percentile(size[size > 0], 99))
    runs = runs_of(size > _COMMAND_SHARE * largest)
    peaks = [a + int(np.argmax(size[a:b])) for a, b in runs]
    return _pulses(time, runs, [float(command[peak]) for peak in peaks])


def _noisy_runs(time: np.ndarray, command: np.ndarray) -> tuple[Pulse, ...]:
    """Return the pulses of a command with noise about 0; none if it does not rest there."""
    size = np.abs(command)
    resting = size < middle_of_levels(size)
    noise_sd = float(np.median(size[resting])) / _MEDIAN_OF_SD if resting.any() else np.inf
    if resting.mean() < _LEAST_REST or np.median(size[~resting]) <= _PULSE_SD * noise_sd:
        return ()
    runs = runs_of(size > _NOISE_SD * noise_sd)
    least = max(_PULSE_SD * noise_sd, _COMMAND_SHARE * float(np.percentile(size[~resting], 99)))
    runs = runs[[bool(size[a:b].max() > least) for a, b in runs]]
    runs = np.stack(joined_runs(runs[:, 0], runs[:, 1], _COMMAND_GAP_S * rate_hz(time)), axis=1)
    long = np.diff(runs)[:, 0] > 1
    runs = runs[long] if long.any() else runs
    amplitudes: list[float] = []
    for run in (command[a:b] for a, b in runs):
        half = 0.5 * np.abs(run).max()
        sign = np.sign(run[np.argmax(np.abs(run) >= half)])  # of the first phase
        amplitudes.append(float(np.median(run[sign * run >= half])))
    return _pulses(time, runs, amplitudes)


def runs_of(active: np.ndarray) -> np.ndarray:
    """Return the first sample of each run and the first sample after it, (n, 2)."""
    padded = np.concatenate([[False], active, [False]])
    return np.flatnonzero(padded[1:] != padded[:-1]).reshape(-1, 2)


def _pulses(time: np.ndarray, runs: np.ndarray, amplitudes: Sequence[float]) -> tuple[Pulse, ...]:
    ends = time[np.minimum(runs[:, 1], time.size - 1)]
    return tuple(
        Pulse(float(time[a]), float(end - time[a]), amplitude)
        for a, end, amplitude in zip(runs[:, 0], ends, amplitudes, strict=True)
    )


def _steps(
    time: np.ndarray, angle: np.ndarray, speed: np.ndarray, *, rate_hz: float, longest: int
) -> list[Pulse]:
    """Return the bursts of speed of at most ``longest`` samples after rest."""
    size = np.abs(speed)
    quiet, settled = round(_QUIET_S * rate_hz), [round(s * rate_hz) for s in _SETTLE_S]
    # If steps are rare, the percentile is a speed at rest.
    fast = max(float(np.percentile(size, 99)), _SPEED_SHARE * float(size.max()))
    peaks, _ = find_peaks(size, height=_SPEED_SHARE * fast, distance=max(quiet, 1))
    steps: list[Pulse] = []
    for peak in peaks:
        slow = size < _ONSET_SHARE * size[peak]
        below = np.flatnonzero(slow[:peak])
        onset = int(below[-1]) + 1 if below.size else 0
        ends_soon = slow[peak : onset + longest].any()
        if not ends_soon or onset < quiet or peak + settled[1] >= time.size:
            continue
        before = angle[onset - quiet : onset]
        step = float(np.median(angle[peak + settled[0] : peak + settled[1]]) - np.median(before))
        if np.ptp(before) < _QUIET_SHARE * abs(step):
            steps.append(Pulse(float(time[onset]), np.nan, step))
    return steps
