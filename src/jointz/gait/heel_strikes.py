"""Detection of heel strikes in footswitches, vertical forces and stride counters.

Every detector is a Schmitt trigger with a refractory time. Its thresholds are
calibrated in two stages: coarse levels of the whole record first, then the
medians of the samples below and above their middle. A rise counts only where it
was seen: the first sample of a recording and a rise hidden by a hole or by
missing samples are no strikes.
"""

from dataclasses import dataclass
from itertools import pairwise

import numpy as np
import xarray as xr
from scipy.ndimage import median_filter

from jointz.core.channels import HEEL_STRIKES
from jointz.core.codes import Exclusion
from jointz.core.errors import DataError, EstimationError
from jointz.gait.timestamps import longest_step_s
from jointz.kernels.levels import (
    block_count,
    joined_runs,
    level,
    schmitt_states,
    thinned,
    two_levels,
)

#: Refractory time: at first, then as a share of the median interval.
_REFRACTORY_S = 0.3
_REFRACTORY_SHARE = 0.4

#: Of two rises in the refractory time the later stands where the earlier came before the
#: first figure and the later within the others, as shares of the expected interval.
_EARLY, _ON_TIME = 0.85, (0.9, 1.1)

#: Contact chatter; the shortest run that tells of stance and swing; shares of the median stance
#: and swing below which a run is a blip or a drop-out; low on both sides of a blip, in its length.
_CHATTER_S, _RUN_S = 0.05, 0.1
_BLIP_SHARE, _DROPOUT_SHARE, _BLIP_ALONE = 0.1, 0.3, 3.0

#: Levels closer than this many standard deviations of the signal about them are one level.
_SEPARATION = 4.0

#: A switch rests: most of its samples lie no further from its two levels than this share of their
#: distance. What has so few values is no voltage, but several switches on one channel.
_AT_LEVEL, _LARGEST_AWAY, _SWITCH_VALUES = 0.005, 0.15, 4

#: Vertical force: strike, sure contact (N, or share of the load), least load of a foot.
_STRIKE_N, _CONTACT_N, _CONTACT_SHARE, _LOAD_N = 20.0, 50.0, 0.05, 100.0

#: Drift of a voltage is followed in blocks of this length: several strides.
_BLOCK_S = 5.0


@dataclass(frozen=True, slots=True, eq=False)
class HeelStrikes:
    """Heel strikes of one foot."""

    time_s: np.ndarray  # times of the strikes, increasing
    # times of rises that are no strikes: bounces, drop-outs, brief false contacts, and rises inside
    # the refractory time
    rejected_s: np.ndarray
    # lower threshold of the trigger, in the unit of the signal, at the middle of the drift of a
    # voltage; NaN for a stride counter or a signal that never switches
    low: float
    # upper threshold of the trigger, in the unit of the signal, at the middle of the drift of a
    # voltage; NaN for a stride counter or a signal that never switches
    high: float
    # kind of the signal: ``contact``, ``voltage``, ``pulse``, ``force``, ``cycle`` or, where they
    # are listed, ``heel_strikes``
    method: str


def find_heel_strikes(
    recording: xr.Dataset, *, levels_v: tuple[float, float] | None = None
) -> HeelStrikes:
    """Find the heel strikes of a recording.

    Listed heel strikes are used where they exist, else the channel ``contact``, else
    ``ground_reaction_force``, else ``cycle``. A contact whose kind is not
    declared is read as ``contact`` where it has two values, else as ``voltage``.
    """
    where = recording.attrs.get("file") or "recording"
    time = recording["time"].to_numpy()
    if HEEL_STRIKES in recording:
        return strikes_from_count(time, recording[HEEL_STRIKES].to_numpy())
    if "contact" in recording:
        signal = recording["contact"].to_numpy()
        kind = recording.attrs.get("contact_kind") or _kind(signal)
        if kind == "voltage":
            return strikes_from_voltage(time, signal, levels_v=levels_v)
        return _FOOTSWITCHES[kind](time, signal)
    if "ground_reaction_force" in recording:
        try:
            return strikes_from_force(time, recording["ground_reaction_force"].to_numpy())
        except DataError as exc:
            raise DataError(f"{where}: {exc}", path=where, channel=exc.channel) from exc
    if "cycle" in recording:
        return strikes_from_cycle(time, recording["cycle"].to_numpy())
    raise EstimationError(
        Exclusion.NO_HEEL_STRIKES.value,
        f"{where}: heel strikes need a channel 'heel_strikes', 'contact', 'ground_reaction_force' "
        f"or 'cycle', found {', '.join(map(str, recording.data_vars)) or 'no channel'}. "
        "Declare one of them under [channels] in study.toml.",
    )


