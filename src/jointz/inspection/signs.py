"""Directions of angle and torque, as far as the samples decide them."""

import numpy as np
from scipy.signal import find_peaks
from scipy.special import stdtrit

from jointz.inspection.guess import Assignments, si_of
from jointz.inspection.inspection_result import SeenClock

_BENT_DEG, _STRETCHED_DEG = 35.0, 25.0  # a walking knee bends beyond, and stretches no further
_MOST_BENT_DEG = 110.0
#: Angle of a straight knee -> largest smallest bend; an included angle may have an offset.
_LEAST_BENT_DEG = {0: 35.0, 180: 50.0}
_SPANS_S = ((-0.045, 0.0), (0.005, 0.05))  # before an onset, and after it
_FEWEST_PULSES, _FEWEST_SAMPLES = 5, 4
_SURE = 0.997
_CLEAR_OF_PULSES_S = 0.4
_STRIDE_S, _ALIKE, _AS_HIGH = (0.7, 2.5), 0.4, 0.85
_REPEAT_STEP_S, _REST_STEP_S = 0.01, 0.02
_GAIT_DEG, _SLOW = 20.0, 0.15  # range of a knee or ankle; share of speed at rest
_SINE, _HARMONIC = 0.01, 0.1  # power of the second harmonic, in that of the first
_BENT_MORE_DEG = 15.0


def angle_direction(assigned: Assignments) -> tuple[str, int, str]:
    """Return the direction in which a walking knee's angle grows, "" where its range is unclear.

    Beside it stand the angle of a straight knee, 0 or 180 deg, and the reason.
    """
    inspected, assignment = assigned["angle"]
    _, factor = si_of(assignment)
    values = np.rad2deg(factor * inspected.column.values)
    finite = values[np.isfinite(values)]
    if not finite.size:
        return "", 0, "no numbers"
    low, high = np.percentile(finite, [1.0, 99.0])
    for straight, least_bent in _LEAST_BENT_DEG.items():
        seen = f"{low:.0f} to {high:.0f} deg" + (f": {straight} is straight" if straight else "")
        for direction, least, most in (
            ("flexion", low - straight, high - straight),
            ("extension", straight - high, straight - low),
        ):
            if -_STRETCHED_DEG < least < least_bent and _BENT_DEG < most < _MOST_BENT_DEG:
                return direction, straight, f"{seen}: a knee bends so far"
    return "", 0, f"{low:.0f} to {high:.0f} deg"


def torque_side(
    time_s: np.ndarray, angle: np.ndarray, torque: np.ndarray, onsets_s: np.ndarray
) -> tuple[float, float]:
    """Return how clearly pulses of torque move the joint in their own direction, and its inertia.

    The torque acts on the joint above 1, on the device below -1. The inertia is the torque over the
    acceleration that it causes.
    """
    stride_s = repeat_s(time_s, angle)
    moved = responses(time_s, angle, onsets_s, stride_s, of_bend=True)
    pushed = responses(time_s, torque, onsets_s, stride_s)
    bend = float(np.nanmean(turned)) if np.isfinite(turned := moved * np.sign(pushed)).any() else 0
    inertia = float(np.nanmean(np.abs(pushed))) / (2 * bend) if bend else np.nan
    return clearness(turned), abs(inertia)


def responses(
    time_s: np.ndarray,
    values: np.ndarray,
    onsets_s: np.ndarray,
    stride_s: float,
    *,
    of_bend: bool = False,
) -> np.ndarray:
    """Return the change of a signal, or of its bend, at onsets, less that in the strides around.

    It is NaN where samples are missing, or both strides have pulses themselves.
    """
    found = []
    for onset_s in onsets_s:
        near = [onset_s - stride_s, onset_s + stride_s] if stride_s else []
        alone = [t for t in near if np.abs(onsets_s - t).min() > _CLEAR_OF_PULSES_S]
        beside = [_change(time_s, values, t, of_bend=of_bend) for t in alone] if stride_s else [0.0]
        beside = [one for one in beside if np.isfinite(one)]
        usual = np.mean(beside) if beside else np.nan
        found.append(_change(time_s, values, onset_s, of_bend=of_bend) - usual)
    return np.array(found)


def clearness(changes: np.ndarray) -> float:
    """Return the mean of changes over the half-width of its interval, 0 where there are few."""
    changes = changes[np.isfinite(changes)]
    if changes.size < _FEWEST_PULSES:
        return 0.0
    error = float(np.std(changes, ddof=1) / np.sqrt(changes.size)) or 1.0
    return float(np.mean(changes)) / error / float(stdtrit(changes.size - 1, _SURE))


