r"""The compiled physics: joint, strap, actuator, tissue and goniometer over one sample period.

With :math:`x = \theta - \theta_0(t)`, the deviation from the unperturbed path:

rigid strap
    :math:`(J + J_r)\ddot x + B\dot x + Kx = \tau_m - J_r\ddot\theta_0 + \tau_v + \tau_r`
strap of its own stiffness
    :math:`J\ddot x + B\dot x + Kx = \tau_s - \Delta g + \tau_v + \tau_r`,
    :math:`J_e\ddot\theta_e = \tau_m - \tau_s - m_e g l_e \sin\alpha_e`,
    :math:`\tau_s = k_s(\theta_e - \theta) + b_s(\dot\theta_e - \dot\theta)`
motor
    :math:`\tau_m = c\,i - (f_c + f_g|i|)\tanh(\dot\theta_e/v_0) + e` (equation 4.1), e an
    Ornstein-Uhlenbeck process; i follows the delayed command with a first order

K, B and J go with phase; :math:`\alpha` is the angle of the shank from the vertical,
:math:`\Delta g` the change of the limb's gravity torque with x. A body with a chain adds
:math:`-\dot J\dot x - K_c x` to the right side (``chain_terms``). A known addition is part of J,
of the limb's gravity and of :math:`K_c`; its spring does not soften. Runge and Kutta's fourth-order
method with the current and all inputs given exactly at its stages. Between samples the path
:math:`\theta_0` is the quintic through its values and two derivatives: at 500 Hz it is exact to
1e-9 rad. Muscles and ligaments give the shank :math:`M_0(phase) - Kx - B\dot x + \tau_v + \tau_r`,
where the moment :math:`M_0` of the unperturbed path moves nothing away from it.
"""

import math

import numpy as np
from numba import njit

from jointz.rig.sim.walking.layout import (
    COMMANDS,
    CURVE_PIECES,
    CURVES,
    HISTORY,
    INTEGRATED,
    Fault,
    Gait,
    Noise,
    Param,
    State,
)
from jointz.rig.sim.walking.path import path

# Inlined: without, the calls take a quarter of the time of a sample.
_compiled = njit(cache=True, nogil=True, error_model="numpy", forceinline=True)
#: Columns of the history: deviation, velocity, acceleration, angle at the goniometer.
HISTORY_COLUMNS = 4
# Room to work in, at the end of the state (views of arrays cost more than the arithmetic): four
# slopes, a trial state, then K B J and thigh, then the path, 1 / inertia that moves with the
# joint, and the coefficients of the path.
_SLOPES = int(State.WORK)
_TRIAL = _SLOPES + 4 * INTEGRATED
_INPUT_CURVES = CURVES - 1  # the moment, which comes last, moves nothing
_K, _B, _J, _THIGH = range(_TRIAL + INTEGRATED, _TRIAL + INTEGRATED + _INPUT_CURVES)
_THETA, _THETA_RATE, _THETA_BEND = range(_THIGH + 1, _THIGH + 4)
_MOBILITY = _THETA_BEND + 1
_QUINTIC = _MOBILITY + 1
_J_RATE, _CHAIN = _QUINTIC + 6, _QUINTIC + 7

#: Angle, velocity, current, voltage, temperature, fault bits.
MotorMeasured = tuple[float, float, float, float, float, int]


@_compiled
def _quintic(state: np.ndarray, end: tuple[float, float, float], T: float) -> None:
    """Fill the coefficients of the path over a sample period, in share of the period."""
    p0, v0 = state[State.PATH], state[State.PATH_RATE] * T
    a0 = 0.5 * state[State.PATH_ACCELERATION] * T * T
    rise = end[0] - p0 - v0 - a0
    speed = end[1] * T - v0 - 2.0 * a0
    bend = end[2] * T * T - 2.0 * a0
    state[_QUINTIC], state[_QUINTIC + 1], state[_QUINTIC + 2] = p0, v0, a0
    state[_QUINTIC + 3] = 10.0 * rise - 4.0 * speed + 0.5 * bend
    state[_QUINTIC + 4] = -15.0 * rise + 7.0 * speed - bend
    state[_QUINTIC + 5] = 6.0 * rise - 3.0 * speed + 0.5 * bend


