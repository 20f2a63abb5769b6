"""What the devices measured, tick by tick."""

from jointz.core.session_log import NO_SAMPLE
from jointz.devices.interface import ActuatorSample, Devices, SensorSample

_NAN = float("nan")
NO_ACTUATOR_SAMPLE = ActuatorSample(NO_SAMPLE, NO_SAMPLE, _NAN, _NAN, _NAN, _NAN, _NAN, 0)
NO_SENSOR_SAMPLE = SensorSample(NO_SAMPLE, NO_SAMPLE, _NAN)


class Streams:
    """All samples that the devices queued since the tick before."""

    __slots__ = (
        "_actuator_ns",
        "_angle_ns",
        "_contact_ns",
        "_read_actuator",
        "_read_angle",
        "_read_contact",
        "actuator",
        "angle",
        "contact",
        "newest_actuator",
        "newest_angle",
    )

    def __init__(self, devices: Devices) -> None:
        if devices.angle is None or devices.contact is None:
            raise ValueError("expected devices with a goniometer and a footswitch.")
        self._read_actuator = devices.actuator.read if devices.actuator else None
        self._read_angle = devices.angle.read
        self._read_contact = devices.contact.read
        self._actuator_ns = self._angle_ns = self._contact_ns = -1
        self.actuator: list[ActuatorSample] = []
        self.angle: list[SensorSample] = []
        self.contact: list[SensorSample] = []
        self.newest_actuator = NO_ACTUATOR_SAMPLE
        self.newest_angle = NO_SENSOR_SAMPLE

    def read(self, slot_ns: int) -> float:
        """Read all devices and return how old the stalest of them is, s; infinite at first."""
        if self._read_actuator is None:
            self._actuator_ns = slot_ns
        else:
            self.actuator = self._read_actuator()
            if self.actuator:
                self.newest_actuator = self.actuator[-1]
                self._actuator_ns = slot_ns
        self.angle = self._read_angle()
        if self.angle:
            self.newest_angle = self.angle[-1]
            self._angle_ns = slot_ns
        self.contact = self._read_contact()
        if self.contact:
            self._contact_ns = slot_ns
        oldest_ns = min(self._actuator_ns, self._angle_ns, self._contact_ns)
        if oldest_ns == slot_ns:
            return 0.0
        return (slot_ns - oldest_ns) * 1e-9 if oldest_ns >= 0 else float("inf")
