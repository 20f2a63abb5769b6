"""Presets of simulated people and instruments.

Everything random is a standard deviation unless it is called a range; angles
are in rad, times in s, torques in N*m. What one wearer gets is drawn from
these by :mod:`jointz.rig.sim.people`.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from math import radians
from typing import Literal, TypeVar

from jointz.core.errors import DataError
from jointz.rig.sim.sensors.sensor_settings import EncoderSettings, GyroscopeSettings, Range

PresetT = TypeVar("PresetT")


@dataclass(frozen=True, slots=True)
class GaitSettings:
    """Variation between strides."""

    duration_sd: float = 0.025  # stride time from stride to stride, share of the mean
    duration_drift_sd: float = 0.01  # slow drift of the stride time, share of the mean
    amplitude_sd: float = 0.03  # size of the knee curve from stride to stride, share
    # rad: offset of the knee curve from stride to stride, autoregressive
    offset_sd_rad: float = radians(1.0)
    offset_drift_sd_rad: float = radians(1.5)  # rad: slow drift of the offset of the knee curve
    shape_sd_rad: float = radians(0.8)  # rad: RMS over the cycle of the random change of shape
    shape_harmonics: int = 3  # harmonics of the stride that change at random, 1 to 6
    memory: float = 0.5  # correlation of amplitude and offset between neighbouring strides
    drift_strides: float = 150.0  # strides after which a drift has lost 63 % of its memory
    condition_offset_sd_rad: float = radians(1.5)  # rad: offset between two conditions
    condition_amplitude_sd: float = 0.02  # size of the knee curve between two conditions, share
    condition_phase_sd: float = 0.005  # phase between two conditions, cycles
    contact_share: float = 0.62  # share of the stride with the foot on the ground


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
        if not 0.025 <= self.latency_s <= 0.07:
            raise DataError(
                f"ReflexSettings: expected latency_s in 0.025..0.07 s, got {self.latency_s:g}."
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
    stiffness_change, damping_change : float, optional
        Largest median over the cycle of the relative change of K and B per 100 ms, if smooth.
        None: as large as the values at the timing points make it.
    softening_rad : float, optional
        K halves at this deviation: K / (1 + (x / softening)^2).
    reflex : ReflexSettings, optional
        None: no reflex.
    voluntary_sd_nm, voluntary_time_s : float, N*m, s
        Muscle torque that nobody asked for, an Ornstein-Uhlenbeck process.
    """

    inertia_variation: float = 0.0
    smooth: bool = False
    stiffness_change: float | None = None
    damping_change: float | None = None
    softening_rad: float | None = None
    reflex: ReflexSettings | None = None
    voluntary_sd_nm: float = 0.0
    voluntary_time_s: float = 0.08


@dataclass(frozen=True, slots=True)
class ActuatorSettings:
    """A quasi-direct-drive actuator; nominal values of table 3.1, model 3."""

    gear_ratio: float = 9.0  # of equation 4.1, as stated by the device
    torque_constant: float = 0.11  # N*m/A, stated by the device
    coulomb_friction: float = 0.38  # N*m, stated by the device
    gear_friction: float = 0.09  # N*m/A, stated by the device
    rotor_inertia: float = 92e-4  # kg*m^2, at the output
    delay_s: float = 0.006  # delay of the current behind the command
    time_constant_s: float = 0.012  # time constant of the current
    gain_error_sd: float = 0.02  # torque per ampere, share
    friction_error_sd: float = 0.1  # both frictions, share
    torque_error_sd_nm: float = 0.25  # sd of an Ornstein-Uhlenbeck error of the torque
    torque_error_time_s: float = 0.25  # correlation time of that error
    sign_velocity_rad_s: float = 0.05  # velocity scale v of the friction's sign, tanh(velocity / v)
    current_max_a: float = 30.0  # limit of the driver
    # resolution of the reported angle; 0: none
    angle_step_rad: float = 6.283185307179586 / (9 * 16384)
    velocity_step_rad_s: float = 0.005  # resolution of the reported velocity; 0: none
    current_step_a: float = 0.01  # resolution of the reported current; 0: none
    supply_v: float = 48.0  # voltage of the battery
    supply_ohm: float = 0.05  # resistance of the battery
    ambient_c: float = 25.0  # ambient temperature
    heating_c_a2: float = 0.3  # final rise of the winding's temperature per A^2
    thermal_s: float = 90.0  # time constant of the winding's temperature
    temperature_max_c: float = 110.0  # winding temperature above which the device faults
    command_timeout_s: float = 0.05  # time without a command after which the current is zero


