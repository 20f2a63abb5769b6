"""Responses of a leg to torque on a device that is strapped to it, compiled.

The device, its cuff and the soft tissue under it move against the bone on a spring and a damper.
Angles are deviations from the unperturbed motion. Runge and Kutta's fourth-order method.
"""

import numpy as np
from numba import njit

#: Columns of the parameters of a leg, SI.
(
    DEVICE_INERTIA,
    STRAP_STIFFNESS,
    STRAP_DAMPING,
    HALF_ANGLE,  # displacement at which the muscles' stiffness is half, rad
    SOFTENING_POWER,
    GRAVITY_STIFFNESS,  # the part of K that does not soften
    REFLEX_GAIN,  # share of K
    REFLEX_LATENCY,
    REFLEX_TIME,  # of each of the two first-order lags of the muscle
    REFLEX_POSITION,  # share of the reflex that answers displacement, the rest velocity
    REFLEX_SHORTENING,  # share that answers displacements in the negative direction
    FRICTION,  # of Coulomb, that the stated torque does not include
    FRICTION_VELOCITY,
    TORQUE_ERROR,  # stated over true, less one
    SKIN_SHARE,  # of the strap's deformation that the goniometer sees
    SENSOR_TIME,  # first-order lag of the goniometer
    SENSOR_DELAY,
    SENSOR_GAIN,  # shown over true
    SENSOR_HZ,  # resonance of the goniometer on the skin; 0: none
    SENSOR_DAMPING,
    ENCODER_DELAY,
    ENCODER_GAIN,
    GYROSCOPE_DELAY,
    GYROSCOPE_GAIN,
    SHANK_SHARE,  # of the joint's velocity; the rest is the thigh's
    SHANK_HZ,  # resonance of the gyroscope on the shank; 0: none
    SHANK_DAMPING,
    THIGH_HZ,  # of the one on the thigh; 0: none
    THIGH_DAMPING,
) = range(29)
N_PARAMETERS = 29
#: Columns of the responses: angles of the goniometer and of the device (rad), velocity that the
#: gyroscope shows (rad/s), angle of the bone (rad).
GONIOMETER, ENCODER, GYROSCOPE, BONE = range(4)
#: Velocity is this time as good as displacement to the reflex.
_VELOCITY_S = 0.05
#: A lag below this is none.
_SHORTEST_S = 1e-6
_STATES = 6


#: Rows of the curves of a pulse, and of the motion that it causes.
STIFFNESS, DAMPING, VELOCITY, INERTIA = range(4)
_TORQUE, _DRIVE, _INERTIA_RATE = range(4, 7)
_POSITION, _SPEED, _SENSED, _DEVICE = range(4)


@njit(cache=True, nogil=True, error_model="numpy")
def leg_responses(
    torque: np.ndarray,
    curves: np.ndarray,
    parameters: np.ndarray,
    period_s: float,
    substeps: int,
) -> np.ndarray:
    """Return what the sensors show, and the angle of the bone, (m, n, 4).

    ``torque`` (m, (n - 1) * substeps + 1) at the steps; ``curves`` (m, 4, n): K, B, the
    velocity of the unperturbed motion and the inertia of the bone side at the samples, linear
    between them; ``parameters`` (m, N_PARAMETERS).
    """
    m, _, n = curves.shape
    out = np.zeros((m, n, 4))
    last = (n - 1) * substeps
    motion = np.zeros((4, last + 1))
    step_s = period_s / substeps
    for j in range(m):
        p = parameters[j]
        _respond(torque[j], curves[j], p, period_s, substeps, motion)
        for i in range(n):
            out[j, i, BONE] = motion[_POSITION, i * substeps]
        if p[SENSOR_HZ] > 0.0:
            _resonate(motion[_SENSED], p[SENSOR_HZ], p[SENSOR_DAMPING], step_s)
        _lag(motion[_SENSED], p[SENSOR_TIME], step_s)
        _show(motion[_SENSED], p[SENSOR_DELAY] / step_s, p[SENSOR_GAIN], out[j, :, GONIOMETER])
        _show(motion[_DEVICE], p[ENCODER_DELAY] / step_s, p[ENCODER_GAIN], out[j, :, ENCODER])
        if p[SHANK_HZ] > 0.0:
            _turn(motion[_SPEED], motion[_SENSED], p, step_s)
            late = p[GYROSCOPE_DELAY] / step_s
            _show(motion[_SPEED], late, p[GYROSCOPE_GAIN], out[j, :, GYROSCOPE])
    return out


