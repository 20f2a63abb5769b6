"""Places of constants and state in the packed arrays of the compiled plant.

The compiled step takes a few flat arrays; these are the names of their places.
"""

from enum import IntEnum

import numpy as np

HARMONICS = 7  # of the knee's Fourier series, the mean included
CURVE_PIECES = 200  # of 0.5 % of the cycle each
CURVES = 5  # stiffness, damping, inertia, thigh, moment; four cubic coefficients each
COMMANDS = 64  # samples of commands kept: more than the actuator's delay
HISTORY = 2048  # substeps kept: more than any delay; a power of two


class Param(IntEnum):
    """Constants of a plant; SI."""

    STEP_S = 0  # substep
    PERIOD_S = 1  # sample period
    TORQUE_PER_AMPERE = 2  # true, at the output
    AMPERE_PER_TORQUE = 3  # nominal: what the driver believes
    CURRENT_MAX_A = 4
    COMMAND_DELAY = 5  # substeps
    CURRENT_KEEP = 6  # exp(-step / time constant)
    CURRENT_KEEP_HALF = 7  # the same for half a step
    COULOMB_FRICTION = 8  # true
    GEAR_FRICTION = 9  # true, per A
    SIGN_RATE = 10  # 1 / velocity of the smooth sign of friction
    EXO_INERTIA = 11  # rotor, and frame where the strap gives
    EXO_GRAVITY = 12  # mass * g * distance
    STRAP_STIFFNESS = 13  # 0: rigid
    STRAP_DAMPING = 14
    LIMB_GRAVITY = 15  # mass * g * distance
    SOFTENING = 16  # 1 / (deviation that halves K)^2
    REFLEX_GAIN = 17  # share of K
    REFLEX_SCALE = 18  # s for a velocity reflex, 0 for a position reflex
    REFLEX_DELAY = 19  # substeps
    REFLEX_RATE = 20  # 1 / time to the twitch's peak
    TISSUE_RATE = 21  # rad/s, 0: rigid
    TISSUE_DAMPING = 22
    ANGLE_LAG_RATE = 23  # 1 / time constant of the goniometer, 0: none
    ANGLE_DELAY = 24  # substeps
    ANGLE_GAIN = 25
    TORSION = 26  # rad per N*m
    TORQUE_ERROR_KEEP = 27  # per sample, of an autoregressive process; then its drive
    TORQUE_ERROR_DRIVE = 28
    VOLUNTARY_KEEP = 29
    VOLUNTARY_DRIVE = 30
    COLOURED_KEEP = 31
    COLOURED_DRIVE = 32
    DRIFT_KEEP = 33
    DRIFT_DRIVE = 34
    WHITE = 35  # sd
    ANGLE_STEP = 36  # quanta
    VELOCITY_STEP = 37
    CURRENT_STEP = 38
    SUPPLY_V = 39
    SUPPLY_OHM = 40
    AMBIENT_C = 41
    HEATING_C_A2 = 42
    THERMAL_KEEP = 43  # per sample
    TEMPERATURE_MAX_C = 44
    SAMPLE_RATE_HZ = 45
    SUBSTEPS = 46  # in a sample period
    ACTIVE = 47  # states that are integrated, from the first on
    ADDED_STIFFNESS = 48  # of a known spring across the joint


class State(IntEnum):
    """State of a plant; up to nine of the first are integrated by Runge and Kutta's method."""

    ANGLE = 0  # deviation from the unperturbed path
    VELOCITY = 1
    LAGGED = 2  # angle behind the goniometer's lag
    REFLEX = 3
    REFLEX_RATE = 4
    TISSUE = 5  # angle behind the tissue
    TISSUE_PULL = 6  # rate behind the tissue, less 2 zeta omega times the angle before it
    EXO_ANGLE = 7  # deviation of the frame from the unperturbed path
    EXO_VELOCITY = 8
    ACCELERATION = 9  # of the deviation, as last computed; not integrated
    CURRENT = 10
    TORQUE_ERROR = 11
    VOLUNTARY = 12
    COLOURED = 13
    DRIFT = 14
    TEMPERATURE = 15
    PATH = 16  # unperturbed angle, rate and acceleration at the last sample
    PATH_RATE = 17
    PATH_ACCELERATION = 18
    PATH_KNOWN = 19  # 0 after a heel strike: the path is computed anew
    SUBSTEPS = 20  # done so far
    FAULT = 21  # bits; any of them sets the current to zero
    MOMENT = 22  # of muscles and ligaments on the shank at the last sample, N*m
    COMMAND = 23  # ring of commands begins here
    WORK = 23 + COMMANDS  # and here the room that a step works in


class Gait(IntEnum):
    """One stride: phase = u (LINEAR + u^2 (CUBIC + u (QUARTIC + u QUINTIC))), u = time * RATE_HZ.

    The angle is the Fourier series plus the smoothstep of phase times the series of changes.
    """

    START_S = 0
    RATE_HZ = 1  # 1 / duration
    LINEAR = 2
    CUBIC = 3
    QUARTIC = 4
    QUINTIC = 5
    COSINES = 6
    SINES = 6 + HARMONICS
    COSINE_CHANGES = 6 + 2 * HARMONICS
    SINE_CHANGES = 6 + 3 * HARMONICS


class Noise(IntEnum):
    """Columns of a block of standard normal numbers, a row a sample."""

    TORQUE_ERROR = 0
    VOLUNTARY = 1
    WHITE = 2
    COLOURED = 3
    DRIFT = 4


class Fault(IntEnum):
    """Fault bits of the simulated actuator."""

    OVER_TEMPERATURE = 1
    OVER_CURRENT = 2


INTEGRATED = 9
STATE_SIZE = int(State.WORK) + 5 * INTEGRATED + CURVES + 12
GAIT_SIZE = 6 + 4 * HARMONICS


def describe(params: np.ndarray) -> dict[str, float]:
    """Return the constants of a plant by name; that of a spring only where there is one."""
    added = params[Param.ADDED_STIFFNESS] > 0.0
    places = (place for place in Param if added or place is not Param.ADDED_STIFFNESS)
    return {place.name.lower(): float(params[place]) for place in places}
