"""A study as a Motion-BIDS folder: recordings in SI and in the study's directions."""

import os
from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import xarray as xr

from jointz.analysis.study_pulses import (
    amplitude_unit,
    given_pulses,
    positive_direction,
    pulse_tables,
)
from jointz.core.errors import DataError, OutputError
from jointz.core.provenance import own_version
from jointz.core.study import ParticipantSpec, RecordingSpec, Study
from jointz.gait.timestamps import rate_hz
from jointz.identify.preparation.pulses import Pulse
from jointz.io.bids.bids_read import DESCRIPTION
from jointz.io.bids.bids_tables import NOTHING, label_of
from jointz.io.bids.bids_write import MotionChannel, MotionRecording, json_text, write_motion
from jointz.io.formats.columns import file_sha256
from jointz.io.new_folder import new_folder, write_marker
from jointz.io.recordings import read_recording
from jointz.io.small_files import read_json
from jointz.io.study_reader import open_study

BIDS_VERSION = "1.10.0"
#: Marks a folder of jointz; it is listed in .bidsignore.
MARKER = "jointz.json"
MADE_BY = "bids"
_HASHES = "sha256"
_MOST_SHOWN = 3
_PERSON = {
    "mass_kg": ("Body mass.", "kg"),
    "height_m": ("Body height.", "m"),
    "limb_mass_kg": ("Mass of all that moves with the segment beyond the joint.", "kg"),
    "limb_centre_m": ("Distance of that mass's centre from the joint.", "m"),
}
_DESCRIPTIONS: Mapping[str, str] = {
    "angle": "Joint angle.",
    "velocity": "Angular velocity of the joint; its axis is the joint's own, hence MISC.",
    "torque": "Torque on the joint; BIDS has no channel type for torques, hence MISC.",
    "sensor_torque": "Torque of a second sensor; BIDS has no channel type for torques.",
    "joint_moment": "Internal moment of the joint; BIDS has no channel type for torques.",
    "command": "Commanded perturbation torque, 0 outside pulses.",
    "reference": "Reference that the device followed.",
    "current": "Motor current.",
    "motor_angle": "Angle of the actuator's output, after the gear.",
    "motor_velocity": "Angular velocity of the actuator's output, after the gear.",
    "motor_acceleration": "Angular acceleration of the actuator's output, after the gear.",
    "contact": "Footswitch, high on the ground.",
    "ground_reaction_force": "Vertical force under the foot, positive upward.",
    "cycle": "Stride counter.",
}
_DEVICE = ("command", "reference", "current", "sensor_torque")


@dataclass(frozen=True, slots=True)
class BidsWritten:
    """Summary of a BIDS folder."""

    folder: str
    participants: tuple[str, ...]  # labels, ``sub-...``
    recordings: tuple[str, ...]  # names of the recordings, without suffix
    n_events: int  # number of pulses in all events files
    notes: tuple[str, ...] = ()  # notes on missing information

    def summary(self) -> str:
        """Return a short text."""
        notes = (f"  Note: {note}" for note in self.notes)
        return "\n".join([self.headline(), *(f"  {name}" for name in self.recordings), *notes])

    def headline(self) -> str:
        """Return the numbers of recordings, participants and pulses."""
        return (
            f"{self.folder}: {len(self.recordings)} recording(s) of {len(self.participants)} "
            f"participant(s), {self.n_events} pulse(s), Motion-BIDS {BIDS_VERSION}"
        )

    def to_dict(self) -> dict[str, Any]:
        """Return plain values, ready for JSON."""
        listed = {n: list(getattr(self, n)) for n in ("participants", "recordings", "notes")}
        return {"folder": self.folder, "n_events": self.n_events, **listed}


def write_bids(
    study: str | os.PathLike[str], out: str | os.PathLike[str], *, overwrite: bool = False
) -> BidsWritten:
    """Write a study as a Motion-BIDS folder, whole or not at all.

    Parameters
    ----------
    study : path
        The folder that holds ``study.toml``; it is not modified.
    out : path
        The folder to make.
    overwrite : bool
        Replace a BIDS folder of jointz that was not changed since.

    Returns
    -------
    BidsWritten
        Participants, recordings, number of events and notes.

    Raises
    ------
    DataError
        If recordings cannot be read, or BIDS cannot hold them.
    OutputError
        If ``out`` must be kept.
    """
    opened = open_study(study)
    target = Path(out)
    with new_folder(target, marker=MARKER, overwrite=overwrite, made_by=MADE_BY) as folder:
        _check_unchanged(target)
        people, notes = _people(opened)
        written, more = _write_recordings(opened, folder, people)
        notes += more
        _write_top(opened, folder, people)
        made = {"made_by": MADE_BY, "study_sha256": opened.sha256, _HASHES: _hashes(folder)}
        write_marker(folder, MARKER, made)
    return BidsWritten(
        folder=str(target),
        participants=tuple(f"sub-{label}" for label in people.values()),
        recordings=tuple(written),
        n_events=sum(written.values()),
        notes=tuple(notes),
    )


