"""Checks of average responses before the fit, and of the fit."""

import numpy as np

from jointz.core.codes import Failure
from jointz.identify.prediction.signal_checks import shows_stiff_joint, smallest_response
from jointz.identify.walking.map_fit import MapSearch
from jointz.identify.walking.posterior import LegPosterior
from jointz.identify.walking.responses import PointResponse

#: Inertia dominates for so long, s; motion against the torque by so many sds has a wrong sign.
_EARLY_S, _AGAINST_SD = 0.06, 4.0
#: Torque below this is none, N*m.
_LEAST_NM = 1e-3
#: Change of response over torque from small pulses to large ones, in logarithms, and the sds by
#: which it must differ from 0. K, B and J of a size in the middle are off by half of it.
_LARGEST_CHANGE, _CHANGE_SD = float(np.log(1.5)), 4.0
#: Longest lag of the sensor, s.
_LONGEST_LAG_S = 0.03


def response_failure(point: PointResponse) -> Failure | None:
    """Return why the responses of a timing point cannot be fitted, None if they can."""
    stride = point.stride_covariance(np.zeros((1, point.time_s.size)))
    checks = [_signed_response(point, stride, k) for k in range(len(point.shapes))]
    moved, against, clear = zip(*checks, strict=True)
    if any(against):
        return Failure.OPPOSITE_SIGN
    # Walking must not hide the response of a stiff joint, too.
    return Failure.CONSTANT_ANGLE if any(clear) and not any(moved) else None


def _signed_response(point: PointResponse, stride: np.ndarray, k: int) -> tuple[bool, bool, bool]:
    """Return whether the joint moves, whether against the torque, and whether it would show.

    From rest a joint first accelerates with the torque, whatever its stiffness: the motion of an
    inertia alone, the torque integrated twice, has the sign of the true one.
    """
    shape = point.shapes[k]
    noise = stride * (1.0 / shape.n_pulses + 1.0 / point.n_strides)
    angle = shape.sensor_signals[0]
    moved = float(angle @ np.linalg.solve(noise, angle)) > smallest_response(angle.size)
    early = point.time_s < _EARLY_S
    free = np.cumsum(np.cumsum(shape.torque))[early]
    weighted = np.linalg.solve(noise[np.ix_(early, early)], free)
    against = float(angle[early] @ weighted) < -_AGAINST_SD * float(np.sqrt(free @ weighted))
    return moved, against, shows_stiff_joint(noise, shape.torque)


def lag_failure(posterior: LegPosterior) -> Failure | None:
    """Return a failure if the sensor is later than any that is modelled."""
    return Failure.LAG_OUT_OF_RANGE if posterior.lag_moments()[0] > _LONGEST_LAG_S else None


def differs_with_size(posterior: LegPosterior) -> bool:
    """Return whether large and small pulses are answered as if a torque were recorded wrongly.

    A motor at its limit, whose torque is stated as commanded, moves the joint too little in large
    pulses. Softening is in the model.
    """
    model, fit = posterior.model, posterior.best
    sizes = [
        np.log([max(float(np.abs(s.torque).max()), _LEAST_NM) for s in point.shapes])
        for point in model.points
    ]
    every = np.concatenate(sizes)
    span = float(np.ptp(every))
    if span == 0.0:
        return False
    additions = [
        np.repeat((size - every.mean()) / span, point.shapes[0].sensor_signals.size)
        * model.responses(fit.theta[None], k)[0]
        for k, (size, point) in enumerate(zip(sizes, model.points, strict=True))
    ]
    # Of the logarithm of response over torque, from the smallest pulse to the largest.
    change, sd = MapSearch(model, fit.prior).size_of(fit, additions)
    return abs(change) > max(_LARGEST_CHANGE, _CHANGE_SD * sd)