@dataclass(frozen=True, slots=True)
class GoniometerSettings:
    """An electrogoniometer on soft tissue."""

    delay_s: float = 0.002  # s: pure delay
    # s: range of the total lag, pure delay plus first-order lag
    lag_range_s: Range = (0.004, 0.012)
    # Hz: range of the resonance between joint and goniometer; None: rigid tissue
    tissue_range_hz: Range | None = None
    tissue_damping: float = 0.3  # damping ratio of that resonance
    gain_error_sd: float = 0.02  # relative sd of the gain, also as known to the lab
    # relative error of the gain of every wearer's instrument; None: drawn
    gain_error: float | None = None
    white_sd_rad: float = radians(0.3)  # white noise
    coloured_sd_rad: float = radians(0.15)  # coloured noise
    coloured_time_s: float = 0.1  # correlation time of the coloured noise
    drift_sd_rad: float = 0.0  # slow drift
    drift_time_s: float = 300.0  # correlation time of the drift
    torsion_rad_nm: float = 0.0  # rad/(N*m): angle shown per torque on the joint

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
    """A switch under the heel."""

    jitter_sd_s: float = 0.005  # s: jitter of the moment of contact
    bounce_s: float = 0.004  # s: duration of chatter after closing; 0: none
    missed: float = 0.001  # probability per stride of a contact that is not shown
    false: float = 0.001  # probability per stride of a short false contact in swing


@dataclass(frozen=True, slots=True)
class MomentSettings:
    """The internal moment of the joint by inverse dynamics."""

    gain_error_sd: float = 0.0  # relative sd of the gain over people
    noise_sd_nm: float = 1.0  # N*m: white noise

    def __post_init__(self) -> None:
        if not (self.gain_error_sd >= 0.0 and self.noise_sd_nm >= 0.0):
            raise DataError(
                "MomentSettings: expected gain_error_sd >= 0 and noise_sd_nm >= 0, got "
                f"{self.gain_error_sd:g} and {self.noise_sd_nm:g} N*m."
            )


@dataclass(frozen=True, slots=True)
class BodySettings:
    """Leg, exoskeleton frame and strap as bodies of their own."""

    strap_range_nm_rad: Range = (300.0, 1000.0)  # N*m/rad: stiffness between frame and leg
    strap_damping_time_s: float = 0.005  # s: strap damping over strap stiffness
    frame_mass_kg: float = 1.0  # mass of the frame on the shank
    frame_distance_m: float = 0.18  # distance of the frame's centre below the knee
    # proportions of the leg: ``winter`` (average body) or ``de_leva`` (female and male bodies)
    segments: Literal["winter", "de_leva"] = "winter"
    chain: bool = False  # dJ/dt times velocity, and the stiffness that a moving leg has by inertia