@njit(cache=True, nogil=True, error_model="numpy")
def _turn(speed: np.ndarray, work: np.ndarray, p: np.ndarray, step_s: float) -> None:
    """Make of the joint's velocity what gyroscopes on their mounts show of it."""
    share = p[SHANK_SHARE]
    for i in range(speed.size):
        work[i] = (1.0 - share) * speed[i]
        speed[i] = share * speed[i]
    _resonate(speed, p[SHANK_HZ], p[SHANK_DAMPING], step_s)
    if p[THIGH_HZ] > 0.0:
        _resonate(work, p[THIGH_HZ], p[THIGH_DAMPING], step_s)
        for i in range(speed.size):
            speed[i] += work[i]


@njit(cache=True, nogil=True, error_model="numpy")
def _show(values: np.ndarray, late: float, gain: float, out: np.ndarray) -> None:
    """Fill the samples of a sensor that is late by so many steps."""
    substeps = (values.size - 1) // (out.size - 1)
    for i in range(out.size):
        out[i] = gain * _past(values, i * substeps - late, values.size - 1)


@njit(cache=True, nogil=True, error_model="numpy")
def _past(values: np.ndarray, at: float, last: int) -> float:
    """Return a series at a fraction of its steps, zero before it begins."""
    if at <= 0.0:
        return 0.0
    k = int(at)
    if k >= last:
        return float(values[last])
    return float(values[k] + (at - k) * (values[k + 1] - values[k]))


@njit(cache=True, nogil=True, error_model="numpy")
def _respond(
    torque: np.ndarray,
    curves: np.ndarray,
    p: np.ndarray,
    period_s: float,
    substeps: int,
    motion: np.ndarray,
) -> None:
    """Integrate one response from rest; fill position and speed of the bone, and the sensor."""
    state, trial = np.zeros(_STATES), np.zeros(_STATES)
    slopes, inputs = np.zeros((4, _STATES)), np.zeros(7)
    step_s = period_s / substeps
    last = motion.shape[1] - 1
    latency = p[REFLEX_LATENCY] / step_s
    share = p[REFLEX_POSITION]
    for i in range(last + 1):
        motion[_POSITION, i], motion[_SPEED, i] = state[0], state[1]
        motion[_SENSED, i] = state[0] + p[SKIN_SHARE] * (state[2] - state[0])
        motion[_DEVICE, i] = state[2]
        if i == last:
            break
        sample = i // substeps
        first = (i - sample * substeps) / substeps
        for stage in range(4):
            part = 0.0 if stage == 0 else (0.5 if stage < 3 else 1.0)
            for z in range(_STATES):
                trial[z] = state[z] + (0.0 if stage == 0 else step_s * part * slopes[stage - 1, z])
            within = first + part / substeps
            for row in range(4):
                rise = curves[row, sample + 1] - curves[row, sample]
                inputs[row] = curves[row, sample] + within * rise
            growth = curves[INERTIA, sample + 1] - curves[INERTIA, sample]
            inputs[_INERTIA_RATE] = growth / period_s
            inputs[_TORQUE] = torque[i] + part * (torque[i + 1] - torque[i])
            # What the reflex answers was before this step: latencies are longer than a step.
            past = i + part - latency
            drive = share * _past(motion[_POSITION], past, i)
            drive += (1.0 - share) * _VELOCITY_S * _past(motion[_SPEED], past, i)
            drive *= p[REFLEX_GAIN] * max(inputs[STIFFNESS], 0.0)
            inputs[_DRIVE] = drive if drive > 0.0 else drive * p[REFLEX_SHORTENING]
            _slopes(trial, inputs, p, slopes[stage])
        for z in range(_STATES):
            change = slopes[0, z] + 2.0 * slopes[1, z] + 2.0 * slopes[2, z] + slopes[3, z]
            state[z] += step_s / 6.0 * change


