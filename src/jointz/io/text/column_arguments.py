"""Parser of columns and quantities in commands: ``COL[:[FACTOR*]unit]``, ``VALUE[:unit]``."""

import re
from dataclasses import dataclass

from jointz.core.channels import RECORD_UNITS, UNITLESS_RECORD_COLUMNS
from jointz.core.errors import DataError, UnitError
from jointz.core.units import conversion

#: Other quantity of a command -> SI unit.
_QUANTITIES = {"inertia": "kg*m^2", "rotor-inertia": "kg*m^2", "smooth-velocity": "rad/s"}


_FACTOR = re.compile(r"(?P<factor>[+-]?(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?)\*(?P<unit>.+)")


@dataclass(frozen=True, slots=True)
class Column:
    """A column of a file, and the unit given for it."""

    name: str  # name of the column
    unit: str = ""  # as written; "" if none was
    factor: float | None = None  # what makes the numbers those of the unit


def parse_column(text: str, channel: str, columns: list[str] | None = None) -> Column:
    """Read ``COL``, ``COL:UNIT`` or ``COL:FACTOR*UNIT``."""
    name, colon, unit = text.rpartition(":")
    if not colon or channel in UNITLESS_RECORD_COLUMNS or (columns is not None and text in columns):
        return Column(text)
    factor = None
    if scaled := _FACTOR.fullmatch(unit.strip()):
        factor, unit = float(scaled["factor"]), scaled["unit"]
        if not 0.0 < abs(factor) < float("inf"):
            raise UnitError(f"{channel} {text}: expected a factor other than 0.", channel=channel)
    _conversion(unit, channel, text)
    return Column(name, unit, factor)


def parse_quantity(text: str, quantity: str) -> float:
    """Read ``VALUE[:unit]``."""
    number, _, unit = text.partition(":")
    factor, offset = _conversion(unit or _QUANTITIES[quantity], quantity, text)
    try:
        return factor * float(number) + offset
    except ValueError as exc:
        raise DataError(
            f"--{quantity} {text}: expected VALUE[:unit] in {_QUANTITIES[quantity]}, such as 0.01."
        ) from exc


def _conversion(unit: str, channel: str, text: str) -> tuple[float, float]:
    try:
        return conversion(unit, {**RECORD_UNITS, **_QUANTITIES}[channel])
    except UnitError as exc:
        option = "--" if channel in _QUANTITIES else ""
        raise UnitError(f"{option}{channel} {text}: {exc}", channel=channel) from exc
