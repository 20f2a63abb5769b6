"""Search for the joint and the sensor that explain several responses at once, compiled.

Gauss and Newton's method with Levenberg and Marquardt's damping over the parameters of all
timing points and of one sensor. A response concerns the parameters of its point and the shared
ones, and, where K and B change along a curve through the points, K and B of all of them.
"""

from typing import NamedTuple

import numpy as np
from numba import njit

from jointz.kernels.joint_response import (
    DAMPING,
    DAMPING_SLOPE,
    INERTIA,
    MOTION,
    SHARE,
    STIFFNESS,
    STIFFNESS_SLOPE,
    joint_motion,
    sense,
)

#: Parameters of a timing point: K, change of K over the window over a size of K, B, its change,
#: deviation of the logarithm of J.
PER_POINT = 5
K, K_DRIFT, B, B_DRIFT, J_DEVIATION = range(PER_POINT)
#: Shared parameters, behind those of the points.
SHARED = 7
LOG_J, LAG, DELAY, FRICTION_GAIN, CROSS_TALK, LOG_RESONANCE, RESONANCE_DAMPING = range(SHARED)

#: Smallest sizes by which drifts of K and B are measured, N*m/rad and N*m*s/rad.
K_FLOOR, B_FLOOR = 8.0, 0.3
_OWN = PER_POINT + SHARED
_LAG_STEP_S, _RESONANCE_STEP = 2e-4, 0.01
_SMALL_CHANGE = 1e-3
_HOPELESS = 1e8
#: Derivatives this large are those of a simulation that has left all bounds.
_BEYOND = 1e9


class Responses(NamedTuple):
    """Average responses of m timing points, in arrays of one width.

    ``angle`` (m, N) rad; ``torque`` (m, 2, N) N*m: without friction, and friction; ``weights`` (m,
    N, N): inverse covariance of the error of the angle, 1/rad^2; ``samples`` (m,): number of
    samples of each point; ``period_s`` (m,): between samples; ``substeps`` (m,): steps of the
    simulation per sample.
    """

    angle: np.ndarray
    torque: np.ndarray
    weights: np.ndarray
    samples: np.ndarray
    period_s: np.ndarray
    substeps: np.ndarray


class Frame(NamedTuple):
    """What a search holds fixed.

    ``mean``, ``sd`` (p,): prior of every parameter; ``low``, ``high`` (p,): its range; ``late_s``
    (2,): prior mean and sd of the sum of lag and delay; ``middle_s`` (m, 3): times from the first
    sample at which K, B and J of each point apply; ``size_per_s`` (m, 2): rate of change of K
    (N*m/rad/s) and of B (N*m*s/rad/s) for a drift parameter of 1; ``slope_map`` (m, m) 1/s: from
    logarithms at all points to relative slopes at each; ``curves``: whether K and B follow the
    curve; ``resonance``: whether the tissue resonates.
    """

    mean: np.ndarray
    sd: np.ndarray
    low: np.ndarray
    high: np.ndarray
    late_s: np.ndarray
    middle_s: np.ndarray
    size_per_s: np.ndarray
    slope_map: np.ndarray
    curves: bool
    resonance: bool


