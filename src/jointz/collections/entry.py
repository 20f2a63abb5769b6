"""Draft of an entry, made of a results folder of ``jointz analyze``."""

import csv
import json
import re
import shutil
from collections import Counter
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

from jointz.collections.checking.entry_checks import PARAMETERS
from jointz.collections.entry_model import ENTRY_FILE, STUDY_ID
from jointz.collections.entry_reader import written_entry
from jointz.core.channels import PARAMETER_UNITS
from jointz.core.errors import DataError
from jointz.core.study import CalibrationSpec
from jointz.io.formats.columns import file_sha256
from jointz.io.new_folder import new_folder

_ESTIMATES, _COVARIANCE = "estimates.csv", "covariance.csv"
_PROVENANCE, _EXCLUDED = "provenance.json", "excluded.csv"
_SETTINGS = ("baseline", "window_s", "cutoff_hz", "resamples", "seed")

#: Keys that no results folder knows -> what belongs there.
_QUESTIONS = {
    "title": "what was measured, in a line",
    "licence": 'such as "CC-BY-4.0"',
    "cite": "how to cite the study: authors, year, title, DOI",
    "protocol": "a protocol of jointz, a file in this folder, an address or doi:...",
    "contributors": '[{ name = "...", affiliation = "...", orcid = "..." }]',
    "ethics.approval": "committee and number",
    "ethics.consent": 'what the people agreed to, such as "public"',
    "device.name": "what perturbed the joint",
    "participants.age_band": "of at least five years, such as 20-29",
    "participants.sex": '"female", "male", "other" or "not_stated"',
    "conditions.name": "a name that no other condition has, such as level-1.2",
    "conditions.walking_speed_m_s": "m/s",
    "conditions.slope_deg": "uphill is positive, 0 is level",
    "conditions.surface": '"treadmill", "overground", ...',
    "raw_data.where": "an address, or whom to ask",
}


def make_entry(
    results: Path, *, out: Path, study_id: str, version: str = "1.0", study: str = ""
) -> Path:
    """Make a draft of an entry: known values are filled in, the others are comments.

    Parameters
    ----------
    results : pathlib.Path
        Folder that ``jointz analyze`` made of a walking study.
    out : pathlib.Path
        Folder of the entry; must not exist yet.
    study_id : str
        Id of the study in the collection: lower case, digits, ``.``, ``-``, ``_``.
    version : str
        Version of the entry.
    study : str
        Path of the study with its recordings, from the entry's folder, if others may read it.

    Returns
    -------
    pathlib.Path
        The ``entry.toml``. Keys that only the lab knows are comments in it; ``jointz collect
        check`` names them until they are filled in.

    Raises
    ------
    DataError
        If the id is not valid, or the folder holds no results of a walking study.
    OutputError
        If ``out`` exists or cannot be written.
    """
    if re.fullmatch(STUDY_ID, study_id) is None:
        raise DataError(
            f"id of the study: expected lower case letters, digits, '.', '-' and '_', as in "
            f"our-knees; found {study_id!r}. Choose one: --id."
        )
    provenance = read_provenance(results)
    if provenance["study"]["kind"] == "bench":
        raise DataError(
            f"{results}: results of a bench study. Its participants are loads, and a collection "
            "holds people. Name the results of a walking study."
        )
    files = [name for name in (_ESTIMATES, _COVARIANCE) if (results / name).is_file()]
    with new_folder(out, marker=ENTRY_FILE, overwrite=False) as folder:
        for name in files:
            shutil.copyfile(results / name, folder / name)
        content = _content(provenance, results, study_id, version)
        if _COVARIANCE in files:
            content["conditions"][0]["covariance"] = _COVARIANCE
        content["hashes"] = {name: file_sha256(folder / name) for name in files}
        content["raw_data"] = {"study": study, "sha256": provenance.get("study_sha256", "")}
        text = written_entry(content, _open_questions(content))
        (folder / ENTRY_FILE).write_text(text, encoding="utf-8")
    return out / ENTRY_FILE


