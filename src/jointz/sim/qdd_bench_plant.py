r"""The compiled physics of the quasi-direct-drive bench over one sample period.

torque motor (3.3)
    :math:`J\ddot\theta = c\,i - (f_c + f_g|i|)(1 \pm a)\tanh(\dot\theta/v_0)
    + r\sin(n\theta) - \tau`
spring
    :math:`\tau = k(\theta - p) + d(\dot\theta - \dot p)`
position side
    :math:`J_p\ddot p = k_p(p_c - p) + d_p(\dot p_c - \dot p) + \tau`, or held where it is locked

The current follows its delayed command with a first order. Runge and Kutta's fourth-order
method at 5 kHz or more. The torque sensor reads the spring's torque.
"""

import math

import numpy as np
from numba import njit

from jointz.sim.bench_load import BenchLoad
from jointz.sim.qdd_bench import COMMANDS, STATE_SIZE, QddParam, QddSettings, QddState, pack_qdd

#: Angle (rad), velocity (rad/s), current (A), supply (V), torque sensor (N*m), far angle (rad).
QddRow = tuple[float, float, float, float, float, float]

_compiled = njit(cache=True, nogil=True, error_model="numpy")
_NOISE_ROWS = 4096
_NOISES = 3  # sensor, velocity, current


@_compiled
def _spring(p: np.ndarray, angle: float, velocity: float, far: float, far_velocity: float) -> float:
    return float(
        p[QddParam.SPRING] * (angle - far) + p[QddParam.SPRING_DAMPING] * (velocity - far_velocity)
    )


@_compiled
def _motor(p: np.ndarray, angle: float, velocity: float, current: float) -> float:
    """Return the torque of the motor at its output."""
    sign = math.tanh(velocity * p[QddParam.SIGN_RATE])
    friction = p[QddParam.COULOMB] + p[QddParam.GEAR_FRICTION] * abs(current)
    friction *= 1.0 + p[QddParam.ASYMMETRY] * sign
    ripple = p[QddParam.COGGING_NM] * math.sin(
        p[QddParam.COGGING_PERIODS] * angle + p[QddParam.COGGING_PHASE]
    )
    return float(p[QddParam.TORQUE_PER_AMPERE] * current - friction * sign + ripple)


@_compiled
def _slopes(
    p: np.ndarray,
    at: tuple[float, float, float, float, float],
    wanted: float,
    far: tuple[float, float],
) -> tuple[float, float, float, float, float]:
    """Return the rates of angle, velocity, far angle, far velocity and current."""
    angle, velocity, far_angle, far_velocity, current = at
    torque = _spring(p, angle, velocity, far_angle, far_velocity)
    acceleration = (_motor(p, angle, velocity, current) - torque) * p[QddParam.ROTOR_MOBILITY]
    if p[QddParam.LOCKED] > 0.0:
        far_velocity, far_acceleration = 0.0, 0.0
    else:
        servo = p[QddParam.FAR_STIFFNESS] * (far[0] - far_angle)
        servo += p[QddParam.FAR_DAMPING] * (far[1] - far_velocity)
        far_acceleration = (servo + torque) * p[QddParam.FAR_MOBILITY]
    rate = (wanted - current) * p[QddParam.CURRENT_RATE]
    return velocity, acceleration, far_velocity, far_acceleration, rate


@_compiled
def _moved(
    at: tuple[float, float, float, float, float],
    by: tuple[float, float, float, float, float],
    step: float,
) -> tuple[float, float, float, float, float]:
    return (
        at[0] + step * by[0],
        at[1] + step * by[1],
        at[2] + step * by[2],
        at[3] + step * by[3],
        at[4] + step * by[4],
    )