@_compiled
def _piece(gait: np.ndarray, time_s: float) -> tuple[int, float]:
    """Return the piece of the cycle at a time, and the share of it that is over."""
    v = (time_s - gait[Gait.START_S]) * gait[Gait.RATE_HZ]
    higher = gait[Gait.CUBIC] + v * (gait[Gait.QUARTIC] + v * gait[Gait.QUINTIC])
    phase = v * (gait[Gait.LINEAR] + v * v * higher)
    place = (phase - math.floor(phase)) * CURVE_PIECES
    piece = min(int(place), CURVE_PIECES - 1)
    return piece, place - piece


@_compiled
def _cubic(curves: np.ndarray, at: tuple[int, int], r: float) -> float:
    """Return a curve inside a piece; ``at`` is piece and curve."""
    piece, j = at
    q0, q1 = curves[piece, 4 * j], curves[piece, 4 * j + 1]
    q2, q3 = curves[piece, 4 * j + 2], curves[piece, 4 * j + 3]
    return float(q0 + r * (q1 + r * (q2 + r * q3)))


@_compiled
def _inputs(
    p: np.ndarray, state: np.ndarray, curves: np.ndarray, gait: np.ndarray, at: tuple[float, float]
) -> None:
    """Fill K, B, J, thigh and the path; ``at`` is time and share of the sample period."""
    time_s, u = at
    c0, c1, c2 = state[_QUINTIC], state[_QUINTIC + 1], state[_QUINTIC + 2]
    c3, c4, c5 = state[_QUINTIC + 3], state[_QUINTIC + 4], state[_QUINTIC + 5]
    state[_THETA] = c0 + u * (c1 + u * (c2 + u * (c3 + u * (c4 + u * c5))))
    rate = c1 + u * (2.0 * c2 + u * (3.0 * c3 + u * (4.0 * c4 + u * 5.0 * c5)))
    bend = 2.0 * c2 + u * (6.0 * c3 + u * (12.0 * c4 + u * 20.0 * c5))
    per_s = p[Param.SAMPLE_RATE_HZ]
    state[_THETA_RATE], state[_THETA_BEND] = rate * per_s, bend * per_s * per_s
    piece, r = _piece(gait, time_s)
    for j in range(_INPUT_CURVES):
        state[_K + j] = _cubic(curves, (piece, j), r)
    _chain(state, curves, gait, (piece, r), time_s)
    carried = p[Param.EXO_INERTIA] if p[Param.STRAP_STIFFNESS] == 0.0 else 0.0
    state[_MOBILITY] = 1.0 / (state[_J] + carried)


@_compiled
def _chain(
    state: np.ndarray, curves: np.ndarray, gait: np.ndarray, at: tuple[int, float], time_s: float
) -> None:
    """Fill dJ/dt and the stiffness of the chain; ``at`` is piece and share of it."""
    state[_J_RATE] = state[_CHAIN] = 0.0
    if curves.shape[1] <= 4 * CURVES:
        return
    piece, r = at
    state[_CHAIN] = _cubic(curves, (piece, CURVES), r)
    j = 4 * (_J - _K)
    slope = curves[piece, j + 1] + r * (2.0 * curves[piece, j + 2] + r * 3.0 * curves[piece, j + 3])
    v = (time_s - gait[Gait.START_S]) * gait[Gait.RATE_HZ]
    higher = 3.0 * gait[Gait.CUBIC] + v * (4.0 * gait[Gait.QUARTIC] + v * 5.0 * gait[Gait.QUINTIC])
    rate = gait[Gait.RATE_HZ] * (gait[Gait.LINEAR] + v * v * higher)
    state[_J_RATE] = slope * CURVE_PIECES * rate


