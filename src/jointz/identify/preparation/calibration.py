"""What is known of the instruments behind an average over several recordings."""

from collections import Counter
from collections.abc import Mapping, Sequence

import numpy as np

from jointz.core.study import Calibrated, CalibrationSpec

#: Entries whose absence does not mean a perfect instrument, and whose mean means nothing.
_NO_ERRORS = ("contact_threshold_v", "contact_release_v", "tissue_hz")


def value_of(entry: Calibrated | None, default: float) -> float:
    """Return the value of a calibration's entry."""
    return default if entry is None else float(entry.value)


def relative_sd(gain: Calibrated | None) -> float:
    """Return the sd of a gain over its value, zero without one."""
    return 0.0 if gain is None else gain.sd / gain.value


def joint_angle(angle: np.ndarray, torque: np.ndarray, known: CalibrationSpec) -> np.ndarray:
    """Return the angle of the joint: what torque made the sensor show off, its gain divided out.

    The sensor's mount twists at once, so that the torque of the same sample counts.
    """
    twist, gain = known.angle_per_torque, value_of(known.angle_gain, 1.0)
    if twist is not None:
        angle = angle - twist.value * torque / value_of(known.torque_gain, 1.0)
    return angle if gain == 1.0 else angle / gain


def twist_sd(known: CalibrationSpec) -> float:
    """Return the sd of the angle shown per torque, of the joint's angle, rad/(N*m)."""
    twist = known.angle_per_torque
    return 0.0 if twist is None else twist.sd / value_of(known.angle_gain, 1.0)


def pooled_calibration(
    calibrations: Sequence[CalibrationSpec], *, usual: Mapping[str, Calibrated] | None = None
) -> CalibrationSpec:
    """Combine the calibrations of the pulses of a cell.

    Holds to first order, for recordings whose responses are alike: where a share
    ``w_k`` of the pulses has the error ``e_k``, their average has the sum of
    ``w_k * e_k``. Equal entries are one calibration and share their error; the errors
    of others are independent. A recording without an entry, and not in ``usual``, has perfect
    instruments. What is no error of a response, the levels of a footswitch and the resonance of
    tissue, is left out where the recordings do not agree and ``usual`` does not say.
    """
    pooled = {}
    for name in CalibrationSpec.model_fields:
        entries = [getattr(calibration, name) for calibration in calibrations]
        pooled[name] = entries[0] if len(set(entries)) == 1 else _mean(name, entries, usual or {})
    return CalibrationSpec(**pooled)


def _mean(
    name: str, entries: Sequence[Calibrated | None], usual: Mapping[str, Calibrated]
) -> Calibrated | None:
    if name in _NO_ERRORS and name not in usual:
        return None
    gain = name.endswith("_gain")
    missing = usual.get(name, Calibrated(value=1.0 if gain else 0.0, sd=0.0))
    counts = Counter(entry or missing for entry in entries)
    shares = np.array(list(counts.values())) / len(entries)
    values = np.array([entry.value for entry in counts])
    sds = np.array([entry.sd for entry in counts])
    value = float(shares @ values)
    # What is left of a gain after its division is relative.
    sd = value * np.linalg.norm(shares * sds / values) if gain else np.linalg.norm(shares * sds)
    return Calibrated(value=value, sd=float(sd))
