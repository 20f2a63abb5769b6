"""References of a bench as samples: what torque or position is to follow, tick by tick."""

from collections.abc import Iterator
from functools import singledispatch

import numpy as np
from scipy.interpolate import CubicSpline
from scipy.signal import butter, sosfilt

from jointz.core.protocols.reference_signal_models import (
    Chirps,
    Noise,
    Reference,
    Sine,
    Steps,
    SumOfSines,
    Sweep,
    Trajectory,
)

#: Noise runs in for so many periods of its cutoff before it counts.
_RUN_IN_PERIODS = 20.0


def reference_samples(
    reference: Reference, n: int, *, rate_hz: float, rng: np.random.Generator
) -> np.ndarray:
    """Return what a reference asks for at every tick; one that ends begins again."""
    if isinstance(reference, Noise):
        return _noise(reference, n, rate_hz, rng)
    return _at(reference, np.arange(n) / rate_hz)


@singledispatch
def _at(reference: Reference, time: np.ndarray) -> np.ndarray:
    raise TypeError(f"expected a reference, got {type(reference).__name__} ({time.size} samples).")


@_at.register
def _sine(reference: Sine, time: np.ndarray) -> np.ndarray:
    return reference.offset + reference.amplitude * np.sin(
        2 * np.pi * reference.frequency_hz * time
    )


@_at.register
def _sum_of_sines(reference: SumOfSines, time: np.ndarray) -> np.ndarray:
    total = np.full_like(time, reference.offset)
    for term in reference.terms:
        total += term.amplitude * np.sin(2 * np.pi * term.frequency_hz * time)
    return total


@_at.register
def _chirps(reference: Chirps, time: np.ndarray) -> np.ndarray:
    since = time % reference.cycle_s
    total = np.full_like(time, reference.offset)
    begin = 0.0
    for sweep in reference.sweeps:
        inside = (since >= begin) & (since < begin + sweep.duration_s)
        total[inside] += _sweep(sweep, since[inside] - begin)
        begin += sweep.duration_s
    return total


def _sweep(sweep: Sweep, time: np.ndarray) -> np.ndarray:
    """Return a chirp: its phase is the integral of a frequency that is linear in time."""
    share = time / sweep.duration_s
    low, high = sweep.frequency_hz
    phase = 2 * np.pi * (low * time + 0.5 * (high - low) * share * time)
    amplitude = sweep.amplitude[0] + (sweep.amplitude[1] - sweep.amplitude[0]) * share
    return np.asarray(amplitude * np.sin(phase))


def endless_noise(reference: Noise, *, rate_hz: float, rng: np.random.Generator) -> Iterator[float]:
    """Yield noise tick by tick, cut off at its bounds: a wearer feels what limits were checked."""
    sos, run_in, size = _noise_filter(reference, rate_hz)
    _, state = sosfilt(sos, rng.standard_normal(run_in) / size, zi=np.zeros((len(sos), 2)))
    while True:
        white = rng.standard_normal(round(rate_hz)) / size
        filtered, state = sosfilt(sos, white, zi=state)
        yield from np.clip(reference.offset + reference.sd * filtered, *reference.bounds).tolist()


def _noise(reference: Noise, n: int, rate_hz: float, rng: np.random.Generator) -> np.ndarray:
    sos, run_in, size = _noise_filter(reference, rate_hz)
    filtered = np.asarray(sosfilt(sos, rng.standard_normal(run_in + n) / size))[run_in:]
    return reference.offset + reference.sd * filtered


def _noise_filter(reference: Noise, rate_hz: float) -> tuple[np.ndarray, int, float]:
    """Return sections, run-in in samples, and the SD of white noise after the filter."""
    sos = butter(reference.order, reference.cutoff_hz, fs=rate_hz, output="sos")
    run_in = int(np.ceil(_RUN_IN_PERIODS * rate_hz / reference.cutoff_hz))
    # Of the filtered noise itself, not of one draw: a draw is as large as it comes.
    impulse = sosfilt(sos, np.r_[1.0, np.zeros(run_in)])
    return sos, run_in, float(np.sqrt((impulse**2).sum()))


@_at.register
def _steps(reference: Steps, time: np.ndarray) -> np.ndarray:
    levels = np.asarray(reference.levels)
    # A tick that stands on a boundary up to rounding belongs to the later level.
    place = np.floor(time / reference.hold_s + 1e-9).astype(int)
    return np.asarray(levels[place % levels.size])


@_at.register
def _trajectory(reference: Trajectory, time: np.ndarray) -> np.ndarray:
    samples = np.asarray(reference.samples)
    knots = np.linspace(0.0, reference.duration_s, samples.size + 1)
    curve = CubicSpline(knots, np.r_[samples, samples[0]], bc_type="periodic")
    return np.asarray(curve(time % reference.duration_s))