@dataclass(frozen=True, slots=True)
class PersonalSettings:
    """Ranges from which every person's own settings are drawn, uniformly unless stated.

    :func:`jointz.rig.sim.people.personal_preset` replaces the settings of the preset with them.
    """

    softening_range_rad: Range = (radians(12.0), radians(40.0))  # log-uniform
    # relative change of K and of B per 100 ms, median over the cycle; drawn each on its own
    change_range: Range = (0.1, 0.3)
    # rad: RMS over the cycle of the random change of shape of a stride; log-uniform
    shape_sd_range_rad: Range = (radians(0.5), radians(1.4))
    reflex_gain_range: Range = (0.0, 0.6)
    reflex_latency_range_s: Range = (0.025, 0.070)
    reflex_twitch_range_s: Range = (0.020, 0.060)
    # Hz and damping ratio: resonance of the soft tissue under the goniometer
    tissue_range_hz: Range = (10.0, 40.0)
    tissue_damping_range: Range = (0.1, 0.6)
    # Hz and damping ratio: resonance of frame and rotor on the strap, the leg held still
    strap_range_hz: Range = (10.0, 40.0)
    strap_damping_range: Range = (0.1, 0.6)


@dataclass(frozen=True, slots=True)
class Preset:
    """Settings of a simulated person and rig.

    Parameters
    ----------
    name : str
        Name of the preset.
    gait, joint, actuator, goniometer, footswitch, moment : settings
        Strides; impedance and reflex; motor and its torque model; the two sensors; the measured
        internal moment.
    body : BodySettings, optional
        Segments and strap; without them the strap is rigid, and the inertia that of the printed
        table.
    personal : PersonalSettings, optional
        Ranges of settings that differ between people; without them all people share the settings
        above.
    encoder, gyroscopes : settings, optional
        Sensors of the knee's motion beside the goniometer; none without them.
    """

    name: str
    gait: GaitSettings = field(default_factory=GaitSettings)
    joint: JointSettings = field(default_factory=JointSettings)
    actuator: ActuatorSettings = field(default_factory=ActuatorSettings)
    goniometer: GoniometerSettings = field(default_factory=GoniometerSettings)
    footswitch: FootswitchSettings = field(default_factory=FootswitchSettings)
    moment: MomentSettings = field(default_factory=MomentSettings)
    body: BodySettings | None = None
    personal: PersonalSettings | None = None
    encoder: EncoderSettings | None = None
    gyroscopes: GyroscopeSettings | None = None


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
    moment=MomentSettings(noise_sd_nm=0.0),
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
    moment=MomentSettings(noise_sd_nm=2.0),
)

_ANTHROPOMETRIC = replace(
    _NOMINAL,
    name="anthropometric",
    goniometer=GoniometerSettings(tissue_range_hz=(20.0, 40.0)),
    body=BodySettings(),
)

_REALISTIC = replace(
    _NOMINAL,
    name="realistic",
    gait=GaitSettings(shape_harmonics=6),
    joint=JointSettings(smooth=True),
    goniometer=GoniometerSettings(tissue_range_hz=(10.0, 40.0)),
    body=BodySettings(segments="de_leva", chain=True),
    personal=PersonalSettings(),
    encoder=EncoderSettings(),
    gyroscopes=GyroscopeSettings(),
)

#: Name -> preset.
PRESETS: Mapping[str, Preset] = {
    "clean": _CLEAN,
    "nominal": _NOMINAL,
    "hard": _HARD,
    "anthropometric": _ANTHROPOMETRIC,
    "realistic": _REALISTIC,
}


def preset(name: str) -> Preset:
    """Return the preset with this name.

    Parameters
    ----------
    name : str
        One of ``clean``, ``nominal``, ``hard``, ``anthropometric``, ``realistic``.

    Raises
    ------
    DataError
        When there is none.

    Examples
    --------
    >>> preset("nominal").goniometer.delay_s
    0.002
    """
    return named_preset(PRESETS, name, what="preset")


def named_preset(presets: Mapping[str, PresetT], name: str, *, what: str) -> PresetT:
    """Return one of several presets; ``what`` they are of stands in the error."""
    if name not in presets:
        raise DataError(f"{what}: expected one of {', '.join(presets)}; got {name!r}.")
    return presets[name]