@njit(cache=True, nogil=True, error_model="numpy")
def point_response(
    i: int, values: np.ndarray, responses: Responses, frame: Frame
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return the simulated angle of a point, its derivatives, and which parameters these are of.

    ``values`` (p,): all parameters. Returns ``angle`` (n,) rad as the sensor would show it,
    ``derivatives`` (n, q), and ``places`` (q,): the parameters they are with respect to; one may
    occur twice, its derivatives then add up.
    """
    m, n = responses.angle.shape[0], responses.samples[i]
    first, shared = PER_POINT * i, PER_POINT * m
    width = _OWN + (2 * m if frame.curves else 0)
    places = np.empty(width, dtype=np.int64)
    for j in range(PER_POINT):
        places[j] = first + j
    for j in range(SHARED):
        places[PER_POINT + j] = shared + j
    slopes = np.zeros(2)
    turns = np.zeros((2, m))
    if frame.curves:
        _follow_curve(i, values, frame, slopes, turns)
        for j in range(m):
            places[_OWN + j] = PER_POINT * j + K
            places[_OWN + m + j] = PER_POINT * j + B
    size_K, size_B = frame.size_per_s[i, 0], frame.size_per_s[i, 1]
    inertia = np.exp(values[shared + LOG_J] + values[first + J_DEVIATION])
    impedance = np.zeros(6)
    impedance[0] = values[first + K]
    impedance[1] = values[first + K_DRIFT] * size_K + slopes[0]
    impedance[2] = values[first + B]
    impedance[3] = values[first + B_DRIFT] * size_B + slopes[1]
    impedance[4] = inertia
    gain, cross = values[shared + FRICTION_GAIN], values[shared + CROSS_TALK]
    torque = responses.torque[i, :, :n].copy()
    step_s = responses.period_s[i] / responses.substeps[i]
    motion = joint_motion(
        torque,
        gain,
        impedance,
        frame.middle_s[i],
        responses.period_s[i],
        responses.substeps[i],
    )
    samples_s = np.empty(n)
    for k in range(n):
        samples_s[k] = k * responses.period_s[i]
    sensor = values[shared:].copy()
    if not frame.resonance:
        sensor[LOG_RESONANCE] = -np.inf  # of a rigid limb: 0 Hz stands for none
    shown = _shown(motion, sensor, step_s, samples_s)
    angle, derivatives = np.empty(n), np.zeros((n, width))
    for k in range(n):
        total = torque[0, k] + gain * torque[1, k]
        angle[k] = shown[k, MOTION] + cross * total
        row = derivatives[k]
        row[K], row[B] = shown[k, STIFFNESS], shown[k, DAMPING]
        row[K_DRIFT] = shown[k, STIFFNESS_SLOPE] * size_K
        row[B_DRIFT] = shown[k, DAMPING_SLOPE] * size_B
        row[J_DEVIATION] = row[PER_POINT + LOG_J] = shown[k, INERTIA] * inertia
        row[PER_POINT + FRICTION_GAIN] = shown[k, SHARE] + cross * torque[1, k]
        row[PER_POINT + CROSS_TALK] = total
    if frame.curves:
        _fill_curve(derivatives, shown, turns)
    _fill_sensor(derivatives, motion, shown, sensor, (step_s, samples_s))
    return angle, derivatives, places


@njit(cache=True, nogil=True)
def _fill_curve(derivatives: np.ndarray, shown: np.ndarray, turns: np.ndarray) -> None:
    """Fill the derivatives with respect to K and B of all points, by way of the slopes here."""
    m = turns.shape[1]
    for k in range(derivatives.shape[0]):
        for j in range(m):
            derivatives[k, _OWN + j] = shown[k, STIFFNESS_SLOPE] * turns[0, j]
            derivatives[k, _OWN + m + j] = shown[k, DAMPING_SLOPE] * turns[1, j]


@njit(cache=True, nogil=True)
def _fill_sensor(
    derivatives: np.ndarray,
    motion: np.ndarray,
    shown: np.ndarray,
    sensor: np.ndarray,
    times: tuple[float, np.ndarray],
) -> None:
    """Fill the derivatives with respect to the sensor, by small steps of its parameters."""
    alone = motion[:, MOTION : MOTION + 1].copy()
    for place in (LAG, DELAY, LOG_RESONANCE, RESONANCE_DAMPING):
        resonates = place > CROSS_TALK
        if resonates and sensor[LOG_RESONANCE] == -np.inf:
            continue
        step = _RESONANCE_STEP if resonates else _LAG_STEP_S
        sensor[place] += step
        other = _shown(alone, sensor, times[0], times[1])
        sensor[place] -= step
        for k in range(derivatives.shape[0]):
            derivatives[k, PER_POINT + place] = (other[k, 0] - shown[k, MOTION]) / step


@njit(cache=True, nogil=True)
def _follow_curve(
    i: int, values: np.ndarray, frame: Frame, slopes: np.ndarray, turns: np.ndarray
) -> None:
    """Fill slopes of K and B of a point along the curve, and what K and B of all do to them."""
    m = frame.slope_map.shape[0]
    for row in range(2):
        place, floor = (K, K_FLOOR) if row == 0 else (B, B_FLOOR)
        relative = 0.0
        for j in range(m):
            relative += frame.slope_map[i, j] * np.log(max(values[PER_POINT * j + place], floor))
        own = max(values[PER_POINT * i + place], floor)
        slopes[row] = own * relative
        for j in range(m):
            size = values[PER_POINT * j + place]
            if size > floor:
                turns[row, j] = own * frame.slope_map[i, j] / size
                if j == i:
                    turns[row, j] += relative


@njit(cache=True, nogil=True)
def _shown(
    motion: np.ndarray, sensor: np.ndarray, step_s: float, samples_s: np.ndarray
) -> np.ndarray:
    return sense(
        motion,
        step_s,
        samples_s,
        sensor[DELAY],
        sensor[LAG],
        np.exp(sensor[LOG_RESONANCE]),
        sensor[RESONANCE_DAMPING],
    )


@njit(cache=True, nogil=True, error_model="numpy")
def prior_curvature(frame: Frame) -> np.ndarray:
    """Return the curvature of the priors, (p, p).

    Parameters
    ----------
    frame : Frame
        With the priors.
    """
    p = frame.mean.size
    curvature = np.zeros((p, p))
    for j in range(p):
        curvature[j, j] = 1.0 / frame.sd[j] ** 2
    for one in (LAG, DELAY):
        for other in (LAG, DELAY):
            curvature[p - SHARED + one, p - SHARED + other] += 1.0 / frame.late_s[1] ** 2
    return curvature


@njit(cache=True, nogil=True, error_model="numpy")
def _evaluate(
    values: np.ndarray, responses: Responses, frame: Frame
) -> tuple[float, np.ndarray, np.ndarray]:
    """Return twice the negative logarithm of the posterior, its curvature and its descent."""
    m, p = responses.angle.shape[0], values.size
    curvature = prior_curvature(frame)
    descent = np.empty(p)
    late = values[p - SHARED + LAG] + values[p - SHARED + DELAY] - frame.late_s[0]
    late /= frame.late_s[1]
    cost = late * late
    for j in range(p):
        off = (values[j] - frame.mean[j]) / frame.sd[j]
        descent[j] = -off / frame.sd[j]
        cost += off * off
    descent[p - SHARED + LAG] -= late / frame.late_s[1]
    descent[p - SHARED + DELAY] -= late / frame.late_s[1]
    for i in range(m):
        n = responses.samples[i]
        angle, derivatives, places = point_response(i, values, responses, frame)
        for k in range(n):
            for j in range(places.size):
                if not abs(derivatives[k, j]) < _BEYOND:
                    return np.inf, curvature, descent
        residual = np.empty(n)
        for k in range(n):
            residual[k] = responses.angle[i, k] - angle[k]
        weights = responses.weights[i, :n, :n].copy()
        weighted = np.dot(weights, derivatives)
        cost += np.dot(residual, np.dot(weights, residual))
        steep = np.dot(residual, weighted)
        bent = np.dot(derivatives.T.copy(), weighted)
        for one in range(places.size):
            descent[places[one]] += steep[one]
            for other in range(places.size):
                curvature[places[one], places[other]] += bent[one, other]
    return cost, curvature, descent


def search(
    start: np.ndarray, responses: Responses, frame: Frame, passes: int
) -> tuple[np.ndarray, float, np.ndarray]:
    """Return the parameters of least cost, their cost and the curvature there.

    ``start`` (p,). Returns ``values`` (p,) inside the range; ``cost``: squared distance from the
    responses and from the priors' means, both weighted; ``curvature`` (p, p): half the second
    derivative of the cost, by Gauss and Newton.
    """
    values = np.clip(start, frame.low, frame.high)
    cost, curvature, descent = _evaluate(values, responses, frame)
    damping = 1e-3
    for _ in range(passes):
        step = np.linalg.solve(curvature + damping * np.diag(np.diag(curvature)), descent)
        new = np.clip(values + step, frame.low, frame.high)
        there, bent, steep = _evaluate(new, responses, frame)
        if there <= cost:
            done = cost - there < _SMALL_CHANGE
            values, cost, curvature, descent = new, there, bent, steep
            damping = max(damping / 6.0, 1e-10)
            if done:
                break
        else:
            damping = max(10.0 * damping, 1e-6)
            if damping > _HOPELESS:
                break
    return values, float(cost), curvature