@_compiled
def _substep(
    p: np.ndarray,
    at: tuple[float, float, float, float, float],
    wanted: float,
    far: tuple[float, float],
    step: float,
) -> tuple[float, float, float, float, float]:
    """Return the state one step later; ``far`` is the wanted far angle now and its rate."""
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
def advance(
    p: np.ndarray, s: np.ndarray, noise: np.ndarray, torque: float, position: float
) -> tuple[float, float, float, float, float, float]:
    """Advance the bench to its next sample and return the row measured there.

    Parameters
    ----------
    p : (len(QddParam),) float
        Constants, see :class:`jointz.sim.qdd_bench.QddParam`.
    s : (STATE_SIZE,) float
        See :class:`jointz.sim.qdd_bench.QddState`; changed.
    noise : (n, 3) float
        Standard normal numbers for sensor, velocity and current; a sample has row ``sample % n``.
    torque, position : float, N*m, rad
        Commands since the sample before. The position side goes straight to its own.

    Returns
    -------
    QddRow
    """
    sample = int(s[QddState.SAMPLES])
    row = sample % noise.shape[0]
    at = (
        s[QddState.ANGLE],
        s[QddState.VELOCITY],
        s[QddState.FAR_ANGLE],
        s[QddState.FAR_VELOCITY],
        s[QddState.CURRENT],
    )
    if sample > 0:
        most = p[QddParam.CURRENT_MAX_A]
        asked = min(max(torque * p[QddParam.AMPERE_PER_TORQUE], -most), most)
        substeps = int(p[QddParam.SUBSTEPS])
        step = p[QddParam.PERIOD_S] / substeps
        delay = int(p[QddParam.COMMAND_DELAY])
        before = s[QddState.POSITION_BEFORE]
        rate = (position - before) / p[QddParam.PERIOD_S]
        for i in range(substeps):
            now = ((sample - 1) * substeps + i) % COMMANDS
            s[QddState.COMMAND + now] = asked
            wanted = s[QddState.COMMAND + (now - delay) % COMMANDS]
            at = _substep(p, at, wanted, (before + i * step * rate, rate), step)
        s[QddState.POSITION_BEFORE] = position
        s[QddState.ANGLE], s[QddState.VELOCITY] = at[0], at[1]
        s[QddState.FAR_ANGLE], s[QddState.FAR_VELOCITY], s[QddState.CURRENT] = at[2], at[3], at[4]
    s[QddState.SAMPLES] = sample + 1.0
    angle, quantum = at[0], p[QddParam.ENCODER_STEP]
    if quantum > 0.0:
        angle = math.floor(angle / quantum + 0.5) * quantum
    reading = p[QddParam.SENSOR_GAIN] * _spring(p, at[0], at[1], at[2], at[3])
    return (
        angle,
        at[1] + p[QddParam.VELOCITY_NOISE] * noise[row, 1],
        at[4] + p[QddParam.CURRENT_NOISE] * noise[row, 2],
        p[QddParam.SUPPLY_V],
        reading + p[QddParam.SENSOR_BIAS] + p[QddParam.SENSOR_NOISE] * noise[row, 0],
        at[2],
    )


class QddBenchPlant:
    """A quasi-direct-drive bench from its start on, sample by sample.

    Parameters
    ----------
    settings : QddSettings
        Of the bench; its sensor's gain as it stands there.
    load : BenchLoad
        The spring between the sides.
    sample_rate_hz : float, Hz
        Of all devices, 100 to 20000.
    noise : numpy.random.Generator
        Drawn from in blocks, by nobody else.

    Raises
    ------
    DataError
        When the rate is out of range, or there is no spring.

    Examples
    --------
    >>> from jointz.sim.qdd_bench import qdd_preset
    >>> spring = BenchLoad("springs", stiffness=146.39, locked=True)
    >>> rng = np.random.default_rng(1)
    >>> plant = QddBenchPlant(qdd_preset("clean"), spring, sample_rate_hz=500.0, noise=rng)
    >>> rows = [plant.advance(5.0, 0.0) for _ in range(500)]
    >>> abs(rows[-1][0] - 5.0 / 146.39) < 0.01
    True
    """

    def __init__(
        self,
        settings: QddSettings,
        load: BenchLoad,
        *,
        sample_rate_hz: float,
        noise: np.random.Generator,
    ) -> None:
        self._params = pack_qdd(settings, load, sample_rate_hz=sample_rate_hz)
        self._rng = noise
        self._noise = np.zeros((_NOISE_ROWS, _NOISES))
        self._state = np.zeros(STATE_SIZE)
        self._left = 0

    def advance(self, torque_nm: float, position_rad: float) -> QddRow:
        """Compute the next sample; the first is the state at rest.

        Parameters
        ----------
        torque_nm, position_rad : float, N*m, rad
            Commands since the sample before, to the torque motor and the position side.

        Returns
        -------
        QddRow
            Angle (rad), velocity (rad/s), current (A), supply (V), torque sensor (N*m), angle
            of the position side (rad).
        """
        if self._left == 0:
            self._rng.standard_normal(out=self._noise)
            self._left = _NOISE_ROWS
        self._left -= 1
        row: QddRow = advance(self._params, self._state, self._noise, torque_nm, position_rad)
        return row