def is_unclean_switch(recording: xr.Dataset) -> bool:
    """Return whether a declared two-level switch does not rest at two levels.

    Every seventh of its samples or more lies away from both: a voltage that drifts or rises
    slowly. Edges of a few samples, bounces, missing samples and levels other than 0 and 1 are no
    sign of that.
    """
    if "contact" not in recording or recording.attrs.get("contact_kind") != "contact":
        return False
    x = np.asarray(recording["contact"].to_numpy(), dtype=float)
    x = thinned(x[np.isfinite(x)])
    if np.unique(x).size <= _SWITCH_VALUES:
        return False
    above = x >= 0.5 * sum(_coarse_levels(x))
    if above.all() or not above.any():
        return False
    low, high = float(np.median(x[~above])), float(np.median(x[above]))
    away = np.abs(x - np.where(above, high, low)) > _AT_LEVEL * (high - low)
    return bool(away.mean() >= _LARGEST_AWAY)


def strikes_from_contact(time: np.ndarray, signal: np.ndarray) -> HeelStrikes:
    """Find heel strikes in a two-level contact, high while the foot is on the ground.

    The strike is the first sample of each contact. Drop-outs shorter than 0.05 s or
    0.3 of the median swing make none, nor do lone contacts shorter than 0.1 of the
    median stance.
    """
    t, x = _finite(time, signal)
    if t.size < 2:
        return _none("contact")
    return _from_levels(t, x, _coarse_levels(x), method="contact")


def strikes_from_voltage(
    time: np.ndarray, signal: np.ndarray, *, levels_v: tuple[float, float] | None = None
) -> HeelStrikes:
    """Find heel strikes in the voltage of an analog footswitch, high on the ground.

    Noise is lowered by a running median of 11 ms, which keeps edges where they
    are; drift is followed by the middle between the 5th and 95th percentile of
    5 s blocks that switch. The strike is the interpolated crossing of the lower
    threshold; bounces are treated as in a contact.
    """
    t, x = _finite(time, signal)
    if t.size < 2:
        return _none("voltage")
    half = int(0.0055 / np.median(np.diff(t)))
    x = _without_drift(t, median_filter(x, size=2 * half + 1, mode="nearest"))
    if levels_v is not None:
        switches = x.min() < levels_v[0] and x.max() >= levels_v[1]
        return _trigger(t, x, levels_v, method="voltage") if switches else _none("voltage")
    return _from_levels(t, x, _coarse_levels(x), method="voltage")


def strikes_from_pulse(time: np.ndarray, signal: np.ndarray) -> HeelStrikes:
    """Find heel strikes in a signal that pulses briefly at each of them.

    Levels are the median and the typical peak of 2.5 s blocks, as the pulses may
    fill less than 1 % of the record. The strike is the first sample of the pulse.
    """
    t, x = _finite(time, signal)
    if t.size < 2:
        return _none("pulse")
    blocks = np.array_split(x, block_count(t, 0.5 * _BLOCK_S))
    peak = float(np.percentile([block.max() for block in blocks], 90))
    return _from_levels(t, x, (float(np.median(x)), peak), method="pulse")


def strikes_from_force(time: np.ndarray, force: np.ndarray) -> HeelStrikes:
    """Find heel strikes in the vertical force under one foot, positive upward on the foot.

    The strike is the interpolated upward crossing of 20 N above the unloaded
    level, as in ground reaction force studies; it counts only where the force
    goes on to 50 N or 5 % of the load, whichever is more, so that noise at toe-off
    and in swing makes none.
    """
    t, x = _finite(time, force)
    if t.size < 2:
        return _none("force")
    low, high = _coarse_levels(x)
    if -low > abs(high) + _LOAD_N:
        raise DataError(
            f"ground_reaction_force: expected positive upward on the foot, found {low:.0f} N to "
            f"{high:.0f} N: its sign is turned. Turn it in the file.",
            channel="ground_reaction_force",
        )
    unloaded = x[x <= low + 0.1 * (high - low)]
    loaded = x[x >= 0.5 * (low + high)]
    rest, spread = level(unloaded)
    load = float(np.median(loaded)) - rest
    if load < max(_LOAD_N, _SEPARATION * spread):
        return _none("force")
    thresholds = (rest + _STRIKE_N, rest + max(_CONTACT_N, _CONTACT_SHARE * load))
    return _trigger(t, x, thresholds, method="force")


