"""Comparison of all recordings of a folder's draft with their truths."""

import tomllib
import warnings
from pathlib import Path
from typing import Any

from benchmarks.awkward_files.compare import Fault, Reading, Stretch, faults_of
from benchmarks.awkward_files.truth import FileTruth, FolderTruth

import jointz
from jointz.core.errors import JointzError

Readings = dict[str, list[Reading]]  # by file


def readings_of(folder: Path) -> tuple[Readings, str]:
    """Return what the study of a folder reads from each file, or the message of its refusal."""
    readings: Readings = {}
    try:
        study = tomllib.loads((folder / "study.toml").read_text("utf-8"))
        recordings = jointz.open_study(folder).recordings
    except Exception as error:  # noqa: BLE001 - a crash is a verdict, not the end of the table
        return readings, message_of(error, folder)
    for i, recording in enumerate(recordings):
        reading = reading_of(recording, folder, angle_zero_rad(study, i))
        readings.setdefault(Path(recording.spec.file).name, []).append(reading)
    return readings, ""


def reading_of(recording: Any, folder: Path, zero_rad: float) -> Reading:
    """Return the parts and onsets of a recording, or the message of its refusal."""
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            stretches = tuple(Stretch.of(dataset, zero_rad) for dataset in recording.read())
            return Reading(stretches, onsets_s=_onsets(recording))
    except Exception as error:  # noqa: BLE001 - a crash is a verdict, not the end of the table
        return Reading(error=message_of(error, folder))


def _onsets(recording: Any) -> tuple[float, ...]:
    if not recording.spec.perturbations:
        return ()
    return tuple(map(float, recording.read_pulses()["onset_s"]))


def message_of(error: Exception, folder: Path) -> str:
    """Return a message on one line without the scratch folder, whose name is no statement."""
    kind = "" if isinstance(error, JointzError) else f"{type(error).__name__}: "
    return " ".join((kind + str(error)).replace(f"{folder}/", "").split())


def angle_zero_rad(study: dict[str, Any], i: int) -> float:
    """Return the zero that the analysis subtracts from the angle of recording `i`."""
    recording = study.get("recordings", [{}])[i : i + 1]
    name = recording[0].get("participant") if recording else None
    people = [p for p in study.get("participants", ()) if name is None or p.get("id") == name]
    tables = (study, *people[:1], *recording)
    zeros = [table.get("calibration", {}).get("angle_zero_rad", {}) for table in tables]
    values = [zero["value"] for zero in zeros if "value" in zero]
    return float(values[-1]) if values else 0.0


def folder_faults(readings: Readings, truth: FolderTruth) -> list[Fault]:
    """Return all differences of a folder's recordings from their truths."""
    faults = []
    for file, expected in truth.recordings.items():
        of_file = readings.get(file, [])
        if not of_file:
            faults.append(Fault(file, "not in the draft", is_number=False))
        for reading in of_file:
            here = faults_of(reading, expected.truth) + label_faults(reading, expected)
            faults += [Fault(f"{file} {f.channel}".strip(), f.text, f.is_number) for f in here]
    extra = [file for file in readings if file not in truth.recordings]
    faults += [Fault(file, "taken for a recording") for file in extra]
    return faults + _people_faults(readings, truth)


def label_faults(reading: Reading, expected: FileTruth) -> list[Fault]:
    """Return wrong labels; a label that is empty is missing, not wrong."""
    if not reading.stretches:
        return []
    first, truth = reading.stretches[0], expected.truth
    labels = (
        ("participant", first.participant, truth.participant),
        ("condition", first.condition, truth.condition),
        ("side", first.side, expected.side),
        ("session", first.session, expected.session),
    )
    faults = [
        Fault(name, f"is {text!r}, not {wanted!r}", is_number=bool(text))
        for name, text, wanted in labels
        if wanted and not same_label(name, text, wanted)
    ]
    if expected.no_onsets and reading.onsets_s:
        faults.append(Fault("pulses", "onsets read, not known"))
    return faults


def same_label(name: str, text: str, wanted: str) -> bool:
    """Return whether labels agree; S3, 03 and subject_3 are the same person."""
    if name in ("participant", "session"):
        return number(text) == number(wanted)
    return text == wanted


def number(text: str) -> int:
    """Return the number in a label, -1 without one."""
    digits = "".join(filter(str.isdigit, text))
    return int(digits) if digits else -1


def _people_faults(readings: Readings, truth: FolderTruth) -> list[Fault]:
    """One person must have one name in the draft."""
    names: dict[int, set[str]] = {}
    for file, expected in truth.recordings.items():
        known = names.setdefault(number(expected.truth.participant), set())
        known |= {r.stretches[0].participant for r in readings.get(file, []) if r.stretches}
    return [
        Fault("participant", f"one person under the names {sorted(known)}")
        for known in names.values()
        if len(known) > 1
    ]
