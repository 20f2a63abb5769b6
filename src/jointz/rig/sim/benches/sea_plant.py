r"""The compiled physics of the series-elastic bench over one sample period.

rotor
    :math:`J_m\ddot m = k_t i - T_c\,s(\dot m) - b\dot m - F\,\partial\delta/\partial m`
output
    :math:`(J_i + J)\ddot\theta = -F\,\partial\delta/\partial\theta - (B_i + B)\dot\theta
    - (K_i + K)\theta - T_f\,s(\dot\theta)`, or :math:`\theta = 0` where it is locked
beam
    :math:`F = k\delta + k_3\delta^3`, :math:`\delta(m, \theta)` as in ``sea.py``

with the smooth sign :math:`s(v) = v/\sqrt{v^2 + v_0^2}`. The drive gives the current that the
loop asks for within :math:`|i| \le i_{max}` and :math:`|Ri + k_t\dot m| \le U` (the winding's
inductance, 0.16 ms, is left out). Runge and Kutta's fourth-order method at 6 kHz or more.
"""

import math
from enum import IntEnum
from math import exp, pi

import numpy as np
from numba import njit

from jointz.rig.sim.benches.bench_load import BenchLoad
from jointz.rig.sim.benches.compiled_bench import JITTER_MAX, CompiledBench, check_rate, packed
from jointz.rig.sim.benches.sea import SeaSettings
from jointz.rig.sim.sensors.sampled_time import Sample
from jointz.rig.sim.walking.layout import Fault

HISTORY = 256  # substeps of torque kept for its lag; a power of two
_LOWEST_PHYSICS_HZ = 6000.0


class SeaParam(IntEnum):
    """Constants of a packed bench; SI."""

    PERIOD_S = 0
    SUBSTEPS = 1
    CLOCK_STRETCH = 2
    CLOCK_JITTER_S = 3
    TRUE_STAMPS = 4
    TRAVEL = 5  # of the nut per radian of the rotor
    LEVER_M = 6
    BRACKET_M = 7
    MEMBER_M = 8
    REST = 9  # of the nut along its line, everything at rest at the angle 0
    BEAM_STIFFNESS = 10
    BEAM_CUBIC_PER_M2 = 11  # k3 / k
    ROTOR_MOBILITY = 12  # 1 / inertia
    TORQUE_CONSTANT = 13
    RESISTANCE_OHM = 14
    SUPPLY_V = 15
    CURRENT_MAX_A = 16
    DRIVE_FRICTION_NM = 17
    DRIVE_DAMPING = 18
    DRIVE_BEND = 19  # squared velocity of the smooth sign
    STIFFNESS = 20  # of the output and its load together
    DAMPING = 21
    MOBILITY = 22  # 1 / inertia; 0: locked
    FRICTION = 23
    FRICTION_BEND = 24
    STOP_RAD = 25
    STOP_STIFFNESS = 26
    STOP_DAMPING = 27
    TORQUE_GAIN = 28
    TORQUE_RATE_GAIN_S = 29
    POSITION_GAIN = 30
    POSITION_RATE_GAIN = 31
    LAB_GAIN = 32  # measured torque over that of the linear beam
    TORQUE_LAG_S = 33
    FILTER_RATE = 34  # rad/s, 0: none
    TORQUE_NOISE_NM = 35
    ANGLE_NOISE_RAD = 36
    LINEAR_STEP_M = 37
    ROTARY_STEP_RAD = 38
    AMBIENT_C = 39
    HEATING_C_A2 = 40
    THERMAL_KEEP = 41  # per sample
    TEMPERATURE_MAX_C = 42


class SeaState(IntEnum):
    """State of a packed bench."""

    ROTOR = 0
    ROTOR_VELOCITY = 1
    ANGLE = 2
    VELOCITY = 3
    CURRENT = 4
    TIME_S = 5  # true, of the newest sample
    FILTERED = 6  # torque behind the low-pass
    SPRING = 7  # true torque of the beam on the output
    MEASURED = 8  # torque that the loop sees, at the newest sample and the one before
    MEASURED_BEFORE = 9
    MOTOR = 10  # angle that the loop sees, likewise
    MOTOR_BEFORE = 11
    RATIO = 12  # rad of the output per rad of the rotor, at the newest sample
    TEMPERATURE = 13
    FAULT = 14
    HEAD = 15  # newest place of the rings
    SAMPLES = 16  # computed
    TIMES = 17  # ring of times begins here
    TORQUES = 17 + HISTORY  # and here that of torques


