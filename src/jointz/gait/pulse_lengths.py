"""Sampling rate that the lengths of pulses make likely."""

from dataclasses import dataclass

import numpy as np
import xarray as xr

from jointz.gait.sample_rate import USUAL_HZ

#: Lengths are measured where a pulse exceeds these shares of its height. A table may state the
#: time from first rise to end, the hold, or what lies between.
_LEVELS = (0.1, 0.5, 0.9)
_FEWEST_PULSES = 5
#: Least ratio of lengths that is a contradiction, and the precision of a usual rate.
_DIFFERENT, _NEAR = 1.12, 1.04
#: Largest ratio of the widths at the foot and at the top: a smooth pulse has no definite length.
_STEEP = 2.2
#: Robust relative spread of the lengths of clear pulses, and motion before one over its height.
_MOST_SPREAD, _MOST_BEFORE = 0.05, 0.15
#: Seconds before and after an onset, in lengths of the table, and an onset's own error, s.
_BEFORE, _AFTER, _EARLY_S = 0.5, 4.0, 0.02


@dataclass(frozen=True, slots=True)
class LikelyRate:
    """A sampling rate at which pulses last as long as stated."""

    rate_hz: float
    ratio: float  # measured over stated duration, at the rate of the recording
    n_pulses: int  # number of pulses behind ``ratio``


def rate_of_lengths(
    recording: xr.Dataset, onset_s: np.ndarray, duration_s: np.ndarray
) -> LikelyRate | None:
    """Return the usual rate at which pulses last as stated, None if they do or are unclear.

    Pulses are unclear if they are few, differ from one another, rise from a signal that moves, or
    last as stated by any of the usual definitions of a length.
    """
    name = next((n for n in ("command", "torque", "current") if n in recording), None)
    if name is None:
        return None
    time, signal = recording["time"].to_numpy(), recording[name].to_numpy()
    known = np.isfinite(duration_s) & (duration_s > 0)
    if known.sum() < _FEWEST_PULSES:
        return None
    order = np.argsort(onset_s[known], kind="stable")
    onsets, stated = onset_s[known][order], duration_s[known][order]
    following = np.append(onsets[1:], np.inf)
    pulses = zip(onsets.tolist(), stated.tolist(), following.tolist(), strict=True)
    measured = [_lengths(time, signal, *pulse) / pulse[1] for pulse in pulses]
    ratios = np.array(measured).reshape(-1, len(_LEVELS))
    ratios = ratios[np.isfinite(ratios).all(axis=1)]
    if len(ratios) < max(_FEWEST_PULSES, 0.5 * onsets.size):
        return None
    logs = np.log(ratios)
    medians = np.median(logs, axis=0)
    spread = float(np.median(np.abs(logs[:, 1] - medians[1])))
    if medians[0] - medians[-1] > np.log(_STEEP):
        return None
    low, high = float(medians.min()), float(medians.max())
    # Lengths by different definitions on both sides of the stated one contradict nothing.
    if spread > _MOST_SPREAD or max(low, -high) <= np.log(_DIFFERENT):
        return None
    own_hz = (time.size - 1) / float(time[-1] - time[0])
    middle = float(np.exp(medians[1]))
    usual = min(USUAL_HZ, key=lambda hz: abs(np.log(hz / (own_hz * middle))))
    if abs(np.log(usual / (own_hz * middle))) > np.log(_NEAR):
        return None
    return LikelyRate(float(usual), middle, len(ratios))


def _lengths(
    time: np.ndarray, signal: np.ndarray, onset_s: float, length_s: float, next_s: float
) -> np.ndarray:
    """Return the lengths of a pulse at all levels in s, NaN if it is not clear."""
    unclear = np.full(len(_LEVELS), np.nan)
    end_s = min(onset_s + _AFTER * length_s, next_s - _EARLY_S)
    moments = [onset_s - _BEFORE * length_s, onset_s - _EARLY_S, end_s]
    first, start, stop = np.searchsorted(time, moments)
    before, during = signal[first:start], signal[start:stop]
    if before.size < 3 or during.size < 5 or not np.isfinite(signal[first:stop]).all():
        return unclear
    rise = np.abs(during - np.median(before))
    height = float(np.percentile(rise, 96)) if rise.size else 0.0
    if height <= 0.0 or np.ptp(before) > _MOST_BEFORE * height:
        return unclear
    step_s = float(time[1] - time[0])
    lengths = []
    for level in _LEVELS:
        above = rise > level * height
        begin = int(np.argmax(above))
        below = np.flatnonzero(~above[begin:])
        if not above.any() or not below.size:
            return unclear
        lengths.append(int(below[0]) * step_s)
    return np.array(lengths)
