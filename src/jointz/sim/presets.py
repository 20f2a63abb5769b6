"""How well simulated people walk and simulated instruments measure: the presets.

Everything random is a standard deviation unless it is called a range; angles
are in rad, times in s, torques in N*m. What one wearer gets is drawn from
these by :mod:`jointz.sim.people`.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from math import radians
from types import MappingProxyType
from typing import Literal

from jointz.core.errors import DataError

Range = tuple[float, float]


@dataclass(frozen=True, slots=True)
class GaitSettings:
    """How strides differ from each other.

    Parameters
    ----------
    duration_sd, duration_drift_sd : float
        Stride time, share of the mean: from stride to stride, and slowly.
    amplitude_sd : float
        Size of the knee curve, share.
    offset_sd_rad, offset_drift_sd_rad : float, rad
        Level of the knee curve: autoregressive from stride to stride, and slowly.
    shape_sd_rad : float, rad
        RMS over the cycle of a random change of shape.
    memory : float
        Correlation of amplitude and offset between neighbouring strides.
    drift_strides : float
        Strides after which a drift has forgotten 63 %.
    condition_offset_sd_rad, condition_amplitude_sd, condition_phase_sd : float
        Difference between two conditions: rad, share, cycles.
    contact_share : float
        Share of the stride with the foot on the ground.
    """

    duration_sd: float = 0.025
    duration_drift_sd: float = 0.01
    amplitude_sd: float = 0.03
    offset_sd_rad: float = radians(1.0)
    offset_drift_sd_rad: float = radians(1.5)
    shape_sd_rad: float = radians(0.8)
    memory: float = 0.5
    drift_strides: float = 150.0
    condition_offset_sd_rad: float = radians(1.5)
    condition_amplitude_sd: float = 0.02
    condition_phase_sd: float = 0.005
    contact_share: float = 0.62


@dataclass(frozen=True, slots=True)
class ReflexSettings:
    """A delayed reflex that resists flexion away from the path.

    Its torque is ``-gain * K(phase) * r``, where ``r`` is the positive part of
    the delayed deviation (or of ``velocity_time_s`` times its rate), filtered
    by a critically damped second-order twitch.

    Parameters
    ----------
    gain : float
        Share of the stiffness.
    latency_s, twitch_s : float, s
        Delay; time to the peak of the twitch.
    kind : {"velocity", "position"}
        What is fed back.
    velocity_time_s : float, s
        Turns velocity into an angle.
    """

    gain: float = 0.3
    latency_s: float = 0.045
    kind: Literal["velocity", "position"] = "velocity"
    twitch_s: float = 0.04
    velocity_time_s: float = 0.05

    def __post_init__(self) -> None:
        if not 0.03 <= self.latency_s <= 0.06:
            raise DataError(
                f"ReflexSettings: expected latency_s in 0.03..0.06 s, got {self.latency_s:g}."
            )


@dataclass(frozen=True, slots=True)
class JointSettings:
    """The joint beside its path.

    Parameters
    ----------
    inertia_variation : float
        Amplitude of one cosine over the cycle, share of the mean.
    smooth : bool
        K and B change smoothly all over the cycle, without plateaus.
    softening_rad : float, optional
        K halves at this deviation: K / (1 + (x / softening)^2).
    reflex : ReflexSettings, optional
        None: no reflex.
    voluntary_sd_nm, voluntary_time_s : float, N*m, s
        Muscle torque that nobody asked for, an Ornstein-Uhlenbeck process.
    """

    inertia_variation: float = 0.0
    smooth: bool = False
    softening_rad: float | None = None
    reflex: ReflexSettings | None = None
    voluntary_sd_nm: float = 0.0
    voluntary_time_s: float = 0.08


@dataclass(frozen=True, slots=True)
class ActuatorSettings:
    """A quasi-direct-drive actuator; nominal values of table 3.1, model 3.

    Parameters
    ----------
    gear_ratio, torque_constant, coulomb_friction, gear_friction, rotor_inertia : float
        Of equation 4.1: 1, N*m/A, N*m, N*m/A, kg*m^2, as the device states them.
    delay_s, time_constant_s : float, s
        From command to current.
    gain_error_sd, friction_error_sd : float
        Of torque per ampere and of both frictions, share.
    torque_error_sd_nm, torque_error_time_s : float, N*m, s
        Ornstein-Uhlenbeck error of the torque.
    sign_velocity_rad_s : float, rad/s
        Friction goes as tanh(velocity / this).
    current_max_a : float, A
        Where the driver saturates.
    angle_step_rad, velocity_step_rad_s, current_step_a : float
        Quanta of what is reported; 0 for none.
    supply_v, supply_ohm : float, V, ohm
        Battery.
    ambient_c, heating_c_a2, thermal_s : float
        Winding: ambient temperature, final rise per A^2, time constant.
    temperature_max_c : float, degrees Celsius
        Above it the device goes into fault.
    command_timeout_s : float, s
        Without a command for so long the device goes to zero current.
    """

    gear_ratio: float = 9.0
    torque_constant: float = 0.11
    coulomb_friction: float = 0.38
    gear_friction: float = 0.09
    rotor_inertia: float = 92e-4
    delay_s: float = 0.006
    time_constant_s: float = 0.012
    gain_error_sd: float = 0.02
    friction_error_sd: float = 0.1
    torque_error_sd_nm: float = 0.25
    torque_error_time_s: float = 0.25
    sign_velocity_rad_s: float = 0.05
    current_max_a: float = 30.0
    angle_step_rad: float = 6.283185307179586 / (9 * 16384)
    velocity_step_rad_s: float = 0.005
    current_step_a: float = 0.01
    supply_v: float = 48.0
    supply_ohm: float = 0.05
    ambient_c: float = 25.0
    heating_c_a2: float = 0.3
    thermal_s: float = 90.0
    temperature_max_c: float = 110.0
    command_timeout_s: float = 0.05


@dataclass(frozen=True, slots=True)
class GoniometerSettings:
    """An electrogoniometer on soft tissue.

    Parameters
    ----------
    delay_s : float, s
        Pure delay.
    lag_range_s : tuple of float, s
        Range of the total lag: the delay and a first order.
    tissue_range_hz : tuple of float, optional, Hz
        Resonance between joint and goniometer, before its lag; None: the tissue is rigid.
    tissue_damping : float
        Damping ratio of that resonance.
    gain_error_sd : float
        Share; also what a lab believes of its instrument.
    gain_error : float, optional
        The error that every wearer's instrument has, share; None: drawn.
    white_sd_rad, coloured_sd_rad, coloured_time_s : float, rad, rad, s
        Noise.
    drift_sd_rad, drift_time_s : float, rad, s
        Slow drift.
    torsion_rad_nm : float, rad/(N*m)
        Angle shown per torque on the joint.
    """

    delay_s: float = 0.002
    lag_range_s: Range = (0.004, 0.012)
    tissue_range_hz: Range | None = None
    tissue_damping: float = 0.3
    gain_error_sd: float = 0.02
    gain_error: float | None = None
    white_sd_rad: float = radians(0.3)
    coloured_sd_rad: float = radians(0.15)
    coloured_time_s: float = 0.1
    drift_sd_rad: float = 0.0
    drift_time_s: float = 300.0
    torsion_rad_nm: float = 0.0

    def __post_init__(self) -> None:
        low, high = self.lag_range_s
        if not 0.0 <= self.delay_s <= low <= high:
            raise DataError(
                "GoniometerSettings: expected 0 <= delay_s <= lag_range_s, the total lag from low "
                f"to high, got {self.delay_s:g} s and {low:g}..{high:g} s."
            )
        if self.tissue_range_hz is None:
            return
        low, high = self.tissue_range_hz
        if not (0.0 < low <= high and self.tissue_damping >= 0.0):
            raise DataError(
                "GoniometerSettings: expected 0 < tissue_range_hz from low to high and "
                f"tissue_damping >= 0, got {low:g}..{high:g} Hz and {self.tissue_damping:g}."
            )


@dataclass(frozen=True, slots=True)
class FootswitchSettings:
    """A switch under the heel.

    Parameters
    ----------
    jitter_sd_s : float, s
        Of the moment of contact.
    bounce_s : float, s
        How long it chatters after closing; 0 for none.
    missed, false : float
        Probability, a stride, of a contact that does not show and of a short one in swing.
    """

    jitter_sd_s: float = 0.005
    bounce_s: float = 0.004
    missed: float = 0.001
    false: float = 0.001


@dataclass(frozen=True, slots=True)
class BodySettings:
    """Leg, exoskeleton frame and strap as bodies of their own.

    Parameters
    ----------
    strap_range_nm_rad : tuple of float, N*m/rad
        Stiffness between frame and leg.
    strap_damping_time_s : float, s
        Strap damping over strap stiffness.
    frame_mass_kg, frame_distance_m : float, kg, m
        What hangs on the shank, and how far below the knee its centre is.
    """

    strap_range_nm_rad: Range = (300.0, 1000.0)
    strap_damping_time_s: float = 0.005
    frame_mass_kg: float = 1.0
    frame_distance_m: float = 0.18


@dataclass(frozen=True, slots=True)
class Preset:
    """Everything that makes a simulated rig as good or bad as it is.

    Parameters
    ----------
    name : str
        Of the preset.
    gait, joint, actuator, goniometer, footswitch : settings
        Of the parts.
    body : BodySettings, optional
        None: the strap is rigid and the inertia is the person's printed one.
    """

    name: str
    gait: GaitSettings = field(default_factory=GaitSettings)
    joint: JointSettings = field(default_factory=JointSettings)
    actuator: ActuatorSettings = field(default_factory=ActuatorSettings)
    goniometer: GoniometerSettings = field(default_factory=GoniometerSettings)
    footswitch: FootswitchSettings = field(default_factory=FootswitchSettings)
    body: BodySettings | None = None


_NOMINAL = Preset("nominal")

_CLEAN = Preset(
    "clean",
    gait=GaitSettings(
        duration_sd=0.0,
        duration_drift_sd=0.0,
        amplitude_sd=0.0,
        offset_sd_rad=0.0,
        offset_drift_sd_rad=0.0,
        shape_sd_rad=0.0,
        condition_offset_sd_rad=0.0,
        condition_amplitude_sd=0.0,
        condition_phase_sd=0.0,
    ),
    actuator=ActuatorSettings(
        gain_error_sd=0.0,
        friction_error_sd=0.0,
        torque_error_sd_nm=0.0,
        # As near to the sign of equation 4.1 as the steps of the physics stay exact to 1e-6 rad.
        sign_velocity_rad_s=0.02,
        angle_step_rad=0.0,
        velocity_step_rad_s=0.0,
        current_step_a=0.0,
    ),
    goniometer=GoniometerSettings(
        delay_s=0.0,
        lag_range_s=(0.0, 0.0),
        gain_error_sd=0.0,
        white_sd_rad=0.0,
        coloured_sd_rad=0.0,
    ),
    footswitch=FootswitchSettings(jitter_sd_s=0.0, bounce_s=0.0, missed=0.0, false=0.0),
)

_HARD = Preset(
    "hard",
    gait=GaitSettings(
        duration_sd=0.0375,
        duration_drift_sd=0.015,
        amplitude_sd=0.045,
        offset_sd_rad=radians(1.5),
        offset_drift_sd_rad=radians(2.25),
        shape_sd_rad=radians(1.2),
        condition_offset_sd_rad=radians(4.0),
        condition_phase_sd=0.02,
    ),
    joint=JointSettings(inertia_variation=0.15),
    actuator=ActuatorSettings(friction_error_sd=0.3, torque_error_sd_nm=0.35),
    goniometer=GoniometerSettings(
        lag_range_s=(0.015, 0.025),
        gain_error_sd=0.03,
        white_sd_rad=radians(0.5),
        torsion_rad_nm=radians(0.5) / 17.0,
    ),
    footswitch=FootswitchSettings(jitter_sd_s=0.01, missed=0.005, false=0.005),
)

_ANTHROPOMETRIC = replace(
    _NOMINAL,
    name="anthropometric",
    goniometer=GoniometerSettings(tissue_range_hz=(20.0, 40.0)),
    body=BodySettings(),
)

#: Name -> preset.
PRESETS: Mapping[str, Preset] = MappingProxyType(
    {
        "clean": _CLEAN,
        "nominal": _NOMINAL,
        "hard": _HARD,
        "anthropometric": _ANTHROPOMETRIC,
    }
)


def preset(name: str) -> Preset:
    """Return the preset with this name.

    Parameters
    ----------
    name : str
        One of ``clean``, ``nominal``, ``hard``, ``anthropometric``.

    Raises
    ------
    DataError
        When there is none.

    Examples
    --------
    >>> preset("nominal").goniometer.delay_s
    0.002
    """
    if name not in PRESETS:
        raise DataError(f"preset: expected one of {', '.join(PRESETS)}; got {name!r}.")
    return PRESETS[name]
