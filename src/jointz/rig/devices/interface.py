"""Interface of devices: small protocols that every driver implements.

A device walks through a lifecycle::

    UNCONFIGURED --configure--> INACTIVE --activate--> ACTIVE --stop--> INACTIVE
    any --close--> FINALISED          ACTIVE --(its own fault)--> FAULT

A driver of hardware, the simulated rig, a replay and a scripted fake are all
devices; :mod:`jointz.rig.testing` holds the tests that any of them can be run
against. SI units; angles and torques are positive in the study's direction and
torque is the torque on the joint, by the driver's care. Times are nanoseconds.
"""

from collections.abc import Mapping
from dataclasses import asdict, dataclass, replace
from enum import Enum
from typing import Any, NamedTuple, Protocol, runtime_checkable

from jointz.core.channels import MOTION_SENSORS
from jointz.core.clock import Clock
from jointz.core.limits import SafetyLimits
from jointz.core.study import CalibrationSpec, DeviceSpec, TorqueModelSpec


class Lifecycle(Enum):
    """States of a device in its lifecycle."""

    UNCONFIGURED = "unconfigured"
    INACTIVE = "inactive"
    ACTIVE = "active"
    FAULT = "fault"
    FINALISED = "finalised"


class ActuatorSample(NamedTuple):
    """One sample of an actuator."""

    device_time_ns: int  # time of the measurement, by the device's clock
    host_time_ns: int  # time of arrival, by the host's clock
    angle: float  # rad, of the output, after the gear
    velocity: float  # rad/s, of the output
    current: float  # A, current of the motor (q axis)
    voltage: float  # V, supply voltage
    temperature_c: float  # temperature of the winding, or the nearest measured one
    faults: int  # fault bits set by the device; 0 for none


class SensorSample(NamedTuple):
    """One sample of a sensor."""

    device_time_ns: int  # time of the measurement, by the device's clock
    host_time_ns: int  # time of arrival, by the host's clock
    value: float  # in the unit of the sensor's description


@dataclass(frozen=True, slots=True)
class ActuatorDescription:
    """Description of an actuator."""

    name: str  # name of the device
    model: str
    serial: str
    firmware: str
    sample_rate_hz: float  # samples queued per second
    command_timeout_s: float  # time without a command after which the torque goes to zero
    limits: SafetyLimits  # limits on commands and measurements; a protocol can only tighten them
    # torque on the joint from current, velocity and acceleration (equation 4.1), as calibrated
    torque_model: TorqueModelSpec
    fault_names: Mapping[int, str]  # value of the fault bit (1, 2, 4, ...) -> name of the fault

    def to_dict(self) -> dict[str, Any]:
        """Return the description as plain values."""
        return {
            **asdict(replace(self, fault_names={})),
            "limits": self.limits.model_dump(),
            "torque_model": self.torque_model.model_dump(),
            "fault_names": {str(bit): name for bit, name in self.fault_names.items()},
        }


@dataclass(frozen=True, slots=True)
class SensorDescription:
    """Description of a sensor."""

    name: str  # name of the device
    model: str
    serial: str
    channel: str  # measured canonical channel: ``angle``, ``contact``, ...
    unit: str  # SI unit of its samples; of a contact ``V`` for the kind ``voltage``, else ``1``
    sample_rate_hz: float  # samples queued per second
    # kind of a contact: ``contact`` (0 or 1), ``voltage`` or ``pulse``; "" for other channels
    kind: str = ""

    def to_dict(self) -> dict[str, Any]:
        """Return the description as plain values."""
        return asdict(self)


@runtime_checkable
class Device(Protocol):
    """The lifecycle that all devices share."""

    @property
    def state(self) -> Lifecycle:
        """State of the device in its lifecycle."""

    def configure(self) -> None:
        """Connect and set up; afterwards ``INACTIVE``."""

    def activate(self) -> None:
        """Begin to sample and, for an actuator, to obey; afterwards ``ACTIVE``."""

    def stop(self) -> None:
        """Go to zero torque and ``INACTIVE``, whatever the state; never raises.

        It waits up to 40 ms for a library that hangs. A device in ``FAULT`` or ``FINALISED``
        stays there. A driver that can tell whether the device took the stop has a property
        ``stop_confirmed``; where that is False afterwards, the session ends with "could not be
        stopped".
        """

    def close(self) -> None:
        """Stop and let go; afterwards ``FINALISED``. May be called twice; never raises."""