@njit(cache=True, nogil=True, error_model="numpy")
def _lag(values: np.ndarray, time_s: float, step_s: float) -> None:
    """Pass a series, linear between steps, through a first-order lag: exact, stable for any."""
    if time_s < _SHORTEST_S:
        return
    kept = np.exp(-step_s / time_s)
    ramp = 1.0 - (1.0 - kept) * time_s / step_s
    before, lagged = values[0], values[0]
    for i in range(1, values.size):
        rise = values[i] - before
        lagged = kept * lagged + (1.0 - kept) * before + ramp * rise
        before = values[i]
        values[i] = lagged


@njit(cache=True, nogil=True, error_model="numpy")
def _resonate(values: np.ndarray, frequency_hz: float, damping: float, step_s: float) -> None:
    """Let a sensor on a spring and a damper follow a series, linear between steps.

    Runge and Kutta's method on position y and pull p = dy/dt - 2 zeta omega u.
    """
    square, damped = (2.0 * np.pi * frequency_hz) ** 2, 4.0 * np.pi * damping * frequency_hz
    y, pull, before = values[0], -damped * values[0], values[0]
    for i in range(1, values.size):
        middle, after = 0.5 * (before + values[i]), values[i]
        a1 = pull + damped * before
        b1 = square * (before - y) - damped * a1
        a2 = pull + 0.5 * step_s * b1 + damped * middle
        b2 = square * (middle - y - 0.5 * step_s * a1) - damped * a2
        a3 = pull + 0.5 * step_s * b2 + damped * middle
        b3 = square * (middle - y - 0.5 * step_s * a2) - damped * a3
        a4 = pull + step_s * b3 + damped * after
        b4 = square * (after - y - step_s * a3) - damped * a4
        y += step_s / 6.0 * (a1 + 2.0 * a2 + 2.0 * a3 + a4)
        pull += step_s / 6.0 * (b1 + 2.0 * b2 + 2.0 * b3 + b4)
        before = values[i]
        values[i] = y


@njit(cache=True, nogil=True, error_model="numpy")
def _slopes(state: np.ndarray, inputs: np.ndarray, p: np.ndarray, out: np.ndarray) -> None:
    """Fill the derivatives of angle and speed of bone and device, reflex and sensor."""
    x, v, x2, v2 = state[0], state[1], state[2], state[3]
    v0, torque, drive = inputs[VELOCITY], inputs[_TORQUE], inputs[_DRIVE]
    gravity = p[GRAVITY_STIFFNESS]
    soft = 1.0 + (abs(x) / p[HALF_ANGLE]) ** p[SOFTENING_POWER]
    elastic = (gravity + (inputs[STIFFNESS] - gravity) / soft) * x
    # The momentum of an inertia that changes: d(J v)/dt.
    damping = inputs[DAMPING] + inputs[_INERTIA_RATE]
    strap = p[STRAP_STIFFNESS] * (x2 - x) + p[STRAP_DAMPING] * (v2 - v)
    vs = p[FRICTION_VELOCITY]
    friction = p[FRICTION] * (np.tanh(v0 / vs) - np.tanh((v0 + v2) / vs))
    out[0], out[1] = v, (strap - elastic - damping * v - state[5]) / inputs[INERTIA]
    out[2] = v2
    out[3] = (torque / (1.0 + p[TORQUE_ERROR]) + friction - strap) / p[DEVICE_INERTIA]
    out[4] = (drive - state[4]) / p[REFLEX_TIME]
    out[5] = (state[4] - state[5]) / p[REFLEX_TIME]
