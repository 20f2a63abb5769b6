"""Directions of angle and torque, as far as the samples decide them."""

import numpy as np
from scipy.special import stdtrit

from jointz.inspection.guess import Assignments, si_of
from jointz.inspection.inspection_result import SeenClock

_BENT_DEG, _STRETCHED_DEG = 35.0, 25.0  # a walking knee bends beyond, and stretches no further
_MOST_BENT_DEG = 110.0
#: Largest of an angle that is 180 where the knee is straight.
_STRAIGHT_FROM_DEG, _STRAIGHT_TO_DEG = 130.0, 210.0
_SPANS_S = ((-0.045, 0.0), (0.005, 0.05))  # before an onset, and after it
_FEWEST_PULSES, _FEWEST_SAMPLES = 5, 4
_SURE = 0.997
_CLEAR_OF_PULSES_S = 0.4
_STRIDE_S, _ALIKE = (0.7, 2.0), 0.5
_BENT_MORE_DEG = 15.0


def angle_direction(assigned: Assignments) -> tuple[str, bool, str]:
    """Return the direction in which a walking knee's angle grows, "" where its range is unclear.

    Beside it stand whether 180 deg is straight, and the reason.
    """
    inspected, assignment = assigned["angle"]
    _, factor = si_of(assignment)
    values = np.rad2deg(factor * inspected.column.values)
    finite = values[np.isfinite(values)]
    if not finite.size:
        return "", False, "no numbers"
    low, high = np.percentile(finite, [1.0, 99.0])
    seen = f"{low:.0f} to {high:.0f} deg"
    if low > _BENT_DEG and _STRAIGHT_FROM_DEG < high < _STRAIGHT_TO_DEG:
        return "extension", True, f"{seen}: 180 is straight"
    if -_STRETCHED_DEG < low < _BENT_DEG < high < _MOST_BENT_DEG:
        return "flexion", False, f"{seen}: a knee bends so far"
    if -_MOST_BENT_DEG < low < -_BENT_DEG < high < _STRETCHED_DEG:
        return "extension", False, f"{seen}: a knee does not stretch so far"
    return "", False, seen


def torque_side(
    time_s: np.ndarray, angle: np.ndarray, torque: np.ndarray, onsets_s: np.ndarray
) -> float:
    """Return how clearly pulses of torque move the joint in their own direction.

    It is the mean change of acceleration along that of torque, less that in the strides before and
    after, over the half-width of its interval: the torque acts on the joint above 1, on the device
    below -1.
    """
    stride_s = _stride_s(time_s, angle)
    turned = []
    for onset_s in onsets_s:
        moved = _change(time_s, angle, onset_s, of_bend=True)
        near = [onset_s - stride_s, onset_s + stride_s] if stride_s else []
        alone = [t for t in near if np.abs(onsets_s - t).min() > _CLEAR_OF_PULSES_S]
        beside = [_change(time_s, angle, t, of_bend=True) for t in alone] if stride_s else [0.0]
        beside = [one for one in beside if np.isfinite(one)]
        if np.isfinite(moved) and beside:
            pushed = _change(time_s, torque, onset_s)
            turned.append((moved - np.mean(beside)) * np.sign(pushed))
    turned = [one for one in turned if np.isfinite(one)]
    if len(turned) < _FEWEST_PULSES:
        return 0.0
    error = float(np.std(turned, ddof=1) / np.sqrt(len(turned))) or 1.0
    return float(np.mean(turned)) / error / float(stdtrit(len(turned) - 1, _SURE))


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


def _stride_s(time_s: np.ndarray, angle: np.ndarray) -> float:
    """Return the time after which a walking joint's angle repeats, 0 where it does not."""
    step = float(np.median(np.diff(time_s)))
    moved = np.nan_to_num(angle - np.nanmean(angle))
    spectrum = np.fft.rfft(moved, 2 * moved.size)
    repeats = np.fft.irfft(np.abs(spectrum) ** 2)[: moved.size]
    first, last = (round(s / step) for s in _STRIDE_S)
    if last >= moved.size or not repeats[0]:
        return 0.0
    best = first + int(np.argmax(repeats[first:last]))
    return best * step if repeats[best] > _ALIKE * repeats[0] else 0.0


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
    direction, from_180, _ = angle_direction(assigned)
    if not direction:
        return False
    bend = np.rad2deg(si_of(assignment)[1] * inspected.column.values)
    bend = (180.0 - bend if from_180 else -bend) if direction == "extension" else bend
    contact = assigned["contact"][0].column.values
    is_high = contact > (np.nanmin(contact) + np.nanmax(contact)) / 2
    rises, falls = (np.flatnonzero(np.diff(is_high.astype(int)) == step) for step in (1, -1))
    if min(rises.size, falls.size) < _FEWEST_PULSES:
        return False
    return bool(np.nanmedian(bend[rises]) - np.nanmedian(bend[falls]) > _BENT_MORE_DEG)
