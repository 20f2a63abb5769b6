"""Calibration of the instruments of an average over several recordings."""

from collections import Counter
from collections.abc import Sequence

import numpy as np

from jointz.core.study import Calibrated, CalibrationSpec

#: Entries that are no errors of a response, so that their mean has no meaning.
_NO_ERRORS = ("contact_threshold_v", "contact_release_v", "tissue_hz")


def value_of(entry: Calibrated | None, default: float) -> float:
    """Return the value of a calibration's entry."""
    return default if entry is None else float(entry.value)


def relative_sd(gain: Calibrated | None) -> float:
    """Return the sd of a gain over its value, zero without one."""
    return 0.0 if gain is None else gain.sd / gain.value


def gains_sd(known: CalibrationSpec) -> float:
    """Return the relative sd of both gains together, common to K, B and J."""
    return float(np.hypot(relative_sd(known.angle_gain), relative_sd(known.torque_gain)))


def joint_angle(angle: np.ndarray, torque: np.ndarray, known: CalibrationSpec) -> np.ndarray:
    """Return the angle of the joint, corrected for torque seen as angle and for the gain.

    The mount of the sensor twists without delay, with the torque of the same sample.
    """
    twist, gain = known.angle_per_torque, value_of(known.angle_gain, 1.0)
    if twist is not None:
        angle = angle - twist.value * torque / value_of(known.torque_gain, 1.0)
    return angle if gain == 1.0 else angle / gain


def twist_sd(known: CalibrationSpec) -> float:
    """Return the sd of the torque seen as angle, rad/(N*m) of the joint's angle."""
    twist = known.angle_per_torque
    return 0.0 if twist is None else twist.sd / value_of(known.angle_gain, 1.0)


def pooled_calibration(calibrations: Sequence[CalibrationSpec]) -> CalibrationSpec:
    """Combine the calibrations of the pulses of a cell.

    To first order, for similar responses: if a share ``w_k`` of the pulses has the error ``e_k``,
    their average has the error ``sum(w_k * e_k)``. Equal entries are one calibration with one
    error; errors of different entries are independent. An instrument without an entry is perfect.
    Entries that are no errors of a response (levels of a footswitch, resonance of tissue) are
    dropped if the recordings differ.
    """
    pooled = {}
    for name in CalibrationSpec.model_fields:
        entries = [getattr(calibration, name) for calibration in calibrations]
        pooled[name] = entries[0] if len(set(entries)) == 1 else _mean(name, entries)
    return CalibrationSpec(**pooled)


def _mean(name: str, entries: Sequence[Calibrated | None]) -> Calibrated | None:
    if name in _NO_ERRORS:
        return None
    gain = name.endswith("_gain")
    perfect = Calibrated(value=1.0 if gain else 0.0, sd=0.0)
    counts = Counter(entry or perfect for entry in entries)
    shares = np.array(list(counts.values())) / len(entries)
    values = np.array([entry.value for entry in counts])
    sds = np.array([entry.sd for entry in counts])
    value = float(shares @ values)
    # The remaining error of a gain is relative.
    sd = value * np.linalg.norm(shares * sds / values) if gain else np.linalg.norm(shares * sds)
    return Calibrated(value=value, sd=float(sd))
