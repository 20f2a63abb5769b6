"""Checks of angle and torque that need no model: degrees taken for rad, a bad torque sensor."""

from collections.abc import Sequence

import numpy as np
import xarray as xr

from jointz.core.codes import Failure
from jointz.gait.timestamps import rate_hz
from jointz.identify.preparation.pulses import Pulse
from jointz.identify.preparation.sources import FRICTION_OF_MODEL

#: Widest range of a joint (rad) and its largest speed (rad/s): a knee that kicks reaches 30 rad/s.
#: Degrees that are taken for rad exceed one or the other.
_WIDEST_RAD, _FASTEST_RAD_S = np.pi, 50.0
#: Neither is judged by the most extreme samples, which may be errors of the sensor, %.
_USUAL_PCT = (1.0, 99.0)
_SPEED_OVER_S = 0.02
#: A flat top has this share of a pulse's samples at the largest value, within a tolerance; it is a
#: sign of clipping if it lies between these shares of the command.
_FLAT_SHARE, _SAME = 0.2, 1e-9
_CLIPPED_SHARES = (0.2, 0.95)
#: A clipped record has this share of its samples at one end, and seldom repeats a value elsewhere.
_AT_END, _IN_RUNS, _REPEATED = 0.01, 0.7, 0.05
#: Share of samples at which the curvature of a noisy record turns its sign: of white noise 2/3.
_NOISY = 0.3
#: A held torque keeps its values for one time, and takes many.
_LONGEST_HOLD_S, _FEWEST_STEPS, _REGULAR, _DISTINCT = 0.01, 20, 0.9, 0.5


def angle_failure(recording: xr.Dataset) -> Failure | None:
    """Return why the angle cannot be that of a joint in rad, None if it can."""
    angle = recording["angle"].to_numpy()
    if not np.isfinite(angle).any():
        return Failure.CONSTANT_ANGLE
    degrees = looks_like_degrees(angle, rate_hz(recording["time"].to_numpy()))
    return Failure.ANGLE_OUT_OF_RANGE if degrees else None


def looks_like_degrees(angle: np.ndarray, rate_hz: float) -> bool:
    """Return whether an angle in rad turns further or faster than a joint."""
    # Percentiles lie within the extremes, which take less time and memory.
    if not np.fmax.reduce(angle) - np.fmin.reduce(angle) <= _WIDEST_RAD:
        low, high = np.nanpercentile(angle, _USUAL_PCT)
        if high - low > _WIDEST_RAD:
            return True
    step = max(1, round(_SPEED_OVER_S * rate_hz))
    moved = angle[step:] - angle[:-step]
    np.abs(moved, out=moved)
    if np.fmax.reduce(moved, initial=0.0) * rate_hz / step <= _FASTEST_RAD_S:
        return False
    moved = moved[np.isfinite(moved)]
    speed = np.percentile(moved, _USUAL_PCT[1]) * rate_hz / step if moved.size else 0.0
    return bool(speed > _FASTEST_RAD_S)


def torque_failure(recording: xr.Dataset, pulses: Sequence[Pulse]) -> Failure | None:
    """Return a failure if the torque looks clipped at a share of the command.

    Both a motor at its limit, whose torque is correct, and a saturated sensor, whose torque is too
    small, clip it; the latter makes K, B and J too small by one factor without a worse fit. The
    shape of the rise distinguishes them only if the lag is known well, so this is not attempted.
    A flat top at the commanded torque indicates neither.
    """
    if not pulses or not np.isfinite([p.amplitude for p in pulses]).all():
        return None
    time, torque = recording["time"].to_numpy(), recording["torque"].to_numpy()
    raw = recording["current"].to_numpy() if "current" in recording else torque
    if FRICTION_OF_MODEL in recording:
        torque = torque - recording[FRICTION_OF_MODEL].to_numpy()
    durations = [p.duration_s if np.isfinite(p.duration_s) else 0.1 for p in pulses]
    spans = [
        np.searchsorted(time, [p.onset_s, p.onset_s + d])
        for p, d in zip(pulses, durations, strict=True)
    ]
    inside = [
        (p.sign * raw[a:b], p.sign * torque[a:b]) for p, (a, b) in zip(pulses, spans, strict=True)
    ]
    top = max((float(np.nanmax(r)) for r, _ in inside if np.isfinite(r).any()), default=np.nan)
    levels = []  # of the clipped pulses
    for pulse, (record, driving) in zip(pulses, inside, strict=True):
        at_top = record >= top - _SAME * abs(top)
        if record.size and at_top.mean() > _FLAT_SHARE:
            level = float(np.median(driving[at_top]))
            if _CLIPPED_SHARES[0] < level / abs(pulse.amplitude) < _CLIPPED_SHARES[1]:
                levels.append(level)
    if not levels:
        return None
    # Smaller pulses do not reach the limit.
    larger = np.abs([p.amplitude for p in pulses]) > np.median(levels) / _CLIPPED_SHARES[1]
    return Failure.TORQUE_SATURATED if len(levels) > larger.sum() / 2 else None


def is_clipped(torque: np.ndarray) -> bool:
    """Return whether a record whose values otherwise differ stands at its largest or smallest."""
    size = np.abs(torque).max()
    ends = [np.abs(torque - end) <= _SAME * size for end in (torque.min(), torque.max())]
    at_end = ends[0] | ends[1]
    between = ~(at_end[1:] | at_end[:-1])
    if not between.any() or max(float(end.mean()) for end in ends) < _AT_END:
        return False
    in_runs = np.mean(at_end[1:][at_end[:-1]])
    repeated = np.mean(np.diff(torque)[between] == 0.0)
    # A torque that was calculated may stand at its levels; that of a sensor has noise elsewhere.
    bends = np.diff(torque, 2)[between[1:] & between[:-1]]
    noisy = np.mean(bends[1:] * bends[:-1] < 0.0) if bends.size > 1 else 0.0
    return bool(in_runs > _IN_RUNS and repeated < _REPEATED and noisy > _NOISY)


def is_held(torque: np.ndarray, rate_hz: float) -> bool:
    """Return whether a record keeps each value for one and the same, long time.

    Commanded steps between a few levels do so, too; a sampled torque takes many values.
    """
    changes = torque[1:] != torque[:-1]
    n_changes, shortest_s = np.count_nonzero(changes), 1.05 * _LONGEST_HOLD_S  # rate is rounded
    # The median of the times between changes is at most twice their mean.
    if n_changes < _FEWEST_STEPS or (n_changes - 1) * shortest_s * rate_hz > 2 * torque.size:
        return False
    steps = np.flatnonzero(changes)
    lasted = np.diff(steps)
    usual = float(np.median(lasted))
    regular = float(np.mean(np.abs(lasted - usual) <= 1.0))
    distinct = np.unique(torque[steps]).size / steps.size
    long = usual / rate_hz > shortest_s
    return bool(long and usual >= 2.0 and regular > _REGULAR and distinct > _DISTINCT)
