"""Opens the devices that a device file names; drivers are imported when they are needed."""

from collections.abc import Mapping
from typing import Any

from jointz.core.clock import Clock
from jointz.devices.config import DeviceFile, device_file
from jointz.devices.drivers import load_driver
from jointz.devices.interface import Actuator, Devices


def open_devices(
    config: DeviceFile | Mapping[str, Any], *, clock: Clock, before: Actuator | None = None
) -> Devices:
    """Return the devices that a file names, ``UNCONFIGURED``."""
    file = config if isinstance(config, DeviceFile) else device_file(config)
    devices = {}
    for section, settings in file.sections().items():
        driver = load_driver(section, settings.driver)
        if section == "actuator":
            devices[section] = driver.open(settings, clock=clock, before=before)
        else:
            devices[section] = driver.open(settings, section, clock=clock)
    return Devices(**devices)