def _people(study: Study) -> tuple[dict[str, str], list[str]]:
    """Return the labels of participants with a recording, and a note about the others."""
    labels = _labels((p.id for p in study.spec.participants), "participants")
    recorded = {entry.participant for entry in study.spec.recordings}
    others = [name for name in labels if name not in recorded]
    # BIDS requires a folder for each participant.
    note = f"without a recording, and so not in participants.tsv: {', '.join(others)}."
    people = {name: label for name, label in labels.items() if name in recorded}
    return people, [note] if others else []


def _hashes(folder: Path) -> dict[str, str]:
    """Return the hash of every file in a folder but the marker."""
    files = sorted(p for p in folder.rglob("*") if p.is_file() and p != folder / MARKER)
    return {p.relative_to(folder).as_posix(): file_sha256(p) for p in files}


def _check_unchanged(folder: Path) -> None:
    """Refuse to replace a folder whose files were changed since jointz wrote them."""
    if not (folder / MARKER).is_file():
        return
    written = read_json(folder / MARKER, "Name another folder.").get(_HASHES, {})
    hashes = _hashes(folder)
    changed = [name for name, sha256 in hashes.items() if written.get(name, sha256) != sha256]
    if changed:
        more = ", ..." if len(changed) > _MOST_SHOWN else ""
        raise OutputError(
            f"{folder}: changed since jointz wrote it, and kept: "
            f"{', '.join(changed[:_MOST_SHOWN])}{more}. Move what you want to keep, or name "
            "another folder."
        )


def _labels(names: Iterable[str], what: str) -> dict[str, str]:
    """Return the label of each name; labels must differ."""
    labels = {name: label_of(name) for name in names}
    # Some systems do not distinguish S01 and s01 as file names.
    counts = Counter(label.casefold() for label in labels.values())
    same = [name for name, label in labels.items() if counts[label.casefold()] > 1 or not label]
    if same:
        raise DataError(
            f"study.toml, {what}: BIDS names consist of letters and digits, without regard to "
            f"capitals, so that {', '.join(map(repr, same))} have no unique name. Rename them."
        )
    return labels


def _write_recordings(
    study: Study, folder: Path, people: Mapping[str, str]
) -> tuple[dict[str, int], list[str]]:
    """Write all recordings; return their numbers of pulses by name, and notes."""
    written: dict[str, int] = {}
    notes: list[str] = []
    sessions = _labels(dict.fromkeys(r.session for r in study.spec.recordings if r.session),
                       "recordings, session")  # fmt: skip
    cells = Counter(_cell(entry) for entry in study.spec.recordings)
    in_files = any(entry.condition is None for entry in study.spec.recordings)
    runs: Counter[tuple[str, ...]] = Counter()
    for entry in study.spec.recordings:
        pieces = read_recording(study, entry)
        tables = pulse_tables(study, entry, pieces)
        several = in_files or len(pieces) > 1 or cells[_cell(entry)] > 1
        for piece, table in zip(pieces, tables, strict=True):
            entities = _entities(study, entry, piece, people, sessions)
            runs[tuple(entities.values())] += 1
            if several:
                entities["run"] = str(runs[tuple(entities.values())])
            pulses, note = given_pulses(study, piece, table)
            recording = _recording(study, piece, entities, pulses)
            write_motion(recording, folder)
            written[recording.stem] = len(recording.events)
            notes += [note] if note and note not in notes else []
    return written, notes


def _cell(entry: RecordingSpec) -> tuple[str, ...]:
    return (entry.participant, entry.session or "", entry.side or "", entry.condition or "")


def _entities(
    study: Study,
    entry: RecordingSpec,
    piece: xr.Dataset,
    people: Mapping[str, str],
    sessions: Mapping[str, str],
) -> dict[str, str]:
    return {
        "sub": people[entry.participant],
        **({"ses": sessions[entry.session]} if entry.session else {}),
        "task": study.spec.kind,
        "tracksys": label_of(study.spec.joint + (entry.side or "").capitalize()) or "joint",
        "acq": label_of(str(piece.attrs["condition"])),
    }


def _recording(
    study: Study, piece: xr.Dataset, entities: Mapping[str, str], pulses: Sequence[Pulse]
) -> MotionRecording:
    time = piece["time"].to_numpy()
    columns = ("onset_s", "duration_s", "amplitude", "timing_point")
    events = [{name: getattr(pulse, name) for name in columns} for pulse in pulses]
    return MotionRecording(
        entities=entities,
        time_s=time,
        nominal_hz=float(f"{rate_hz(time):.9g}"),
        channels=tuple(_channel(study, piece, str(name)) for name in piece.data_vars),
        sidecar=_sidecar(study, piece),
        told=_recording_metadata(study, piece),
        events=events,
        amplitude_unit=amplitude_unit(study),
    )


