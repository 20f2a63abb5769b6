r"""The compiled physics of the quasi-direct-drive bench over one sample period.

torque motor (3.3)
    :math:`J\ddot\theta = c\,i - (f_c + f_g|i|)(1 + a s)s + r\sin(n\theta + \varphi) - \tau`,
    :math:`s = \tanh(\dot\theta/v_0)`
spring
    :math:`\tau = k\delta + d\dot\delta + h`, :math:`\delta = \theta - p`, with Dahl's hysteresis
    :math:`\delta_h\dot h = h_0\dot\delta - |\dot\delta|h`
position side
    :math:`J_p\ddot p = k_p(p_c - p) + d_p(\dot p_c - \dot p) + \tau`, or held where it is locked
torque sensor
    reads :math:`g\tau` behind a lag of first order, with bias and noise

The current follows its delayed command with a first order; the command of the position side
goes straight from one sample to the next. Runge and Kutta's fourth-order method at 5 kHz or
more.

The friction about standstill is the fastest part: with the :math:`v_0` of the presets,
0.02 rad/s, angles are exact to 5e-5 rad where the motor turns back, one count of its encoder;
with a smooth friction (0.5 rad/s) to 1e-6 rad.
"""

import math

import numpy as np
from numba import njit

from jointz.rig.sim.benches.bench_load import BenchLoad
from jointz.rig.sim.benches.compiled_bench import JITTER_MAX, CompiledBench
from jointz.rig.sim.benches.qdd_bench import (
    COMMANDS,
    STATE_SIZE,
    QddParam,
    QddSettings,
    QddState,
    pack_qdd,
)
from jointz.rig.sim.sensors.sampled_time import Sample

# Angle, velocity, far angle, far velocity, current, torque of the hysteresis.
_At = tuple[float, float, float, float, float, float]

_compiled = njit(cache=True, nogil=True, error_model="numpy")
_AMBIENT_C = 25.0


@_compiled
def _spring(p: np.ndarray, at: _At) -> float:
    elastic = p[QddParam.SPRING] * (at[0] - at[2]) + p[QddParam.SPRING_DAMPING] * (at[1] - at[3])
    return float(elastic + at[5])


@_compiled
def _motor(p: np.ndarray, at: _At) -> float:
    """Return the torque of the motor at its output."""
    # tanh by one exponential: a quarter of the time of the library's.
    sign = 1.0 - 2.0 / (math.exp(2.0 * at[1] * p[QddParam.SIGN_RATE]) + 1.0)
    friction = p[QddParam.COULOMB_FRICTION] + p[QddParam.GEAR_FRICTION] * abs(at[4])
    friction *= 1.0 + p[QddParam.FRICTION_ASYMMETRY] * sign
    torque = p[QddParam.TORQUE_PER_AMPERE] * at[4] - friction * sign
    if p[QddParam.COGGING_NM] != 0.0:
        turned = p[QddParam.COGGING_PERIODS] * at[0] + p[QddParam.RIPPLE_PHASE_RAD]
        torque += p[QddParam.COGGING_NM] * math.sin(turned)
    return float(torque)


@_compiled
def _slopes(p: np.ndarray, at: _At, wanted: float, far: tuple[float, float]) -> _At:
    """Return the rates of a state; ``far`` is the commanded far angle and its rate."""
    torque = _spring(p, at)
    acceleration = (_motor(p, at) - torque) * p[QddParam.ROTOR_MOBILITY]
    if p[QddParam.LOCKED] > 0.0:
        far_velocity, far_acceleration = 0.0, 0.0
    else:
        far_velocity = at[3]
        servo = p[QddParam.FAR_STIFFNESS] * (far[0] - at[2])
        servo += p[QddParam.FAR_DAMPING] * (far[1] - at[3])
        far_acceleration = (servo + torque) * p[QddParam.FAR_MOBILITY]
    rate = at[1] - at[3]
    slip = (p[QddParam.SPRING_HYSTERESIS_NM] * rate - abs(rate) * at[5]) * p[
        QddParam.HYSTERESIS_PER_RAD
    ]
    current = (wanted - at[4]) * p[QddParam.CURRENT_RATE]
    return at[1], acceleration, far_velocity, far_acceleration, current, slip


@_compiled
def _moved(at: _At, by: _At, step: float) -> _At:
    return (
        at[0] + step * by[0],
        at[1] + step * by[1],
        at[2] + step * by[2],
        at[3] + step * by[3],
        at[4] + step * by[4],
        at[5] + step * by[5],
    )


@_compiled
def _substep(p: np.ndarray, at: _At, wanted: float, far: tuple[float, float], step: float) -> _At:
    """Return the state one step later; ``far`` is the commanded far angle now and its rate."""
    middle, end = (far[0] + 0.5 * step * far[1], far[1]), (far[0] + step * far[1], far[1])
    k1 = _slopes(p, at, wanted, far)
    k2 = _slopes(p, _moved(at, k1, 0.5 * step), wanted, middle)
    k3 = _slopes(p, _moved(at, k2, 0.5 * step), wanted, middle)
    k4 = _slopes(p, _moved(at, k3, step), wanted, end)
    sixth = step / 6.0
    at = _moved(at, k1, sixth)
    at = _moved(at, k2, 2.0 * sixth)
    at = _moved(at, k3, 2.0 * sixth)
    return _moved(at, k4, sixth)


@_compiled
def _lagged(sensed: float, span: tuple[float, float], rate: float) -> float:
    """Return a lagged torque a step later.

    ``span`` is the torque before and after, straight between; ``rate`` the step over the lag.
    """
    slope = (span[1] - span[0]) / rate
    return float(span[1] - slope + (sensed - span[0] + slope) * math.exp(-rate))


