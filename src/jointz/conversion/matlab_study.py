"""Study as one MATLAB file: recordings in SI and in the study's directions."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from jointz.analysis.participant_jobs import read_participant
from jointz.analysis.study_pulses import given_pulses, positive_direction
from jointz.core.study import ParticipantSpec, Study
from jointz.core.whole_file import whole_file
from jointz.identify.preparation.pulses import Pulse
from jointz.identify.preparation.sources import RecordingInput
from jointz.io.formats.matlab_format import (
    STUDY,
    cells,
    column,
    field_names,
    number_or_empty,
    struct_bytes,
)

_ATTRIBUTES = ("participant", "condition", "session", "side", "trial", "file", "sha256")
_PERSON_NUMBERS = ("mass_kg", "height_m", "limb_mass_kg", "limb_centre_m")


def write_matlab_study(study: Study, path: Path) -> tuple[tuple[str, ...], tuple[str, ...]]:
    """Write all recordings of a study into one struct ``jointz``; return their lines and notes."""
    spec = study.spec
    recordings, lines, notes = [], [], []
    for person in spec.participants:
        for source in read_participant(study, person.id, {}):
            pulses, note = given_pulses(study, source.recording, source.pulse_table)
            recordings.append(_recording(study, source, pulses))
            lines.append(_line(source, pulses))
            notes += [note] if note else []
    toml = (study.root / "study.toml").read_text(encoding="utf-8")
    content = {
        "version": STUDY,
        "kind": spec.kind,
        "joint": spec.joint,
        "positive": spec.positive,
        "torque_acts_on": "joint",
        "participants": _struct_array([_person(person) for person in spec.participants]),
        "recordings": _struct_array(recordings),
        "study_toml": toml,
    }
    data = struct_bytes(content, path)
    with whole_file(path, "Make room or name another place.") as partial:
        partial.write_bytes(data)
    return tuple(lines), tuple(notes)


def _recording(study: Study, source: RecordingInput, pulses: Sequence[Pulse]) -> dict[str, Any]:
    recording = source.recording
    names = [str(name) for name in recording.data_vars]
    signals = {
        field: {
            "name": name,
            "unit": str(recording[name].attrs.get("units", "")),
            "positive": positive_direction(study, name),
            "values": column(recording[name].to_numpy()),
        }
        for field, name in zip(field_names(names), names, strict=True)
    }
    return {
        **{key: str(recording.attrs.get(key, "")) for key in _ATTRIBUTES},
        "n": float(recording.sizes["time"]),
        "time": column(recording["time"].to_numpy()),
        "signals": signals,
        "pulses": _pulse_struct(pulses),
    }


def _pulse_struct(pulses: Sequence[Pulse]) -> Mapping[str, Any]:
    rows = [(pulse.onset_s, pulse.duration_s, pulse.amplitude) for pulse in pulses]
    table = np.array(rows, dtype=np.float64).reshape(-1, 3)
    return {
        "onset_s": table[:, :1],
        "duration_s": table[:, 1:2],
        "amplitude": table[:, 2:],
        "timing_point": cells(pulse.timing_point for pulse in pulses),
    }


def _person(person: ParticipantSpec) -> dict[str, Any]:
    numbers = {name: number_or_empty(getattr(person, name)) for name in _PERSON_NUMBERS}
    return {"id": person.id, **numbers, "group": person.group or ""}


def _struct_array(entries: Sequence[Mapping[str, Any]]) -> np.ndarray:
    """Return 1 x n structs of the same fields."""
    fields = list(entries[0]) if entries else []
    array = np.empty((1, len(entries)), dtype=[(name, object) for name in fields])
    for k, entry in enumerate(entries):
        for name in fields:
            array[0, k][name] = entry[name]
    return array


def _line(source: RecordingInput, pulses: Sequence[Pulse]) -> str:
    recording = source.recording
    person, n_channels = recording.attrs["participant"], len(recording.data_vars)
    where = [str(recording.attrs.get(key) or "") for key in ("session", "side", "trial")]
    label = " ".join(word for word in [person, source.condition, *where] if word)
    counted = f", {len(pulses)} pulses" if pulses else ""
    return f"{label}: {recording.sizes['time']} samples of {n_channels} channels{counted}"
