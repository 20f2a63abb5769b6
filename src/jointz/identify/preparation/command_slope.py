"""Slope of the measured torque on its command."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from itertools import product

import numpy as np
from scipy.signal import lfilter

from jointz.gait.timestamps import rate_hz
from jointz.identify.preparation.pulses import Pulse, pulses_from_table
from jointz.identify.preparation.sources import FRICTION_OF_MODEL, Source
from jointz.kernels.filtering import lowpass_zero_phase, shortest_record

#: Slopes outside of the first limits are doubted; those outside of the second are refused.
DOUBTED, REFUSED = (0.85, 1.15), (0.7, 1.4)
#: Standard errors by which a slope exceeds its limit, and the pulses or blocks that tell it.
_CERTAIN, _FEWEST, _BLOCKS = 3.0, 4, 20
#: Delays and time constants of an actuator that are tried, s.
_DELAYS_S, _TIMES_S = np.arange(0.0, 0.013, 3e-3), (0.0, 4e-3, 8e-3, 12e-3, 18e-3)
#: A pulse is compared from before its onset to after its end, s, at no more than this rate.
_BEFORE_S, _AFTER_S, _RATE_HZ = 0.05, 0.06, 500.0
#: A record is compared below this frequency, without most of a sensor's noise.
_CUTOFF_HZ = 20.0
#: Largest misfit of a torque that follows its command, and that of other lags that may be right,
#: relative to the best.
_FLAT, _AMBIGUOUS = 0.03, 3.0
#: Strides near a pulse that show the torque without it.
_STRIDES = 15
#: Length of a pulse that is not stated, and the longest that is compared, s.
_USUAL_S, _LONGEST_S = 0.1, 1.0
#: Least power of a command, relative to the largest of a pulse.
_LEAST_POWER, _TINY = 0.01, 1e-300
#: Torque over amplitude by the share of a pulse's length: one phase, two, ramps, half a sine.
_SHAPES: tuple[Callable[[np.ndarray], np.ndarray], ...] = (
    np.ones_like,
    lambda share: np.where(share < 0.5, 1.0, -1.0),
    lambda share: np.clip(4.0 * np.minimum(share, 1.0 - share), 0.0, 1.0),
    lambda share: np.sin(np.pi * share),
)
#: Standard error of a median, in median deviations of normal numbers.
_ERROR_OF_MEDIAN = 1.4826 * 1.2533


@dataclass(frozen=True, slots=True)
class CommandSlope:
    """Size of the slope of a torque on its command."""

    value: float
    low: float  # lower limit, by three standard errors and the lags that fit about as well
    high: float
    # whether lag and slope explain the torque; a device beside the joint takes part of a command
    flat: bool

    def exceeds(self, limits: tuple[float, float]) -> bool:
        """Return whether the slope is surely outside of limits."""
        return (self.high < limits[0] and self.flat) or self.low > limits[1]

    def divided(self, gain: float) -> "CommandSlope":
        """Return the slope of a torque that a gain is divided out of."""
        value, low, high = (each / abs(gain) for each in (self.value, self.low, self.high))
        return CommandSlope(value, low, high, self.flat)

    def __str__(self) -> str:
        limits = f"{self.low:.2f} to {self.high:.2f}"
        return f"the torque is {self.value:.2f} ({limits}) times its command"


def pulse_slope(source: Source) -> CommandSlope | None:
    """Return the slope over the pulses of a recording, without division by its calibrated gain.

    None if neither a command nor a pulse table states what the torque should be. If both do, the
    one that the torque is more like counts: the table may state what a motor reached.
    """
    table = source.given.pulse_table
    stated = [] if table is None else pulses_from_table(table)
    stated = [p for p in stated if np.isfinite(p.amplitude)]
    slopes = [_slope_over(source, stated, stated=True)] if stated else []
    if "command" in source.given.recording:
        slopes.append(_slope_over(source, source.pulses, stated=False))
    known = [slope for slope in slopes if slope is not None]
    return min(known, key=lambda slope: abs(np.log(max(slope.value, _TINY))), default=None)


def record_slope(torque: np.ndarray, command: np.ndarray, rate_hz: float) -> CommandSlope | None:
    """Return the slope over blocks of a record, None if it is too short."""
    if command.size <= max(shortest_record(), _BLOCKS):
        return None
    size = command.size // _BLOCKS
    cutoff_hz = min(_CUTOFF_HZ, 0.4 * rate_hz)
    smooth = [
        lowpass_zero_phase(x, cutoff_hz=cutoff_hz, rate_hz=rate_hz) for x in (torque, command)
    ]
    blocks = [x[: size * _BLOCKS].reshape(_BLOCKS, size) for x in smooth]
    torque, command = (block - block.mean(axis=1, keepdims=True) for block in blocks)
    return _slope(torque, [command], 1.0 / rate_hz, alike=False)


def _slope_over(source: Source, pulses: Sequence[Pulse], *, stated: bool) -> CommandSlope | None:
    """Return the slope on the stated amplitudes of pulses, or on the recorded command."""
    recording = source.given.recording
    torque = recording["torque"].to_numpy()
    if FRICTION_OF_MODEL in recording:
        torque = torque - recording[FRICTION_OF_MODEL].to_numpy()
    step_s = 1.0 / min(rate_hz(recording["time"].to_numpy()), _RATE_HZ)
    rows = np.array([(p.onset_s, p.duration_s, p.amplitude) for p in pulses])
    onset, length, amplitude = rows.T[:, :, None]
    length = np.where(np.isfinite(length), length, _USUAL_S)
    since = np.arange(-_BEFORE_S, min(length.max(), _LONGEST_S) + _AFTER_S, step_s)
    if stated:
        share = since / length
        inside = (share >= 0.0) & (share < 1.0)
        commands = [np.where(inside, amplitude * shape(share), 0.0) for shape in _SHAPES]
    else:
        commands = [_courses(source, recording["command"].to_numpy(), onset, since)]
    compared = since < length + _AFTER_S
    measured = _courses(source, torque, onset, since)
    return _slope(np.where(compared, measured, np.nan), commands, step_s, alike=True)


def _courses(
    source: Source, samples: np.ndarray, onset: np.ndarray, since: np.ndarray
) -> np.ndarray:
    """Return a channel about pulses, (n, m), less that of strides without one and before each."""
    time = source.given.recording["time"].to_numpy()
    finite = np.isfinite(samples)
    if not finite.any():
        return np.full((onset.size, since.size), np.nan)
    time, samples = time[finite], samples[finite]
    courses = np.interp(onset + since, time, samples, left=np.nan, right=np.nan)
    if source.undisturbed.sum() >= _FEWEST and source.strides is not None:
        start = source.strides.start_s
        quiet = start[source.undisturbed]
        for course, t in zip(courses, onset[:, 0], strict=True):
            own = start[max(int(np.searchsorted(start, t)) - 1, 0)]
            near = quiet[np.argsort(np.abs(quiet - own))[:_STRIDES]]
            others = t - own + near[:, None] + since
            course -= np.median(np.interp(others, time, samples), axis=0)
    return np.asarray(courses - courses[:, since < 0.0].mean(axis=1, keepdims=True))


def _slope(
    torque: np.ndarray, commands: Sequence[np.ndarray], step_s: float, *, alike: bool
) -> CommandSlope | None:
    """Return the slope of torque on the best of commands and lags, (n, m) each.

    Rows that are ``alike`` but for their size are averaged to find the lag.
    """
    known = np.isfinite(torque).any(axis=1) & np.isfinite(commands).all(axis=(0, 2))
    if known.sum() < _FEWEST:
        return None
    missing = ~np.isfinite(torque[known])
    torque = np.where(missing, 0.0, torque[known])
    misfits, slopes = [], []
    for command, delay_s, time_s in product(commands, _DELAYS_S, _TIMES_S):
        late = np.where(missing, 0.0, _late(command[known], delay_s, time_s, step_s))
        power = (late**2).sum(axis=1)
        used = power > _LEAST_POWER * power.max()
        if used.sum() < _FEWEST:
            continue
        peaks = late[np.arange(len(late)), np.abs(late).argmax(axis=1)]
        a, b = (peaks @ torque, peaks @ late) if alike else (torque.ravel(), late.ravel())
        explained = (a @ b) ** 2 / max((a @ a) * (b @ b), _TINY)
        misfits.append(max(1.0 - explained, _TINY))
        slopes.append((late * torque).sum(axis=1)[used] / power[used])
    if not misfits:
        return None
    best = int(np.argmin(misfits))
    likely = np.array(misfits) <= min(_AMBIGUOUS * misfits[best], misfits[best] + _FLAT)
    values = np.array([np.median(each) for each in slopes])
    value, sign = float(abs(values[best])), np.sign(values[best])
    deviation = float(np.median(np.abs(slopes[best] - values[best])))
    margin = _CERTAIN * _ERROR_OF_MEDIAN * deviation / np.sqrt(slopes[best].size)
    low, high = np.min(sign * values[likely]) - margin, np.max(sign * values[likely]) + margin
    return CommandSlope(value, float(low), float(high), flat=bool(misfits[best] < _FLAT))


def _late(command: np.ndarray, delay_s: float, time_s: float, step_s: float) -> np.ndarray:
    """Return commands behind a delay and a first-order lag, from rest at the first sample."""
    delay = round(delay_s / step_s)
    first = command[:, :1]
    late = np.concatenate([np.repeat(first, delay, axis=1), command], axis=1)[:, : command.shape[1]]
    keep = np.exp(-step_s / time_s) if time_s else 0.0
    return np.asarray(lfilter([1.0 - keep], [1.0, -keep], late - first, axis=1) + first)
