"""Files and channels of a study, as ``study.toml`` names them."""

import os
import re
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from typing import TypeVar

from pydantic import BaseModel

from jointz.core.channels import CHANNEL_UNITS, HEEL_STRIKES, LABEL_CHANNELS
from jointz.core.errors import DataError, UnitError
from jointz.core.study import ChannelSpec, RecordingSpec, Study, StudySpec
from jointz.core.units import conversion, si_unit_of

_VARIABLE = re.compile(r"\$\{(\w+)(?::-([^}]*))?\}|\$(\w+)")
_ALWAYS_THERE = (
    *("time", "angle", "velocity", "joint_moment", "contact", "ground_reaction_force"),
    HEEL_STRIKES,
    *LABEL_CHANNELS,
)

#: What stands in the name of a column for the key ``part`` of a recording.
PART = "{part}"

#: Unit of what is counted in samples.
SAMPLE = "sample"

#: Units of channels that may be given per body mass, and how that is written.
PER_MASS, OVER_MASS = ("N*m", "N"), "/kg"

_Model = TypeVar("_Model", bound=BaseModel)
#: SI unit of a channel, with factor and offset to it: ``si = factor * value + offset``.
Unit = tuple[str, float, float]


def data_file(root: Path, file: str) -> Path:
    """Return the path of a file named in a study, variables expanded."""

    def value(match: re.Match[str]) -> str:
        name = match.group(1) or match.group(3)
        expanded = os.environ.get(name, match.group(2))
        if expanded is None:
            raise DataError(f"'{file}': the environment variable {name} is not set. Set it.")
        return expanded

    return root / _VARIABLE.sub(value, file)


def shown_file(file: str) -> str:
    """Return the name people know a file by: what stands behind the folders of variables."""
    name = _VARIABLE.sub("$", file).rpartition("/")[2]
    return file if "$" in name or "$" not in file else name


@contextmanager
def named_as_written(root: Path, file: str) -> Iterator[Path]:
    """Give the path of a file named in a study; what its variables hold is not told in errors."""
    path = data_file(root, file)
    if "$" not in file:
        yield path
        return
    try:
        yield path
    except DataError as exc:
        written = {str(path): file, path.name: shown_file(file)}
        places = re.compile("|".join(map(re.escape, written)))
        exc.args = (places.sub(lambda found: written[found[0]], str(exc)), *exc.args[1:])
        exc.path = file
        raise exc from None


def needed_channels(
    names: Iterable[str], condition: str | None, *, moments_only: bool = False
) -> list[str]:
    """Return the channels that the file of a recording must hold."""
    used = (*_ALWAYS_THERE, "torque") if moments_only else _ALWAYS_THERE
    return [
        name
        for name in names
        if not (name == "condition" and condition) and (condition != "no_device" or name in used)
    ]


def study_of_recording(study: Study, entry: RecordingSpec) -> Study:
    """Return the study as it holds for one recording: its columns, its changes, its layout.

    Channels of joined files are among its channels.
    """
    changes = entry.channels or {}
    if not changes and entry.part is None and entry.files is None and not entry.joined:
        return study
    own = {n: _changed(channel, changes.get(n)) for n, channel in study.spec.channels.items()}
    joined = {n: c for one in entry.joined for n, c in one.channels.items() if n != "time"}
    channels = {n: in_part(channel, entry.part) for n, channel in {**own, **joined}.items()}
    files = _changed(study.spec.files, entry.files)
    spec = study.spec.model_copy(update={"channels": channels, "files": files})
    new = {n: unit_of_channel(n, channels[n]) for n in (*changes, *joined)}
    return replace(study, spec=spec, units={**study.units, **new})


def _changed(model: _Model, change: BaseModel | None) -> _Model:
    """Return a model with the fields that a change states."""
    if change is None:
        return model
    return model.model_copy(update={n: getattr(change, n) for n in change.model_fields_set})


def in_part(channel: ChannelSpec, part: str | None) -> ChannelSpec:
    """Return a channel with the recording's part in the names of its columns."""
    if part is None:
        return channel
    clock = None if channel.time is None else _column_in_part(channel.time, part)
    return _column_in_part(channel, part).model_copy(update={"time": clock})


def _column_in_part(model: _Model, part: str) -> _Model:
    column = getattr(model, "column", None)
    if not isinstance(column, str):
        return model
    return model.model_copy(update={"column": column.replace(PART, part)})


def unit_of_channel(name: str, channel: ChannelSpec) -> Unit:
    """Return the SI unit of a channel as the study states it, with factor and offset to it."""
    if channel.unit is None:
        return (CHANNEL_UNITS.get(name, ("1",))[0], 1.0, 0.0)
    return channel_unit(name, channel.unit, kind=channel.kind)


def check_scaled(file: str, name: str, channel: ChannelSpec, stated: str) -> None:
    """Refuse a scale without a unit where the file states one: that may be before or after it."""
    if channel.scale is not None and channel.unit is None:
        raise UnitError(
            f"{file}, channel '{name}': the file says {stated!r}, and the channel has a scale. "
            "Give unit: that of the numbers times scale.",
            channel=name,
        )


def mass_of(spec: StudySpec, entry: RecordingSpec, name: str) -> float:
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


def channel_unit(name: str, unit: str, *, kind: str | None = None) -> Unit:
    """Return the SI unit of a channel, with factor and offset to it."""
    if name in LABEL_CHANNELS:
        return ("1", 1.0, 0.0)
    if name == HEEL_STRIKES:
        return ("s", *((1.0, 0.0) if unit == SAMPLE else conversion(unit, "s")))
    if name == "trigger":  # its levels are compared with a threshold in the same unit
        return (unit, 1.0, 0.0)
    contact = ("V",) if kind == "voltage" else ("1",)
    allowed = contact if name == "contact" else CHANNEL_UNITS.get(name)
    if allowed is not None and allowed[-1] in PER_MASS:
        allowed = (*allowed, f"{allowed[-1]}{OVER_MASS}")
    if allowed is None:
        return si_unit_of(unit)
    failures = []
    for si_unit in allowed:
        try:
            return (si_unit, *conversion(unit, si_unit))
        except UnitError as exc:
            failures.append(exc)
    if name == "command":
        raise UnitError(
            f"{failures[0]} If the channel is a trigger and no torque, call it [channels.trigger]."
        )
    raise failures[0]


def trigger_threshold(spec: StudySpec) -> str:
    """Return the stated threshold of the trigger as text, "" without one."""
    trigger = spec.channels.get("trigger")
    return "" if trigger is None or trigger.threshold is None else repr(trigger.threshold)
