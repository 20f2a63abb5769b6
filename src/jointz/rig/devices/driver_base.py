"""Base class of drivers: the state, and the steps that most of them share."""

import importlib
from collections import deque
from math import isfinite
from typing import Any, Literal, TypeVar

from jointz.core.channels import CHANNEL_UNITS
from jointz.core.errors import DeviceError, install_advice
from jointz.rig.devices.interface import Lifecycle

UNCONFIGURED, INACTIVE, ACTIVE = Lifecycle.UNCONFIGURED, Lifecycle.INACTIVE, Lifecycle.ACTIVE
FAULT, FINALISED = Lifecycle.FAULT, Lifecycle.FINALISED
KindT = TypeVar("KindT", bound=str)
SampleT = TypeVar("SampleT")


class DriverBase:
    """State of a driver; a driver derives from it and adds its own steps."""

    def __init__(self, name: str) -> None:
        self._name = name
        self._state = UNCONFIGURED

    @property
    def state(self) -> Lifecycle:
        """State of the device in its lifecycle."""
        return self._state

    def stop(self) -> None:
        """Sample no more; never raises, never blocks."""
        if self._state is ACTIVE:
            self._state = INACTIVE

    def close(self) -> None:
        """Stop and release the device; afterwards ``FINALISED``; may be called twice."""
        self.stop()
        self._state = FINALISED
        self._release()

    def _release(self) -> None:
        """Release what the driver holds; never raises."""

    def _require(self, *states: Lifecycle) -> None:
        if self._state not in states:
            expected = " or ".join(state.value for state in states)
            raise DeviceError(self._name, f"expected it {expected}; it is {self._state.value}.")


def refuse_infinite(device: str, torque_nm: float) -> None:
    """Refuse a command that is no finite torque."""
    if not isfinite(torque_nm):
        raise DeviceError(device, f"expected a finite torque, got {torque_nm} N*m.")


def load_library(module: str, *, device: str, extra: str) -> Any:
    """Return a module that a driver needs; ``extra`` of jointz installs it."""
    try:
        return importlib.import_module(module)
    except ImportError as exc:
        library = module.partition(".")[0]
        raise DeviceError(device, f"{library} is not installed. {install_advice(extra)}") from exc


def drained(queue: deque[SampleT]) -> list[SampleT]:
    """Return the samples that are queued now, oldest first; another thread may append more."""
    return [queue.popleft() for _ in range(len(queue))]


def channel_unit(channel: str, kind: KindT) -> tuple[str, KindT | Literal[""]]:
    """Return unit and kind of the samples of a channel; only a contact has a kind."""
    if channel != "contact":
        return CHANNEL_UNITS[channel][0], ""
    return ("V" if kind == "voltage" else "1"), kind
