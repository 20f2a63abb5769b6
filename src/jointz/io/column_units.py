"""Unit of a column: the unit given for it, settled with the unit that the file states."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace

import numpy as np

from jointz.core.channels import (
    CHANNEL_UNITS,
    HEEL_STRIKES,
    LABEL_CHANNELS,
    RECORD_UNITS,
    UNITLESS_RECORD_COLUMNS,
)
from jointz.core.errors import DataError, UnitError
from jointz.core.study import ChannelSpec, RecordingSpec, StudySpec
from jointz.core.units import conversion, si_unit_of
from jointz.io.text.column_arguments import Column
from jointz.io.text.column_names import EITHER, known_unit_in_name, written_unit

#: Units of channels that may be given per body mass, and how that is written.
PER_MASS, OVER_MASS = ("N*m", "N"), "/kg"

#: Unit of what is counted in samples.
SAMPLE = "sample"

#: SI unit of a channel, with factor and offset to it: ``si = factor * value + offset``.
Unit = tuple[str, float, float]


@dataclass(frozen=True, slots=True)
class ColumnUnit:
    """Unit of a column and its conversion: ``si = factor * value + offset``."""

    si_unit: str
    factor: float
    offset: float
    text: str  # as given, else as the file states it, else SI

    def in_si(self, values: np.ndarray, *, inverted: bool = False) -> np.ndarray:
        """Return values of the column in SI, with the opposite sign if ``inverted``."""
        sign = -1.0 if inverted else 1.0
        factor, offset = sign * self.factor, sign * self.offset
        return values if (factor, offset) == (1.0, 0.0) else factor * values + offset


def unit_in_study(
    spec: StudySpec,
    entry: RecordingSpec,
    channel: tuple[str, ChannelSpec],
    units: Mapping[str, str],
    *,
    file: str,
) -> ColumnUnit:
    """Return the unit of a study's channel; the factor includes its scale and the body mass."""
    name, column = channel
    if name == "trigger":  # its levels are compared with a threshold in the same unit
        return ColumnUnit(column.unit or "1", 1.0, 0.0, column.unit or "1")
    stated = "" if name == "contact" else stated_unit(name, str(column.column), units, column.unit)
    where = f"{file}, channel '{name}'"
    if stated and column.scale is not None:
        if column.unit is None:
            raise UnitError(
                f"{where}: the file says {stated!r}, and the channel has a scale. Give unit: that "
                "of the numbers times scale.",
                channel=name,
            )
        stated = ""
    try:
        unit = _settle(
            name,
            column.unit,
            stated,
            _allowed(name, column.kind),
            (
                "study.toml",
                "Correct one of them; scale = 1 beside unit replaces a wrong unit of the file.",
                lambda unit: f'unit = "{unit}" under [channels.{name}]',
            ),
        )
    except UnitError as exc:
        raise UnitError(f"{where}: {exc}", channel=name) from exc
    si_unit, factor = unit.si_unit, unit.factor
    if name in CHANNEL_UNITS and si_unit.endswith(OVER_MASS):
        si_unit, factor = si_unit.removesuffix(OVER_MASS), factor * _mass_of(spec, entry, name)
    return replace(unit, si_unit=si_unit, factor=factor * column.factor)


def unit_in_record(name: str, column: Column, units: Mapping[str, str], *, file: str) -> ColumnUnit:
    """Return the unit of a column named in a command or in :func:`jointz.read`."""
    if name in UNITLESS_RECORD_COLUMNS:
        return ColumnUnit("1", 1.0, 0.0, "1")
    stated = "" if column.factor is not None else stated_unit(name, column.name, units, column.unit)
    try:
        unit = _settle(
            name,
            column.unit or None,
            stated,
            (RECORD_UNITS[name],),
            (
                f"'{column.name}:{column.unit}'",
                f"Leave :{column.unit} out; if the unit of the file is wrong, write "
                f"'{column.name}:1*{column.unit}'.",
                lambda unit: f"'{column.name}:{unit}'",
            ),
        )
    except UnitError as exc:
        raise UnitError(f"{file}, column '{column.name}', {name}: {exc}", channel=name) from exc
    return replace(unit, factor=unit.factor * (1.0 if column.factor is None else column.factor))


