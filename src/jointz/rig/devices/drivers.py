"""Drivers and rigs by entry points of the group ``jointz.devices``.

The name of an entry point is its kind and its name: ``actuator.NAME`` and ``sensor.NAME`` are a
:class:`Driver` that a ``device.toml`` names, ``rig.NAME`` is a function that returns the rig of a
participant.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import cache
from importlib.metadata import EntryPoint
from typing import Any

from jointz.core.channels import MOTION_SENSORS
from jointz.core.checked_model import CheckedModel
from jointz.core.entry_points import registered

GROUP = "jointz.devices"
#: Entry points of jointz; pyproject.toml registers the same.
BUILT_IN: Mapping[str, str] = {
    "actuator.dephy": "jointz.rig.devices.dephy:DRIVER",
    "actuator.opensourceleg": "jointz.rig.devices.opensourceleg:ACTUATOR_DRIVER",
    "sensor.ads1115": "jointz.rig.devices.adc:DRIVER",
    "sensor.lsl": "jointz.rig.devices.lsl:DRIVER",
    "sensor.opensourceleg": "jointz.rig.devices.opensourceleg:SENSOR_DRIVER",
    "rig.sim": "jointz.rig.session.rigs.simulated_rigs:open_simulated_rig",
}
_KIND_OF_SECTION = {
    "actuator": "actuator",
    **dict.fromkeys(("angle", "contact", *MOTION_SENSORS), "sensor"),
}


class DriverSettings(CheckedModel):
    """A section of a ``device.toml``; a driver adds its own keys."""

    driver: str


@dataclass(frozen=True, slots=True)
class Driver:
    """A driver that a ``device.toml`` can name.

    ``open`` is usually the class of the device. That of an actuator takes ``(settings, *, clock,
    before)``, ``before`` being the actuator of the stretch before; that of a sensor takes
    ``(settings, channel, *, clock)``.
    """

    settings: type[DriverSettings]
    open: Callable[..., Any]
    package: str = ""  # required package besides jointz; "" for none


@cache
def registered_devices(kind: str) -> dict[str, EntryPoint]:
    """Return the entry points of a kind (actuator, sensor, rig) by name."""
    entries = registered(GROUP, BUILT_IN).items()
    return {
        name.removeprefix(f"{kind}."): entry
        for name, entry in entries
        if name.startswith(f"{kind}.")
    }


def driver_names(section: str) -> list[str]:
    """Return the drivers that a section of a ``device.toml`` can name."""
    return sorted(registered_devices(_KIND_OF_SECTION[section]))


def load_driver(section: str, name: str) -> Driver:
    """Return the driver that a section names."""
    driver: Driver = registered_devices(_KIND_OF_SECTION[section])[name].load()
    return driver
