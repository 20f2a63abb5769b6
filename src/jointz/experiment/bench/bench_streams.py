"""What the devices of a bench measured, tick by tick."""

from jointz.devices.interface import ActuatorSample, Devices, SensorSample
from jointz.experiment.streams import NO_ACTUATOR_SAMPLE, NO_SENSOR_SAMPLE

_NEVER_LATE_NS = 2**63


class BenchStreams:
    """All samples that the devices queued since the tick before; empty where there is none."""

    __slots__ = (
        "_last_ns",
        "_read_actuator",
        "_read_angle",
        "_read_contact",
        "_read_position",
        "_read_torque",
        "actuator",
        "angle",
        "contact",
        "newest_actuator",
        "newest_angle",
        "position",
        "torque",
    )

    def __init__(self, devices: Devices) -> None:
        if devices.actuator is None:
            raise ValueError("expected devices with an actuator.")
        self._read_actuator = devices.actuator.read
        self._read_angle = devices.angle.read if devices.angle else None
        self._read_torque = devices.torque.read if devices.torque else None
        self._read_position = devices.positioner.read if devices.positioner else None
        self._read_contact = devices.contact.read if devices.contact else None
        optional = (
            self._read_angle,
            self._read_torque,
            self._read_position,
            self._read_contact,
        )
        #: When each last gave a sample; one that is not there is never late.
        self._last_ns = [-1, *(-1 if read else _NEVER_LATE_NS for read in optional)]
        self.actuator: list[ActuatorSample] = []
        self.angle: list[SensorSample] = []
        self.torque: list[SensorSample] = []
        self.position: list[SensorSample] = []
        self.contact: list[SensorSample] = []
        self.newest_actuator = NO_ACTUATOR_SAMPLE
        self.newest_angle = NO_SENSOR_SAMPLE

    def read(self, slot_ns: int) -> float:
        """Read all devices and return how old the stalest of them is, s; infinite at first."""
        last = self._last_ns
        actuator = self.actuator = self._read_actuator()
        if actuator:
            self.newest_actuator = actuator[-1]
            last[0] = slot_ns
        if self._read_angle is not None:
            angle = self.angle = self._read_angle()
            if angle:
                self.newest_angle = angle[-1]
                last[1] = slot_ns
        if self._read_torque is not None:
            self.torque = self._read_torque()
            if self.torque:
                last[2] = slot_ns
        if self._read_position is not None:
            self.position = self._read_position()
            if self.position:
                last[3] = slot_ns
        self._read_footswitch(slot_ns)
        oldest_ns = min(last)
        if oldest_ns == slot_ns:
            return 0.0
        return (slot_ns - oldest_ns) * 1e-9 if oldest_ns >= 0 else float("inf")

    def _read_footswitch(self, slot_ns: int) -> None:
        if self._read_contact is not None:
            self.contact = self._read_contact()
            if self.contact:
                self._last_ns[4] = slot_ns