STATE_SIZE = 17 + 2 * HISTORY


def pack_sea(settings: SeaSettings, load: BenchLoad, *, sample_rate_hz: float) -> np.ndarray:
    """Return the constants of a bench and its load for the compiled physics."""
    check_rate("series-elastic", sample_rate_hz)
    machine, control, errors = settings.machine, settings.control, settings.errors
    is_loaded = load.stiffness > 0.0 or load.damping > 0.0 or load.inertia > 0.0
    period_s = 1.0 / sample_rate_hz
    derived = {
        SeaParam.PERIOD_S: period_s,
        SeaParam.SUBSTEPS: max(1, -int(-_LOWEST_PHYSICS_HZ // sample_rate_hz)),
        SeaParam.TRAVEL: machine.nut_travel_m,
        SeaParam.REST: machine.bracket_m + machine.member_m,
        SeaParam.ROTOR_MOBILITY: 1.0 / machine.rotor_inertia,
        SeaParam.DRIVE_BEND: machine.drive_velocity_rad_s**2,
        SeaParam.STIFFNESS: machine.stiffness + load.stiffness,
        SeaParam.DAMPING: machine.damping + load.damping,
        SeaParam.MOBILITY: 0.0 if load.locked else 1.0 / (machine.inertia + load.inertia),
        SeaParam.FRICTION: errors.coulomb_friction_nm if is_loaded else 0.0,
        SeaParam.FRICTION_BEND: errors.friction_velocity_rad_s**2,
        SeaParam.LAB_GAIN: settings.total_torque_gain,
        SeaParam.FILTER_RATE: 2.0 * pi * errors.torque_filter_hz,
        SeaParam.THERMAL_KEEP: exp(-period_s / machine.thermal_s),
    }
    return packed(SeaParam, derived, machine, control, errors)


_compiled = njit(cache=True, nogil=True, error_model="numpy")


@_compiled
def _beam(p: np.ndarray, nut: float, angle: float) -> tuple[float, float, float]:
    """Return deflection and its derivatives by the nut's travel and by the angle."""
    c, s = math.cos(angle), math.sin(angle)
    lever = p[SeaParam.LEVER_M]
    along = c * lever + s * nut
    across = c * nut - s * lever
    short = lever - along
    root = math.sqrt(p[SeaParam.MEMBER_M] * p[SeaParam.MEMBER_M] - short * short)
    lean = short / root
    return across - root - p[SeaParam.BRACKET_M], c - lean * s, -along - lean * across


@_compiled
def _through(p: np.ndarray, nut: float) -> tuple[float, float]:
    """Return the angle with a straight beam, and its derivative by the nut's travel."""
    lever, bracket, member = p[SeaParam.LEVER_M], p[SeaParam.BRACKET_M], p[SeaParam.MEMBER_M]
    tip2 = lever * lever + bracket * bracket
    far2 = lever * lever + nut * nut
    tip, far = math.sqrt(tip2), math.sqrt(far2)
    cosine = (tip2 + far2 - member * member) / (2.0 * tip * far)
    angle = math.atan2(nut, lever) - math.acos(cosine) - math.atan2(bracket, lever)
    bend = (far2 - tip2 + member * member) / (2.0 * tip * far2 * far)
    slope = lever / far2 + bend * nut / math.sqrt(1.0 - cosine * cosine)
    return angle, slope


@_compiled
def _forces(p: np.ndarray, rotor: float, angle: float) -> tuple[float, float, float]:
    """Return the beam's torques on rotor and output, and on the output by the linear beam."""
    travel = p[SeaParam.TRAVEL]
    bent, by_nut, by_angle = _beam(p, p[SeaParam.REST] + travel * rotor, angle)
    linear = p[SeaParam.BEAM_STIFFNESS] * bent
    force = linear * (1.0 + p[SeaParam.BEAM_CUBIC_PER_M2] * bent * bent)
    return -force * by_nut * travel, -force * by_angle, -linear * by_angle


@_compiled
def _driven(p: np.ndarray, wanted: float, velocity: float) -> float:
    """Return the current that the drive can give, A."""
    emf = p[SeaParam.TORQUE_CONSTANT] * velocity
    given = min(max(wanted, -p[SeaParam.CURRENT_MAX_A]), p[SeaParam.CURRENT_MAX_A])
    high = (p[SeaParam.SUPPLY_V] - emf) / p[SeaParam.RESISTANCE_OHM]
    low = (-p[SeaParam.SUPPLY_V] - emf) / p[SeaParam.RESISTANCE_OHM]
    return float(min(max(given, low), high))


@_compiled
def _rotor_slope(p: np.ndarray, wanted: float, velocity: float, beam: float) -> float:
    current = _driven(p, wanted, velocity)
    sign = velocity / math.sqrt(velocity * velocity + p[SeaParam.DRIVE_BEND])
    friction = p[SeaParam.DRIVE_FRICTION_NM] * sign + p[SeaParam.DRIVE_DAMPING] * velocity
    torque = p[SeaParam.TORQUE_CONSTANT] * current - friction + beam
    return float(torque * p[SeaParam.ROTOR_MOBILITY])


@_compiled
def _output_slope(p: np.ndarray, angle: float, velocity: float, beam: float) -> float:
    torque = beam - p[SeaParam.STIFFNESS] * angle - p[SeaParam.DAMPING] * velocity
    if p[SeaParam.FRICTION] > 0.0:
        bend = math.sqrt(velocity * velocity + p[SeaParam.FRICTION_BEND])
        torque -= p[SeaParam.FRICTION] * velocity / bend
    stop = p[SeaParam.STOP_RAD]
    if abs(angle) > stop:
        beyond = angle - math.copysign(stop, angle)
        torque -= p[SeaParam.STOP_STIFFNESS] * beyond + p[SeaParam.STOP_DAMPING] * velocity
    return float(torque * p[SeaParam.MOBILITY])


@_compiled
def _substep(
    p: np.ndarray, s: np.ndarray, step: float, wanted: float, beam: tuple[float, float]
) -> None:
    """Advance rotor and output by one step; ``beam`` is its torques on them at the beginning."""
    half = 0.5 * step
    m0, w0 = s[SeaState.ROTOR], s[SeaState.ROTOR_VELOCITY]
    q0, v0 = s[SeaState.ANGLE], s[SeaState.VELOCITY]
    a1 = _rotor_slope(p, wanted, w0, beam[0])
    b1 = _output_slope(p, q0, v0, beam[1])

    w2, v2 = w0 + half * a1, v0 + half * b1
    m, q = m0 + half * w0, q0 + half * v0
    on_rotor, on_output, _ = _forces(p, m, q)
    a2, b2 = _rotor_slope(p, wanted, w2, on_rotor), _output_slope(p, q, v2, on_output)

    w3, v3 = w0 + half * a2, v0 + half * b2
    m, q = m0 + half * w2, q0 + half * v2
    on_rotor, on_output, _ = _forces(p, m, q)
    a3, b3 = _rotor_slope(p, wanted, w3, on_rotor), _output_slope(p, q, v3, on_output)

    w4, v4 = w0 + step * a3, v0 + step * b3
    m, q = m0 + step * w3, q0 + step * v3
    on_rotor, on_output, _ = _forces(p, m, q)
    a4, b4 = _rotor_slope(p, wanted, w4, on_rotor), _output_slope(p, q, v4, on_output)

    sixth = step / 6.0
    s[SeaState.ROTOR] = m0 + sixth * (w0 + 2.0 * (w2 + w3) + w4)
    s[SeaState.ROTOR_VELOCITY] = w0 + sixth * (a1 + 2.0 * (a2 + a3) + a4)
    s[SeaState.ANGLE] = q0 + sixth * (v0 + 2.0 * (v2 + v3) + v4)
    s[SeaState.VELOCITY] = v0 + sixth * (b1 + 2.0 * (b2 + b3) + b4)


@_compiled
def _asked(p: np.ndarray, s: np.ndarray, torque: float, angle: float) -> float:
    """Return the current that the device's loop asks for, from what it saw last."""
    if s[SeaState.FAULT] != 0.0:
        return 0.0
    per_s = 1.0 / p[SeaParam.PERIOD_S]
    if math.isnan(torque) and math.isnan(angle):
        return 0.0  # released: nothing is asked for
    if math.isnan(torque):
        rate = (s[SeaState.MOTOR] - s[SeaState.MOTOR_BEFORE]) * per_s
        at_output = p[SeaParam.POSITION_GAIN] * (angle - s[SeaState.MOTOR])
        at_output -= p[SeaParam.POSITION_RATE_GAIN] * rate
    else:
        rate = (s[SeaState.MEASURED] - s[SeaState.MEASURED_BEFORE]) * per_s
        at_output = torque + p[SeaParam.TORQUE_GAIN] * (torque - s[SeaState.MEASURED])
        at_output -= p[SeaParam.TORQUE_RATE_GAIN_S] * rate
    return float(at_output * s[SeaState.RATIO] / p[SeaParam.TORQUE_CONSTANT])


@_compiled
def _rounding(value: float, step: float) -> float:
    """Return what rounding to a step adds to a value."""
    return 0.0 if step == 0.0 else math.floor(value / step + 0.5) * step - value


@_compiled
def _remember(s: np.ndarray, time_s: float, torque: float) -> None:
    head = (int(s[SeaState.HEAD]) + 1) & (HISTORY - 1)
    s[SeaState.TIMES + head], s[SeaState.TORQUES + head] = time_s, torque
    s[SeaState.HEAD] = head


@_compiled
def _late(s: np.ndarray, lag_s: float) -> float:
    """Return the remembered torque of so long ago: cubic through four substeps."""
    head = int(s[SeaState.HEAD])
    if lag_s == 0.0:
        return float(s[SeaState.TORQUES + head])
    wanted = s[SeaState.TIMES + head] - lag_s
    back = 1
    while back < HISTORY - 3 and s[SeaState.TIMES + ((head - back) & (HISTORY - 1))] > wanted:
        back += 1
    last = head - back + 2 if back > 1 else head
    value = 0.0
    for i in range(last - 3, last + 1):
        at = s[SeaState.TIMES + (i & (HISTORY - 1))]
        weight = 1.0
        for j in range(last - 3, last + 1):
            if j != i:
                other = s[SeaState.TIMES + (j & (HISTORY - 1))]
                weight *= (wanted - other) / (at - other)
        value += weight * s[SeaState.TORQUES + (i & (HISTORY - 1))]
    return float(value)


@_compiled
def _move(p: np.ndarray, s: np.ndarray, until_s: float, wanted: float) -> float:
    """Advance to the next sample and return the torque by the linear beam there."""
    substeps = int(p[SeaParam.SUBSTEPS])
    begin_s = s[SeaState.TIME_S]
    step = (until_s - begin_s) / substeps
    rate = p[SeaParam.FILTER_RATE]
    # Exact for a torque that goes straight from substep to substep.
    keep, before, after = 0.0, 0.0, 1.0
    if rate > 0.0:
        keep = math.exp(-rate * step)
        mean = (1.0 - keep) / (rate * step)
        before, after = mean - keep, 1.0 - mean
    on_rotor, on_output, linear = _forces(p, s[SeaState.ROTOR], s[SeaState.ANGLE])
    for i in range(1, substeps + 1):
        old = linear
        _substep(p, s, step, wanted, (on_rotor, on_output))
        on_rotor, on_output, linear = _forces(p, s[SeaState.ROTOR], s[SeaState.ANGLE])
        s[SeaState.FILTERED] = keep * s[SeaState.FILTERED] + before * old + after * linear
        _remember(s, begin_s + i * step, s[SeaState.FILTERED])
    s[SeaState.TIME_S], s[SeaState.SPRING] = until_s, on_output
    s[SeaState.CURRENT] = _driven(p, wanted, s[SeaState.ROTOR_VELOCITY])
    return float(linear)


@_compiled
def _warm(p: np.ndarray, s: np.ndarray) -> None:
    """Heat the winding over a sample period and see whether it is too much."""
    current = s[SeaState.CURRENT]
    final = p[SeaParam.AMBIENT_C] + p[SeaParam.HEATING_C_A2] * current * current
    s[SeaState.TEMPERATURE] = final + p[SeaParam.THERMAL_KEEP] * (s[SeaState.TEMPERATURE] - final)
    if s[SeaState.TEMPERATURE] > p[SeaParam.TEMPERATURE_MAX_C]:
        s[SeaState.FAULT] = float(int(s[SeaState.FAULT]) | Fault.OVER_TEMPERATURE)


@_compiled
def begin(p: np.ndarray, s: np.ndarray) -> None:
    """Set a bench to rest at the angle 0, at time 0."""
    s[:] = 0.0
    s[SeaState.TEMPERATURE] = p[SeaParam.AMBIENT_C]
    step = p[SeaParam.PERIOD_S] / p[SeaParam.SUBSTEPS]
    for i in range(HISTORY):
        s[SeaState.TIMES + i] = (i + 1 - HISTORY) * step
    s[SeaState.HEAD] = HISTORY - 1


@_compiled
def advance(
    p: np.ndarray, s: np.ndarray, noise: np.ndarray, torque: float, angle: float
) -> tuple[float, float, float, float, float, float, float, float, float, float]:
    """Advance the bench to its next sample and return the row measured there.

    True time (s), stamp (s), motor angle (rad) and velocity (rad/s), current (A), supply (V),
    temperature (degrees Celsius), fault bits, angle (rad), torque (N*m).
    """
    sample = int(s[SeaState.SAMPLES])
    row = sample % noise.shape[0]
    linear = 0.0
    if sample > 0:
        period = p[SeaParam.PERIOD_S] * p[SeaParam.CLOCK_STRETCH]
        most = JITTER_MAX * period
        off = min(max(p[SeaParam.CLOCK_JITTER_S] * noise[row, 2], -most), most)
        linear = _move(p, s, sample * period + off, _asked(p, s, torque, angle))
        _warm(p, s)
    nut = p[SeaParam.TRAVEL] * s[SeaState.ROTOR]
    nut_off = _rounding(nut, p[SeaParam.LINEAR_STEP_M])
    angle_off = _rounding(s[SeaState.ANGLE], p[SeaParam.ROTARY_STEP_RAD])
    motor, slope = _through(p, p[SeaParam.REST] + nut + nut_off)
    ratio = slope * p[SeaParam.TRAVEL]
    _, by_nut, by_angle = _beam(p, p[SeaParam.REST] + nut, s[SeaState.ANGLE])
    bent_off = by_nut * nut_off + by_angle * angle_off
    torque_off = -p[SeaParam.BEAM_STIFFNESS] * by_angle * bent_off
    gain = p[SeaParam.LAB_GAIN]
    s[SeaState.MEASURED_BEFORE], s[SeaState.MOTOR_BEFORE] = s[SeaState.MEASURED], s[SeaState.MOTOR]
    s[SeaState.MEASURED], s[SeaState.MOTOR] = gain * (linear + torque_off), motor
    s[SeaState.RATIO], s[SeaState.SAMPLES] = ratio, sample + 1.0
    stamp = s[SeaState.TIME_S] if p[SeaParam.TRUE_STAMPS] > 0.0 else sample * p[SeaParam.PERIOD_S]
    return (
        s[SeaState.TIME_S],
        stamp,
        motor,
        ratio * s[SeaState.ROTOR_VELOCITY],
        s[SeaState.CURRENT],
        p[SeaParam.SUPPLY_V],
        s[SeaState.TEMPERATURE],
        s[SeaState.FAULT],
        s[SeaState.ANGLE] + angle_off + p[SeaParam.ANGLE_NOISE_RAD] * noise[row, 1],
        gain * (_late(s, p[SeaParam.TORQUE_LAG_S]) + torque_off)
        + p[SeaParam.TORQUE_NOISE_NM] * noise[row, 0],
    )


class SeaPlant(CompiledBench):
    """A series-elastic bench from its start on, sample by sample."""

    STEP = staticmethod(advance)
    NOISES = 3  # torque, angle, sample time

    def __init__(
        self,
        settings: SeaSettings,
        load: BenchLoad,
        *,
        sample_rate_hz: float,
        noise: np.random.Generator,
    ) -> None:
        super().__init__(pack_sea(settings, load, sample_rate_hz=sample_rate_hz), STATE_SIZE, noise)
        begin(self._params, self._state)
        self._compile()

    def sample(self, torque_nm: float, angle_rad: float) -> Sample:
        """Compute the next sample as the devices give it."""
        row = self.advance(torque_nm, angle_rad)
        _, stamp_s, motor_angle, _, current, supply, heat, faults, angle, torque = row
        motor = (angle, self.velocity, current, supply, heat, int(faults))
        return round(stamp_s * 1e9), motor, torque, motor_angle, math.nan

    @property
    def angle(self) -> float:
        """True angle of the output, rad."""
        return float(self._state[SeaState.ANGLE])

    @property
    def velocity(self) -> float:
        """True velocity of the output, rad/s."""
        return float(self._state[SeaState.VELOCITY])

    @property
    def spring_torque(self) -> float:
        """True torque of the beam on the output, N*m."""
        return float(self._state[SeaState.SPRING])
