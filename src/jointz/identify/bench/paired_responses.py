"""Responses of pairs of runs: perturbed less unperturbed."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import xarray as xr
from scipy.ndimage import map_coordinates

from jointz.core.errors import DataError
from jointz.core.study import CalibrationSpec
from jointz.identify.bench.bench_records import white_noise_sd
from jointz.identify.preparation.conditioning import Stretch, condition
from jointz.identify.preparation.pulses import Pulse, pulses_from_command, with_measured_amplitudes
from jointz.identify.record.joint_record import Samples, gather_record

_SAME_RATE = 0.01
#: Of a fourth-order low-pass, run both ways.
_ROLL_OFF = 8


@dataclass(frozen=True, slots=True)
class PairResponses:
    """The responses of one pair of runs."""

    pulses: tuple[Pulse, ...]  # pulses in both runs, times on the clock of the perturbed run
    # (pulse, 4, n) angle (rad), velocity (rad/s), acceleration (rad/s^2) and torque (N*m), the
    # unperturbed run subtracted
    windows: np.ndarray
    left_out: tuple[tuple[Pulse, str], ...]  # excluded pulses with the reason
    shift_s: float  # start of the reference in the unperturbed run minus that in the perturbed run
    rate_hz: float  # sampling rate of both runs
    # rad/s^2: noise of the acceleration of a response, by the white noise of both angles
    acceleration_noise_sd: float


@dataclass(frozen=True, slots=True)
class _Run:
    """One run, filtered."""

    stretch: Stretch
    reference: np.ndarray  # channel by which the runs are aligned
    recording: xr.Dataset
    rate_hz: float
    guard_s: float  # distance of windows from the ends of the run

    @property
    def start_s(self) -> float:
        return float(self.stretch.time[0])

    def holds(self, begin_s: float, end_s: float) -> bool:
        """Return whether a window lies inside, away from the edges that the filter distorts."""
        first, last = self.start_s + self.guard_s, float(self.stretch.time[-1]) - self.guard_s
        half_a_sample = 0.5 / self.rate_hz
        return begin_s >= first - half_a_sample and end_s <= last + half_a_sample


def pair_responses(
    pair: tuple[Samples, Samples],
    pulses: Sequence[Pulse] | None,
    *,
    align: str,
    window_s: float,
    cutoff_hz: float,
    where: str,
) -> PairResponses:
    """Return the response to every pulse that both runs of a pair hold."""
    needed = () if pulses is not None else ("command",)
    unperturbed = _run(pair[0], f"{where}, unperturbed", align, cutoff_hz=cutoff_hz)
    perturbed = _run(pair[1], f"{where}, perturbed", align, needed, cutoff_hz=cutoff_hz)
    check_same_rate(where, unperturbed.rate_hz, perturbed.rate_hz)
    planned = pulses_from_command(perturbed.recording) if pulses is None else tuple(pulses)
    planned = with_measured_amplitudes(planned, perturbed.recording)
    shift_s = _shift(unperturbed, perturbed, planned, window_s=window_s, where=where)
    kept: list[Pulse] = []
    windows: list[np.ndarray] = []
    left_out: list[tuple[Pulse, str]] = []
    ends = [*(later.onset_s for later in planned[1:]), np.inf]
    for pulse, end_s in zip(planned, ends, strict=False):
        if end_s < pulse.onset_s + window_s:
            left_out.append((pulse, "another pulse begins inside its window"))
            continue
        cut = _difference(unperturbed, perturbed, pulse, shift_s, window_s)
        if cut is None:
            left_out.append((pulse, "its window runs past the end of a run"))
        else:
            kept.append(pulse)
            windows.append(cut)
    n_samples = round(window_s * perturbed.rate_hz)
    return PairResponses(
        pulses=tuple(kept),
        windows=np.array(windows).reshape(-1, 4, n_samples),
        left_out=tuple(left_out),
        shift_s=shift_s,
        rate_hz=perturbed.rate_hz,
        acceleration_noise_sd=_acceleration_noise_sd(unperturbed, perturbed, cutoff_hz),
    )


def check_same_rate(where: str, expected_hz: float, rate_hz: float) -> None:
    """Refuse runs of different sampling rates."""
    if abs(rate_hz - expected_hz) > _SAME_RATE * expected_hz:
        raise DataError(
            f"{where}: expected {expected_hz:.5g} Hz in all runs, got {rate_hz:.5g} Hz. Fit runs "
            "of one sampling rate at a time."
        )


def _run(
    samples: Samples,
    where: str,
    align: str,
    needed: tuple[str, ...] = (),
    *,
    cutoff_hz: float,
) -> _Run:
    required = ("time", "angle", "torque", align, *needed)
    record = gather_record(
        samples, dict.fromkeys(required), rate_hz=None, where=where, required=required
    )
    recording = xr.Dataset(
        {name: ("time", values) for name, values in record.channels.items()},
        coords={"time": record.time},
        attrs={"file": where},
    )
    signals = condition(recording, cutoff_hz=cutoff_hz, calibration=CalibrationSpec())
    if not signals.stretches:
        raise DataError(f"{where}: {record.time.size} samples are too few. Record longer.")
    reference = record.channels[align]
    return _Run(signals.stretches[0], reference, recording, signals.rate_hz, signals.guard_s)


def _shift(
    unperturbed: _Run,
    perturbed: _Run,
    pulses: Sequence[Pulse],
    *,
    window_s: float,
    where: str,
) -> float:
    """Return the shift between the runs, by their references outside the pulses."""
    time, rate = perturbed.stretch.time, perturbed.rate_hz
    keep = np.ones(time.size, dtype=bool)
    for pulse in pulses:
        length_s = window_s if np.isnan(pulse.duration_s) else pulse.duration_s
        keep &= (time < pulse.onset_s - 1.0 / rate) | (time > pulse.onset_s + length_s + 1.0 / rate)
    seconds = unperturbed.stretch.time - unperturbed.start_s
    even = np.arange(0.0, seconds[-1] + 0.5 / rate, 1.0 / rate)
    other = np.interp(even, seconds, unperturbed.reference)
    return reference_shift(perturbed.reference, other, rate_hz=rate, keep=keep, where=where)


def _difference(
    unperturbed: _Run, perturbed: _Run, pulse: Pulse, shift_s: float, window_s: float
) -> np.ndarray | None:
    """Return (4, n) perturbed less unperturbed, None where a run does not hold the window."""
    n = round(window_s * perturbed.rate_hz)
    if not perturbed.holds(pulse.onset_s, pulse.onset_s + window_s):
        return None
    first = int(perturbed.stretch.nearest(np.array([pulse.onset_s]))[0])
    elapsed = perturbed.stretch.time[first : first + n] - perturbed.start_s + shift_s
    if not unperturbed.holds(unperturbed.start_s + elapsed[0], unperturbed.start_s + elapsed[-1]):
        return None
    # A cubic spline: the signals are low-passed, and a straight line would damp them.
    places = [elapsed * unperturbed.rate_hz]
    signals = unperturbed.stretch.signals
    plain = np.stack([map_coordinates(s, places, order=3, mode="nearest") for s in signals])
    return np.asarray(perturbed.stretch.signals[:, first : first + n] - plain)


def _acceleration_noise_sd(unperturbed: _Run, perturbed: _Run, cutoff_hz: float) -> float:
    """Return the sd that noise of both angles has after low-pass and two derivatives."""
    runs = (unperturbed, perturbed)
    power = sum(white_noise_sd(run.recording["angle"].to_numpy()) ** 2 for run in runs)
    frequency = np.linspace(0.0, perturbed.rate_hz / 2.0, 2000)
    gain = (2.0 * np.pi * frequency) ** 2 / (1.0 + (frequency / cutoff_hz) ** _ROLL_OFF)
    return float(np.sqrt(power * np.mean(gain**2)))


#: How far apart the beginnings are looked for, at least this share of the shorter run in common.
_SEARCH_S = 5.0
_LEAST_COMMON = 0.5
_COARSE_HZ = 100.0
#: Shifts whose error is within this share of the reference's variance of the best are as good:
#: a periodic reference has many, the smallest is taken.
_AS_GOOD = 1e-3
#: Larger disagreement, as a share of the reference's variance, is another reference.
_MOST_DIFFERENT = 0.05
_PASSES = 10
_CONVERGED_S = 1e-9


def reference_shift(
    reference: np.ndarray, other: np.ndarray, *, rate_hz: float, keep: np.ndarray, where: str
) -> float:
    """Return the delay of the other run along the reference, s."""
    variance = float(np.var(reference[keep])) if keep.any() else 0.0
    if variance <= 1e-18 * float(np.max(np.abs(reference), initial=0.0)) ** 2:
        raise DataError(
            f"{where}: expected a reference that moves, got {reference[0]:.6g} throughout. Name "
            "the channel that both runs follow with align=."
        )
    shift = _coarse(reference, other, rate_hz, keep) / rate_hz
    shift = _refined(reference, other, shift, rate_hz=rate_hz, keep=keep)
    difference, _ = _shifted_difference(reference, other, shift, rate_hz=rate_hz, keep=keep)
    share = float(np.mean(difference**2)) / variance if difference.size else np.inf
    if share > _MOST_DIFFERENT:
        raise DataError(
            f"{where}: expected two runs along one reference, got references that differ by "
            f"{100.0 * share:.3g} % of their variance at best. Pair each perturbed run with the "
            "unperturbed run of the same reference."
        )
    return shift


def _coarse(reference: np.ndarray, other: np.ndarray, rate_hz: float, keep: np.ndarray) -> int:
    """Return the best shift in samples, to one in a hundredth of a second."""
    every = max(1, round(rate_hz / _COARSE_HZ))
    first, second, kept = reference[::every], other[::every], keep[::every]
    most = round(_SEARCH_S * rate_hz / every)
    fewest = int(_LEAST_COMMON * min(first.size, second.size))
    errors: dict[int, float] = {}
    for lag in range(-most, most + 1):
        begin, end = max(0, -lag), min(first.size, second.size - lag)
        if end - begin < max(fewest, 1):
            continue
        inside = kept[begin:end]
        difference = (first[begin:end] - second[begin + lag : end + lag])[inside]
        if difference.size:
            errors[lag] = float(np.mean(difference**2))
    if not errors:
        return 0
    as_good = min(errors.values()) + _AS_GOOD * float(np.var(first))
    return every * min((lag for lag, e in errors.items() if e <= as_good), key=abs)


def _refined(
    reference: np.ndarray, other: np.ndarray, shift: float, *, rate_hz: float, keep: np.ndarray
) -> float:
    """Improve a shift by Gauss-Newton steps."""
    for _ in range(_PASSES):
        difference, slope = _shifted_difference(reference, other, shift, rate_hz=rate_hz, keep=keep)
        power = float(slope @ slope)
        if power == 0.0:
            break
        step = float(difference @ slope) / power
        shift += step
        if abs(step) < _CONVERGED_S:
            break
    return shift


def _shifted_difference(
    reference: np.ndarray, other: np.ndarray, shift: float, *, rate_hz: float, keep: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Return the first reference less the shifted other one, and the slope of the latter."""
    at = np.arange(reference.size) + shift * rate_hz
    used = keep & (at >= 0.0) & (at <= other.size - 1)
    grid = np.arange(other.size)
    shifted = np.interp(at[used], grid, other)
    slope = np.interp(at[used], grid, np.gradient(other) * rate_hz)
    return reference[used] - shifted, slope
