"""Real devices, as a ``device.toml`` names them, for an experiment.

**No driver of jointz was ever tried on hardware.** The limits of the file and those of the protocol
both hold; nothing here knows any truth.
"""

import os
import platform
import sys
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any

from jointz.core.channels import MOTION_SENSORS
from jointz.core.clock import Clock
from jointz.core.errors import DataError, DeviceFileError
from jointz.core.protocols.protocol import Protocol
from jointz.core.provenance import version_of
from jointz.core.study import CalibrationSpec, DeviceSpec
from jointz.io.calibration_file import CalibrationFile
from jointz.io.small_files import file_content, parse_toml
from jointz.rig.devices.config import DeviceFile, device_file, open_devices
from jointz.rig.devices.drivers import load_driver
from jointz.rig.devices.interface import Actuator, Devices, Wearer
from jointz.rig.session.participant_run import check_id

UNTRIED = "No driver of jointz was ever tried on hardware."
#: The sensors that a step of a calibration looks at; the others are on nothing then.
_SENSORS_OF_STEP = {
    "zero": ("angle",),
    "footswitch": ("contact",),
    "hinge": ("angle",),
    "leg": ("angle",),
    "torsion": ("angle",),
}
_WHY = {
    "angle": "the angle of the joint is measured by a goniometer of its own.",
    "contact": "heel strikes, and with them the gait phase, come from a footswitch.",
    **dict.fromkeys(MOTION_SENSORS, "the protocol is planned with it (sensors)."),
}
#: Channels of the sensors that a protocol is planned with, beside the goniometer.
_OF_MOTION = {"encoder": MOTION_SENSORS[:1], "gyroscopes": MOTION_SENSORS[1:]}
#: Moved by a motor in position control, of which there is no driver.
_POSITIONS = ("position_rad", "velocity_rad_s")


@dataclass(frozen=True, slots=True)
class Hardware:
    """The devices that a file names, and whom they are put on."""

    where: str  # name of the file
    file: DeviceFile  # devices of the file, without sensors that the protocol does not use
    wearers: tuple[Wearer, ...]  # participants, or the loads of a bench, in their order


class HardwareRig:
    """The devices of a laboratory on one wearer."""

    def __init__(self, hardware: Hardware, number: int) -> None:
        self._hardware = hardware
        self._wearer = hardware.wearers[number]
        self._actuator: Actuator | None = None

    @property
    def wearer(self) -> Wearer:
        """The participant."""
        return self._wearer

    @property
    def calibration(self) -> CalibrationSpec:
        """The calibration that the file states."""
        return self._hardware.file.calibration

    @property
    def device(self) -> DeviceSpec | None:
        """The mass on the moving segment, if the file states it."""
        return self._hardware.file.device

    def open(self, condition: str, *, worn: bool, segment: int, clock: Clock) -> Devices:
        """Return the devices, ``UNCONFIGURED``."""
        del condition, segment
        file = self._hardware.file
        if not worn:
            file = file.model_copy(update={"actuator": None, "joint_encoder": None})
        devices = open_devices(file, clock=clock, before=self._actuator)
        self._actuator = devices.actuator or self._actuator
        return devices

    def notes(self) -> Mapping[str, Any]:
        """Return file, drivers, versions of their libraries, and that nothing was tried."""
        file = self._hardware.file
        sections = file.sections()
        packages = {load_driver(name, one.driver).package for name, one in sections.items()}
        return {
            "simulated": False,
            "device_file": self._hardware.where,
            "drivers": {name: one.driver for name, one in sections.items()},
            "libraries": {package: version_of(package) for package in sorted(packages) if package},
            "untried": UNTRIED,
            "settings": file.model_dump(mode="json", exclude={"participants", "calibration"}),
        }


def read_hardware(
    path: str | os.PathLike[str],
    protocol: Protocol,
    *,
    participants: int | None = None,
    known: CalibrationFile | None = None,
) -> Hardware:
    """Read a ``device.toml`` and see that it has what a protocol needs."""
    where = os.fspath(path)
    file = device_file(read_device_file(path), where=where)
    wearers = _wearers(protocol, file, where, participants)
    for one in wearers:  # before the first is measured, not after
        check_id(one.id)
    problems = list(_lacking(protocol, file, levels_known=_knows_levels(file, wearers, known)))
    if problems:
        raise DeviceFileError(f"{where} for {protocol.name}", problems)
    of_motion = () if protocol.by_gait else MOTION_SENSORS
    unused = dict.fromkeys({"angle", "contact", *of_motion} - set(_sensors(protocol, file)))
    return Hardware(where, file.model_copy(update=unused), wearers)