@runtime_checkable
class Actuator(Device, Protocol):
    """A device that puts torque on the joint."""

    def describe(self) -> ActuatorDescription:
        """Return the description of the actuator, in any state."""

    def read(self) -> list[ActuatorSample]:
        """Return all samples queued since the last read, oldest first; empty when none came."""

    def command_torque(self, torque_nm: float) -> None:
        """Command a torque on the joint, held until the next command or the command timeout."""


@runtime_checkable
class Sensor(Device, Protocol):
    """A device that only measures."""

    def describe(self) -> SensorDescription:
        """Return the description of the sensor, in any state."""

    def read(self) -> list[SensorSample]:
        """Return all samples queued since the last read, oldest first; empty when none came."""


@dataclass(frozen=True, slots=True)
class PositionerDescription:
    """Description of a motor that moves the far side of a bench."""

    name: str  # name of the device
    model: str
    serial: str
    # meaning of its angle: ``position`` of the far side, or ``motor_angle`` of a series-elastic
    # actuator, before its spring
    channel: str
    sample_rate_hz: float  # samples queued per second
    command_timeout_s: float  # time without a command after which it stops moving
    angle_min_rad: float  # smallest angle that can be commanded; -inf without an end
    angle_max_rad: float  # largest angle that can be commanded; inf without an end
    velocity_rad_s: float  # largest velocity

    def to_dict(self) -> dict[str, Any]:
        """Return the description as plain values."""
        return asdict(self)


@runtime_checkable
class Positioner(Device, Protocol):
    """A motor in position control: it moves the far side of a bench, whatever the torque.

    Active and without a command it holds still where it is.
    """

    def describe(self) -> PositionerDescription:
        """Return the description of the positioner, in any state."""

    def read(self) -> list[SensorSample]:
        """Return all angles (rad) queued since the last read, oldest first."""

    def command_position(self, angle_rad: float) -> None:
        """Command an angle of the output, held until the next command."""


@dataclass(frozen=True, slots=True)
class Devices:
    """The devices of one condition of an experiment; None for what there is not."""

    # goniometer of a wearer, or encoder at the output of a bench; None: the actuator's angle is
    # that of the joint
    angle: Sensor | None = None
    contact: Sensor | None = None  # footswitch
    actuator: Actuator | None = None  # None if the participant does not wear the device
    # torque sensor of a bench, or the deflection of a spring read as torque
    torque: Sensor | None = None
    # motor that moves the far side of a bench; a series-elastic actuator under position control is
    # its own
    positioner: Positioner | None = None
    joint_encoder: Sensor | None = None  # the joint's angle, measured on the device
    # gyroscopes on both segments, about the joint's axis; the joint's velocity is their difference
    shank_velocity: Sensor | None = None
    thigh_velocity: Sensor | None = None

    def to_dict(self) -> dict[str, Any]:
        """Return the descriptions of the devices as plain values."""
        devices = {name: getattr(self, name) for name in self.__slots__}
        return {
            name: None if device is None else device.describe().to_dict()
            for name, device in devices.items()
        }

    def named(self) -> dict[str, Device]:
        """Return every device by what it is here, the actuator first: it is stopped first."""
        names = ("actuator", "positioner", "angle", "contact", "torque", *MOTION_SENSORS)
        return {name: device for name in names if (device := getattr(self, name)) is not None}

    def all(self) -> tuple[Device, ...]:
        """Return every device in the order of :meth:`named`."""
        return tuple(self.named().values())


@dataclass(frozen=True, slots=True)
class Wearer:
    """The participant."""

    id: str  # name in the study
    mass_kg: float | None = None  # body mass
    height_m: float | None = None  # body height


class Stretch(NamedTuple):
    """One uninterrupted stretch of a recording.

    Parameters
    ----------
    segment : int
        Number of the stretch in the session.
    offset_s : float, s
        Offset added to the devices' time.
    end_s : float, s
        Time of its last sample, by the devices' clock, without the offset.
    """

    segment: int
    offset_s: float
    end_s: float


class Rig(Protocol):
    """Everything one participant is measured with, handed to an experiment."""

    @property
    def wearer(self) -> Wearer:
        """The participant."""

    @property
    def calibration(self) -> CalibrationSpec:
        """Calibration of this participant's instruments."""

    @property
    def device(self) -> DeviceSpec | None:
        """The mass on the moving segment beyond the measured torque; None if unknown."""

    def open(self, condition: str, *, worn: bool, segment: int, clock: Clock) -> Devices:
        """Return the devices, ``UNCONFIGURED``, for one uninterrupted stretch of a condition."""

    def notes(self) -> Mapping[str, Any]:
        """Return what else should stand in the session's description of the devices."""