def read_provenance(results: Path) -> dict[str, Any]:
    """Return the provenance of a results folder."""
    error = DataError(
        f"{results}: expected a results folder of jointz analyze, with {_ESTIMATES} and "
        f"{_PROVENANCE} of this version. Run jointz analyze again, or correct the name."
    )
    try:
        content = json.loads((results / _PROVENANCE).read_text(encoding="utf-8"))
        has_people = content["study"]["kind"] and content["study"]["participants"]
        (results / _ESTIMATES).stat()
    except (OSError, ValueError, KeyError, TypeError) as exc:
        raise error from exc
    if not has_people:
        raise error
    return dict(content)


def _content(
    provenance: Mapping[str, Any], results: Path, study_id: str, version: str
) -> dict[str, Any]:
    spec, settings = provenance["study"], provenance.get("settings", {})
    estimated = {row.get("parameter") for row in _csv_rows(results / _ESTIMATES)}
    return {
        "jointz_entry": 1,
        "study": study_id,
        "version": version,
        "values": "estimates",
        "exclusions": _exclusions(results / _EXCLUDED),
        "device": _torque_path(spec),
        "joint": {"name": spec["joint"], **_side(spec["recordings"]), "positive": spec["positive"]},
        "calibration": _calibration(spec),
        "units": {name: PARAMETER_UNITS[name] for name in PARAMETERS if name in estimated},
        "method": {
            "name": settings.get("method"),
            "settings": {name: settings[name] for name in _SETTINGS if name in settings},
        },
        "software": {"name": "jointz", "version": provenance.get("jointz")},
        "participants": [described_person(spec, person) for person in spec["participants"]],
        "conditions": [{"activity": spec["kind"], "estimates": _ESTIMATES}],
    }


def _open_questions(content: Mapping[str, Any]) -> dict[str, str]:
    """Return the keys that only the lab can fill in, and what belongs there."""
    questions = dict(_QUESTIONS)
    if "torque" not in content["device"]:
        questions["device.torque"] = '"joint_torque_sensor", "motor_current", "load_cell", ...'
    if "side" not in content["joint"]:
        questions["joint.side"] = '"left", "right" or "both", and then side of each participant'
    if not content["calibration"]:
        questions["calibration.note"] = "entries with their sd, or why there are none"
    return questions


def _side(recordings: Iterable[Mapping[str, Any]]) -> dict[str, str]:
    """Return the side of recordings, or ``both``; nothing if one of them states no side."""
    sides = {recording.get("side") for recording in recordings}
    if None in sides or not sides:
        return {}
    return {"side": "both" if len(sides) > 1 else str(sides.pop())}


def described_person(spec: Mapping[str, Any], person: Mapping[str, Any]) -> dict[str, Any]:
    """Return a participant of a study: id, side, mass, height, group."""
    recordings = [r for r in spec["recordings"] if r["participant"] == person["id"]]
    known = {key: person.get(key) for key in ("id", "mass_kg", "height_m", "group")}
    return known | _side(recordings)


def _torque_path(spec: Mapping[str, Any]) -> dict[str, str]:
    """Return how torque was computed from current; a torque channel does not say how."""
    if spec.get("torque_model") and "torque" not in spec["channels"]:
        model = ", ".join(f"{name} {value:g}" for name, value in spec["torque_model"].items())
        return {"torque": "motor_current", "torque_detail": model}
    return {}


def _calibration(spec: Mapping[str, Any]) -> dict[str, Any]:
    """Return the calibration that all recordings share."""
    people = {person["id"]: person for person in spec["participants"]}
    calibrations = []
    for recording in spec["recordings"]:
        calibration = CalibrationSpec()
        for part in (spec, people[recording["participant"]], recording):
            override = CalibrationSpec.model_validate(part.get("calibration") or {})
            calibration = calibration.overridden_by(override)
        calibrations.append(calibration.model_dump(exclude_none=True))
    first = calibrations[0]
    return {k: v for k, v in first.items() if all(c.get(k) == v for c in calibrations)}


def _csv_rows(file: Path) -> list[dict[str, str]]:
    with file.open(encoding="utf-8-sig", newline="") as stream:
        return list(csv.DictReader(stream))


def _exclusions(file: Path) -> list[dict[str, Any]]:
    """Count the strides and pulses that were excluded, by kind and code."""
    rows = _csv_rows(file) if file.is_file() else []
    count = Counter((row["kind"], row["code"]) for row in rows)
    return [{"kind": kind, "n": n, "reason": code} for (kind, code), n in sorted(count.items())]