def _change(
    time_s: np.ndarray, values: np.ndarray, onset_s: float, *, of_bend: bool = False
) -> float:
    """Return the change of a signal at an onset, or of its bend; NaN where samples are missing."""
    found = []
    for span in _SPANS_S:
        first, last = np.searchsorted(time_s, onset_s + np.array(span))
        part = values[first:last]
        if part.size < _FEWEST_SAMPLES or np.isnan(part).any():
            return np.nan
        found.append(
            np.polyfit(time_s[first:last] - onset_s, part, 2)[0] if of_bend else part.mean()
        )
    return float(found[1] - found[0])


def step_of(time_s: np.ndarray) -> float:
    """Return the usual time between samples, s."""
    return float(np.nanmedian(np.diff(time_s)))


def repeat_s(time_s: np.ndarray, angle: np.ndarray) -> float:
    """Return the time after which a walking joint's angle repeats, 0 where it does not."""
    every = max(1, round(_REPEAT_STEP_S / step_of(time_s)))
    step = every * step_of(time_s)
    moved = np.nan_to_num(angle - np.nanmean(angle))[::every]
    spectrum = np.fft.rfft(moved, 2 * moved.size)
    repeats = np.fft.irfft(np.abs(spectrum) ** 2)[: round(_STRIDE_S[1] / step)]
    if not repeats.size:  # sampled too slowly
        return 0.0
    peaks, _ = find_peaks(repeats, height=_ALIKE * repeats[0]) if moved.any() else ([], {})
    # A sine repeats after several periods, too: the first of the high ones counts.
    high = [k for k in peaks if repeats[k] > _AS_HIGH * repeats[peaks].max()]
    return high[0] * step if high and high[0] * step > _STRIDE_S[0] else 0.0


def kind_of_motion(time_s: np.ndarray, angle: np.ndarray, *, is_range_sure: bool) -> str:
    """Return how an angle (rad) moves: "gait", "sine", "aperiodic", or "" if it is unclear.

    In walking, a knee or an ankle repeats with a clear second harmonic and is seldom at rest.
    """
    stride_s = repeat_s(time_s, angle)
    n = round(stride_s / step_of(time_s))
    cycles = angle[: angle.size // n * n].reshape(-1, n) if n else np.empty((0, 0))
    cycles = cycles[np.isfinite(cycles).all(axis=1)]
    low, high = np.rad2deg(np.nanpercentile(angle, [1.0, 99.0]))
    is_small = is_range_sure and high - low < _GAIT_DEG
    if not stride_s or (is_small and is_mostly_at_rest(time_s, angle)):
        return "aperiodic"
    power = np.abs(np.fft.rfft(cycles, axis=1)) ** 2
    harmonic = float(np.median(power[:, 2] / power[:, 1])) if len(cycles) else np.nan
    if harmonic < _SINE:
        return "sine"
    return "gait" if is_range_sure and not is_small and harmonic > _HARMONIC else ""


def is_mostly_at_rest(time_s: np.ndarray, angle: np.ndarray) -> bool:
    """Return whether an angle hardly moves in most samples, as between pulses and steps."""
    every = max(1, round(_REST_STEP_S / step_of(time_s)))
    whole = angle[: angle.size // every * every].reshape(-1, every)
    speed = np.abs(np.diff(whole.mean(axis=1)))
    speed = speed[np.isfinite(speed)]
    return bool(speed.size and np.mean(speed < _SLOW * np.percentile(speed, 99.5)) > 0.5)


def is_clear(score: float) -> bool:
    """Return whether a score of pulses decides the side on which a torque acts."""
    return abs(score) > 1.0


def inverted_channels(assigned: Assignments, clock: SeenClock) -> frozenset[str]:
    """Return the footswitch if it is low on the ground, and a force that is negative there."""
    found = set()
    if "contact" in assigned and _is_low_on_ground(assigned, clock):
        found.add("contact")
    if "ground_reaction_force" in assigned:
        course = assigned["ground_reaction_force"][0].course
        if -(course.low or 0.0) > abs(course.high or 0.0):
            found.add("ground_reaction_force")
    return frozenset(found)


def _is_low_on_ground(assigned: Assignments, clock: SeenClock) -> bool:
    """Return whether a footswitch is low on the ground: it rises where a walking knee is bent.

    A knee is nearly straight at heel strike and bent by some 40 deg at toe-off.
    """
    if "angle" not in assigned or clock.rate_hz is None:
        return False
    inspected, assignment = assigned["angle"]
    direction, _, _ = angle_direction(assigned)
    if not direction:
        return False
    bend = np.rad2deg(si_of(assignment)[1] * inspected.column.values)
    bend = -bend if direction == "extension" else bend
    contact = assigned["contact"][0].column.values
    is_high = contact > (np.nanmin(contact) + np.nanmax(contact)) / 2
    rises, falls = (np.flatnonzero(np.diff(is_high.astype(int)) == step) for step in (1, -1))
    if min(rises.size, falls.size) < _FEWEST_PULSES:
        return False
    return bool(np.nanmedian(bend[rises]) - np.nanmedian(bend[falls]) > _BENT_MORE_DEG)
