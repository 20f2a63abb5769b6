r"""The series-elastic exoskeleton on its bench (2.2.1): its parts and how well it measures.

Motor, 2:1 belt and ball screw move a nut along a line beside the joint; a two-force member of
length :math:`l` joins it to the tip of a cantilever beam that is fixed to the output. In the
frame of the beam (x along it, the joint at the origin) the tip stands at :math:`(L, h + \delta)`,
the nut at :math:`(p_1, p_2)`, so that

.. math:: \delta = p_2 - \sqrt{l^2 - (L - p_1)^2} - h

is the beam's deflection, exact for any angle, and the torque on the output
:math:`-(k\delta + k_3\delta^3)\,\partial\delta/\partial\theta`: transmission and torsional
stiffness both go with the angle. The physics is in :mod:`jointz.rig.sim.benches.sea_plant`.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from math import pi

import numpy as np

from jointz.core.errors import DataError
from jointz.rig.sim.presets import named_preset

_LONGEST_LAG_S = 0.02


@dataclass(frozen=True, slots=True)
class SeaMachine:
    """The machine; what is not of 2.2.1 and 2.3.1 or a catalogue is assumed, see the docs."""

    torque_constant: float = 0.0276  # N*m/A, of the motor
    resistance_ohm: float = 0.386
    rotor_inertia: float = 4.5e-6  # kg*m^2, with pulleys and screw, at the rotor
    supply_v: float = 15.5  # supply of the drive
    current_max_a: float = 13.0  # limit of the drive
    drive_friction_nm: float = 0.004  # Coulomb friction of motor, belt and screw, at the rotor
    drive_damping: float = 2e-6  # N*m*s/rad, at the rotor
    # velocity over which the sign of the friction changes smoothly
    drive_velocity_rad_s: float = 2.0
    belt_ratio: float = 2.0  # turns of the motor per turn of the screw
    screw_lead_m: float = 0.0025  # travel of the nut per turn of the screw
    beam_stiffness: float = 274e3  # N/m, stiffness of the beam's tip against transverse motion
    lever_m: float = 0.05  # L
    bracket_m: float = 0.01  # h
    member_m: float = 0.1  # l; at the angle 0 the two-force member is perpendicular to the beam
    stiffness: float = 0.388  # intrinsic stiffness between beam and load, N*m/rad
    damping: float = 0.163  # intrinsic damping between beam and load, N*m*s/rad
    inertia: float = 0.001  # intrinsic inertia between beam and load, kg*m^2
    stop_rad: float = 0.6  # angle of the end stops of the output
    stop_stiffness: float = 3000.0  # N*m/rad
    stop_damping: float = 2.0  # N*m*s/rad
    ambient_c: float = 25.0
    heating_c_a2: float = 0.3  # final rise of the winding's temperature per A^2
    thermal_s: float = 30.0  # time constant of the winding
    temperature_max_c: float = 120.0  # winding temperature above which the device faults

    @property
    def nut_travel_m(self) -> float:
        """Travel of the nut per radian of the rotor, m."""
        return self.screw_lead_m / (2.0 * pi * self.belt_ratio)


@dataclass(frozen=True, slots=True)
class SeaControl:
    """The device's own loop, once a sample: torque for the motor, counted at the output.

    In torque control ``u = w + torque_gain (w - t) - torque_rate_gain_s dt/dt`` for a wanted
    torque w and the measured one t; in position control
    ``u = position_gain (w - q) - position_rate_gain dq/dt`` for the angle q of the motor,
    through the transmission.
    """

    torque_gain: float = 9.0  # gain on the error of the torque
    torque_rate_gain_s: float = 0.06  # gain on the rate of the torque
    position_gain: float = 1000.0  # N*m/rad, gain on the error of the angle
    position_rate_gain: float = 25.0  # N*m*s/rad, gain on the rate of the angle


@dataclass(frozen=True, slots=True)
class SeaErrors:
    """Errors of the bench's record; none by default."""

    torque_lag_s: float = 0.0  # lag of the recorded torque behind the recorded angle
    torque_filter_hz: float = 0.0  # corner of a first-order low-pass of the torque; 0: none
    clock_stretch: float = 1.0  # true sample period over the nominal one
    clock_jitter_s: float = 0.0  # SD of the sample times about their grid
    true_stamps: bool = True  # whether the recorded times are the true ones, not the nominal grid
    coulomb_friction_nm: float = 0.0  # Coulomb friction of the bearing that carries a load
    # velocity over which the sign of that friction changes smoothly
    friction_velocity_rad_s: float = 0.02
    beam_error: float = 0.0  # assumed over true stiffness of the beam, minus 1
    # ``k3 / k``: relative excess of the beam's stiffness per squared deflection
    beam_cubic_per_m2: float = 0.0
    # relative SD of the torque's calibration; drawn by :func:`draw_torque_gain`
    torque_gain_sd: float = 0.0
    torque_noise_nm: float = 0.0  # SD of white noise in the recorded torque
    angle_noise_rad: float = 0.0  # SD of white noise in the recorded angle
    linear_step_m: float = 0.0  # resolution of the encoder before the beam; 0: none
    rotary_step_rad: float = 0.0  # resolution of the encoder after the beam; 0: none

    def __post_init__(self) -> None:
        if not 0.0 <= self.torque_lag_s <= _LONGEST_LAG_S:
            raise DataError(
                f"SeaErrors: expected torque_lag_s in 0..{_LONGEST_LAG_S:g} s, "
                f"got {self.torque_lag_s:g}."
            )
        if not 0.5 <= self.clock_stretch <= 1.5:
            raise DataError(
                f"SeaErrors: expected clock_stretch in 0.5..1.5, got {self.clock_stretch:g}."
            )


