"""Pulses that a trigger channel starts, with sign, size and length of the torque."""

from dataclasses import replace

import numpy as np
import xarray as xr

from jointz.core.errors import DataError
from jointz.gait.timestamps import rate_hz
from jointz.identify.preparation.pulses import Pulse, runs_of
from jointz.kernels import levels

#: Levels closer than this many standard deviations of the signal about them are one level.
_SEPARATION = 6.0
#: Shares of the record within which neither level is surely the idle one.
_EITHER = (0.4, 0.6)
#: Bounces are edges closer than this. More runs a pulse, or a smaller share of its length at the
#: upper level, are the noise of one level, such as that of the last digit.
_BOUNCE_S, _MOST_BOUNCES, _LEAST_HIGH = 0.02, 20, 0.4
#: Longest edge, s, and the least share of such edges: the others are bounces at the fall.
_EDGE_S, _LEAST_STEEP = 0.05, 0.1
#: Blocks in which drift is followed, s; hysteresis in standard deviations of the noise.
_DRIFT_BLOCK_S, _HYSTERESIS_SD = 5.0, 4.0
#: Torque before an onset that a pulse is measured from, s. Torque after it that is searched for the
#: pulse: at least s, or lengths of the trigger, at most a share of the usual time between onsets.
_BEFORE_S = 0.05
_SEARCHED_S, _SEARCHED_LENGTHS, _SEARCHED_SHARE = 0.4, 1.5, 0.4
#: Triggers whose lengths differ by more than this, s and as a share, are of two kinds.
_SAME_LENGTH_S, _SAME_LENGTH = 0.02, 0.2
#: Least torque after a trigger, in standard errors of its mean; fewest pulses for that test.
_LEAST_TORQUE_SE, _FEWEST_TESTED = 4.0, 4
#: Torque before an onset searched for steps, from and up to, s; length of a step, s; and the
#: shares of the largest step, and of the pulse, after the onset that make it the pulse's own step.
#: Latest start of the torque after its trigger, s.
_EARLY_S, _ON_TIME_S, _STEP_S, _LIKE_STEP, _LIKE_PULSE = 0.15, 0.005, 0.01, 0.7, 0.3
_LATEST_S = 0.2
#: Most samples of a window from which signs are found.
_COARSE = 200


def pulses_from_trigger(recording: xr.Dataset) -> tuple[Pulse, ...]:
    """Return the pulses that a trigger starts, with sign, size and length of the torque.

    Raises DataError for a trigger with one level, or triggers that no torque follows.
    """
    triggers = triggers_of(recording)
    if triggers:
        return _with_torque_shapes(triggers, recording)
    raise _error(
        recording,
        f"{_picture(recording)} Name the right column under [channels.trigger], give the right "
        "threshold, or give a pulse table.",
    )


def triggers_of(recording: xr.Dataset, *, brief: bool = True) -> tuple[Pulse, ...]:
    """Return the runs of a trigger away from its idle level, without amplitudes.

    Runs of one sample count if all are that short and ``brief``.
    """
    samples, stated = recording["trigger"].to_numpy(), recording.attrs.get("trigger_threshold")
    good = np.isfinite(samples)
    time, x = recording["time"].to_numpy()[good], samples[good]
    rise = _rise(time, x, float(stated) if stated else None) if x.size else None
    if rise is None:
        return ()
    start, _, state = levels.schmitt_states(*rise)
    runs = np.append(start, x.size - 1)[runs_of(state)]
    runs = runs[runs[:, 0] > 0]  # a run that the record begins in has no onset
    if not runs.size:
        return ()
    begin, end = time[runs].T
    on, off = levels.joined_runs(begin, end, _BOUNCE_S)
    long = off - on > 1.5 / rate_hz(time)
    kept = long if long.any() or not brief else ~long
    if not kept.any() or len(runs) > _MOST_BOUNCES * on.size:
        return ()
    high_s = np.add.reduceat(end - begin, np.searchsorted(begin, on))[kept]
    on, length = on[kept], (off - on)[kept]
    if high_s.sum() < _LEAST_HIGH * length.sum():
        return ()
    return tuple(Pulse(t, s, np.nan) for t, s in zip(on.tolist(), length.tolist(), strict=True))


def _rise(
    time: np.ndarray, x: np.ndarray, threshold: float | None
) -> tuple[np.ndarray, float, float] | None:
    """Return a trigger turned so that pulses rise, and its thresholds; None if it has one level."""
    if threshold is not None:
        idle, sign = _idle(x, threshold)
        rise, upper = sign * x, sign * threshold
        rest = float(np.median(rise[idle]))
        return None if idle.all() else _thresholds(rise, idle, rest, upper)
    before, after = np.append(x[:1], x[:-1]), np.append(x[1:], x[-1:])
    smooth = np.maximum(np.minimum(before, x), np.minimum(np.maximum(before, x), after))
    # Spikes of one sample are no level, unless pulses are that short.
    for values in (smooth, x):
        idle, sign = _idle(values, levels.middle_of_levels(values))
        if idle.all():
            continue
        drift = _idle_level(time, values, idle)
        rise = sign * (values - drift)
        upper = 0.5 * float(np.median(rise[~idle]))
        apart = levels.two_levels(rise, upper, separation=_SEPARATION) is not None
        if apart and _switches(time, rise, upper):
            return _thresholds(sign * (x - drift), idle, 0.0, upper)
    return None


