"""Responses of pairs of runs: perturbed less unperturbed."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import xarray as xr
from scipy.ndimage import map_coordinates

from jointz.core.errors import DataError
from jointz.core.study import CalibrationSpec
from jointz.identify.bench.bench_records import white_noise_sd
from jointz.identify.bench.run_alignment import reference_shift
from jointz.identify.preparation.conditioning import Stretch, condition
from jointz.identify.preparation.pulses import Pulse, pulses_from_command, with_measured_amplitudes
from jointz.identify.series.joint_record import Samples, gather_record

_SAME_RATE = 0.01
#: Of a fourth-order low-pass, run both ways.
_ROLL_OFF = 8


@dataclass(frozen=True, slots=True)
class PairResponses:
    """The responses of one pair of runs."""

    pulses: tuple[Pulse, ...]  # the pulses that both runs hold, on the perturbed run's clock
    # angle (rad), velocity, acceleration and torque (N*m), unperturbed run subtracted
    windows: np.ndarray
    left_out: tuple[tuple[Pulse, str], ...]  # the other pulses, and why
    shift_s: float  # how much later the unperturbed run began the reference
    rate_hz: float  # samples a second
    # rad/s^2: what white noise of both angles leaves in a response's acceleration
    acceleration_noise_sd: float


@dataclass(frozen=True, slots=True)
class _Run:
    """One run, filtered."""

    stretch: Stretch
    reference: np.ndarray
    recording: xr.Dataset
    rate_hz: float
    guard_s: float

    @property
    def start_s(self) -> float:
        return float(self.stretch.time[0])

    def holds(self, begin_s: float, end_s: float) -> bool:
        """Tell whether a window lies inside, away from the edges that the filter spoils."""
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
