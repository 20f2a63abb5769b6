"""The test bench of the quasi-direct-drive actuator (3.2): what it is made of.

A torque motor behind a 9:1 gear, a torque sensor, a rotary spring and a position motor
behind a 50:1 transmission, in one line. The physics is in :mod:`.qdd_bench_plant`.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field
from enum import IntEnum

import numpy as np

from jointz.core.errors import DataError
from jointz.rig.sim.benches.bench_load import BenchLoad
from jointz.rig.sim.benches.compiled_bench import check_rate, packed
from jointz.rig.sim.presets import named_preset

_LOWEST_PHYSICS_HZ = 5000.0
#: Of a time constant and a step; from 2.8 on Runge and Kutta's method has no standstill.
_STEP_LIMIT = 2.5
#: Steps of the physics for which commands are kept: more than the delay; a power of two.
COMMANDS = 128


@dataclass(frozen=True, slots=True)
class QddMachine:
    """The machine; values that tables 3.1 and 3.2 do not state are assumed, see the docs."""

    gear_ratio: float = 9.0  # turns of the motor per turn of the output (table 3.1)
    torque_constant: float = 0.11  # N*m/A, before the gear
    coulomb_friction: float = 0.38  # N*m, at the output
    gear_friction: float = 0.09  # N*m/A, at the output
    sign_velocity_rad_s: float = 0.02  # velocity over which the sign of friction changes smoothly
    rotor_inertia: float = 92e-4  # kg*m^2, at the output
    current_max_a: float = 25.0  # limit of the drive
    supply_v: float = 36.0  # supply of the drive
    delay_s: float = 0.002  # delay of the current behind its command
    time_constant_s: float = 0.002  # time constant of the current
    spring_damping: float = 0.1  # N*m*s/rad, internal damping of the spring
    far_inertia: float = 0.25  # kg*m^2, of the position side at its output
    far_hz: float = 30.0  # natural frequency of the position servo
    far_damping: float = 1.0  # damping ratio of the position servo


@dataclass(frozen=True, slots=True)
class QddErrors:
    """Errors of the bench that model 3.3 does not contain; none by default."""

    torque_constant_error: float = 0.0  # true over stated constant, minus 1
    # share by which friction is larger against positive motion and smaller against negative motion
    friction_asymmetry: float = 0.0
    cogging_nm: float = 0.0  # amplitude of the cogging torque at the output
    cogging_periods: float = 378.0  # periods per turn of the output (42 per turn of the motor)
    sensor_bias_nm: float = 0.0  # offset of the torque sensor
    sensor_noise_nm: float = 0.0  # SD of white noise of the torque sensor
    # relative SD of the sensor's calibration; drawn by :func:`draw_mounting`
    sensor_gain_sd: float = 0.0
    sensor_lag_s: float = 0.0  # time constant of the torque sensor's amplifier
    spring_hysteresis_nm: float = 0.0  # half width of the loop of torque over deflection
    hysteresis_rad: float = 0.005  # deflection over which the hysteresis reverses
    encoder_step_rad: float = 0.0  # resolution of the motor's encoder
    velocity_noise_rad_s: float = 0.0  # SD of white noise of the motor's velocity
    current_noise_a: float = 0.0  # SD of white noise of the motor's current
    # SD of the true sample times about the even grid; commands change at the true times
    clock_jitter_s: float = 0.0


@dataclass(frozen=True, slots=True)
class QddSettings:
    """A quasi-direct-drive bench."""

    name: str  # name of the preset
    machine: QddMachine = field(default_factory=QddMachine)
    errors: QddErrors = field(default_factory=QddErrors)
    sensor_gain: float = 1.0  # reading of the torque sensor over the true torque
    # phase of the cogging at the angle 0, by the mounting of the motor
    ripple_phase_rad: float = 0.0


_NOMINAL = QddErrors(
    cogging_nm=0.3,
    sensor_bias_nm=-0.58,
    sensor_noise_nm=0.33,
    sensor_gain_sd=0.005,
    encoder_step_rad=2.0 * np.pi / 2**14 / 9.0,
    velocity_noise_rad_s=0.01,
    current_noise_a=0.05,
)
_HARD = QddErrors(
    torque_constant_error=-0.05,
    friction_asymmetry=0.3,
    cogging_nm=0.35,
    sensor_bias_nm=-0.58,
    sensor_noise_nm=0.5,
    sensor_gain_sd=0.01,
    sensor_lag_s=0.001,
    spring_hysteresis_nm=0.1,
    encoder_step_rad=2.0 * np.pi / 2**12 / 9.0,
    velocity_noise_rad_s=0.03,
    current_noise_a=0.15,
    clock_jitter_s=2e-4,
)

#: Name -> preset.
QDD_PRESETS: Mapping[str, QddSettings] = {
    "clean": QddSettings("clean"),
    "nominal": QddSettings("nominal", errors=_NOMINAL),
    "hard": QddSettings("hard", errors=_HARD),
}


def qdd_preset(name: str) -> QddSettings:
    """Return the preset with this name."""
    return named_preset(QDD_PRESETS, name, what="quasi-direct-drive bench")


def draw_mounting(settings: QddSettings, rng: np.random.Generator) -> QddSettings:
    """Return the settings of one bench: its sensor as calibrated, its motor as mounted."""
    gain = 1.0 + settings.errors.sensor_gain_sd * float(rng.standard_normal())
    phase = float(rng.uniform(0.0, 2.0 * np.pi))
    return QddSettings(settings.name, settings.machine, settings.errors, gain, phase)


class QddParam(IntEnum):
    """Constants of the compiled physics; SI."""

    PERIOD_S = 0
    SUBSTEPS = 1
    TORQUE_PER_AMPERE = 2  # true, at the output
    AMPERE_PER_TORQUE = 3  # nominal
    CURRENT_MAX_A = 4
    COMMAND_DELAY = 5  # substeps
    CURRENT_RATE = 6  # 1 / time constant
    COULOMB_FRICTION = 7
    GEAR_FRICTION = 8
    FRICTION_ASYMMETRY = 9
    SIGN_RATE = 10
    ROTOR_MOBILITY = 11  # 1 / inertia
    SPRING = 12
    SPRING_DAMPING = 13
    FAR_MOBILITY = 14
    FAR_STIFFNESS = 15
    FAR_DAMPING = 16
    LOCKED = 17
    COGGING_NM = 18
    COGGING_PERIODS = 19
    SENSOR_BIAS_NM = 20
    SENSOR_NOISE_NM = 21
    SENSOR_GAIN = 22
    ENCODER_STEP_RAD = 23
    VELOCITY_NOISE_RAD_S = 24
    CURRENT_NOISE_A = 25
    SUPPLY_V = 26
    RIPPLE_PHASE_RAD = 27
    SENSOR_LAG_S = 28
    SPRING_HYSTERESIS_NM = 29
    HYSTERESIS_PER_RAD = 30
    CLOCK_JITTER_S = 31


class QddState(IntEnum):
    """State of a packed bench; the first six are integrated."""

    ANGLE = 0  # of the torque motor, at the output
    VELOCITY = 1
    FAR_ANGLE = 2
    FAR_VELOCITY = 3
    CURRENT = 4
    SLIP = 5  # torque of the spring's hysteresis
    SENSED = 6  # torque behind the sensor's lag
    SAMPLES = 7
    TIME_S = 8  # true, of the newest sample
    LATE_S = 9  # of that, what is the clock's error
    POSITION_BEFORE = 10  # commanded a sample ago
    COMMAND = 11  # ring of current commands begins here


STATE_SIZE = int(QddState.COMMAND) + COMMANDS


def pack_qdd(settings: QddSettings, load: BenchLoad, *, sample_rate_hz: float) -> np.ndarray:
    """Return the constants of a bench for the compiled physics."""
    machine, errors = settings.machine, settings.errors
    check_rate("quasi-direct-drive", sample_rate_hz)
    if load.stiffness <= 0.0:
        raise DataError(
            f"quasi-direct-drive bench: load {load.name!r} has no stiffness; a spring couples its "
            "two sides. Give loads one."
        )
    substeps = _substeps(machine, load, sample_rate_hz)
    delay = round(machine.delay_s * sample_rate_hz * substeps)
    if not 0 <= delay < COMMANDS:
        longest = (COMMANDS - 1) / (sample_rate_hz * substeps)
        raise DataError(
            f"quasi-direct-drive bench: expected a delay_s of 0..{longest:.4f} s at "
            f"{sample_rate_hz:g} Hz, got {machine.delay_s:g}."
        )
    stated = machine.gear_ratio * machine.torque_constant
    servo = 2.0 * np.pi * machine.far_hz
    derived = {
        QddParam.PERIOD_S: 1.0 / sample_rate_hz,
        QddParam.SUBSTEPS: substeps,
        QddParam.TORQUE_PER_AMPERE: stated * (1.0 + errors.torque_constant_error),
        QddParam.AMPERE_PER_TORQUE: 1.0 / stated,
        QddParam.COMMAND_DELAY: delay,
        QddParam.CURRENT_RATE: 1.0 / machine.time_constant_s,
        QddParam.SIGN_RATE: 1.0 / machine.sign_velocity_rad_s,
        QddParam.ROTOR_MOBILITY: 1.0 / (machine.rotor_inertia + load.inertia),
        QddParam.SPRING: load.stiffness,
        QddParam.SPRING_DAMPING: machine.spring_damping + load.damping,
        QddParam.FAR_MOBILITY: 1.0 / machine.far_inertia,
        QddParam.FAR_STIFFNESS: machine.far_inertia * servo**2,
        QddParam.FAR_DAMPING: 2.0 * machine.far_damping * machine.far_inertia * servo,
        QddParam.LOCKED: float(load.locked),
        QddParam.HYSTERESIS_PER_RAD: 1.0 / errors.hysteresis_rad,
    }
    return packed(QddParam, derived, machine, errors, settings)


def _substeps(machine: QddMachine, load: BenchLoad, sample_rate_hz: float) -> int:
    """Return how many steps a sample takes: friction about standstill is the fastest there is."""
    friction = machine.coulomb_friction + machine.gear_friction * machine.current_max_a
    inertia = machine.rotor_inertia + load.inertia
    friction_rate = friction / machine.sign_velocity_rad_s / inertia
    physics_hz = max(_LOWEST_PHYSICS_HZ, friction_rate / _STEP_LIMIT)
    return max(1, int(np.ceil(physics_hz / sample_rate_hz)))