def stated_unit(name: str, column: str, units: Mapping[str, str], given: str | None = None) -> str:
    """Return the unit that a file states for a column.

    What the end of a name says, as in ``knee_deg``, counts where no other unit is given.
    """
    if stated := units.get(column) or known_unit_in_name(column):
        return stated
    written = "" if given else written_unit(column)
    si_units = CHANNEL_UNITS.get(name) or (RECORD_UNITS.get(name, ""),)
    quantity = si_unit_of(written)[0].removesuffix(OVER_MASS)
    return written if written and quantity in si_units else ""


def same_unit(unit: str, other: str, si_unit: str) -> bool:
    """Return whether two units are one; a unit that cannot be converted is no other."""
    try:
        both = conversion(unit, si_unit), conversion(other, si_unit)
    except UnitError:
        return False
    return np.allclose(*both, rtol=1e-9, atol=0.0)


def channel_unit(name: str, unit: str, *, kind: str | None = None) -> Unit:
    """Return the SI unit of a channel, with factor and offset to it."""
    if name == HEEL_STRIKES:
        return ("s", *((1.0, 0.0) if unit == SAMPLE else conversion(unit, "s")))
    if name == "trigger":
        return (unit, 1.0, 0.0)
    return ("1", 1.0, 0.0) if name in LABEL_CHANNELS else _in_si(name, unit, _allowed(name, kind))


def _settle(
    name: str,
    given: str | None,
    stated: str,
    allowed: tuple[str, ...] | None,
    texts: tuple[str, str, Callable[[str], str]],
) -> ColumnUnit:
    """Settle the unit given against the unit of the file; SI if there is neither."""
    source, remedy, answer = texts
    candidates = stated.split(EITHER) if stated else []
    if given is None:
        if len(candidates) > 1:
            which, answers = " and ".join(candidates), " or ".join(map(answer, candidates))
            raise UnitError(f"the file states two units, {which}. Which is right? Give {answers}.")
        if not stated:
            si_unit = (allowed or ("1",))[0]
            return ColumnUnit(si_unit, 1.0, 0.0, si_unit)
        return ColumnUnit(*_in_si(name, stated, allowed), stated)
    si_unit, factor, offset = _in_si(name, given, allowed)
    if not candidates:
        return ColumnUnit(si_unit, factor, offset, given)
    for unit in candidates:
        if same_unit(unit, given, si_unit):
            return ColumnUnit(si_unit, *conversion(unit, si_unit), given)
    raise UnitError(f"the file says {stated!r}, {source} says {given!r}. {remedy}")


def _allowed(name: str, kind: str | None) -> tuple[str, ...] | None:
    """Return the SI units that a channel may have; None for any."""
    if name == "contact":
        return ("V",) if kind == "voltage" else ("1",)
    allowed = CHANNEL_UNITS.get(name)
    if allowed is not None and allowed[-1] in PER_MASS:
        return (*allowed, f"{allowed[-1]}{OVER_MASS}")
    return allowed


def _in_si(name: str, unit: str, allowed: tuple[str, ...] | None) -> Unit:
    if allowed is None:
        return si_unit_of(unit)
    failures = []
    for si_unit in allowed:
        try:
            return (si_unit, *conversion(unit, si_unit))
        except UnitError as exc:
            failures.append(exc)
    if name == "command" and OVER_MASS in allowed[-1]:
        raise UnitError(
            f"{failures[0]} If the channel is a trigger and no torque, call it [channels.trigger]."
        )
    raise failures[0]


def _mass_of(spec: StudySpec, entry: RecordingSpec, name: str) -> float:
    """Return the mass (kg) by which a channel per body mass is multiplied."""
    mass_kg = spec.participant(entry.participant).mass_kg
    if mass_kg is None:
        raise DataError(
            f"{entry.file}, channel '{name}': is per body mass. Give mass_kg of participant "
            f"'{entry.participant}'.",
            path=entry.file,
            channel=name,
        )
    return mass_kg
