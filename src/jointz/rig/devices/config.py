"""Models of ``device.toml``, the file that names the devices of a laboratory.

Sections ``[actuator]``, ``[angle]``, ``[contact]``, ``[joint_encoder]``, ``[shank_velocity]`` and
``[thigh_velocity]``, each with a ``driver`` and its keys, ``[calibration]`` and ``[device]`` as in
a study, and ``[[participants]]``. Reading the file is not done here: these models take what
:mod:`tomllib` makes of it. Drivers, and the libraries that they need, are imported when the devices
are opened.
"""

import reprlib
from collections.abc import Iterator, Mapping
from typing import Annotated, Any, Literal

from pydantic import Field, PlainValidator, SerializeAsAny, ValidationError, ValidationInfo
from pydantic_core import PydanticCustomError, PydanticKnownError

from jointz.core.channels import CHANNEL_UNITS, MOTION_SENSORS
from jointz.core.checked_model import Check, CheckedModel, Problem, place_of
from jointz.core.clock import Clock
from jointz.core.errors import DeviceFileError
from jointz.core.limits import Positive, SafetyLimits
from jointz.core.study import CalibrationSpec, DeviceSpec, Name, TorqueModelSpec
from jointz.rig.devices.dephy_units import WindingSpec
from jointz.rig.devices.drivers import DriverSettings, driver_names, load_driver
from jointz.rig.devices.interface import Actuator, Devices

#: The ADS1115 converts so often a second; its oscillator is 10 % wide, so that this many
#: can be read without reading one twice.
ADS1115_RATES = (8, 16, 32, 64, 128, 250, 475, 860)
ADS1115_FASTEST_HZ = 774.0
ADS1115_FULL_SCALES_V = (6.144, 4.096, 2.048, 1.024, 0.512, 0.256)

Text = Annotated[str, Field(min_length=1)]
ContactKind = Literal["contact", "voltage"]


class DephySpec(DriverSettings):
    """A Dephy ActPack: ``driver = "dephy"``.

    ``direction`` is 1 where the motor of a right device turns in the study's positive
    direction; a left one turns against it. ``library`` is flexsea's compiled library as a
    file; without it flexsea downloads the one of the firmware, once.
    """

    driver: Literal["dephy"] = "dephy"
    port: Text
    firmware: Annotated[str, Field(pattern=r"^\d+\.\d+\.\d+$")]
    side: Literal["left", "right"]
    torque_model: TorqueModelSpec
    limits: SafetyLimits
    direction: Literal[1, -1] = 1
    zero_counts: int = 0
    sample_rate_hz: float = 500.0
    command_timeout_s: Annotated[float, Field(ge=0.01, le=0.5)] = 0.1
    current_gains: Annotated[
        tuple[Annotated[int, Field(ge=0, le=1000)], ...],
        Field(min_length=3, max_length=3, strict=False),
    ] = (40, 400, 128)
    winding: WindingSpec = WindingSpec()
    serial: str = ""
    library: str = ""

    def checks(self) -> tuple[Check, ...]:
        """Return what holds between the keys."""
        return (self._rate_is_one_of_the_firmware, self._torque_has_a_constant)

    def _rate_is_one_of_the_firmware(self) -> Iterator[Problem]:
        if self.sample_rate_hz not in (500.0, 1000.0):
            yield Problem(
                ("sample_rate_hz",),
                f"expected 500 or 1000, which the firmware streams; got {self.sample_rate_hz:g}.",
            )

    def _torque_has_a_constant(self) -> Iterator[Problem]:
        if self.torque_model.torque_constant <= 0.0:
            yield Problem(
                ("torque_model", "torque_constant"),
                f"expected more than 0, got {self.torque_model.torque_constant:g}. Direction is "
                "given by side and direction.",
            )
        if self.torque_model.bias != 0.0:
            yield Problem(
                ("torque_model", "bias"),
                f"expected 0, got {self.torque_model.bias:g}: what equation 3.3 calls bias is that "
                "of the torque sensor it was fitted to; zero torque would be a standing current.",
            )


