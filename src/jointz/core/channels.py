"""Channels a recording may hold, their SI units, and the directions of joints."""

from collections.abc import Mapping
from types import MappingProxyType

#: Channel -> SI units it may have; the first stands where a study gives none.
CHANNEL_UNITS: Mapping[str, tuple[str, ...]] = MappingProxyType(
    {
        "time": ("s",),
        "angle": ("rad",),
        "velocity": ("rad/s",),
        "torque": ("N*m",),
        "command": ("N*m",),
        "reference": ("rad", "N*m"),
        "current": ("A",),
        "motor_angle": ("rad",),
        "motor_velocity": ("rad/s",),
        "motor_acceleration": ("rad/s^2",),
        "sensor_torque": ("N*m",),
        "joint_moment": ("N*m",),
        "joint_encoder": ("rad",),
        "shank_velocity": ("rad/s",),
        "thigh_velocity": ("rad/s",),
        "ground_reaction_force": ("N",),
    }
)

#: Columns of a table of the pulses that an experiment or a simulation of one made.
PULSE_COLUMNS = (
    "pulse",
    "onset_s",
    "duration_s",
    "amplitude_nm",
    "timing_point",
    "shape",
    "completed",
)

#: Column of a single record -> unit; an acceleration and those of a mean stride are no channels of
#: a study.
RECORD_UNITS: Mapping[str, str] = MappingProxyType(
    {
        **{n: units[0] for n, units in CHANNEL_UNITS.items()},
        "acceleration": "rad/s^2",
        "torque_per_mass": "N*m/kg",
        "gait_pct": "%",
    }
)

#: Columns of a single record whose unit does not matter: a level, or a sign.
UNITLESS_RECORD_COLUMNS = ("contact", "direction")

#: Channels that hold labels or switch states, not quantities with a unit.
LABEL_CHANNELS = ("condition", "trial", "cycle")

#: Channels of levels, which hold until their next sample.
LEVEL_CHANNELS = ("contact", "command", "trigger")

#: Channel of event times, no samples; in a recording it counts the heel strikes so far.
HEEL_STRIKES = "heel_strikes"

#: Channels whose sign turns with ``torque_acts_on = "device"``.
DEVICE_SIDE_CHANNELS = ("torque", "sensor_torque")

#: Channels of the motor: they turn together with the current's direction.
MOTOR_CHANNELS = ("motor_angle", "motor_velocity", "motor_acceleration")

#: Other measurements of the joint's motion: by the device, and by gyroscopes on both segments,
#: whose difference is the joint's velocity.
MOTION_SENSORS = ("joint_encoder", "shank_velocity", "thigh_velocity")

#: Opposite directions of joint rotation.
OPPOSITE_DIRECTION: Mapping[str, str] = MappingProxyType(
    {
        a: b
        for pair in (
            ("flexion", "extension"),
            ("dorsiflexion", "plantarflexion"),
            ("abduction", "adduction"),
            ("inversion", "eversion"),
            ("internal_rotation", "external_rotation"),
            ("pronation", "supination"),
            ("radial_deviation", "ulnar_deviation"),
        )
        for a, b in (pair, pair[::-1])
    }
)

#: Conditions of a recording and the names the dissertation gives them.
CONDITIONS: Mapping[str, str] = MappingProxyType(
    {
        "unperturbed": "unperturbed",
        "perturbed": "perturbed",
        "no_device": "no_device",
        "npc": "unperturbed",
        "e-npc": "unperturbed",
        "enp": "unperturbed",
        "apc": "perturbed",
        "e-apc": "perturbed",
        "ewp": "perturbed",
        "nwc": "no_device",
    }
)

#: Parameter -> (name in words, symbol), in the order of tables and figures.
PARAMETER_NAMES: Mapping[str, tuple[str, str]] = MappingProxyType(
    {
        "stiffness_per_mass": ("Stiffness per body mass", "K/m"),
        "stiffness": ("Stiffness", "K"),
        "damping_per_mass": ("Damping per body mass", "B/m"),
        "damping": ("Damping", "B"),
        "inertia": ("Inertia", "J"),
        "stiffness_onset": ("Stiffness at the onset", "K at the onset"),
        "damping_onset": ("Damping at the onset", "B at the onset"),
    }
)
#: Parameter -> unit, as written in ``estimates.csv`` and by ``jointz identify``.
PARAMETER_UNITS: Mapping[str, str] = MappingProxyType(
    {
        "stiffness": "N*m/rad",
        "damping": "N*m*s/rad",
        "inertia": "kg*m^2",
        "stiffness_per_mass": "N*m/rad/kg",
        "damping_per_mass": "N*m*s/rad/kg",
        "stiffness_onset": "N*m/rad",
        "damping_onset": "N*m*s/rad",
        "bias": "N*m",
        "torque_constant": "N*m/A",
        "viscous_friction": "N*m*s/rad",
        "coulomb_friction": "N*m",
        "gear_friction": "N*m/A",
        "load_friction": "1",
        "rotor_inertia": "kg*m^2",
        "torque_lag": "s",
        "angle_lag": "s",
        "joint_encoder_lag": "s",
        "joint_velocity_lag": "s",
        "shank_velocity_lag": "s",
        "friction_gain": "1",
        "stiffness_gravity_corrected": "N*m/rad",
        "reflex_gain": "N*m*s/rad",
        "reflex_delay": "s",
        "bandwidth": "Hz",
    }
)


def is_turned(stated: str | None, positive: str | None, *, on_device: bool) -> bool:
    """Tell whether the sign of a channel is opposite to the study's."""
    against = stated not in (None, positive)
    return against != on_device


def pretty_unit(unit: str) -> str:
    """Write a unit with dots and superscripts."""
    return unit.replace("*", "·").replace("^2", "²").replace("+-", "±")


def axis_label(parameter: str) -> str:
    """Return symbol and unit of a parameter, for axes and column heads."""
    return f"{PARAMETER_NAMES[parameter][1]} ({pretty_unit(PARAMETER_UNITS[parameter])})"