def strikes_from_cycle(time: np.ndarray, cycle: np.ndarray) -> HeelStrikes:
    """Find heel strikes where a stride number changes."""
    t, x = _finite(time, cycle)
    if t.size < 2:
        return _none("cycle")
    seen = np.diff(t) <= _limit(t)
    at = np.flatnonzero((np.diff(x) != 0) & seen) + 1
    return HeelStrikes(t[at], np.empty(0), np.nan, np.nan, "cycle")


def strikes_from_count(time: np.ndarray, count: np.ndarray) -> HeelStrikes:
    """Find heel strikes where their listed number rises; those too soon after one are rejected."""
    rises = np.diff(count)
    time_s = np.repeat(time[1:], np.maximum(rises, 0).astype(int))
    every = np.ones(time_s.size, dtype=bool)
    strike, rejected = _select(time_s, every, seen=every)
    return HeelStrikes(strike, rejected, np.nan, np.nan, HEEL_STRIKES)


_INTERPOLATED = ("voltage", "force")
_FOOTSWITCHES = {"contact": strikes_from_contact, "pulse": strikes_from_pulse}


def _none(method: str) -> HeelStrikes:
    return HeelStrikes(np.empty(0), np.empty(0), np.nan, np.nan, method)


def _kind(signal: np.ndarray) -> str:
    return "contact" if np.unique(signal[np.isfinite(signal)]).size <= 2 else "voltage"


