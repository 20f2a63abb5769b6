"""Slope of the measured torque on its command."""

from collections.abc import Callable, Sequence
from itertools import product
from typing import NamedTuple

import numpy as np
from scipy.signal import lfilter

from jointz.gait.timestamps import rate_hz
from jointz.identify.preparation.pulses import pulses_from_table, runs_of
from jointz.identify.preparation.sources import FRICTION_OF_MODEL, Source
from jointz.kernels.filtering import SHORTEST_RECORD, lowpass_zero_phase

#: Slopes outside of the first limits are doubted; those outside of the second are refused.
DOUBTED, REFUSED = (0.85, 1.15), (0.7, 1.4)
#: Standard errors by which a slope exceeds its limit, the standard error of a median in median
#: deviations, fewest pulses, and blocks of a record.
_CERTAIN, _ERROR_OF_MEDIAN, _FEWEST, _BLOCKS = 3.0, 1.4826 * 1.2533, 4, 20
#: Delays and time constants of an actuator that are tried, s.
_DELAYS_S, _TIMES_S = np.arange(0.0, 0.013, 3e-3), (1e-6, 4e-3, 8e-3, 12e-3, 18e-3)
#: A pulse is compared from before its onset to after its end, s, at no more than this rate; length
#: of one that is not stated, and the longest. A record is compared below the last frequency.
_BEFORE_S, _AFTER_S, _RATE_HZ, _USUAL_S, _LONGEST_S, _CUTOFF_HZ = 0.05, 0.06, 500.0, 0.1, 1.0, 20.0
_LONGEST_UNSTATED_S = 0.6
#: Largest misfit of a torque that follows its command, and that of other lags that may be right,
#: relative to the best.
_FLAT, _AMBIGUOUS, _TINY = 0.03, 3.0, 1e-300
#: Strides near a pulse that show the torque without it.
_STRIDES = 15
#: Torque over amplitude by the share of a pulse's length: one phase, two, ramps, half a sine.
_SHAPES: tuple[Callable[[np.ndarray], np.ndarray], ...] = (
    np.ones_like,
    lambda share: np.where(share < 0.5, 1.0, -1.0),
    lambda share: np.clip(4.0 * np.minimum(share, 1.0 - share), 0.0, 1.0),
    lambda share: np.sin(np.pi * share),
)


class CommandSlope(NamedTuple):
    """Size of the slope of a torque on its command."""

    value: float
    low: float  # lower limit, by three standard errors and the lags that fit about as well
    high: float
    # whether lag and slope explain the torque; a device beside the joint takes part of a command
    flat: bool

    def exceeds(self, limits: tuple[float, float]) -> bool:
        """Return whether the slope is outside of limits, and surely not 1."""
        low = self.value < limits[0] and self.high < 1.0 and self.flat
        return low or (self.value > limits[1] and self.low > 1.0)

    def __str__(self) -> str:
        limits = f"{self.low:.2f} to {self.high:.2f}"
        return f"the torque is {self.value:.2f} ({limits}) times its command"


def pulse_slope(source: Source, gain: float = 1.0) -> CommandSlope | None:
    """Return the slope over the pulses of a recording, a gain divided out of its torque.

    None if neither a command nor a pulse table states what the torque should be. If both do, the
    one that the torque is more like counts: the table may state what a motor reached.
    """
    recording, table = source.input.recording, source.input.pulse_table
    torque = recording["torque"].to_numpy() / gain
    if FRICTION_OF_MODEL in recording:
        torque = torque - recording[FRICTION_OF_MODEL].to_numpy() / gain
    step_s = 1.0 / min(rate_hz(recording["time"].to_numpy()), _RATE_HZ)
    stated = () if table is None else pulses_from_table(table)
    stated = tuple(p for p in stated if np.isfinite(p.amplitude))
    slopes = []
    for pulses in (stated, source.pulses if "command" in recording else ()):
        if not pulses:
            continue
        rows = np.array([(p.onset_s, p.duration_s, p.amplitude) for p in pulses])
        onset, length, size = rows.T[:, :, None]
        unstated = ~(length > 0.0)
        if unstated.any():
            length = np.where(unstated, _usual_length(source, torque, onset, size), length)
        since = np.arange(-_BEFORE_S, min(length.max(), _LONGEST_S) + _AFTER_S, step_s)
        if pulses is stated:
            inside = (since >= 0.0) & (since < length)
            commands = [np.where(inside, size * shape(since / length), 0.0) for shape in _SHAPES]
        else:
            commands = [_courses(source, recording["command"].to_numpy(), onset, since)]
        measured = _courses(source, torque, onset, since)
        measured[since >= length + _AFTER_S] = np.nan
        slopes.append(_slope(measured, commands, step_s, alike=True))
    known = [slope for slope in slopes if slope is not None]
    return min(known, key=lambda slope: abs(np.log(max(slope.value, _TINY))), default=None)


