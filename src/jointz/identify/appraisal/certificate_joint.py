r"""The joint that a certificate injects: a linear system, stepped by matrix exponentials.

.. math:: J \dot v = \tau - K(t) x - B(t) v

behind it tissue of second order, a first-order lag and a pure delay. Torque is a straight line
between samples; K and B are held over each step at their value in its middle, which a step of
2 ms makes exact enough (see the tests). Written apart from
:mod:`jointz.kernels.joint_response`: a certificate must be able to reveal its error.
"""

from dataclasses import dataclass

import numpy as np
from scipy.interpolate import CubicHermiteSpline
from scipy.linalg import expm

# Places of the state: joint, tissue, lag; then torque and its rise.
_X, _V, _Y, _YD, _Z, _TORQUE, _RISE = range(7)
_STATES = 5
#: A lag shorter than this, s, is none.
_INSTANT_S = 1e-5


@dataclass(frozen=True, slots=True)
class InjectedJoint:
    """A joint and the chain of instruments that shows its angle; SI."""

    stiffness: float  # N*m/rad, at ``stiffness_at_s``
    damping: float  # N*m*s/rad, at ``damping_at_s``
    inertia: float  # kg*m^2
    stiffness_slope: float = 0.0  # change of the stiffness, N*m/rad per s
    damping_slope: float = 0.0  # change of the damping, N*m*s/rad per s
    stiffness_at_s: float = 0.0  # s: time from the onset at which the stiffness is ``stiffness``
    damping_at_s: float = 0.0  # s: time from the onset at which the damping is ``damping``
    lag_s: float = 0.0  # s: time constant of the first-order lag
    delay_s: float = 0.0  # s: pure delay
    resonance_hz: float = 0.0  # resonance of the tissue, Hz; 0: rigid tissue
    resonance_damping: float = 0.0  # damping ratio of that resonance
    cross_talk: float = 0.0  # rad/(N*m): angle shown per torque
    angle_gain: float = 1.0  # shown over true angle


@dataclass(frozen=True, slots=True, eq=False)
class InjectedResponse:
    """Response of an injected joint."""

    shown: np.ndarray  # angle that the sensor shows, rad
    stiffness: float  # N*m/rad: mean over the window, weighted by the effect on the motion
    damping: float  # N*m*s/rad: mean over the window, weighted by the effect on the motion


def injected_response(
    torque: np.ndarray, joint: InjectedJoint, *, period_s: float, window_s: float
) -> InjectedResponse:
    """Return the response of a joint at rest to a torque, and its mean K and B.

    The means are those of SCIENCE, trap 10: a change of K at one moment moves the angle from
    then on, and counts by what least squares on the angle would make of it.
    """
    states = _states(torque, joint, period_s)
    times = np.arange(torque.size) * period_s
    place, rate = _output(states, joint)
    curve = CubicHermiteSpline(times, place, rate)
    late = times - joint.delay_s
    delayed = np.where(late > 0.0, curve(np.maximum(late, 0.0)), 0.0)
    within = slice(0, int(window_s / period_s + 1e-9) + 1)
    kick = np.zeros(torque.size)
    kick[0] = 1.0
    answer = _states(kick, joint, period_s)[within, _X]
    since_K, since_B = (times[within] - at for at in (joint.stiffness_at_s, joint.damping_at_s))
    weight_K = _moment_weights(answer, states[within, _X])
    weight_B = _moment_weights(answer, states[within, _V])
    return InjectedResponse(
        shown=joint.angle_gain * (delayed + joint.cross_talk * torque),
        stiffness=joint.stiffness + joint.stiffness_slope * float(weight_K @ since_K),
        damping=joint.damping + joint.damping_slope * float(weight_B @ since_B),
    )


def _moment_weights(answer: np.ndarray, motion: np.ndarray) -> np.ndarray:
    """Return the weight of each moment in a fit of the factor of the motion; sum 1."""
    n = motion.size
    lower = np.tril(answer[np.subtract.outer(np.arange(n), np.arange(n)).clip(0)])
    effect = lower * motion
    weight = effect.T @ effect.sum(axis=1)
    return np.asarray(weight / weight.sum())


def _states(torque: np.ndarray, joint: InjectedJoint, period_s: float) -> np.ndarray:
    """Return the state at every sample, (n, 5)."""
    steps = _steps(torque.size - 1, joint, period_s)
    states = np.zeros((torque.size, _STATES))
    rises = np.diff(torque)
    for k in range(torque.size - 1):
        here = np.array([*states[k], torque[k], rises[k]])
        states[k + 1] = steps[k] @ here
    return states


def _steps(n: int, joint: InjectedJoint, period_s: float) -> np.ndarray:
    """Return the matrices that take state, torque and its rise over each step, (n, 5, 7)."""
    middle = (np.arange(n) + 0.5) * period_s
    stiffness = joint.stiffness + joint.stiffness_slope * (middle - joint.stiffness_at_s)
    damping = joint.damping + joint.damping_slope * (middle - joint.damping_at_s)
    constant = not (joint.stiffness_slope or joint.damping_slope)
    flow = np.zeros((1 if constant else n, _RISE + 1, _RISE + 1))
    flow[:, _X, _V] = 1.0
    flow[:, _V, _X] = -stiffness[: len(flow)] / joint.inertia
    flow[:, _V, _V] = -damping[: len(flow)] / joint.inertia
    flow[:, _V, _TORQUE] = 1.0 / joint.inertia
    flow[:, _TORQUE, _RISE] = 1.0 / period_s
    before = _X
    if joint.resonance_hz > 0.0:
        rate = 2.0 * np.pi * joint.resonance_hz
        flow[:, _Y, _YD] = 1.0
        flow[:, _YD, _X], flow[:, _YD, _Y] = rate**2, -(rate**2)
        flow[:, _YD, _YD] = -2.0 * joint.resonance_damping * rate
        before = _Y
    if joint.lag_s > _INSTANT_S:
        flow[:, _Z, before] = 1.0 / joint.lag_s
        flow[:, _Z, _Z] = -1.0 / joint.lag_s
    steps = expm(flow * period_s)[:, :_STATES]
    return np.asarray(np.broadcast_to(steps, (n, *steps.shape[1:])))


def _output(states: np.ndarray, joint: InjectedJoint) -> tuple[np.ndarray, np.ndarray]:
    """Return the signal before the delay, and its derivative."""
    place, rate = states[:, _X], states[:, _V]
    if joint.resonance_hz > 0.0:
        place, rate = states[:, _Y], states[:, _YD]
    if joint.lag_s > _INSTANT_S:
        lagged = states[:, _Z]
        return lagged, (place - lagged) / joint.lag_s
    return place, rate