def _switches(time: np.ndarray, rise: np.ndarray, upper: float) -> bool:
    """Return whether a signal rises to a level from half of it at once, as drift does not."""
    edges = runs_of(rise >= upper)[:, 0]
    earlier = np.maximum(edges - round(_EDGE_S * rate_hz(time)), 0)
    return bool(np.mean(rise[earlier] < 0.5 * upper) > _LEAST_STEEP)


def _idle(x: np.ndarray, middle: float) -> tuple[np.ndarray, float]:
    """Return which samples are idle, and the sign of the others relative to them."""
    high = x >= middle
    share = float(high.mean())
    idle_is_high = bool(high[0]) if _EITHER[0] <= share <= _EITHER[1] else share > 0.5
    return high == idle_is_high, -1.0 if idle_is_high else 1.0


def _thresholds(
    rise: np.ndarray, idle: np.ndarray, rest: float, upper: float
) -> tuple[np.ndarray, float, float]:
    """Return a trigger with its thresholds, apart by the noise of the idle level."""
    _, noise_sd = levels.level(levels.thinned(rise[idle]))
    return rise, upper - min(_HYSTERESIS_SD * noise_sd, 0.5 * (upper - rest)), upper


def _idle_level(time: np.ndarray, x: np.ndarray, idle: np.ndarray) -> np.ndarray:
    """Return the idle level over time, which may drift."""
    blocks = np.array_split(np.arange(x.size), levels.block_count(time, _DRIFT_BLOCK_S))
    parts = [rest for block in blocks if (rest := block[idle[block]]).size]
    centres, medians = [time[p].mean() for p in parts], [np.median(x[p]) for p in parts]
    return np.asarray(np.interp(time, centres, medians))


def _picture(recording: xr.Dataset) -> str:
    """Describe a trigger without pulses in words."""
    x = recording["trigger"].to_numpy()
    x = x[np.isfinite(x)]
    if not x.size:
        return "it has no samples."
    stated = recording.attrs.get("trigger_threshold")
    expected = f"pulses across its threshold {stated}" if stated else "steps between two levels"
    apart = 100.0 * np.mean(np.abs(x - np.median(x)) > 0.25 * np.ptp(x))
    return (
        f"expected {expected}, found a median of {np.median(x):.4g}, a range from {x.min():.4g} to "
        f"{x.max():.4g} and {apart:.2g} % of the samples further than a quarter of that range from "
        "the median."
    )


def _error(recording: xr.Dataset, problem: str) -> DataError:
    file = str(recording.attrs.get("file") or "recording")
    return DataError(f"{file}, channel 'trigger': {problem}", path=file, channel="trigger")


def _with_torque_shapes(pulses: tuple[Pulse, ...], recording: xr.Dataset) -> tuple[Pulse, ...]:
    """Return triggers with sign, size and length of the torque that follows them.

    Triggers of one length are one kind of pulse. Its length is the time for which the mean torque,
    turned by the sign, first stays above half of its peak; sizes are means over that time.
    """
    rate = rate_hz(recording["time"].to_numpy())
    lengths = np.array([p.duration_s for p in pulses])
    before, after = _torque_around(pulses, recording)
    whole = np.isfinite(after).all(axis=1)
    both = whole & np.isfinite(before).all(axis=1)
    if np.count_nonzero(both) >= _FEWEST_TESTED:
        _check_torque(before[both], after[both], recording)
        _check_onsets(before[both], after[both], recording, rate)
    sign = np.ones(len(pulses))
    if whole.any():
        sign[whole] = _signs(after[whole])
    shaped = list(pulses)
    for members in _kinds(lengths):
        begin, end = 0, max(1, round(float(np.median(lengths[members])) * rate))
        known = members[whole[members]]
        if known.size:
            mean = (sign[known, None] * after[known]).mean(axis=0)
            begin, first_low = runs_of(mean >= 0.5 * mean.max())[0]
            if begin > _LATEST_S * rate:
                raise _error(
                    recording,
                    f"the torque starts {begin / rate:.2g} s after its runs, expected at most "
                    f"{_LATEST_S:g} s. Name the trigger that starts the pulses; threshold tells "
                    "which level is the idle one.",
                )
            # A torque that outlasts what is searched is at least as long as its trigger.
            end = first_low if first_low < mean.size else max(first_low, end)
        sizes = after[members, begin:end].mean(axis=1).tolist()
        length_s = float(end - begin) / rate
        for k, size in zip(members, sizes, strict=True):
            shaped[k] = replace(pulses[k], duration_s=length_s, amplitude=size)
    return tuple(shaped)


