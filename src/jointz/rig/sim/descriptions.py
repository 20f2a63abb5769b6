"""Descriptions of the simulated devices."""

from jointz.core.channels import CHANNEL_UNITS
from jointz.core.limits import SafetyLimits
from jointz.core.study import TorqueModelSpec
from jointz.rig.devices.interface import ActuatorDescription, SensorDescription
from jointz.rig.sim.benches.qdd_bench import QddMachine
from jointz.rig.sim.presets import ActuatorSettings
from jointz.rig.sim.walking.layout import Fault
from jointz.rig.sim.walking.plant_build import PlantBuild

#: Limits of the simulated exoskeleton.
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
        torque_model=torque_model_of(settings),
        fault_names={int(fault): fault.name.lower() for fault in Fault},
    )


def torque_model_of(motor: ActuatorSettings | QddMachine) -> TorqueModelSpec:
    """Return the torque model that is stated of a quasi-direct drive."""
    return TorqueModelSpec(
        gear_ratio=motor.gear_ratio,
        torque_constant=motor.torque_constant,
        coulomb_friction=motor.coulomb_friction,
        gear_friction=motor.gear_friction,
        rotor_inertia=motor.rotor_inertia,
    )


def goniometer(build: PlantBuild) -> SensorDescription:
    """Describe the electrogoniometer across the knee."""
    return _sensor(build, "goniometer", "electrogoniometer", channel="angle", unit="rad")


def motion_sensor(build: PlantBuild, channel: str) -> SensorDescription:
    """Describe the device's encoder, or the gyroscope on shank or thigh."""
    encoder = channel == "joint_encoder"
    name = "joint encoder" if encoder else f"{channel.partition('_')[0]} gyroscope"
    model = "encoder" if encoder else "gyroscope"
    return _sensor(build, name, model, channel=channel, unit=CHANNEL_UNITS[channel][0])


def inverse_dynamics(build: PlantBuild) -> SensorDescription:
    """Describe the motion capture and force plates that give the knee's internal moment."""
    return _sensor(build, "inverse dynamics", "motion capture", channel="joint_moment", unit="N*m")


def footswitch(build: PlantBuild) -> SensorDescription:
    """Describe the switch under the heel."""
    return _sensor(build, "footswitch", "heel switch", channel="contact", unit="1", kind="contact")


def _sensor(
    build: PlantBuild, name: str, model: str, *, channel: str, unit: str, kind: str = ""
) -> SensorDescription:
    return SensorDescription(
        name=name,
        model=f"jointz simulated {model}",
        serial=build.person.id,
        channel=channel,
        unit=unit,
        sample_rate_hz=build.grid.sample_rate_hz,
        kind=kind,
    )
