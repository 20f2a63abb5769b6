"""Files and channels of a study, as ``study.toml`` names them."""

import os
import re
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from typing import TypeVar

from pydantic import BaseModel

from jointz.core.channels import LABEL_CHANNELS
from jointz.core.errors import DataError
from jointz.core.study import ChannelSpec, RecordingSpec, Study
from jointz.io.column_units import channel_unit

_VARIABLE = re.compile(r"\$\{(\w+)(?::-([^}]*))?\}|\$(\w+)")
_ALWAYS_THERE = (
    *("time", "angle", "velocity", "joint_moment", "contact", "ground_reaction_force"),
    *LABEL_CHANNELS,
)

#: What stands in the name of a column for the key ``part`` of a recording.
PART = "{part}"

_Model = TypeVar("_Model", bound=BaseModel)


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
    """Return the study as it holds for one recording: its columns, its changes, its layout."""
    changes = entry.channels or {}
    if not changes and entry.part is None and entry.files is None:
        return study
    channels = {
        name: _in_part(_changed(channel, changes.get(name)), entry.part)
        for name, channel in study.spec.channels.items()
    }
    units = {
        name: channel_unit(name, unit, kind=channels[name].kind)
        for name, change in changes.items()
        if (unit := change.unit) is not None
    }
    files = _changed(study.spec.files, entry.files)
    spec = study.spec.model_copy(update={"channels": channels, "files": files})
    return replace(study, spec=spec, units={**study.units, **units})


def _changed(model: _Model, change: BaseModel | None) -> _Model:
    """Return a model with the fields that a change states."""
    if change is None:
        return model
    return model.model_copy(update={n: getattr(change, n) for n in change.model_fields_set})


def _in_part(channel: ChannelSpec, part: str | None) -> ChannelSpec:
    if part is None or not isinstance(channel.column, str):
        return channel
    return channel.model_copy(update={"column": channel.column.replace(PART, part)})