def _finite(time: np.ndarray, signal: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    signal = np.asarray(signal, dtype=float)
    time, good = np.asarray(time, dtype=float), np.isfinite(signal)
    return (time, signal) if good.all() else (time[good], signal[good])


def _limit(t: np.ndarray) -> float:
    """Return the longest step over which a rise is timed, with room for rounding errors."""
    return longest_step_s(t) * (1.0 + 1e-9)


def _coarse_levels(x: np.ndarray) -> tuple[float, float]:
    """Return stage one: robust percentiles, or the extremes where these coincide."""
    low, high = np.percentile(x, [1, 99])
    return (float(low), float(high)) if high > low else (float(x.min()), float(x.max()))


def _thresholds(x: np.ndarray, coarse: tuple[float, float]) -> tuple[float, float] | None:
    """Return stage two: thresholds between the two levels, or None where there is one level.

    The level of stance may have steps of its own (heel, heel and toe, toe).
    """
    levels = two_levels(x, 0.5 * (coarse[0] + coarse[1]), separation=_SEPARATION)
    if levels is None:
        return None
    low, high = levels
    return low + 0.3 * (high - low), low + 0.7 * (high - low)


def _without_drift(t: np.ndarray, x: np.ndarray) -> np.ndarray:
    """Subtract the drift of the middle between the levels, keeping its median."""
    blocks = block_count(t, _BLOCK_S)
    ends = np.array([np.percentile(b, [5, 95]) for b in np.array_split(x, blocks)])
    centre = np.array([b.mean() for b in np.array_split(t, blocks)])
    swing = ends[:, 1] - ends[:, 0]
    switches = swing >= 0.5 * np.percentile(swing, 90)
    middle = ends[switches].mean(axis=1)
    steady: np.ndarray = x - np.interp(t, centre[switches], middle - np.median(middle))
    return steady


def _from_levels(
    t: np.ndarray, x: np.ndarray, coarse: tuple[float, float], *, method: str
) -> HeelStrikes:
    if (thresholds := _thresholds(x, coarse)) is None:
        return _none(method)
    return _trigger(t, x, thresholds, method=method)


def _trigger(
    t: np.ndarray, x: np.ndarray, thresholds: tuple[float, float], *, method: str
) -> HeelStrikes:
    """Find the rises, when they crossed the lower threshold, and which are strikes."""
    low, high = thresholds
    # What stands between the thresholds at the very beginning may be a contact already.
    start, side, state = schmitt_states(x, low, high)
    rising = np.flatnonzero(~state[:-1] & state[1:]) + 1
    rise = start[rising]
    fall = start[np.flatnonzero(state[:-1] & ~state[1:]) + 1]
    low_run = np.maximum.accumulate(np.where(side < 0, np.arange(start.size), -1))[rising - 1]
    below = np.append(start, t.size)[low_run + 1] - 1
    holes = np.flatnonzero(np.diff(t) > _limit(t))
    seen = np.searchsorted(holes, below) == np.searchsorted(holes, rise)
    time_s = t[below + 1]
    if method in _INTERPOLATED:
        share = (low - x[below]) / (x[below + 1] - x[below])
        time_s = t[below] + share * (time_s - t[below])
    kept = np.ones(rise.size, dtype=bool) if method == "pulse" else _debounced(t, rise, fall)
    strike, rejected = _select(time_s, kept, seen=seen)
    return HeelStrikes(strike, rejected, low, high, method)


def _debounced(t: np.ndarray, rise: np.ndarray, fall: np.ndarray) -> np.ndarray:
    """Return which rises begin a contact, and are not chatter, a blip or the end of a drop-out.

    In this order: contacts apart by no more than chatter become one; contacts that
    are short against stance and against the low runs around them go; contacts apart
    by little against swing become one.
    """
    on, off = t[rise], t[fall]
    if off.size and (on.size == 0 or off[0] < on[0]):
        on = np.append(-np.inf, on)
    if off.size < on.size:
        off = np.append(off, np.inf)
    on, off = joined_runs(on, off, _CHATTER_S)
    low = np.concatenate([[np.inf], on[1:] - off[:-1], [np.inf]])
    high = off - on
    alone = np.minimum(low[:-1], low[1:]) > _BLIP_ALONE * high
    blip = alone & (high < _BLIP_SHARE * _typical(high))
    on, off = on[~blip], off[~blip]
    on, _ = joined_runs(on, off, _DROPOUT_SHARE * _typical(on[1:] - off[:-1]))
    kept: np.ndarray = np.isin(t[rise], on)
    return kept


def _typical(length: np.ndarray) -> float:
    """Return the median of the runs that may be a stance or a swing, 0 where there is none."""
    long = length[np.isfinite(length) & (length > _RUN_S)]
    return float(np.median(long)) if long.size else 0.0


def _select(
    time_s: np.ndarray, kept: np.ndarray, *, seen: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Apply the refractory time, twice; rises that were not seen block what follows them."""
    stands = _outside_refractory(time_s, kept, wait_s=_REFRACTORY_S, expected=np.nan)
    if stands.size > 1:
        interval = float(np.median(np.diff(time_s[stands])))
        wait_s = _REFRACTORY_SHARE * interval
        stands = _outside_refractory(time_s, kept, wait_s=wait_s, expected=interval)
    strike = np.zeros(time_s.size, dtype=bool)
    strike[stands] = True
    return time_s[strike & seen], time_s[~strike & seen]


def _outside_refractory(
    time_s: np.ndarray, kept: np.ndarray, *, wait_s: float, expected: float
) -> np.ndarray:
    """Return the indices of accepted rises: of two closer than ``wait_s``, as a rule the first.

    The second stands, debounced or not, where the first came early and the second
    in time, by the median of the last five intervals: the first was a false contact.
    """
    stands: list[int] = []
    times = time_s.tolist()
    for k, (now, clean) in enumerate(zip(times, kept.tolist(), strict=True)):
        apart = now - times[stands[-1]] if stands else np.inf
        if clean and apart >= wait_s:
            stands.append(k)
        elif len(stands) > 1 and apart < wait_s:
            recent = sorted(times[b] - times[a] for a, b in pairwise(stands[-7:-1]))
            usual = recent[2] if len(recent) == 5 else expected
            before = times[stands[-2]]
            early = times[stands[-1]] - before < _EARLY * usual
            if early and _ON_TIME[0] <= (now - before) / usual <= _ON_TIME[1]:
                stands[-1] = k
    return np.array(stands, dtype=int)