@_compiled
def _motor(p: np.ndarray, current: float, velocity: float, error: float) -> float:
    friction = p[Param.COULOMB_FRICTION] + p[Param.GEAR_FRICTION] * abs(current)
    # tanh by one exponential: a quarter of the time of the library's.
    sign = 1.0 - 2.0 / (math.exp(2.0 * velocity * p[Param.SIGN_RATE]) + 1.0)
    return float(p[Param.TORQUE_PER_AMPERE] * current - friction * sign + error)


@_compiled
def _muscle_torque(p: np.ndarray, s: np.ndarray, i: int, voluntary: float) -> float:
    """Return what muscles and ligaments add to the moment of the path, for the state at ``i``."""
    K, x = s[_K], s[i + State.ANGLE]
    if p[Param.SOFTENING] > 0.0:
        K = K / (1.0 + p[Param.SOFTENING] * x * x)
    torque = voluntary - s[_B] * s[i + State.VELOCITY] - K * x
    if p[Param.REFLEX_GAIN] > 0.0:
        torque -= p[Param.REFLEX_GAIN] * s[_K] * s[i + State.REFLEX]
    return float(torque)


@_compiled
def _slopes(
    p: np.ndarray,
    s: np.ndarray,
    at: tuple[int, int],
    drive: tuple[float, float, float, float],
) -> None:
    """Fill the slopes of a state: ``at`` says where in ``s`` it stands and they go.

    ``drive`` is current, torque error, voluntary torque and stretch.
    """
    i, k = at
    current, error, voluntary, stretch = drive
    thigh = s[_THIGH]
    theta, theta_rate, theta_bend = s[_THETA], s[_THETA_RATE], s[_THETA_BEND]
    x, v = s[i + State.ANGLE], s[i + State.VELOCITY]
    joint = _muscle_torque(p, s, i, voluntary) - s[_J_RATE] * v
    joint -= (s[_CHAIN] + p[Param.ADDED_STIFFNESS]) * x
    if p[Param.REFLEX_GAIN] > 0.0:
        r, rate, w = s[i + State.REFLEX], s[i + State.REFLEX_RATE], p[Param.REFLEX_RATE]
        s[k + State.REFLEX] = rate
        s[k + State.REFLEX_RATE] = w * w * (stretch - r) - 2.0 * w * rate
    if p[Param.LIMB_GRAVITY] > 0.0:
        shank = theta - thigh
        joint -= p[Param.LIMB_GRAVITY] * (math.sin(shank + x) - math.sin(shank))
    if p[Param.STRAP_STIFFNESS] > 0.0:
        xe, ve = s[i + State.EXO_ANGLE], s[i + State.EXO_VELOCITY]
        strap = p[Param.STRAP_STIFFNESS] * (xe - x) + p[Param.STRAP_DAMPING] * (ve - v)
        motor = _motor(p, current, theta_rate + ve, error)
        motor -= p[Param.EXO_GRAVITY] * math.sin(theta + xe - thigh)
        s[k + State.EXO_ANGLE] = ve
        s[k + State.EXO_VELOCITY] = (motor - strap) / p[Param.EXO_INERTIA] - theta_bend
        acceleration = (joint + strap) * s[_MOBILITY]
    else:
        motor = _motor(p, current, theta_rate + v, error)
        inertial = p[Param.EXO_INERTIA] * theta_bend
        acceleration = (joint + motor - inertial) * s[_MOBILITY]
    s[k + State.ANGLE], s[k + State.VELOCITY] = v, acceleration
    shown = theta + x
    if p[Param.TISSUE_RATE] > 0.0:
        # The damper is between bone and sensor, too. The state is y' - 2 zeta w u, so that the
        # velocity of the bone is not needed.
        w, y = p[Param.TISSUE_RATE], s[i + State.TISSUE]
        damper = 2.0 * p[Param.TISSUE_DAMPING] * w
        rate = s[i + State.TISSUE_PULL] + damper * shown
        s[k + State.TISSUE] = rate
        s[k + State.TISSUE_PULL] = w * w * (shown - y) - damper * rate
        shown = y
    s[k + State.LAGGED] = p[Param.ANGLE_LAG_RATE] * (shown - s[i + State.LAGGED])


