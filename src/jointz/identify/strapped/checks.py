"""Checks of average responses before the fit, and of the fit."""

import numpy as np

from jointz.core.codes import Failure
from jointz.identify.prediction.signal_checks import shows_stiff_joint, smallest_response
from jointz.identify.strapped.posterior import LegPosterior
from jointz.identify.strapped.responses import PointResponse

#: Inertia dominates for so long, s; motion against the torque by so many sds has a wrong sign.
_EARLY_S, _AGAINST_SD = 0.06, 4.0
#: Longest lag of the sensor, s.
_LONGEST_LAG_S = 0.03


def response_failure(point: PointResponse) -> Failure | None:
    """Return why the responses of a timing point cannot be fitted, None if they can."""
    stride = point.stride_covariance(np.zeros(point.time_s.size))
    checked = [_signed_response(point, stride, k) for k in range(len(point.shapes))]
    if any(against for _, against, _ in checked):
        return Failure.OPPOSITE_SIGN
    if not any(moved for moved, _, _ in checked):
        # Walking must not hide the response of a stiff joint, too.
        return Failure.CONSTANT_ANGLE if any(clear for _, _, clear in checked) else None
    return None


def _signed_response(point: PointResponse, stride: np.ndarray, k: int) -> tuple[bool, bool, bool]:
    """Return whether the joint moves, whether against the torque, and whether it would show.

    From rest a joint first accelerates with the torque, whatever its stiffness: the motion of an
    inertia alone, the torque integrated twice, has the sign of the true one.
    """
    shape = point.shapes[k]
    noise = stride * (1.0 / shape.n_pulses + 1.0 / point.n_strides)
    angle = shape.angle[0]
    moved = float(angle @ np.linalg.solve(noise, angle)) > smallest_response(angle.size)
    early = point.time_s < _EARLY_S
    free = np.cumsum(np.cumsum(shape.torque))[early]
    weighted = np.linalg.solve(noise[np.ix_(early, early)], free)
    against = float(angle[early] @ weighted) < -_AGAINST_SD * float(np.sqrt(free @ weighted))
    return moved, against, shows_stiff_joint(noise, shape.torque)


def lag_failure(posterior: LegPosterior) -> Failure | None:
    """Return a failure if the sensor is later than any that is modelled."""
    lags = [posterior.shared_moments(name)[0] for name in ("sensor_delay_s", "sensor_lag_s")]
    return Failure.LAG_OUT_OF_RANGE if float(np.exp(lags).sum()) > _LONGEST_LAG_S else None
