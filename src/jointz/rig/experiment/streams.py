"""Samples of all devices, tick by tick."""

from collections.abc import Collection

from jointz.core.channels import MOTION_SENSORS
from jointz.core.session_log import NO_SAMPLE
from jointz.rig.devices.interface import ActuatorSample, Devices, SensorSample

_NAN = float("nan")
NO_ACTUATOR_SAMPLE = ActuatorSample(NO_SAMPLE, NO_SAMPLE, _NAN, _NAN, _NAN, _NAN, _NAN, 0)
NO_SENSOR_SAMPLE = SensorSample(NO_SAMPLE, NO_SAMPLE, _NAN)
_NAMES = ("actuator", "angle", "torque", "positioner", "contact", *MOTION_SENSORS)


class Streams:
    """Samples that the devices queued since the tick before; empty where there is no device.

    Nobody acts on a ``dispensable`` one: its age does not count.
    """

    def __init__(self, devices: Devices, *, dispensable: Collection[str] = ()) -> None:
        present = [(n, device) for n in _NAMES if (device := getattr(devices, n)) is not None]
        self._reads = [(name, device.read) for name, device in present]
        #: When each device last gave a sample, -1 before the first.
        self._last_ns = dict.fromkeys((n for n, _ in present if n not in dispensable), -1)
        self.actuator: list[ActuatorSample] = []
        no_samples: list[SensorSample] = []  # replaced by every read, never appended to
        self.angle = self.torque = self.positioner = self.contact = no_samples
        self.joint_encoder = self.shank_velocity = self.thigh_velocity = no_samples
        self.newest_actuator = NO_ACTUATOR_SAMPLE
        self.newest_angle = NO_SENSOR_SAMPLE
        self.newest_contact = NO_SENSOR_SAMPLE
        #: Records of this tick: one for each sample of the device that had most, at least one.
        self.parts = 1

    def read(self, slot_ns: int) -> float:
        """Read all devices and return how old the stalest of them is, s; infinite at first."""
        last_ns, parts = self._last_ns, 1
        for name, read in self._reads:
            samples = read()
            setattr(self, name, samples)
            if samples and name in last_ns:
                last_ns[name] = slot_ns
            if len(samples) > parts:
                parts = len(samples)
        self.parts = parts
        if self.actuator:
            self.newest_actuator = self.actuator[-1]
        if self.angle:
            self.newest_angle = self.angle[-1]
        if self.contact:
            self.newest_contact = self.contact[-1]
        oldest_ns = min(last_ns.values())
        if oldest_ns == slot_ns:
            return 0.0
        return (slot_ns - oldest_ns) * 1e-9 if oldest_ns >= 0 else float("inf")