def record_slope(torque: np.ndarray, command: np.ndarray, rate_hz: float) -> CommandSlope | None:
    """Return the slope over blocks of a record, None if it is too short."""
    if command.size <= max(SHORTEST_RECORD, _BLOCKS):
        return None
    size, cutoff_hz = command.size // _BLOCKS, min(_CUTOFF_HZ, 0.4 * rate_hz)
    both = lowpass_zero_phase(np.stack([torque, command]), cutoff_hz=cutoff_hz, rate_hz=rate_hz)
    blocks = both[:, : size * _BLOCKS].reshape(2, _BLOCKS, size)
    torque, command = blocks - blocks.mean(axis=2, keepdims=True)
    return _slope(torque, [command], 1.0 / rate_hz, alike=False)


def _usual_length(source: Source, torque: np.ndarray, onset: np.ndarray, size: np.ndarray) -> float:
    """Return the time for which the mean torque after onsets is first above half of its peak, s."""
    step_s = 1.0 / _RATE_HZ
    since = np.arange(-_BEFORE_S, _LONGEST_UNSTATED_S, step_s)
    courses = np.sign(size) * _courses(source, torque, onset, since)
    whole = np.isfinite(courses).all(axis=1)
    if not whole.any():
        return _USUAL_S
    mean = np.abs(courses[whole].mean(axis=0))[since >= 0.0]
    begin, end = runs_of(mean >= 0.5 * mean.max())[0]
    return float(end - begin) * step_s


def _courses(
    source: Source, samples: np.ndarray, onset: np.ndarray, since: np.ndarray
) -> np.ndarray:
    """Return a channel about pulses, (n, m), less that of strides without one and before each."""
    finite = np.isfinite(samples)
    if not finite.any():
        return np.full((onset.size, since.size), np.nan)
    time, samples = source.input.recording["time"].to_numpy()[finite], samples[finite]
    courses = np.interp(onset + since, time, samples, left=np.nan, right=np.nan)
    if source.strides is not None and source.undisturbed.any():
        start = source.strides.start_s
        quiet = start[source.undisturbed]
        for course, t in zip(courses, onset[:, 0], strict=True):
            stride_s = start[max(int(np.searchsorted(start, t)) - 1, 0)]
            near = quiet[np.argsort(np.abs(quiet - stride_s))[:_STRIDES], None]
            course -= np.median(np.interp(t - stride_s + near + since, time, samples), axis=0)
    return np.asarray(courses - courses[:, since < 0.0].mean(axis=1, keepdims=True))


def _slope(
    torque: np.ndarray, commands: Sequence[np.ndarray], step_s: float, *, alike: bool
) -> CommandSlope | None:
    """Return the slope of torque on the best of commands and lags, (n, m) each.

    Rows that are ``alike`` but for their size are averaged to find the lag.
    """
    known = np.isfinite(torque).any(axis=1) & np.isfinite(commands).all(axis=(0, 2))
    known &= np.abs(commands[0]).max(axis=1) > 0.0
    if known.sum() < _FEWEST:
        return None
    missing = ~np.isfinite(torque[known])
    torque = np.where(missing, 0.0, torque[known])
    misfits, slopes = [], []
    for command, delay_s, time_s in product(commands, _DELAYS_S, _TIMES_S):
        keep, delay = np.exp(-step_s / time_s), np.zeros(round(delay_s / step_s))
        late = lfilter([*delay, 1.0 - keep], [1.0, -keep], command[known], axis=1)
        late[missing] = 0.0
        peaks = late[np.arange(len(late)), np.abs(late).argmax(axis=1)]
        a, b = (peaks @ torque, peaks @ late) if alike else (torque.ravel(), late.ravel())
        misfits.append(max(1.0 - (a @ b) ** 2 / max((a @ a) * (b @ b), _TINY), _TINY))
        slopes.append((late * torque).sum(axis=1) / np.maximum((late**2).sum(axis=1), _TINY))
    best = int(np.argmin(misfits))
    likely = np.array(misfits) <= min(_AMBIGUOUS * misfits[best], misfits[best] + _FLAT)
    values = np.median(slopes, axis=1)
    sizes = np.sign(values[best]) * values[likely]
    deviation = np.median(np.abs(slopes[best] - values[best]))
    margin = _CERTAIN * _ERROR_OF_MEDIAN * deviation / np.sqrt(known.sum())
    value, low, high = abs(values[best]), sizes.min() - margin, sizes.max() + margin
    return CommandSlope(float(value), float(low), float(high), misfits[best] < _FLAT)