@dataclass(frozen=True, slots=True)
class SeaSettings:
    """A series-elastic bench."""

    name: str  # name of the preset
    machine: SeaMachine = field(default_factory=SeaMachine)
    control: SeaControl = field(default_factory=SeaControl)
    errors: SeaErrors = field(default_factory=SeaErrors)
    # measured over true torque by the calibration alone, without the beam's error
    torque_gain: float = 1.0

    @property
    def total_torque_gain(self) -> float:
        """Measured torque over the true one, of a linear beam."""
        return self.torque_gain * (1.0 + self.errors.beam_error)


_NOMINAL_ERRORS = SeaErrors(
    torque_lag_s=2.0 / 900.0,
    clock_jitter_s=1e-4,
    coulomb_friction_nm=0.03,
    beam_error=-0.02,
    torque_gain_sd=0.01,
    torque_noise_nm=0.02,
    angle_noise_rad=1e-5,
    linear_step_m=1e-7,
    rotary_step_rad=5e-6,
)
_HARD_ERRORS = replace(
    _NOMINAL_ERRORS,
    torque_lag_s=3.0 / 900.0,
    torque_filter_hz=100.0,
    clock_stretch=1.05,
    clock_jitter_s=3e-4,
    true_stamps=False,
    coulomb_friction_nm=0.1,
    beam_error=-0.05,
    beam_cubic_per_m2=2400.0,
    torque_gain_sd=0.02,
    torque_noise_nm=0.1,
    angle_noise_rad=5e-5,
)

#: Name -> preset.
SEA_PRESETS: Mapping[str, SeaSettings] = {
    "clean": SeaSettings("clean"),
    "nominal": SeaSettings("nominal", errors=_NOMINAL_ERRORS),
    "hard": SeaSettings("hard", errors=_HARD_ERRORS),
}


def sea_preset(name: str) -> SeaSettings:
    """Return the preset with this name."""
    return named_preset(SEA_PRESETS, name, what="series-elastic bench")


def draw_torque_gain(settings: SeaSettings, rng: np.random.Generator) -> SeaSettings:
    """Return the settings of one bench, its torque calibrated with its error."""
    error = settings.errors.torque_gain_sd * rng.standard_normal()
    return replace(settings, torque_gain=1.0 + float(error))