class Ads1115Spec(DriverSettings):
    """One input of an ADS1115 on an I2C bus: ``driver = "ads1115"``.

    ``value = gain_per_v * (volts - offset_v)``, rad or rad/s for what moves. A contact is the
    voltage itself, or with ``kind = "contact"`` 1 above ``threshold_v`` and 0 below ``release_v``.
    """

    driver: Literal["ads1115"] = "ads1115"
    bus: Annotated[int, Field(ge=0, le=63)] = 1
    address: Annotated[int, Field(ge=0x48, le=0x4B)] = 0x48
    input: Literal["0", "1", "2", "3", "0-1", "0-3", "1-3", "2-3"] = "0"
    full_scale_v: float = 4.096
    sample_rate_hz: Positive = 500.0
    gain_per_v: float = 1.0
    offset_v: float = 0.0
    kind: ContactKind = "voltage"
    threshold_v: float = 1.5
    release_v: float = 1.0
    serial: str = ""

    def checks(self) -> tuple[Check, ...]:
        """Return what holds between the keys."""
        return (self._can_be_converted, self._threshold_above_release, self._gain_is_not_zero)

    def _can_be_converted(self) -> Iterator[Problem]:
        if self.sample_rate_hz > ADS1115_FASTEST_HZ:
            yield Problem(
                ("sample_rate_hz",),
                f"expected at most {ADS1115_FASTEST_HZ:g} Hz, got {self.sample_rate_hz:g}: the "
                "chip converts 860 times a second, give or take 10 %, and tells nobody when.",
            )
        if self.full_scale_v not in ADS1115_FULL_SCALES_V:
            yield Problem(
                ("full_scale_v",),
                f"expected 6.144, 4.096, 2.048, 1.024, 0.512 or 0.256 V; got "
                f"{self.full_scale_v:g}.",
            )

    def _threshold_above_release(self) -> Iterator[Problem]:
        if self.kind == "contact" and self.threshold_v <= self.release_v:
            yield Problem(
                ("threshold_v",),
                f"expected more than release_v = {self.release_v:g} V, got {self.threshold_v:g}.",
            )

    def _gain_is_not_zero(self) -> Iterator[Problem]:
        if self.gain_per_v == 0.0:
            yield Problem(("gain_per_v",), "expected a number that is not 0, got 0.")


class LslSpec(DriverSettings):
    """One channel of a stream of Lab Streaming Layer: ``driver = "lsl"``.

    ``value = gain * (received - offset)``, rad or rad/s for what moves.
    """

    driver: Literal["lsl"] = "lsl"
    stream: Text
    source_id: str = ""
    index: Annotated[int, Field(ge=0)] = 0
    sample_rate_hz: Positive
    gain: float = 1.0
    offset: float = 0.0
    kind: ContactKind = "voltage"
    timeout_s: Annotated[float, Field(gt=0, le=60)] = 5.0

    def checks(self) -> tuple[Check, ...]:
        """Return the check of the gain."""
        return (self._gain_is_not_zero,)

    def _gain_is_not_zero(self) -> Iterator[Problem]:
        if self.gain == 0.0:
            yield Problem(("gain",), "expected a number that is not 0, got 0.")


def _driver_settings(raw: object, info: ValidationInfo) -> DriverSettings | None:
    """Return the settings of a section, checked by the driver that it names."""
    if raw is None or isinstance(raw, DriverSettings):
        return raw
    if not isinstance(raw, Mapping):
        raise PydanticKnownError("model_attributes_type")
    section, driver = str(info.field_name), raw.get("driver")
    names = driver_names(section)
    if driver not in names:
        got = "missing" if driver is None else f"got {driver!r}"
        message = f"expected one of {', '.join(names)}; {got}."
        raise PydanticCustomError("driver", "{message}", {"message": message})
    return load_driver(section, driver).settings.model_validate(dict(raw))


