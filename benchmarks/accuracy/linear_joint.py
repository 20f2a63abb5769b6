r"""The true joint as a linear system, written for the bound alone.

.. math:: J \dot v = \tau_s - K x - B v - g K r

:math:`\tau_s` is the torque of the motor (rigid strap: J and the rotor move together) or of a
strap of its own stiffness; behind the joint come tissue of second order, a first-order lag and
a pure delay. The reflex :math:`r`, a critically damped twitch, is fed with the deviation or its
rate, late: pulses in its own direction keep it positive, so it is linear too. Torque is a
straight line between samples; the step is exact (matrix exponential).
"""

from dataclasses import dataclass

import numpy as np
from scipy.interpolate import CubicSpline
from scipy.linalg import expm, toeplitz

# States: joint, frame, tissue, lag, reflex. Inputs: torque, what the reflex feels.
_X, _V, _XE, _VE, _Y, _YD, _LAG, _R, _RD = range(9)
_N = 9


@dataclass(frozen=True, slots=True)
class Joint:
    """Joint, strap, tissue and sensor of one moment of the gait cycle; SI.

    Parameters
    ----------
    stiffness, damping, inertia : float
        K, B, J.
    carried : float, kg*m^2
        What moves with the motor: rotor, and frame.
    lag_s, delay_share : float
        Total lag of the angle's record, and the share of it that is pure delay.
    strap, strap_time_s : float, N*m/rad, s
        Strap stiffness (0: rigid), and its damping over it.
    tissue_hz, tissue_damping : float
        Resonance before the sensor (0: none).
    reflex, latency_s, twitch_s : float
        Gain in shares of K, its delay and its twitch.
    reflex_velocity_s : float, s
        Turns velocity into an angle; 0 for a position reflex.
    angle_gain, torsion : float, 1, rad/(N*m)
        Measured over true angle; angle shown for torque.
    """

    stiffness: float
    damping: float
    inertia: float
    carried: float = 0.0
    lag_s: float = 0.0
    delay_share: float = 0.0
    strap: float = 0.0
    strap_time_s: float = 0.0
    tissue_hz: float = 0.0
    tissue_damping: float = 0.0
    reflex: float = 0.0
    latency_s: float = 0.0
    twitch_s: float = 0.04
    reflex_velocity_s: float = 0.0
    angle_gain: float = 1.0
    torsion: float = 0.0


def response_matrix(joint: Joint, n: int, step_s: float) -> np.ndarray:
    """Return the matrix that takes torque at the samples to the shown angle at the samples.

    Parameters
    ----------
    joint : Joint
        At rest at the first sample.
    n : int
        Samples.
    step_s : float, s
        Between them.

    Returns
    -------
    (n, n) float, rad/(N*m)
        Lower triangular. The record before the first sample is zero.
    """
    first, later = _hat_responses(joint, n, step_s)
    delay_s = joint.lag_s * joint.delay_share
    shown = [joint.angle_gain * _late(y, delay_s, step_s) for y in (first, later)]
    # The answer to a torque at sample 1, which rises from sample 0 on, and shifted by one each.
    matrix = np.column_stack([shown[0], toeplitz(shown[1], np.zeros(n))[:, :-1]])
    return np.asarray(matrix + joint.torsion * np.eye(n))


def _hat_responses(joint: Joint, n: int, step_s: float) -> tuple[np.ndarray, np.ndarray]:
    """Return the angle after a torque of 1 at sample 0 and, one sample later, at sample 1."""
    system, feed = _system(joint)
    augmented = np.zeros((_N + 4, _N + 4))
    augmented[:_N, :_N], augmented[:_N, _N : _N + 2] = system, feed
    augmented[_N : _N + 2, _N + 2 :] = np.eye(2) / step_s
    step = expm(augmented * step_s)
    keep, now, rise = step[:_N, :_N], step[:_N, _N : _N + 2], step[:_N, _N + 2 :]
    output = _output_of(joint)
    late = round(joint.latency_s / step_s)
    answers = []
    for at in (0, 1):
        states = np.zeros((n + 1, _N))
        felt = np.zeros(n + 2)
        for k in range(n):
            if joint.reflex and k + 1 >= late:
                felt[k + 1] = _felt(joint, states[k + 1 - late])
            u = np.array([float(k == at), felt[k]])
            after = np.array([float(k + 1 == at), felt[k + 1]])
            states[k + 1] = keep @ states[k] + now @ u + rise @ (after - u)
        answers.append(states[:n, output])
    return answers[0], answers[1]


def _felt(joint: Joint, state: np.ndarray) -> float:
    if joint.reflex_velocity_s:
        return float(joint.reflex_velocity_s * state[_V])
    return float(state[_X])


def _system(joint: Joint) -> tuple[np.ndarray, np.ndarray]:
    flow, feed = np.zeros((_N, _N)), np.zeros((_N, 2))
    flow[_X, _V] = 1.0
    moved = joint.inertia + (0.0 if joint.strap else joint.carried)
    flow[_V, _X], flow[_V, _V] = -joint.stiffness / moved, -joint.damping / moved
    flow[_V, _R] = -joint.reflex * joint.stiffness / moved
    if joint.strap:
        pull = np.zeros(_N)
        pull[[_XE, _VE]] = joint.strap, joint.strap * joint.strap_time_s
        pull[[_X, _V]] = -joint.strap, -joint.strap * joint.strap_time_s
        flow[_V] += pull / moved
        flow[_XE, _VE] = 1.0
        flow[_VE] = -pull / joint.carried
        feed[_VE, 0] = 1.0 / joint.carried
    else:
        feed[_V, 0] = 1.0 / moved
    if joint.tissue_hz:
        w = 2.0 * np.pi * joint.tissue_hz
        flow[_Y, _YD] = 1.0
        damper = 2.0 * joint.tissue_damping * w  # between bone and sensor, as the spring
        flow[_YD, [_X, _V, _Y, _YD]] = w**2, damper, -(w**2), -damper
    lag_s = joint.lag_s * (1.0 - joint.delay_share)
    if lag_s > 0.0:
        flow[_LAG, _Y if joint.tissue_hz else _X] = 1.0 / lag_s
        flow[_LAG, _LAG] = -1.0 / lag_s
    w = 1.0 / joint.twitch_s
    flow[_R, _RD] = 1.0
    flow[_RD, _R], flow[_RD, _RD], feed[_RD, 1] = -(w**2), -2.0 * w, w**2
    return flow, feed


def _output_of(joint: Joint) -> int:
    if joint.lag_s * (1.0 - joint.delay_share) > 0.0:
        return _LAG
    return _Y if joint.tissue_hz else _X


def _late(values: np.ndarray, delay_s: float, step_s: float) -> np.ndarray:
    """Shift an answer that begins at rest by a delay."""
    if delay_s == 0.0:
        return values
    at = np.arange(values.size) * step_s
    curve = CubicSpline(at, values, bc_type=((1, 0.0), "not-a-knot"))
    return np.asarray(np.where(at >= delay_s, curve(np.maximum(at - delay_s, 0.0)), 0.0))
