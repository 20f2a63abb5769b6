"""Interface and registry of controllers that command torque while a person walks.

A controller registers by an entry point of the group ``jointz.controllers``: its name is that of
``[conditions.controller]``, its value a :class:`ControllerFactory`. It is loaded when it is used.
"""

import difflib
import json
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from importlib.metadata import EntryPoint
from math import isfinite
from typing import Any, NamedTuple, Protocol, runtime_checkable

from jointz.core.entry_points import registered
from jointz.core.errors import DataError, JointzError, ProtocolError
from jointz.core.protocols.protocol import Protocol as ProtocolSpec
from jointz.core.protocols.protocol_models import ControllerSpec
from jointz.rig.devices.interface import Wearer

GROUP = "jointz.controllers"
_PLACE = "jointz.rig.phase_controllers"
#: Of a parameter: the operator's page has room for no more.
_LONGEST_NAME = 48
#: Controller -> factory of the controllers of jointz; pyproject.toml registers the same.
BUILT_IN: Mapping[str, str] = {
    "zero_torque": f"{_PLACE}:make_zero_torque",
    "torque_replay": f"{_PLACE}:make_torque_replay",
    "kinematic_pd": f"{_PLACE}:make_kinematic_pd",
    "four_state": f"{_PLACE}:make_four_state",
    "quasi_stiffness": f"{_PLACE}:make_quasi_stiffness",
    "impedance_constant": f"{_PLACE}:make_impedance_constant",
    "impedance_per_phase": f"{_PLACE}:make_impedance_per_phase",
    "impedance_continuous": f"{_PLACE}:make_impedance_continuous",
}


class ControlState(NamedTuple):
    """Measurements that a controller gets in a tick."""

    time_s: float  # since the stretch began
    phase_pct: float  # of the gait cycle, 0 to 100; a controller is called while it is known only
    angle: float  # rad, of the goniometer
    velocity: float  # rad/s, of the actuator's output
    contact: float  # newest sample of the footswitch, in its own unit; NaN before the first
    stride: int  # accepted strides of the stretch so far


@dataclass(frozen=True, slots=True)
class ControlParameter:
    """A number of a controller that an operator may change while it runs."""

    value: float  # value at the beginning
    low: float  # least value
    high: float  # largest value
    rate_per_s: float  # largest change per second
    unit: str


@runtime_checkable
class Controller(Protocol):
    """A law that gives the torque of a condition, tick by tick."""

    @property
    def parameters(self) -> Mapping[str, ControlParameter]:
        """The parameters by name."""

    def torque(self, state: ControlState, values: Mapping[str, float]) -> float:
        """Return the torque, N*m, positive in the protocol's direction.

        ``values`` are those of the parameters now.
        """

    def describe(self) -> Mapping[str, Any]:
        """Return everything that is needed to know what ran, as plain JSON."""


class ControllerFactory(Protocol):
    """Makes a controller; raises DataError or ProtocolError if profile or settings do not fit."""

    def __call__(
        self, spec: ControllerSpec, *, protocol: ProtocolSpec, wearer: Wearer
    ) -> Controller:
        """Return the controller of a condition for a wearer, at the start of every stretch."""


def make_controller(spec: ControllerSpec, *, protocol: ProtocolSpec, wearer: Wearer) -> Controller:
    """Return the controller that a condition names, for a wearer."""
    entry = _entry(spec.name)
    source = f"controller '{spec.name}' ({entry.value})"
    factory = _loaded(entry, source)
    try:
        controller: Controller = factory(spec, protocol=protocol, wearer=wearer)
        valid = isinstance(controller, Controller)
        wrong = [*_wrong_parameters(controller), *_wrong_description(controller)] if valid else []
    except JointzError:
        raise
    except (Exception, SystemExit) as exc:
        raise DataError(f"{source}: could not be made ({type(exc).__name__}: {exc}).") from exc
    if not valid:
        raise DataError(
            f"{source}: expected a controller (parameters, torque, describe), got {controller!r}."
        )
    if wrong:
        raise DataError(f"{source}: {' '.join(wrong)}")
    return controller


def refuse_bad_controllers(protocol: ProtocolSpec, wearers: Iterable[Wearer]) -> None:
    """Make every controller of a protocol for every wearer; raise with all problems."""
    problems: dict[str, None] = {}
    for wearer in wearers:
        for i, condition in enumerate(protocol.conditions, start=1):
            if condition.controller is None:
                continue
            try:
                make_controller(condition.controller, protocol=protocol, wearer=wearer)
            except ProtocolError as exc:
                problems |= dict.fromkeys(f"conditions[{i}].{text}" for text in exc.problems)
            except DataError as exc:
                problems[f"conditions[{i}].controller: {exc}"] = None
    if problems:
        raise ProtocolError(protocol.name, list(problems))


def _entry(name: str) -> EntryPoint:
    entries = registered(GROUP, BUILT_IN)
    if name in entries:
        return entries[name]
    close = difflib.get_close_matches(name, entries, n=1)
    hint = f" Did you mean '{close[0]}'?" if close else ""
    raise DataError(f"name: expected one of {', '.join(sorted(entries))}; got '{name}'.{hint}")


def _loaded(entry: EntryPoint, source: str) -> ControllerFactory:
    try:
        factory: ControllerFactory = entry.load()
    except Exception as exc:
        raise DataError(
            f"{source}: cannot be imported ({type(exc).__name__}: {exc}). Repair or remove the "
            "package that registers it."
        ) from exc
    if not callable(factory):
        raise DataError(f"{source}: expected a function that makes a controller, got {factory!r}.")
    return factory


def _wrong_description(controller: Controller) -> Iterator[str]:
    try:
        json.dumps(dict(controller.describe()), allow_nan=False)
    except (TypeError, ValueError) as exc:
        yield f"describe: expected plain JSON for the journal ({exc})."


def _wrong_parameters(controller: Controller) -> Iterator[str]:
    for name, one in controller.parameters.items():
        numbers = one.value, one.low, one.high, one.rate_per_s
        if not (isinstance(name, str) and name.isprintable() and 0 < len(name) <= _LONGEST_NAME):
            yield f"parameter {name!r}: expected a printable name of at most {_LONGEST_NAME}."
        unit: Any = one.unit
        if not isinstance(unit, str):
            yield f"parameter {name}: expected unit as text, got {unit!r}."
        if not all(map(isfinite, numbers)) or not one.low <= one.value <= one.high:
            yield f"parameter {name}: expected finite low <= value <= high, got {one}."
        elif one.rate_per_s <= 0.0:
            yield f"parameter {name}: expected rate_per_s > 0, got {one.rate_per_s:g}."