@_compiled
def _shown(p: np.ndarray, s: np.ndarray, theta: float) -> float:
    """Return the angle that reaches the goniometer, before its pure delay."""
    if p[Param.ANGLE_LAG_RATE] > 0.0:
        return float(s[State.LAGGED])
    if p[Param.TISSUE_RATE] > 0.0:
        return float(s[State.TISSUE])
    return float(theta + s[State.ANGLE])


@_compiled
def _stretch(p: np.ndarray, history: np.ndarray, row: int, share: float) -> float:
    """Return what the reflex feels: the positive part of a delayed deviation or velocity."""
    if p[Param.REFLEX_GAIN] <= 0.0:
        return 0.0
    moving = p[Param.REFLEX_SCALE] > 0.0
    j = 1 if moving else 0
    row -= int(p[Param.REFLEX_DELAY])
    before, after = row & (HISTORY - 1), (row + 1) & (HISTORY - 1)
    if share == 0.0:
        felt = history[before, j]
    elif share == 1.0:
        felt = history[after, j]
    else:
        curve = p[Param.STEP_S] * (history[before, j + 1] - history[after, j + 1]) / 8.0
        felt = 0.5 * (history[before, j] + history[after, j]) + curve
    return float(max(felt, 0.0) * (p[Param.REFLEX_SCALE] if moving else 1.0))


@_compiled
def _setpoint(p: np.ndarray, state: np.ndarray, sample: int) -> float:
    """Return the current that the driver wants for the command given at a sample, A."""
    if sample < 0 or state[State.FAULT] != 0.0:
        return 0.0
    wanted = state[State.COMMAND + sample % COMMANDS] * p[Param.AMPERE_PER_TORQUE]
    return float(min(max(wanted, -p[Param.CURRENT_MAX_A]), p[Param.CURRENT_MAX_A]))


@_compiled
def _rounded(value: float, step: float) -> float:
    return value if step == 0.0 else math.floor(value / step + 0.5) * step


@_compiled
def _autoregress(
    p: np.ndarray, state: np.ndarray, noise: np.ndarray, row: int
) -> tuple[float, float, float, float]:
    """Return the errors at the next sample: torque, voluntary, coloured, drift."""
    return (
        p[Param.TORQUE_ERROR_KEEP] * state[State.TORQUE_ERROR]
        + p[Param.TORQUE_ERROR_DRIVE] * noise[row, Noise.TORQUE_ERROR],
        p[Param.VOLUNTARY_KEEP] * state[State.VOLUNTARY]
        + p[Param.VOLUNTARY_DRIVE] * noise[row, Noise.VOLUNTARY],
        p[Param.COLOURED_KEEP] * state[State.COLOURED]
        + p[Param.COLOURED_DRIVE] * noise[row, Noise.COLOURED],
        p[Param.DRIFT_KEEP] * state[State.DRIFT] + p[Param.DRIFT_DRIVE] * noise[row, Noise.DRIFT],
    )


@_compiled
def _know_path(state: np.ndarray, gait: np.ndarray, time_s: float) -> None:
    if state[State.PATH_KNOWN] == 0.0:
        now = path(gait, time_s)
        state[State.PATH], state[State.PATH_RATE], state[State.PATH_ACCELERATION] = now
        state[State.PATH_KNOWN] = 1.0


@_compiled
def begin(p: np.ndarray, state: np.ndarray, gait: np.ndarray, history: np.ndarray) -> None:
    """Set a plant to rest on its path, at time 0."""
    state[: State.COMMAND] = 0.0
    _know_path(state, gait, 0.0)
    state[State.LAGGED] = state[State.TISSUE] = state[State.PATH]
    damper = 2.0 * p[Param.TISSUE_DAMPING] * p[Param.TISSUE_RATE]
    state[State.TISSUE_PULL] = state[State.PATH_RATE] - damper * state[State.PATH]
    state[State.TEMPERATURE] = p[Param.AMBIENT_C]
    history[:] = 0.0
    history[:, 3] = state[State.PATH]


