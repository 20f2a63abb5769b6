"""Checks of angle and torque before anything is fitted to the responses."""

from collections import Counter
from collections.abc import Mapping, Sequence

import numpy as np
import xarray as xr
from scipy.stats import chi2

from jointz.core.codes import Failure
from jointz.identify.preparation.pulses import Pulse
from jointz.identify.preparation.sources import FRICTION_OF_MODEL

#: Widest range of a walking joint; degrees that are declared as radians exceed it.
_WIDEST_RAD = np.pi
_USUAL_PCT = (1.0, 99.0)
#: A flat top has this share of a pulse's samples at the largest value, within a tolerance; it is a
#: sign of clipping if it lies between these shares of the command.
_FLAT_SHARE, _SAME = 0.2, 1e-9
_CLIPPED_SHARES = (0.2, 0.95)
#: Probability with which walking alone makes as large a response.
_NO_RESPONSE = 1e-3
#: The response of a stiff joint (N*m/rad) must exceed so many sds of walking.
_CLEAR, _STIFF = 4.0, 300.0
#: Largest stiffness (N*m/rad) and damping (N*m*s/rad) of the search, and an inertia (kg*m^2) above
#: that of any limb.
LARGEST_IMPEDANCE = (4900.0, 98.0, 5.0)


def smallest_response(n_samples: int) -> float:
    """Return the weighted sum of squares below which a response may be walking alone."""
    return float(chi2.ppf(1.0 - _NO_RESPONSE, n_samples))


def shows_stiff_joint(noise: np.ndarray, torque: np.ndarray) -> bool:
    """Return whether walking, of this covariance, does not hide the response of a stiff joint."""
    error = _CLEAR * float(np.sqrt(np.diag(noise).max()))
    return error < float(np.abs(torque).max()) / _STIFF


def angle_failure(recording: xr.Dataset) -> Failure | None:
    """Return why the angle cannot be that of a joint in rad, None if it can."""
    angle = recording["angle"].to_numpy()
    angle = angle[np.isfinite(angle)]
    if angle.size == 0:
        return Failure.CONSTANT_ANGLE
    low, high = np.percentile(angle, _USUAL_PCT)
    return Failure.ANGLE_OUT_OF_RANGE if high - low > _WIDEST_RAD else None


def torque_failure(recording: xr.Dataset, pulses: Sequence[Pulse]) -> Failure | None:
    """Return a failure if the torque looks clipped.

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
    clipped = 0
    for pulse, (record, driving) in zip(pulses, inside, strict=True):
        at_top = record >= top - _SAME * abs(top)
        if record.size and at_top.mean() > _FLAT_SHARE:
            reached = float(np.median(driving[at_top])) / abs(pulse.amplitude)
            clipped += _CLIPPED_SHARES[0] < reached < _CLIPPED_SHARES[1]
    return Failure.TORQUE_SATURATED if clipped > len(pulses) / 2 else None


def common_failure(failures: Mapping[str, Failure | None]) -> dict[str, Failure | None]:
    """Return failures with the most frequent one for all, if half of the timing points fail.

    All share sensors and actuator, so that the others are no more reliable. If most do not move
    in response, a wrong sign is due to chance.
    """
    counts = Counter(failure for failure in failures.values() if failure is not None)
    if 2 * counts.total() < len(failures):
        return dict(failures)
    usual = counts.most_common(1)[0][0]
    by_chance = Failure.OPPOSITE_SIGN if usual is Failure.CONSTANT_ANGLE else None
    return {
        label: usual if failure in (None, by_chance) else failure
        for label, failure in failures.items()
    }
