"""Constants and state of the series-elastic bench, packed for its compiled physics."""

from enum import IntEnum
from math import exp, pi

import numpy as np

from jointz.rig.sim.benches.bench_load import BenchLoad
from jointz.rig.sim.benches.compiled_bench import check_rate, packed
from jointz.rig.sim.benches.sea import SeaSettings

HISTORY = 256  # substeps of torque kept for its lag; a power of two
_LOWEST_PHYSICS_HZ = 6000.0


class SeaParam(IntEnum):
    """Constants of a packed bench; SI."""

    PERIOD_S = 0
    SUBSTEPS = 1
    STRETCH = 2
    JITTER_S = 3
    TRUE_STAMPS = 4
    TRAVEL = 5  # of the nut per radian of the rotor
    LEVER = 6
    BRACKET = 7
    MEMBER = 8
    REST = 9  # of the nut along its line, everything at rest at the angle 0
    BEAM = 10
    CUBIC = 11  # k3 / k
    ROTOR_MOBILITY = 12  # 1 / inertia
    TORQUE_CONSTANT = 13
    RESISTANCE = 14
    SUPPLY_V = 15
    CURRENT_MAX_A = 16
    DRIVE_FRICTION = 17
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
    TORQUE_RATE_GAIN = 29
    POSITION_GAIN = 30
    POSITION_RATE_GAIN = 31
    LAB_GAIN = 32  # measured torque over that of the linear beam
    LAG_S = 33
    FILTER_RATE = 34  # rad/s, 0: none
    TORQUE_NOISE = 35
    ANGLE_NOISE = 36
    LINEAR_STEP = 37
    ROTARY_STEP = 38
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
    values = {
        SeaParam.PERIOD_S: period_s,
        SeaParam.SUBSTEPS: max(1, -int(-_LOWEST_PHYSICS_HZ // sample_rate_hz)),
        SeaParam.STRETCH: errors.clock_stretch,
        SeaParam.JITTER_S: errors.clock_jitter_s,
        SeaParam.TRUE_STAMPS: float(errors.true_stamps),
        SeaParam.TRAVEL: machine.nut_travel_m,
        SeaParam.LEVER: machine.lever_m,
        SeaParam.BRACKET: machine.bracket_m,
        SeaParam.MEMBER: machine.member_m,
        SeaParam.REST: machine.bracket_m + machine.member_m,
        SeaParam.BEAM: machine.beam_stiffness,
        SeaParam.CUBIC: errors.beam_cubic_per_m2,
        SeaParam.ROTOR_MOBILITY: 1.0 / machine.rotor_inertia,
        SeaParam.TORQUE_CONSTANT: machine.torque_constant,
        SeaParam.RESISTANCE: machine.resistance_ohm,
        SeaParam.SUPPLY_V: machine.supply_v,
        SeaParam.CURRENT_MAX_A: machine.current_max_a,
        SeaParam.DRIVE_FRICTION: machine.drive_friction_nm,
        SeaParam.DRIVE_DAMPING: machine.drive_damping,
        SeaParam.DRIVE_BEND: machine.drive_velocity_rad_s**2,
        SeaParam.STIFFNESS: machine.stiffness + load.stiffness,
        SeaParam.DAMPING: machine.damping + load.damping,
        SeaParam.MOBILITY: 0.0 if load.locked else 1.0 / (machine.inertia + load.inertia),
        SeaParam.FRICTION: errors.coulomb_friction_nm if is_loaded else 0.0,
        SeaParam.FRICTION_BEND: errors.friction_velocity_rad_s**2,
        SeaParam.STOP_RAD: machine.stop_rad,
        SeaParam.STOP_STIFFNESS: machine.stop_stiffness,
        SeaParam.STOP_DAMPING: machine.stop_damping,
        SeaParam.TORQUE_GAIN: control.torque_gain,
        SeaParam.TORQUE_RATE_GAIN: control.torque_rate_gain_s,
        SeaParam.POSITION_GAIN: control.position_gain,
        SeaParam.POSITION_RATE_GAIN: control.position_rate_gain,
        SeaParam.LAB_GAIN: settings.total_torque_gain,
        SeaParam.LAG_S: errors.torque_lag_s,
        SeaParam.FILTER_RATE: 2.0 * pi * errors.torque_filter_hz,
        SeaParam.TORQUE_NOISE: errors.torque_noise_nm,
        SeaParam.ANGLE_NOISE: errors.angle_noise_rad,
        SeaParam.LINEAR_STEP: errors.linear_step_m,
        SeaParam.ROTARY_STEP: errors.rotary_step_rad,
        SeaParam.AMBIENT_C: machine.ambient_c,
        SeaParam.HEATING_C_A2: machine.heating_c_a2,
        SeaParam.THERMAL_KEEP: exp(-period_s / machine.thermal_s),
        SeaParam.TEMPERATURE_MAX_C: machine.temperature_max_c,
    }
    return packed(values, SeaParam)