def refuse_with_devices(
    *, device: str | None, preset: str | None, clock: str | None, workers: int
) -> None:
    """Refuse what only a simulation knows, where a device file is given."""
    if not sys.platform.startswith("linux"):
        raise DataError(
            f"config: real devices are driven from Linux only, this is {platform.system()}: its "
            "loop has no priority and its USB and I2C other names. Leave out config for simulated "
            "devices, or measure on Linux; studies are analysed on any system."
        )
    if device is not None:
        raise DataError(
            f"device and config: {device!r} and a device file exclude each other. Leave out config "
            "for simulated devices, or device for the real ones of the file."
        )
    if preset is not None:
        raise DataError(
            f"preset: {preset!r} is of simulated devices and people. Leave it out with a device "
            "file."
        )
    if clock == "fast":
        raise DataError("clock: real devices keep real time. Leave it out with a device file.")
    if workers > 1:
        raise DataError(
            f"workers: expected 1 with a device file, got {workers}: one participant wears the "
            "devices."
        )


def _wearers(
    protocol: Protocol, file: DeviceFile, where: str, participants: int | None
) -> tuple[Wearer, ...]:
    if protocol.cases_are_loads:
        return tuple(Wearer(load.name) for load in protocol.loads)
    named = tuple(Wearer(one.id, one.mass_kg, one.height_m) for one in file.participants)
    if not named:
        count = protocol.participants if participants is None else participants
        return tuple(Wearer(f"S{number:02d}") for number in range(1, count + 1))
    if participants is not None and participants > len(named):
        raise DataError(
            f"{where}: names {len(named)} participants, expected {participants}. Add the others "
            "to its [[participants]], or ask for fewer.",
            path=where,
        )
    return named[:participants]


def _sensors(protocol: Protocol, file: DeviceFile) -> tuple[str, ...]:
    """Return which sensors a protocol looks at."""
    if protocol.by_gait:
        return "angle", "contact", *(c for n in protocol.sensors for c in _OF_MOTION.get(n, ()))
    if protocol.kind == "calibration":
        return _SENSORS_OF_STEP.get(protocol.calibration or "", ())
    return () if file.angle is None else ("angle",)  # a bench may have an encoder at its output


def _knows_levels(
    file: DeviceFile, wearers: tuple[Wearer, ...], known: CalibrationFile | None
) -> bool:
    """Return whether the levels of every participant's footswitch are calibrated."""
    levels = (
        file.calibration.overridden_by(known.of(one.id) if known else None).contact_levels_v
        for one in wearers
    )
    return all(one is not None for one in levels)


def _lacking(protocol: Protocol, file: DeviceFile, *, levels_known: bool) -> Iterator[str]:
    """Yield what the protocol needs and the file lacks."""
    worn = [one.name for one in protocol.conditions if one.worn]
    if worn and file.actuator is None:
        yield f"actuator: missing; it is worn in {', '.join(worn)}."
    sensors = _sensors(protocol, file)
    for name in sensors:
        if getattr(file, name) is None:
            yield f"{name}: missing; {_WHY[name]}"
    if "contact" in sensors and file.contact is not None:
        kind = file.contact.model_dump().get("kind", "voltage")
        if not (protocol.by_gait and kind == "voltage" and levels_known):
            yield from _another_kind(protocol, kind)
    for one in protocol.conditions:
        moved = [name for name in one.references if name in _POSITIONS]
        if moved:
            yield (
                f"{one.name} moves the far side of a bench ({', '.join(moved)}), and no driver "
                "does. Run it on simulated devices, or leave the condition out."
            )


def _another_kind(protocol: Protocol, kind: str) -> Iterator[str]:
    """Yield the problem of a footswitch that the loop cannot read or that cannot be calibrated."""
    if protocol.by_gait and kind != "contact":
        yield (
            f'contact.kind: expected "contact", got "{kind}": the loop takes below 0.3 for off and '
            "from 0.7 on for on. Calibrate its levels in V (jointz calibrate footswitch), "
            "or have it give 0 and 1."
        )
    if protocol.kind == "calibration" and kind != "voltage":
        yield f'contact.kind: expected "voltage", whose thresholds are looked for; got "{kind}".'


def read_device_file(path: str | os.PathLike[str]) -> dict[str, Any]:
    """Return what a ``device.toml`` holds, not checked yet."""
    where = os.fspath(path)
    absent = (
        f"{where}: no such file. Name the file that says which devices there are and how they are "
        "connected."
    )
    return parse_toml(where, file_content(where, absent=absent), error=DeviceFileError)
