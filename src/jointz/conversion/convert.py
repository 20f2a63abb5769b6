"""Any file into another format, and a study into what other programs read."""

import os
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from jointz.core.acquisition import Acquisition, Event, SignalGroup
from jointz.core.errors import DataError, OutputError, WriteError
from jointz.core.study import FilesSpec, Study
from jointz.io.formats.registry import format_of, read_acquisition, write_acquisition
from jointz.io.study_reader import data_file, open_study
from jointz.io.text.column_names import READING

_STUDY_FILE = "study.toml"
_BIDS_FILE = "dataset_description.json"


@dataclass(frozen=True, slots=True)
class Conversion:
    """What a conversion read, wrote and left out."""

    source: str  # the files or folders
    target: str
    kind: str  # of what was written
    content: tuple[str, ...]  # a line a group of signals, or a recording
    left_out: tuple[str, ...] = ()  # what the target cannot hold, a sentence each
    notes: tuple[str, ...] = ()  # what the reader had to decide

    def summary(self) -> str:
        """Return what was read, written and left out, a line each."""
        lines = [f"Read: {self.source}", *(f"  {line}" for line in self.content)]
        lines += [f"Note: {note}" for note in self.notes]
        lines += [f"Left out: {sentence}" for sentence in self.left_out]
        return "\n".join([*lines, f"Written: {self.target} ({self.kind})"])

    def to_dict(self) -> dict[str, Any]:
        """Return the same as plain values, for JSON."""
        return {
            "source": self.source,
            "target": self.target,
            "kind": self.kind,
            "content": list(self.content),
            "left_out": list(self.left_out),
            "notes": list(self.notes),
        }


def convert(
    source: str | os.PathLike[str],
    target: str | os.PathLike[str],
    *,
    to: str | None = None,
    files: FilesSpec | None = None,
    lossy: bool = False,
    overwrite: bool = False,
) -> Conversion:
    """Convert a file into the format of another's suffix, or a study into one file or BIDS.

    Parameters
    ----------
    source : path
        A file of any format that jointz reads, a study folder, or a Motion-BIDS folder.
    target : path
        What to write; its suffix says how.
    to : {"bids"}, optional
        Write a Motion-BIDS folder instead.
    files : FilesSpec, optional
        How a text file is laid out.
    lossy : bool
        Whether what the target cannot hold may be left out.
    overwrite : bool
        Whether a target that exists may be replaced.

    Returns
    -------
    Conversion
        What was read, written and left out.

    Raises
    ------
    DataError
        When the source cannot be read, or the target cannot hold it all and ``lossy`` is not
        given.
    OutputError
        When the target exists and ``overwrite`` is not given, or is the source.
    """
    came, goes = Path(source), Path(target)
    if to == "bids":
        return _to_bids(came, goes, overwrite=overwrite)
    format_of(goes)  # told before anything is read
    _check_target(came, goes, overwrite=overwrite)
    if _is_study(came):
        return _study_to_file(came, goes)
    content = _bids_content(came) if came.is_dir() else read_acquisition(came, files)
    lost = write_acquisition(content, goes, lossy=lossy)
    return Conversion(
        source=str(came),
        target=str(goes),
        kind=format_of(goes).name,
        content=_described(content),
        left_out=tuple(lost),
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
        raise OutputError(f"{target}: exists. Give another name, or --overwrite to replace it.")
    folder = source.parent if source.name == _STUDY_FILE else source
    if folder.is_dir() and target.resolve().is_relative_to(folder.resolve()):
        raise OutputError(
            f"{target}: is a file of the folder that is to be read, and kept. Give another name, "
            "or one outside it."
        )


def _check_recordings(study: Study, target: Path) -> None:
    """Refuse a target that a study reads, wherever it lies."""
    if not target.exists():
        return
    for entry in study.spec.recordings:
        for name in (entry.file, entry.perturbations):
            if name is not None and data_file(study.root, name).samefile(target):
                raise OutputError(
                    f"{target}: is a file of the study to be read. Give another name."
                )


def _is_study(source: Path) -> bool:
    return (source.is_dir() and (source / _STUDY_FILE).is_file()) or source.name == _STUDY_FILE


def _study_to_file(source: Path, target: Path) -> Conversion:
    if not target.name.lower().endswith(".mat"):
        raise DataError(
            f"{target.name}: a study of several recordings goes into a .mat file or a BIDS folder "
            "(--to bids). Convert its recordings one by one for other formats.",
            path=str(target),
        )
    from jointz.conversion.matlab_study import write_matlab_study

    study = open_study(source)
    _check_recordings(study, target)
    content, notes = write_matlab_study(study, target)
    return Conversion(
        source=str(source), target=str(target), kind="MATLAB .mat", content=content, notes=notes
    )


def _to_bids(source: Path, target: Path, *, overwrite: bool) -> Conversion:
    from jointz.conversion.bids_study import write_bids

    if not _is_study(source):
        raise DataError(
            f"{source}: a BIDS folder is made of a study; expected a folder with study.toml. Let "
            "jointz inspect propose one.",
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

    found = read_bids(source)
    groups: list[SignalGroup] = []
    events: list[Event] = []
    metadata: dict[str, str] = {}
    for name, content in found.items():
        for group in content.groups:
            own = name if len(content.groups) == 1 else f"{name}.{group.name}"
            groups.append(_renamed(group, own))
        if len(found) == 1:
            events += content.events
        metadata |= {_prefixed(name, key): value for key, value in content.metadata.items()}
        metadata |= _event_lines(name, content) if len(found) > 1 else {}
    return Acquisition(tuple(groups), tuple(events), metadata)


def _prefixed(name: str, key: str) -> str:
    """Return a key for one of several recordings; what the reader decided stays a note."""
    return f"{key}.{name}" if key.startswith(READING) else f"{name}.{key}"


def _renamed(group: SignalGroup, name: str) -> SignalGroup:
    return SignalGroup(name, group.signals, group.rate_hz, group.start_s, group.time_s)


def _event_lines(name: str, content: Acquisition) -> dict[str, str]:
    """Return events of one of several recordings as metadata: their clocks differ."""
    if not content.events:
        return {}
    where = f"events of several recordings are kept as metadata, such as {name}.events"
    lines = [f"{e.time_s!r} {e.duration_s!r} {e.label}" for e in content.events]
    return {f"{name}.events": "\n".join(lines), f"{READING}events": where}


def _described(content: Acquisition) -> tuple[str, ...]:
    lines = [_group_line(group) for group in content.groups]
    if content.events:
        lines.append(f"{len(content.events)} events")
    return tuple(lines)


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
