"""Descriptions of the simulated devices that a participant wears."""

from jointz.core.channels import CHANNEL_UNITS
from jointz.core.limits import SafetyLimits
from jointz.core.study import TorqueModelSpec
from jointz.devices.interface import ActuatorDescription, SensorDescription
from jointz.sim.layout import Fault
from jointz.sim.plant_build import PlantBuild

#: What the simulated exoskeleton may be asked for and must not reach.
EXOSKELETON_LIMITS = SafetyLimits(
    torque_nm=25.0,
    torque_rate_nm_s=40000.0,
    current_a=30.0,
    angle_min_rad=-0.6,
    angle_max_rad=2.4,
    velocity_rad_s=25.0,
    temperature_c=90.0,
    sensor_age_s=0.02,
    pulse_count=2000,
    pulse_duty=0.3,
    consecutive_overruns=5,
    fade_s=0.05,
)


def exoskeleton(build: PlantBuild) -> ActuatorDescription:
    """Describe the exoskeleton's quasi-direct-drive actuator."""
    settings = build.preset.actuator
    return ActuatorDescription(
        name="actuator",
        model="jointz simulated quasi-direct drive",
        serial=build.person.id,
        firmware="1",
        sample_rate_hz=build.grid.sample_rate_hz,
        command_timeout_s=settings.command_timeout_s,
        limits=EXOSKELETON_LIMITS,
        torque_model=TorqueModelSpec(
            gear_ratio=settings.gear_ratio,
            torque_constant=settings.torque_constant,
            coulomb_friction=settings.coulomb_friction,
            gear_friction=settings.gear_friction,
            rotor_inertia=settings.rotor_inertia,
        ),
        fault_names={int(fault): fault.name.lower() for fault in Fault},
    )


def goniometer(build: PlantBuild) -> SensorDescription:
    """Describe the electrogoniometer across the knee."""
    return SensorDescription(
        name="goniometer",
        model="jointz simulated electrogoniometer",
        serial=build.person.id,
        channel="angle",
        unit="rad",
        sample_rate_hz=build.grid.sample_rate_hz,
    )


def motion_sensor(build: PlantBuild, channel: str) -> SensorDescription:
    """Describe the device's encoder, or the gyroscope on shank or thigh."""
    encoder = channel == "joint_encoder"
    return SensorDescription(
        name="joint encoder" if encoder else f"{channel.partition('_')[0]} gyroscope",
        model=f"jointz simulated {'encoder' if encoder else 'gyroscope'}",
        serial=build.person.id,
        channel=channel,
        unit=CHANNEL_UNITS[channel][0],
        sample_rate_hz=build.grid.sample_rate_hz,
    )


def inverse_dynamics(build: PlantBuild) -> SensorDescription:
    """Describe the motion capture and force plates that give the knee's internal moment."""
    return SensorDescription(
        name="inverse dynamics",
        model="jointz simulated motion capture",
        serial=build.person.id,
        channel="joint_moment",
        unit="N*m",
        sample_rate_hz=build.grid.sample_rate_hz,
    )


def footswitch(build: PlantBuild) -> SensorDescription:
    """Describe the switch under the heel."""
    return SensorDescription(
        name="footswitch",
        model="jointz simulated heel switch",
        serial=build.person.id,
        channel="contact",
        unit="1",
        sample_rate_hz=build.grid.sample_rate_hz,
        kind="contact",
    )