@_compiled
def _substep(
    p: np.ndarray,
    state: np.ndarray,
    curves: np.ndarray,
    history: np.ndarray,
    gait: np.ndarray,
    place: tuple[float, float, float],
    errors: tuple[float, float, float, float],
    wanted: float,
) -> None:
    """Advance all by one step of Runge and Kutta.

    ``place`` is time and share of the sample period at the beginning, and share
    of a step; ``errors`` are torque error and voluntary torque at
    the beginning and their change over a step.
    """
    time_s, u, du = place
    error, voluntary, more_error, more_voluntary = errors
    h, half = p[Param.STEP_S], 0.5 * p[Param.STEP_S]
    row = int(state[State.SUBSTEPS])
    k2, k3, k4 = _SLOPES + INTEGRATED, _SLOPES + 2 * INTEGRATED, _SLOPES + 3 * INTEGRATED
    sixth = h / 6.0
    active = int(p[Param.ACTIVE])
    away = state[State.CURRENT] - wanted
    mid_current = wanted + away * p[Param.CURRENT_KEEP_HALF]
    end_current = wanted + away * p[Param.CURRENT_KEEP]

    # The inputs at the beginning are those at the end of the substep before.
    shown = _shown(p, state, state[_THETA])
    drive = (state[State.CURRENT], error, voluntary, _stretch(p, history, row, 0.0))
    _slopes(p, state, (0, _SLOPES), drive)
    here = row & (HISTORY - 1)
    history[here, 0], history[here, 1] = state[State.ANGLE], state[State.VELOCITY]
    history[here, 2], history[here, 3] = state[_SLOPES + State.VELOCITY], shown

    _inputs(p, state, curves, gait, (time_s + half, u + 0.5 * du))
    felt = _stretch(p, history, row, 0.5)
    drive = (mid_current, error + 0.5 * more_error, voluntary + 0.5 * more_voluntary, felt)
    for j in range(active):
        state[_TRIAL + j] = state[j] + half * state[_SLOPES + j]
    _slopes(p, state, (_TRIAL, k2), drive)
    for j in range(active):
        state[_TRIAL + j] = state[j] + half * state[k2 + j]
    _slopes(p, state, (_TRIAL, k3), drive)
    for j in range(active):
        state[_TRIAL + j] = state[j] + h * state[k3 + j]

    _inputs(p, state, curves, gait, (time_s + h, u + du))
    felt = _stretch(p, history, row, 1.0)
    drive = (end_current, error + more_error, voluntary + more_voluntary, felt)
    _slopes(p, state, (_TRIAL, k4), drive)
    for j in range(active):
        middle = state[k2 + j] + state[k3 + j]
        state[j] += sixth * (state[_SLOPES + j] + 2.0 * middle + state[k4 + j])
    state[State.ACCELERATION] = state[k4 + State.VELOCITY]
    state[State.CURRENT] = end_current
    state[State.SUBSTEPS] = row + 1


