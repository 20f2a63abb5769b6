"""Best passive and quasi-passive joints for a torque over the stride, by least squares."""

from dataclasses import dataclass

import numpy as np
from scipy.optimize import nnls

#: Bound of the rest angle of a passive spring, rad.
REST_LIMIT = np.pi
#: Below this share of the product of the diagonals a two-parameter problem is singular.
_SINGULAR = 1e-12


@dataclass(frozen=True, slots=True)
class PassiveFit:
    """A spring and a damper that act all the time: torque = k (rest - angle) - b velocity."""

    stiffness: float  # N*m/rad
    damping: float  # N*m*s/rad
    rest_angle: float  # rad
    spring: np.ndarray  # (n,) torque of the spring, N*m
    torque: np.ndarray  # (n,) torque of both, N*m


@dataclass(frozen=True, slots=True)
class ClutchFit:
    """A spring that is engaged without torque in one part of the cycle, and two dampers."""

    engaged: int  # first node of the part
    released: int  # last node of the part
    stiffness: float  # N*m/rad
    rest_angle: float  # rad: angle at engagement
    damping_engaged: float  # N*m*s/rad
    damping_free: float  # N*m*s/rad
    stored_j: float  # energy put into the spring while engaged
    returned_j: float  # energy that it gives back while engaged
    loss_j: float  # energy left in the spring at release
    spring: np.ndarray  # (n,) torque of the spring, N*m
    torque: np.ndarray  # (n,) torque of spring and dampers, N*m


def fit_passive(angle: np.ndarray, velocity: np.ndarray, torque: np.ndarray) -> PassiveFit:
    """Return the spring and damper with the least squared error over the nodes."""
    # Two springs with rest angles at both bounds add up to any spring in between.
    columns = np.column_stack([-REST_LIMIT - angle, REST_LIMIT - angle, -velocity])
    (lower, upper, damping), _ = nnls(columns, torque)
    stiffness = float(lower + upper)
    rest = float(REST_LIMIT * (upper - lower) / stiffness) if stiffness > 0.0 else 0.0
    spring = stiffness * (rest - angle)
    return PassiveFit(stiffness, float(damping), rest, spring, spring - damping * velocity)


def fit_clutch(angle: np.ndarray, velocity: np.ndarray, torque: np.ndarray) -> ClutchFit:
    """Return the best clutched spring among all first and last nodes, and both dampers.

    The part has at least two nodes, and at least one node is left outside.
    """
    n = angle.size
    turn = (np.arange(n)[:, None] + np.arange(n)) % n  # row: first node; column: nodes after it
    stretch, drag, target = angle[:, None] - angle[turn], -velocity[turn], torque[turn]
    inside = _two_parameters(
        *(np.cumsum(a * b, axis=1) for a, b in (
            (stretch, stretch), (stretch, drag), (drag, drag), (stretch, target), (drag, target),
        ))
    )  # fmt: skip
    moved, worked = np.cumsum(drag * drag, axis=1), np.cumsum(drag * target, axis=1)
    free, gain = _one_parameter(moved[:, -1:] - moved, worked[:, -1:] - worked)
    total = (inside[2] + gain)[:, 1 : n - 1]
    first, more = divmod(int(np.argmax(total)), total.shape[1])
    last = more + 1
    stiffness, damping, outside = (float(x[first, last]) for x in (inside[0], inside[1], free))
    part = turn[first, : last + 1]
    spring, dampings = np.zeros(n), np.full(n, outside)
    spring[part] = stiffness * (angle[first] - angle[part])
    dampings[part] = damping
    energy = 0.5 * stiffness * (angle[first] - angle[part]) ** 2
    change = np.diff(energy)
    return ClutchFit(
        engaged=first,
        released=int(part[-1]),
        stiffness=stiffness,
        rest_angle=float(angle[first]),
        damping_engaged=damping,
        damping_free=outside,
        stored_j=float(change[change > 0.0].sum()),
        returned_j=float(-change[change < 0.0].sum()),
        loss_j=float(energy[-1]),
        spring=spring,
        torque=spring - dampings * velocity,
    )


def _one_parameter(square: np.ndarray, product: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return values >= 0 of one coefficient, and how far each lowers the sum of squares."""
    # What is left of a sum of squares after subtraction may be a rounding error of zero.
    usable = square > _SINGULAR * max(float(square.max()), np.finfo(float).tiny)
    product = np.where(usable, np.maximum(product, 0.0), 0.0)
    value = product / np.where(usable, square, 1.0)
    return value, value * product


def _two_parameters(
    xx: np.ndarray, xy: np.ndarray, yy: np.ndarray, xt: np.ndarray, yt: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return values >= 0 of two coefficients, and how far they lower the sum of squares."""
    det = xx * yy - xy**2
    regular = det > _SINGULAR * xx * yy
    safe = np.where(regular, det, 1.0)
    x, y = (xt * yy - yt * xy) / safe, (yt * xx - xt * xy) / safe
    both = regular & (x >= 0.0) & (y >= 0.0)
    (x_only, x_gain), (y_only, y_gain) = _one_parameter(xx, xt), _one_parameter(yy, yt)
    by_x = x_gain >= y_gain
    return (
        np.where(both, x, np.where(by_x, x_only, 0.0)),
        np.where(both, y, np.where(by_x, 0.0, y_only)),
        np.where(both, x * xt + y * yt, np.maximum(x_gain, y_gain)),
    )
