"""Files and channels of a study, as ``study.toml`` names them."""

import os
import re
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from pathlib import Path

from jointz.core.channels import CHANNEL_UNITS, LABEL_CHANNELS
from jointz.core.errors import DataError, UnitError
from jointz.core.units import conversion, si_unit_of

_VARIABLE = re.compile(r"\$\{(\w+)(?::-([^}]*))?\}|\$(\w+)")
_ALWAYS_THERE = (
    *("time", "angle", "velocity", "joint_moment", "contact", "ground_reaction_force"),
    *LABEL_CHANNELS,
)

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


def channel_unit(name: str, unit: str, *, kind: str | None = None) -> Unit:
    """Return the SI unit of a channel, with factor and offset to it."""
    if name in LABEL_CHANNELS:
        return ("1", 1.0, 0.0)
    contact = ("V",) if kind == "voltage" else ("1",)
    allowed = contact if name == "contact" else CHANNEL_UNITS.get(name)
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
            f"{failures[0]} If the channel is a trigger and no torque, leave it out, and write the "
            'onsets into a pulse table (perturbations = "FILE.csv" under [[recordings]]).'
        )
    raise failures[0]