Section = Annotated[SerializeAsAny[DriverSettings] | None, PlainValidator(_driver_settings)]


class WearerSpec(CheckedModel):
    """A participant: name in the study, and body."""

    id: Name
    mass_kg: Positive | None = None
    height_m: Annotated[float, Field(gt=0, lt=3)] | None = None


class DeviceFile(CheckedModel):
    """The whole of a ``device.toml``.

    ``device`` is what hangs on the moving segment beyond the measured torque, as in a study.
    """

    actuator: Section = None
    angle: Section = None
    contact: Section = None
    joint_encoder: Section = None
    shank_velocity: Section = None
    thigh_velocity: Section = None
    calibration: CalibrationSpec = CalibrationSpec()
    device: DeviceSpec | None = None
    participants: tuple[WearerSpec, ...] = Field(default=(), strict=False)

    def checks(self) -> tuple[Check, ...]:
        """Return what holds between the sections."""
        devices = self._some_device, self._one_sensor_per_chip, self._angle_has_a_gain
        return *devices, self._ids_are_unique

    def sections(self) -> dict[str, DriverSettings]:
        """Return the sections of actuator and sensors that the file has."""
        names = ("actuator", "angle", "contact", *MOTION_SENSORS)
        named = {name: getattr(self, name) for name in names}
        return {name: spec for name, spec in named.items() if spec is not None}

    def _ids_are_unique(self) -> Iterator[Problem]:
        ids = [one.id for one in self.participants]
        for i, name in enumerate(ids):
            if name in ids[:i]:
                yield Problem(("participants", i, "id"), f"{name!r} is there already.")

    def _some_device(self) -> Iterator[Problem]:
        if self.actuator is None and self.angle is None and self.contact is None:
            yield Problem(("actuator",), "missing, and so are angle and contact; give one.")

    def _angle_has_a_gain(self) -> Iterator[Problem]:
        for name, spec in self.sections().items():
            without = isinstance(spec, Ads1115Spec) and "gain_per_v" not in spec.model_fields_set
            if without and name != "contact":
                unit = CHANNEL_UNITS[name][0]
                yield Problem((name, "gain_per_v"), f"missing; {unit} per volt, as calibrated.")

    def _one_sensor_per_chip(self) -> Iterator[Problem]:
        chips: dict[tuple[int, int], str] = {}
        for name, other in self.sections().items():
            if not isinstance(other, Ads1115Spec):
                continue
            first = chips.setdefault((other.bus, other.address), name)
            if first == name:
                continue
            yield Problem(
                (name, "address"),
                f"expected another chip than [{first}] has, got {other.address:#x} on bus "
                f"{other.bus} for both: one that switches its input converts neither in time.",
            )


def device_file(raw: Mapping[str, Any], *, where: str = "device.toml") -> DeviceFile:
    """Return the content of a ``device.toml``, checked; raise DeviceFileError with all problems."""
    try:
        return DeviceFile.model_validate(dict(raw))
    except ValidationError as exc:
        problems = [_sentence(dict(e)) for e in exc.errors()]
        raise DeviceFileError(where, problems) from exc


def _sentence(error: Mapping[str, Any]) -> str:
    place, kind, value = place_of(tuple(error["loc"])), error["type"], reprlib.repr(error["input"])
    if kind == "extra_forbidden":
        return f"{place}: unknown key. Remove it, or look at its spelling."
    if kind == "missing":
        return f"{place}: missing; it is required."
    message = str(error["msg"]).removeprefix("Value error, ").replace("Input should be", "expected")
    if kind == "driver":
        return f"{place}.driver: {message}"
    return f"{place}: {message}" if kind == "inconsistent" else f"{place}: {message}; got {value}."


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
