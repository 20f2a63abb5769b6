"""Parser of columns and quantities in commands: ``COL[:unit]`` and ``VALUE[:unit]``."""

from dataclasses import dataclass

from jointz.core.channels import CHANNEL_UNITS
from jointz.core.errors import DataError, UnitError
from jointz.io.text.units import conversion

#: SI units of the columns; an acceleration is no channel of a study.
SI_UNITS = {name: units[0] for name, units in CHANNEL_UNITS.items()} | {
    "acceleration": "rad/s^2",
    "rotor-inertia": "kg*m^2",
    "smooth-velocity": "rad/s",
}


@dataclass(frozen=True, slots=True)
class Column:
    """A column of a file and its unit."""

    name: str  # the column
    unit: str  # as written; SI where nothing was


def parse_column(text: str, channel: str, columns: list[str] | None = None) -> Column:
    """Read ``COL[:unit]``."""
    si_unit = SI_UNITS[channel]
    if columns is not None and text in columns:
        return Column(text, si_unit)
    name, colon, unit = text.rpartition(":")
    if not colon:
        return Column(text, si_unit)
    _conversion(unit, channel, text)
    return Column(name, unit)


def parse_quantity(text: str, quantity: str) -> float:
    """Read ``VALUE[:unit]``."""
    number, _, unit = text.partition(":")
    factor, offset = _conversion(unit or SI_UNITS[quantity], quantity, text)
    try:
        return factor * float(number) + offset
    except ValueError as exc:
        raise DataError(
            f"--{quantity} {text}: expected VALUE[:unit] in {SI_UNITS[quantity]}, such as 0.01."
        ) from exc


def _conversion(unit: str, channel: str, text: str) -> tuple[float, float]:
    try:
        return conversion(unit, SI_UNITS[channel])
    except UnitError as exc:
        raise UnitError(f"--{channel} {text}: {exc}", channel=channel) from exc