@_compiled
def _late(p: np.ndarray, white: float) -> float:
    """Return how late a sample is taken, s."""
    most = JITTER_MAX * p[QddParam.PERIOD_S]
    return float(min(max(p[QddParam.CLOCK_JITTER_S] * white, -most), most))


@_compiled
def _load_state(s: np.ndarray) -> _At:
    return (
        s[QddState.ANGLE],
        s[QddState.VELOCITY],
        s[QddState.FAR_ANGLE],
        s[QddState.FAR_VELOCITY],
        s[QddState.CURRENT],
        s[QddState.SLIP],
    )


@_compiled
def _move(p: np.ndarray, s: np.ndarray, span_s: float, torque: float, position: float) -> None:
    """Advance all by the time between two samples."""
    at = _load_state(s)
    most = p[QddParam.CURRENT_MAX_A]
    asked = min(max(torque * p[QddParam.AMPERE_PER_TORQUE], -most), most)
    substeps, delay = int(p[QddParam.SUBSTEPS]), int(p[QddParam.COMMAND_DELAY])
    first = (int(s[QddState.SAMPLES]) - 1) * substeps
    step = span_s / substeps
    before = s[QddState.POSITION_BEFORE]
    rate = (position - before) / span_s
    lag_s = p[QddParam.SENSOR_LAG_S]
    for i in range(substeps):
        now = (first + i) & (COMMANDS - 1)
        s[QddState.COMMAND + now] = asked
        wanted = s[QddState.COMMAND + ((now - delay) & (COMMANDS - 1))]
        torque_before = _spring(p, at)
        at = _substep(p, at, wanted, (before + i * step * rate, rate), step)
        if lag_s > 0.0:
            span = (torque_before, _spring(p, at))
            s[QddState.SENSED] = _lagged(s[QddState.SENSED], span, step / lag_s)
    s[QddState.POSITION_BEFORE] = position
    s[QddState.ANGLE], s[QddState.VELOCITY] = at[0], at[1]
    s[QddState.FAR_ANGLE], s[QddState.FAR_VELOCITY] = at[2], at[3]
    s[QddState.CURRENT], s[QddState.SLIP] = at[4], at[5]
    if lag_s <= 0.0:
        s[QddState.SENSED] = _spring(p, at)


@_compiled
def advance(
    p: np.ndarray, s: np.ndarray, noise: np.ndarray, torque: float, position: float
) -> tuple[float, float, float, float, float, float]:
    """Advance the bench to its next sample and return the row measured there.

    Angle (rad), velocity (rad/s), current (A), supply (V), torque sensor (N*m), far angle (rad).
    """
    sample = int(s[QddState.SAMPLES])
    row = sample % noise.shape[0]
    if sample > 0:
        late = _late(p, noise[row, 3])
        span_s = p[QddParam.PERIOD_S] + late - s[QddState.LATE_S]
        _move(p, s, span_s, torque, position)
        s[QddState.LATE_S] = late
        s[QddState.TIME_S] = sample * p[QddParam.PERIOD_S] + late
    s[QddState.SAMPLES] = sample + 1.0
    angle, quantum = s[QddState.ANGLE], p[QddParam.ENCODER_STEP_RAD]
    if quantum > 0.0:
        angle = math.floor(angle / quantum + 0.5) * quantum
    reading = p[QddParam.SENSOR_GAIN] * s[QddState.SENSED] + p[QddParam.SENSOR_BIAS_NM]
    return (
        angle,
        s[QddState.VELOCITY] + p[QddParam.VELOCITY_NOISE_RAD_S] * noise[row, 1],
        s[QddState.CURRENT] + p[QddParam.CURRENT_NOISE_A] * noise[row, 2],
        p[QddParam.SUPPLY_V],
        reading + p[QddParam.SENSOR_NOISE_NM] * noise[row, 0],
        s[QddState.FAR_ANGLE],
    )


class QddBenchPlant(CompiledBench):
    """A quasi-direct-drive bench from its start on, sample by sample."""

    STEP = staticmethod(advance)
    NOISES = 4  # sensor, velocity, current, sample time

    def __init__(
        self,
        settings: QddSettings,
        load: BenchLoad,
        *,
        sample_rate_hz: float,
        noise: np.random.Generator,
    ) -> None:
        super().__init__(pack_qdd(settings, load, sample_rate_hz=sample_rate_hz), STATE_SIZE, noise)
        self._jitter = noise.spawn(1)[0]
        self._period_ns = round(1e9 / sample_rate_hz)
        self._compile()

    def sample(self, torque_nm: float, angle_rad: float) -> Sample:
        """Compute the next sample as the devices give it."""
        time_ns = int(self._state[QddState.SAMPLES]) * self._period_ns
        angle, velocity, current, supply, torque, far = self.advance(torque_nm, angle_rad)
        return time_ns, (angle, velocity, current, supply, _AMBIENT_C, 0), torque, far, math.nan

    @property
    def time_s(self) -> float:
        """True time of the newest sample, s; samples of an even clock are a period apart."""
        return float(self._state[QddState.TIME_S])

    @property
    def spring_torque(self) -> float:
        """True torque on the spring at the newest sample, N*m."""
        at: _At = tuple(self._state[: QddState.SENSED].tolist())
        return float(_spring(self._params, at))

    def _draw(self) -> None:
        self._noise[:, :-1] = self._rng.standard_normal(self._noise[:, :-1].shape)
        # Apart from the rest: switching the jitter on leaves the other noises what they are.
        if self._params[QddParam.CLOCK_JITTER_S] > 0.0:
            self._noise[:, -1] = self._jitter.standard_normal(len(self._noise))