def _torque_around(
    pulses: tuple[Pulse, ...], recording: xr.Dataset
) -> tuple[np.ndarray, np.ndarray]:
    """Return the torque before and after each onset, (n_pulse, n) each.

    Each is relative to the mean of the 50 ms before it, and NaN beyond the record.
    """
    time, torque = recording["time"].to_numpy(), recording["torque"].to_numpy()
    rate, onsets = rate_hz(time), np.array([p.onset_s for p in pulses])
    searched_s = max(_SEARCHED_S, _SEARCHED_LENGTHS * max(p.duration_s for p in pulses))
    if onsets.size > 1:
        searched_s = min(searched_s, _SEARCHED_SHARE * float(np.median(np.diff(onsets))))
    n, rest = max(2, round(searched_s * rate)), max(1, round(_BEFORE_S * rate))
    padded = np.pad(torque, n + rest, constant_values=np.nan)
    at = np.searchsorted(time, onsets)[:, None] + np.arange(n + rest)
    before, after = padded[at], padded[at + n]
    zeros = (part[:, :rest].mean(axis=1, keepdims=True) for part in (before, after))
    return before[:, rest:] - next(zeros), after[:, rest:] - next(zeros)


def _signs(torque: np.ndarray) -> np.ndarray:
    """Return the sign of the first phase of each pulse, by the main course of all, (n_pulse,)."""
    scores = np.linalg.svd(_coarse(torque), full_matrices=False)[0][:, 0]
    sign = np.where(scores < 0.0, -1.0, 1.0)
    mean = (sign[:, None] * torque).mean(axis=0)
    return np.asarray(sign * np.sign(mean[np.argmax(np.abs(mean) >= 0.5 * np.abs(mean).max())]))


def _kinds(lengths: np.ndarray) -> list[np.ndarray]:
    """Return the indices of the triggers of each length."""
    order = np.argsort(lengths, kind="stable")
    step = np.diff(lengths[order])
    apart = step > np.maximum(_SAME_LENGTH_S, _SAME_LENGTH * lengths[order][:-1])
    return np.split(order, np.flatnonzero(apart) + 1)


def _check_torque(before: np.ndarray, after: np.ndarray, recording: xr.Dataset) -> None:
    """Raise DataError if the torque after triggers is like that before them.

    Both are projected on the main course after the other half of the triggers.
    """
    before, after = _coarse(before), _coarse(after)
    larger = np.empty(len(after))
    for half in (0, 1):
        course = np.linalg.svd(after[1 - half :: 2], full_matrices=False)[2][0]
        larger[half::2] = np.abs(after[half::2] @ course) - np.abs(before[half::2] @ course)
    least = _LEAST_TORQUE_SE * larger.std(ddof=1) / np.sqrt(larger.size)
    if larger.mean() <= least:
        raise _error(
            recording,
            f"expected a pulse of torque after each of its {larger.size} runs, found a mean torque "
            f"within {_LEAST_TORQUE_SE:g} standard errors of that before them. Check the columns "
            "of trigger and torque, and that they share one clock.",
        )


def _check_onsets(
    before: np.ndarray, after: np.ndarray, recording: xr.Dataset, rate: float
) -> None:
    """Raise DataError if the torque steps before triggers about as far as after them."""
    sign, n = _signs(after)[:, None], max(1, round(_STEP_S * rate))
    early = before[:, -round(_EARLY_S * rate) : -max(1, round(_ON_TIME_S * rate))]
    if early.shape[1] <= n or after.shape[1] <= n:
        return
    pulse = sign * after
    steps, later = (x[:, n:] - x[:, :-n] for x in (sign * early, pulse))
    mean = np.abs(steps.mean(axis=0))
    error = steps.std(axis=0, ddof=1) / np.sqrt(len(steps))
    step, size = (float(np.abs(x.mean(axis=0)).max()) for x in (later, pulse))
    like = mean >= max(_LIKE_STEP * step, _LIKE_PULSE * size)
    if (like & (mean > _LEAST_TORQUE_SE * error)).any():
        lead_s = (mean.size - int(mean.argmax())) / rate + _ON_TIME_S + 0.5 * _STEP_S
        raise _error(
            recording,
            f"the torque steps about {1e3 * lead_s:.2g} ms before its runs as far as after them. "
            "Name the trigger that starts the pulses, or give a pulse table.",
        )


def _coarse(windows: np.ndarray) -> np.ndarray:
    return windows[:, :: 1 + windows.shape[1] // _COARSE]
