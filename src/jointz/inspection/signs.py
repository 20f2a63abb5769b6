"""Directions of angle and torque, as far as the samples decide them."""

import numpy as np

from jointz.inspection.guess import Assignments, si_of
from jointz.inspection.inspection_result import SeenClock

_BENT_DEG, _STRETCHED_DEG = 35.0, 25.0  # a walking knee bends beyond, and stretches no further
#: Lowest and highest of an angle that is 180 where the knee is straight.
_INCLUDED_DEG = ((40.0, 130.0), (150.0, 200.0))
_FIT_S, _DELAY_S = 0.06, 0.01
_FEWEST_PULSES, _CLEAR = 5, 4.0
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
    (low_min, low_max), (high_min, high_max) = _INCLUDED_DEG
    if low_min <= low <= low_max and high_min <= high <= high_max:
        return "extension", True, f"{seen}: 180 is straight"
    if high > _BENT_DEG and low > -_STRETCHED_DEG:
        return "flexion", False, f"{seen}: a knee bends so far"
    if low < -_BENT_DEG and high < _STRETCHED_DEG:
        return "extension", False, f"{seen}: a knee does not stretch so far"
    return "", False, seen


def torque_side(
    time_s: np.ndarray, angle: np.ndarray, torque: np.ndarray, onsets_s: np.ndarray
) -> float:
    """Return how clearly pulses of torque accelerate the joint in their own direction.

    It is the mean change of acceleration along the change of torque over its standard error: the
    torque acts on the joint where it is well above 0, on the device where it is well below.
    """
    turned = []
    for onset_s in onsets_s:
        before = (time_s >= onset_s - _FIT_S) & (time_s <= onset_s)
        after = (time_s > onset_s + _DELAY_S) & (time_s <= onset_s + _DELAY_S + _FIT_S)
        if min(before.sum(), after.sum()) < 4 or np.isnan(angle[before | after]).any():
            continue
        jump = [np.polyfit(time_s[part] - onset_s, angle[part], 2)[0] for part in (after, before)]
        change = np.nanmean(torque[after]) - np.nanmean(torque[before])
        turned.append((jump[0] - jump[1]) * np.sign(change))
    if len(turned) < _FEWEST_PULSES:
        return 0.0
    error = float(np.std(turned, ddof=1) / np.sqrt(len(turned))) or 1.0
    return float(np.mean(turned)) / error


def is_clear(score: float) -> bool:
    """Whether pulses decide the side on which a torque acts."""
    return abs(score) > _CLEAR


def switch_is_inverted(assigned: Assignments, clock: SeenClock) -> bool:
    """Whether a footswitch is low on the ground: it rises where a walking knee is bent.

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
