"""Parser of columns and quantities in commands: ``COL[:unit]`` and ``VALUE[:unit]``."""

from dataclasses import dataclass

from jointz.core.channels import RECORD_UNITS, UNITLESS_RECORD_COLUMNS
from jointz.core.errors import DataError, UnitError
from jointz.core.units import conversion
from jointz.io.text.column_names import known_unit_in_name

#: Other quantity of a command -> SI unit.
_QUANTITIES = {"inertia": "kg*m^2", "rotor-inertia": "kg*m^2", "smooth-velocity": "rad/s"}


@dataclass(frozen=True, slots=True)
class Column:
    """A column of a file and its unit."""

    name: str  # name of the column
    unit: str  # as written; the SI unit of the channel if none was


def parse_column(text: str, channel: str, columns: list[str] | None = None) -> Column:
    """Read ``COL[:unit]``; without, the unit that the column's name ends in, else SI."""
    if channel in UNITLESS_RECORD_COLUMNS:
        return Column(text, "1")
    name, colon, unit = text.rpartition(":")
    if not colon or (columns is not None and text in columns):
        return Column(text, _unit_in(text, channel) or RECORD_UNITS[channel])
    stated, in_name = _conversion(unit, channel, text), _unit_in(name, channel)
    if in_name and _conversion(in_name, channel, text) != stated:
        raise UnitError(
            f"{channel}: column '{name}' states another unit than {unit}. Leave :{unit} out, or "
            "rename the column.",
            channel=channel,
        )
    return Column(name, unit)


def _unit_in(name: str, channel: str) -> str:
    """Return the unit at the end of a column's name, as in ``knee [deg]`` or ``knee:deg``."""
    if unit := known_unit_in_name(name):
        _conversion(unit, channel, name)
        return unit
    after = name.rpartition(":")[2]
    try:
        conversion(after, RECORD_UNITS[channel])
    except UnitError:
        return ""
    return after if ":" in name else ""


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