def _channel(study: Study, piece: xr.Dataset, name: str) -> MotionChannel:
    joint = f"{piece.attrs.get('side', '')}{study.spec.joint.capitalize()}"
    device = name in _DEVICE or name.startswith("motor_")
    return MotionChannel(
        name=name,
        values=piece[name].to_numpy(),
        kind="JNTANG" if name == "angle" else "MISC",
        unit=str(piece[name].attrs.get("units", "1")),
        tracked_point="device" if device else joint,
        description=_DESCRIPTIONS.get(name, "A channel of the study's own."),
        positive=positive_direction(study, name),
    )


def _sidecar(study: Study, piece: xr.Dataset) -> dict[str, Any]:
    spec, condition = study.spec, piece.attrs["condition"]
    return {
        "TaskDescription": f"{spec.kind}, {condition}: impedance of the {spec.joint}. "
        f"{_torque_note(study)}",
        "TrackingSystemName": f"{spec.joint} sensors",
        "Manufacturer": NOTHING,
        "ManufacturersModelName": NOTHING,
        "DeviceSerialNumber": NOTHING,
        "SoftwareVersions": f"written by jointz {own_version()}",
        "SubjectArtefactDescription": NOTHING,
    }


def _torque_note(study: Study) -> str:
    return (
        "Torques are torques on the joint, in N.m; Motion-BIDS has no channel type for torques, "
        f"so they are of type MISC. Angles and torques count positive in {study.spec.positive}."
    )


def _recording_metadata(study: Study, piece: xr.Dataset) -> dict[str, Any]:
    spec, attributes = study.spec, piece.attrs
    names = {"Condition": "condition", "Side": "side", "Session": "session", "Trial": "trial"}
    names |= {"SourceFile": "file", "SourceSHA256": "sha256"}
    return {
        "Joint": spec.joint,
        "PositiveDirection": spec.positive,
        "TorqueActsOn": "joint",
        **({"Coupling": spec.coupling} if spec.coupling else {}),
        **{key: str(attributes[name]) for key, name in names.items() if attributes.get(name)},
    }


# --- the files at the top -----------------------------------------------------------------------


def _write_top(study: Study, folder: Path, people: Mapping[str, str]) -> None:
    spec = study.spec
    description = {
        "Name": f"{spec.joint} impedance, {spec.kind}: {study.root.resolve().name}",
        "BIDSVersion": BIDS_VERSION,
        "DatasetType": "raw",
        "GeneratedBy": [{"Name": "jointz", "Version": own_version()}],
    }
    _write_text(folder / DESCRIPTION, json_text(description))
    recorded = [p for p in spec.participants if p.id in people]
    columns, about = _person_columns(recorded)
    rows = [_person_row(p, people[p.id], columns) for p in recorded]
    lines = [["participant_id", "study_id", *columns], *rows]
    _write_text(folder / "participants.tsv", "".join("\t".join(line) + "\n" for line in lines))
    _write_text(folder / "participants.json", json_text(about))
    _write_text(folder / "README", _readme(study, len(people)))
    _write_text(folder / ".bidsignore", f"{MARKER}\n")


def _person_columns(people: Sequence[ParticipantSpec]) -> tuple[list[str], dict[str, Any]]:
    """Return the columns with known values, and their descriptions."""
    known = [n for n in _PERSON if any(getattr(p, n) is not None for p in people)]
    about: dict[str, Any] = {"study_id": {"Description": "The participant's id in study.toml."}}
    about |= {n: {"Description": _PERSON[n][0], "Units": _PERSON[n][1]} for n in known}
    if any(p.group for p in people):
        known.append("group")
        about["group"] = {"Description": "The participant's group, as study.toml names it."}
    return known, about


def _person_row(person: ParticipantSpec, label: str, columns: Sequence[str]) -> list[str]:
    values = (getattr(person, name) for name in columns)
    cells = (NOTHING if v is None else " ".join(str(v).split()) for v in values)
    return [f"sub-{label}", " ".join(person.id.split()), *cells]


def _readme(study: Study, n_people: int) -> str:
    spec = study.spec
    return (
        f"Recordings of the {spec.joint} ({spec.kind}), written by jointz {own_version()} from a "
        f"study with {n_people} participant(s).\n\n"
        "Every *_motion.tsv holds SI units: angles in rad (type JNTANG), torques in N.m. "
        f"{_torque_note(study)}\n\n"
        "The condition of a recording (unperturbed, perturbed, no_device) is the label acq- of "
        "its name and the key Condition under Recording in its *_channels.json, where joint, side "
        "and signs stand, too; pulses are in *_events.tsv. Clocks that are not even have a "
        "channel 'time' with the exact stamps beside 'latency'.\n"
    )


def _write_text(path: Path, text: str) -> None:
    path.write_text(text, encoding="utf-8", newline="\n")
