"""What the devices of a bench measured, tick by tick."""

from collections.abc import Callable

from jointz.devices.interface import ActuatorSample, Devices, SensorSample
from jointz.experiment.streams import NO_ACTUATOR_SAMPLE, NO_SENSOR_SAMPLE


class BenchStreams:
    """All samples that the devices queued since the tick before; empty where there is none.

    Parameters
    ----------
    devices : Devices
        Active, with an actuator.

    Attributes
    ----------
    actuator, angle, torque, position : list
        The samples of this tick, oldest first.
    newest_actuator, newest_angle : ActuatorSample, SensorSample
        The last that came at all.
    """

    __slots__ = (
        "_last_ns",
        "_read_actuator",
        "_sensors",
        "actuator",
        "angle",
        "newest_actuator",
        "newest_angle",
        "position",
        "torque",
    )

    def __init__(self, devices: Devices) -> None:
        if devices.actuator is None:
            raise ValueError("expected devices with an actuator.")
        self._read_actuator = devices.actuator.read
        named = {
            "angle": devices.angle,
            "torque": devices.torque,
            "position": devices.positioner,
        }
        self._sensors: list[tuple[str, Callable[[], list[SensorSample]]]] = [
            (name, device.read) for name, device in named.items() if device is not None
        ]
        self._last_ns = dict.fromkeys(["actuator", *(name for name, _ in self._sensors)], -1)
        self.actuator: list[ActuatorSample] = []
        self.angle: list[SensorSample] = []
        self.torque: list[SensorSample] = []
        self.position: list[SensorSample] = []
        self.newest_actuator = NO_ACTUATOR_SAMPLE
        self.newest_angle = NO_SENSOR_SAMPLE

    def read(self, slot_ns: int) -> float:
        """Read all devices and return how old the stalest of them is, s; infinite at first.

        Parameters
        ----------
        slot_ns : int, ns
            Time of the tick.

        Raises
        ------
        DeviceError
            When a device is gone.
        """
        last = self._last_ns
        samples = self.actuator = self._read_actuator()
        if samples:
            self.newest_actuator = samples[-1]
            last["actuator"] = slot_ns
        for name, read in self._sensors:
            values = read()
            setattr(self, name, values)
            if values:
                last[name] = slot_ns
        if self.angle:
            self.newest_angle = self.angle[-1]
        oldest_ns = min(last.values())
        if oldest_ns == slot_ns:
            return 0.0
        return (slot_ns - oldest_ns) * 1e-9 if oldest_ns >= 0 else float("inf")
