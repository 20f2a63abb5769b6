"""Opens the devices that a device file names; drivers are imported when they are needed."""

import importlib
from collections.abc import Mapping
from typing import Any

from jointz.core.clock import Clock
from jointz.devices.config import (
    Ads1115Spec,
    DephySpec,
    DeviceFile,
    LslSpec,
    OpenSourceLegSpec,
    device_file,
)
from jointz.devices.interface import Actuator, Devices, Sensor

_OSL_MODULE = "jointz.devices.opensourceleg"


def open_devices(
    config: DeviceFile | Mapping[str, Any], *, clock: Clock, before: Actuator | None = None
) -> Devices:
    """Return the devices that a file names, ``UNCONFIGURED``."""
    checked = config if isinstance(config, DeviceFile) else device_file(config)
    return Devices(
        angle=_sensor(checked.angle, "angle", clock),
        contact=_sensor(checked.contact, "contact", clock),
        actuator=_actuator(checked.actuator, clock, before),
    )


def _actuator(
    spec: DephySpec | OpenSourceLegSpec | None, clock: Clock, before: Actuator | None
) -> Actuator | None:
    if spec is None:
        return None
    if isinstance(spec, DephySpec):
        from jointz.devices.dephy import DephyActPack

        same = before if isinstance(before, DephyActPack) else None
        return DephyActPack(spec, clock=clock, before=same)
    made: Actuator = importlib.import_module(_OSL_MODULE).open_actuator(_keys(spec), clock=clock)
    return made


def _sensor(
    spec: Ads1115Spec | LslSpec | OpenSourceLegSpec | None, channel: str, clock: Clock
) -> Sensor | None:
    if spec is None:
        return None
    if isinstance(spec, Ads1115Spec):
        from jointz.devices.adc import Ads1115Sensor

        return Ads1115Sensor(spec, channel, clock=clock)
    if isinstance(spec, LslSpec):
        from jointz.devices.lsl import LslSensor

        return LslSensor(spec, channel, clock=clock)
    module = importlib.import_module(_OSL_MODULE)
    made: Sensor = module.open_sensor(_keys(spec), channel, clock=clock)
    return made


def _keys(spec: OpenSourceLegSpec) -> dict[str, Any]:
    return dict(spec.model_extra or {})
