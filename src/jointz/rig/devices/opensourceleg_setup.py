"""Settings of opensourceleg devices, and checks that they can be used."""

import inspect
import os
from collections.abc import Mapping
from typing import Annotated, Any, Literal

from pydantic import Field

from jointz.core.checked_model import CheckedModel
from jointz.core.errors import DeviceError, NotConnectedError
from jointz.core.limits import Positive, SafetyLimits
from jointz.core.study import TorqueModelSpec
from jointz.rig.devices.driver_base import channel_unit
from jointz.rig.devices.drivers import DriverSettings


class Profile(CheckedModel):
    """Units of a class of opensourceleg's actuators, and how it is commanded.

    ``ampere`` is one unit of its ``motor_current`` and ``set_motor_current``, A. ``supply`` is
    its property with the supply voltage (without it the voltage is NaN), ``volt`` one unit of
    that, V. ``command = "torque"`` calls ``set_output_torque``, with the library's torque
    constant, for a class of one's own without current control. ``gains`` are handed to
    ``set_current_gains``: empty for the class's own, None where it is not to be called.
    """

    ampere: Positive = 1e-3
    supply: str | None = None
    volt: Positive = 1e-3
    command: Literal["current", "torque"] = "current"
    gains: dict[str, float] | None = None


#: By the name of the class, its own or one that it inherits from.
PROFILES: Mapping[str, Profile] = {
    "DephyActuator": Profile(supply="battery_voltage", gains={}),
    "TMotorServoActuator": Profile(ampere=1.0),
    "JointzActuator": Profile(supply="battery_voltage"),
}


class ActuatorSetup(CheckedModel):
    """Settings of an actuator that opensourceleg does not have.

    The gear ratio of ``torque_model`` must be the library's. Torque and current of ``limits``
    are also clamped in the adapter, whatever the safety gate let through. ``sign`` is -1 where
    the motor's positive direction is not the study's: angle, velocity, current and command
    turn together. ``angle_offset_rad`` is added to the output angle, after the sign. Without a
    command for ``command_timeout_s`` the adapter's thread commands zero.
    """

    torque_model: TorqueModelSpec
    limits: SafetyLimits
    sign: Literal[1, -1] = 1
    angle_offset_rad: float = 0.0
    command_timeout_s: Annotated[float, Field(gt=0, le=0.5)] = 0.1
    profile: Profile | None = None


class ActuatorKeys(ActuatorSetup, DriverSettings):
    """An actuator in a ``device.toml``: its class, what that is made with, and the setup.

    ``device`` is module and class, as ``opensourceleg.actuators.dephy:DephyActuator``;
    ``arguments`` are for the class: ``port``, ``gear_ratio``, ``frequency``, ...
    """

    device: str
    arguments: dict[str, Any] = Field(default_factory=dict)


class Reading(CheckedModel):
    """How one value of a sensor becomes a channel: ``gain * value + offset``.

    ``channel`` is the canonical one and ``unit`` its SI unit (``1`` for a contact), ``kind`` of
    a contact ``contact`` (0 or 1), ``voltage`` or ``pulse``. ``attribute`` is the property of
    opensourceleg's sensor (``position``, ``data``, ``mz``, ...), ``index`` which element where
    the property has several: the input of an ADC. ``gain`` is in units of the channel per unit
    of the property, its sign turns the direction; ``offset`` is in units of the channel.
    """

    channel: str
    unit: str
    attribute: str = "position"
    index: int | None = None
    gain: float = 1.0
    offset: float = 0.0
    kind: Literal["", "contact", "voltage", "pulse"] = ""

    def of(self, library: object) -> float:
        """Return the value in the channel's unit."""
        value: Any = getattr(library, self.attribute)
        raw = float(value if self.index is None else value[self.index])
        return self.gain * raw + self.offset


class SensorKeys(DriverSettings):
    """A sensor in a ``device.toml``: its class, what that is made with, and the reading.

    ``device`` and ``arguments`` as an actuator has them; two channels with the same of both
    share one sensor. ``sample_rate_hz`` is how often it is updated; the rest is a
    :class:`Reading`. A contact is a voltage unless ``kind`` says otherwise.
    """

    device: str
    arguments: dict[str, Any] = Field(default_factory=dict)
    sample_rate_hz: Positive
    attribute: str = "position"
    index: int | None = None
    gain: float = 1.0
    offset: float = 0.0
    kind: Literal["contact", "voltage", "pulse"] = "voltage"

    def reading(self, channel: str) -> Reading:
        """Return how the channel is read."""
        unit, kind = channel_unit(channel, self.kind)
        shared = ("attribute", "index", "gain", "offset")
        values = {name: getattr(self, name) for name in shared}
        return Reading(channel=channel, unit=unit, kind=kind, **values)


def profile_of(actuator: object) -> Profile:
    """Return the profile of an actuator's class."""
    for cls in type(actuator).__mro__:
        if cls.__name__ in PROFILES:
            return PROFILES[cls.__name__]
    raise DeviceError(
        str(getattr(actuator, "tag", "opensourceleg")),
        f"the units of {type(actuator).__name__} are not known (known: {', '.join(PROFILES)}). "
        "Say them: ActuatorSetup(..., profile=Profile(ampere=0.001 for mA, ...)).",
    )


def check_usable(actuator: Any, setup: ActuatorSetup) -> None:
    """Raise if an actuator cannot be used as it is set up."""
    name, model = str(actuator.tag), setup.torque_model
    if inspect.iscoroutinefunction(actuator.update):
        raise DeviceError(
            name, f"{type(actuator).__name__} is awaited; expected one with plain calls."
        )
    if actuator.is_offline:
        raise DeviceError(name, "is offline: what it says is made up. Leave offline=True away.")
    if model.torque_constant == 0.0:
        raise DeviceError(name, "expected a torque constant other than 0 in the torque model.")
    if abs(actuator.gear_ratio - model.gear_ratio) > 1e-6 * model.gear_ratio:
        raise DeviceError(
            name,
            f"expected the gear ratio of the torque model, {model.gear_ratio:g}; opensourceleg "
            f"has {actuator.gear_ratio:g}. Give both the calibrated one.",
        )


def check_port(actuator: object, name: str) -> None:
    """Raise if the port cannot be opened: opensourceleg would end the whole process."""
    port = getattr(actuator, "port", None)
    if isinstance(port, str) and port.startswith("/") and not os.access(port, os.R_OK | os.W_OK):
        raise NotConnectedError(
            name,
            f"{port} cannot be read and written. Check cable and supply, and that you belong to "
            "the group of the port (dialout).",
        )