@_compiled
def _measure(
    p: np.ndarray, state: np.ndarray, history: np.ndarray, white: float
) -> tuple[MotorMeasured, float]:
    """Return what the instruments show at the present sample."""
    x, v = state[State.ANGLE], state[State.VELOCITY]
    exo, exo_rate = state[State.PATH] + x, state[State.PATH_RATE] + v
    current = state[State.CURRENT]
    if p[Param.STRAP_STIFFNESS] > 0.0:
        exo = state[State.PATH] + state[State.EXO_ANGLE]
        exo_rate = state[State.PATH_RATE] + state[State.EXO_VELOCITY]
        torque = p[Param.STRAP_STIFFNESS] * (state[State.EXO_ANGLE] - x)
        torque += p[Param.STRAP_DAMPING] * (state[State.EXO_VELOCITY] - v)
    else:
        torque = _motor(p, current, exo_rate, state[State.TORQUE_ERROR])
        rotor = p[Param.EXO_INERTIA]
        torque -= rotor * (state[State.PATH_ACCELERATION] + state[State.ACCELERATION])
    shown = _shown(p, state, state[State.PATH])
    late = int(p[Param.ANGLE_DELAY])
    if late > 0:
        shown = history[(int(state[State.SUBSTEPS]) - late) & (HISTORY - 1), 3]
    shown = p[Param.ANGLE_GAIN] * shown + p[Param.TORSION] * torque
    shown += state[State.COLOURED] + state[State.DRIFT] + p[Param.WHITE] * white
    motor = (
        _rounded(exo, p[Param.ANGLE_STEP]),
        _rounded(exo_rate, p[Param.VELOCITY_STEP]),
        _rounded(current, p[Param.CURRENT_STEP]),
        p[Param.SUPPLY_V] - p[Param.SUPPLY_OHM] * abs(current),
        state[State.TEMPERATURE],
        int(state[State.FAULT]),
    )
    return motor, shown


@_compiled
def _warm(p: np.ndarray, state: np.ndarray) -> None:
    """Heat the winding over a sample period and see whether it is too much."""
    current = state[State.CURRENT]
    final = p[Param.AMBIENT_C] + p[Param.HEATING_C_A2] * current * current
    state[State.TEMPERATURE] = final + p[Param.THERMAL_KEEP] * (state[State.TEMPERATURE] - final)
    if state[State.TEMPERATURE] > p[Param.TEMPERATURE_MAX_C]:
        state[State.FAULT] = float(int(state[State.FAULT]) | Fault.OVER_TEMPERATURE)


@_compiled
def advance(
    p: np.ndarray,
    state: np.ndarray,
    curves: np.ndarray,
    history: np.ndarray,
    gait: np.ndarray,
    noise: np.ndarray,
    sample: int,
    command: float,
) -> tuple[MotorMeasured, float]:
    """Advance the plant to a sample and return what is measured there."""
    row = sample % noise.shape[0]
    if sample > 0:
        substeps = int(p[Param.SUBSTEPS])
        T = p[Param.PERIOD_S]
        begin_s = (sample - 1) * T
        _know_path(state, gait, begin_s)
        end = path(gait, sample * T)
        _quintic(state, end, T)
        _inputs(p, state, curves, gait, (begin_s, 0.0))
        state[State.COMMAND + (sample - 1) % COMMANDS] = command
        error, voluntary, coloured, drift = _autoregress(p, state, noise, row)
        du = 1.0 / substeps
        more_error = (error - state[State.TORQUE_ERROR]) * du
        more_voluntary = (voluntary - state[State.VOLUNTARY]) * du
        # The command of a sample arrives so many samples and substeps later.
        samples_late = int(p[Param.COMMAND_DELAY]) // substeps
        substeps_late = int(p[Param.COMMAND_DELAY]) - samples_late * substeps
        before = _setpoint(p, state, sample - 2 - samples_late)
        after = _setpoint(p, state, sample - 1 - samples_late)
        for i in range(substeps):
            _substep(
                p,
                state,
                curves,
                history,
                gait,
                (begin_s + i * p[Param.STEP_S], i * du, du),
                (
                    state[State.TORQUE_ERROR] + i * more_error,
                    state[State.VOLUNTARY] + i * more_voluntary,
                    more_error,
                    more_voluntary,
                ),
                after if i >= substeps_late else before,
            )
        state[State.TORQUE_ERROR], state[State.VOLUNTARY] = error, voluntary
        state[State.COLOURED], state[State.DRIFT] = coloured, drift
        state[State.PATH], state[State.PATH_RATE], state[State.PATH_ACCELERATION] = end
        _warm(p, state)
    piece, r = _piece(gait, sample * p[Param.PERIOD_S])
    of_path = _cubic(curves, (piece, _INPUT_CURVES), r)
    state[State.MOMENT] = of_path + _muscle_torque(p, state, 0, state[State.VOLUNTARY])
    return _measure(p, state, history, noise[row, Noise.WHITE])
