"""Conversion of files to other formats, and of studies for other programs."""

import os
from dataclasses import dataclass
from pathlib import Path

from jointz.core.acquisition import Acquisition, Event, SignalGroup
from jointz.core.errors import DataError, OutputError, WriteError
from jointz.core.study import FilesSpec
from jointz.io.formats.registry import format_to_write, read_acquisition, write_acquisition
from jointz.io.text.column_names import READING
from jointz.results.base import Result

_STUDY_FILE = "study.toml"
_BIDS_FILE = "dataset_description.json"


@dataclass(frozen=True, slots=True)
class Conversion(Result):
    """Summary of a conversion."""

    source: str  # file or folder
    target: str
    kind: str  # format of the target
    content: tuple[str, ...]  # a line for each group of signals, or recording
    left_out: tuple[str, ...] = ()  # a sentence for each part that the target cannot hold
    notes: tuple[str, ...] = ()  # decisions of the reader

    def summary(self) -> str:
        """Return source, content, notes, left out parts and target, a line each."""
        lines = [f"Read: {self.source}", *(f"  {line}" for line in self.content)]
        lines += [f"Note: {note}" for note in self.notes]
        lines += [f"Left out: {sentence}" for sentence in self.left_out]
        return "\n".join([*lines, f"Written: {self.target} ({self.kind})"])


def convert(
    source: str | os.PathLike[str],
    target: str | os.PathLike[str],
    *,
    to: str | None = None,
    files: FilesSpec | None = None,
    lossy: bool = False,
    overwrite: bool = False,
) -> Conversion:
    """Convert a file to the format of the target's suffix, or a study to BIDS.

    Parameters
    ----------
    source : path
        A file of any format that jointz reads, a study folder, or a Motion-BIDS folder.
    target : path
        The file to write; its suffix gives the format.
    to : {"bids"}, optional
        Write a Motion-BIDS folder instead.
    files : FilesSpec, optional
        Layout of a text file.
    lossy : bool
        Leave out what the target cannot hold.
    overwrite : bool
        Replace an existing target.

    Returns
    -------
    Conversion
        Content, notes and left out parts.

    Raises
    ------
    DataError
        If the source cannot be read, or the target cannot hold all of it without ``lossy``.
    OutputError
        If the target exists and ``overwrite`` is not set, or is the source.
    """
    origin, out = Path(source), Path(target)
    if to == "bids":
        return _to_bids(origin, out, overwrite=overwrite)
    if _is_study(origin):
        raise DataError(
            f"{origin}: a study becomes a BIDS folder (--to bids). Name one of its files to write "
            "another format.",
            path=str(origin),
        )
    kind = format_to_write(out).name  # refuses other formats before anything is read
    _check_target(origin, out, overwrite=overwrite)
    content = _bids_content(origin) if origin.is_dir() else read_acquisition(origin, files)
    left_out = write_acquisition(content, out, lossy=lossy)
    n_events = [f"{len(content.events)} events"] if content.events else []
    return Conversion(
        source=str(origin),
        target=str(out),
        kind=kind,
        content=(*map(_group_line, content.groups), *n_events),
        left_out=tuple(left_out),
        notes=tuple(text for key, text in content.metadata.items() if key.startswith(READING)),
    )


def _check_target(source: Path, target: Path, *, overwrite: bool) -> None:
    if not target.exists():
        if not target.parent.is_dir():
            cause = FileNotFoundError(2, "no such folder")
            raise WriteError(str(target), cause, f"Make the folder {target.parent} first.")
        return
    if target.is_dir():
        raise OutputError(f"{target}: is a folder; expected the name of a file. Give another name.")
    if source.exists() and target.samefile(source):
        raise OutputError(f"{target}: is the file to be read. Give another name.")
    if not overwrite:
        raise OutputError(
            f"{target}: exists. Give another name, or replace it: --overwrite, overwrite=True."
        )
    if source.is_dir() and target.resolve().is_relative_to(source.resolve()):
        raise OutputError(
            f"{target}: is in the folder to be read, whose files are kept. Give a name outside it."
        )


def _is_study(source: Path) -> bool:
    return (source.is_dir() and (source / _STUDY_FILE).is_file()) or source.name == _STUDY_FILE


def _to_bids(source: Path, target: Path, *, overwrite: bool) -> Conversion:
    from jointz.conversion.bids_study import write_bids

    if not _is_study(source):
        raise DataError(
            f"{source}: a BIDS folder is made of a study; expected a folder with study.toml. "
            "jointz inspect proposes one.",
            path=str(source),
        )
    written = write_bids(source, target, overwrite=overwrite)
    return Conversion(
        source=str(source),
        target=str(target),
        kind="Motion-BIDS",
        content=(written.headline(), *written.recordings),
        notes=written.notes,
    )


def _bids_content(source: Path) -> Acquisition:
    """Return all recordings of a BIDS folder as groups of one content."""
    if not (source / _BIDS_FILE).is_file():
        raise DataError(
            f"{source}: expected a file, a study (study.toml) or a BIDS folder ({_BIDS_FILE}), "
            "found another folder. Name one of its files.",
            path=str(source),
        )
    from jointz.io.bids.bids_read import read_bids

    recordings = read_bids(source)
    groups: list[SignalGroup] = []
    events: list[Event] = []
    metadata: dict[str, str] = {}
    for name, content in recordings.items():
        for group in content.groups:
            full = name if len(content.groups) == 1 else f"{name}.{group.name}"
            parts = group.signals, group.rate_hz, group.start_s, group.time_s
            groups.append(SignalGroup(full, *parts))
        for key, value in content.metadata.items():  # a note of the reader stays one
            metadata[f"{key}.{name}" if key.startswith(READING) else f"{name}.{key}"] = value
        if len(recordings) == 1:
            events += content.events
        else:
            metadata |= _event_lines(name, content)
    return Acquisition(tuple(groups), tuple(events), metadata)


def _event_lines(name: str, content: Acquisition) -> dict[str, str]:
    """Return the events of one of several recordings as metadata, because clocks differ."""
    if not content.events:
        return {}
    where = f"events of several recordings are kept as metadata, such as {name}.events"
    lines = [f"{e.time_s!r} {e.duration_s!r} {e.label}" for e in content.events]
    return {f"{name}.events": "\n".join(lines), f"{READING}events": where}


def _group_line(group: SignalGroup) -> str:
    clock = "no clock"
    time = group.times_s()
    if group.rate_hz is not None:
        clock = f"{group.rate_hz:g} Hz from {group.start_s:g} s"
    elif time is not None and len(time):
        clock = f"time stamps from {time[0]:g} to {time[-1]:g} s"
    count = len(group.signals)
    what = f"{count} signal{'' if count == 1 else 's'} of {group.n_samples} samples, {clock}"
    return f"{group.name}: {what}" if group.name else what
