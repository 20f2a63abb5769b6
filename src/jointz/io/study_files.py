"""Files and channels of a study, as ``study.toml`` names them."""

import os
import re
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from typing import TypeVar

from pydantic import BaseModel

from jointz.core.channels import HEEL_STRIKES, LABEL_CHANNELS
from jointz.core.errors import DataError
from jointz.core.study import ChannelSpec, RecordingSpec, Study, StudySpec

_VARIABLE = re.compile(r"\$\{(\w+)(?::-([^}]*))?\}|\$(\w+)")
_ALWAYS_THERE = (
    *("time", "angle", "velocity", "joint_moment", "contact", "ground_reaction_force"),
    HEEL_STRIKES,
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
    """Yield the path of a file named in a study; errors hide the values of its variables."""
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
    merged = {**own, **entry.joined_channels}
    channels = {n: in_part(channel, entry.part) for n, channel in merged.items()}
    files = _changed(study.spec.files, entry.files)
    spec = study.spec.model_copy(update={"channels": channels, "files": files})
    return replace(study, spec=spec)


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


def trigger_threshold(spec: StudySpec) -> str:
    """Return the stated threshold of the trigger as text, "" without one."""
    trigger = spec.channels.get("trigger")
    return "" if trigger is None or trigger.threshold is None else repr(trigger.threshold)
