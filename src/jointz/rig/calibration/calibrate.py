"""Calibration of a study's instruments: one step, all participants."""

import os
from collections.abc import Mapping, Sequence
from dataclasses import replace
from math import floor, log10
from pathlib import Path

from pydantic import ValidationError

from jointz.analysis.participant_jobs import read_participant
from jointz.core.errors import DataError, StudyError
from jointz.core.protocols.protocol import Protocol
from jointz.core.protocols.protocol_calibration_checks import STEP_RULES
from jointz.core.protocols.protocol_models import LoadSpec
from jointz.core.study import Calibrated, CalibrationSpec, Study
from jointz.io.calibration_file import (
    calibration_toml,
    file_text,
    read_calibration,
    write_into_study,
    write_text,
)
from jointz.io.protocols import load_protocol
from jointz.io.study_reader import open_study
from jointz.results.bench.calibration_fit import STEPS
from jointz.rig.calibration.calibration_steps import fit_step, step_data
from jointz.rig.calibration.report import Calibration
from jointz.rig.experiment.files.whole_files import read_twice
from jointz.rig.session.run_settings import SESSIONS

_SD_DIGITS = 4
#: Entries that are only useful together.
_PAIR = {"contact_threshold_v", "contact_release_v"}


def calibrate(
    study: str | os.PathLike[str] | Study,
    *,
    step: str,
    protocol: str | os.PathLike[str] | Protocol | None = None,
    entries: Sequence[str] | None = None,
    out: str | os.PathLike[str] | None = None,
    into: str | os.PathLike[str] | None = None,
) -> Calibration:
    """Estimate the instruments of a calibration study.

    Parameters
    ----------
    study : path or Study
        One recording a participant and condition, the condition's name as its ``session``: as
        ``jointz run calibration-STEP`` writes it, or one of your own.
    step : str
        ``zero``, ``footswitch``, ``hinge``, ``frame``, ``leg``, ``torsion`` or ``spring``.
    protocol : str, path or Protocol, optional
        States the known loads of ``leg`` and ``spring``; by default the one that was run.
    entries : sequence of str, optional
        Which entries are written; all that stand by default.
    out : path, optional
        A calibration file to write. Into one that is there, entries are added, those of the same
        name replaced.
    into : path, optional
        A study into whose ``study.toml`` entries are put; what it held before is kept as
        ``study.toml.before-calibration``.

    Returns
    -------
    Calibration
        Entries with sd and status, participant by participant.

    Raises
    ------
    DataError
        When there is no such study, step or entry.
    StudyError
        When recordings cannot be used, or a file cannot be written into; all problems at once,
        and nothing was written.
    ProtocolError
        When the protocol has problems.
    WriteError
        When the system does not let a file be written.

    Notes
    -----
    Only entries that stand are written, rounded to four digits of their sd. Two steps may
    estimate the same entry; the last one replaces the other, and a note says where the other
    had the smaller sd. The calibration study's own entries are used where a step needs them:
    the angle's gain in ``leg``, the torque's in ``torsion``.
    """
    if step not in STEPS:
        raise DataError(f"calibrate: expected a step out of {', '.join(STEPS)}; got {step!r}.")
    chosen = _chosen(step, entries)
    opened = study if isinstance(study, Study) else open_study(study)
    calibration = _estimated(opened, step, protocol)
    specifications = _to_write(calibration, chosen)
    target = open_study(into) if into is not None else None
    if not specifications:
        to_write = out is not None or into is not None
        note = "no entry stands: nothing was written"
        return replace(calibration, notes=(note,) if to_write else ())
    written: list[str] = []
    notes: list[str] = []
    if out is not None:
        text, notes = _file_with(Path(out), specifications)
    if target is not None:
        own, notes_of_study = _of_study(target, specifications)
        backup = write_into_study(target.root, own)
        written.append(str(target.root / "study.toml"))
        notes += [*notes_of_study, f"{backup.name} keeps what study.toml held before"]
    if out is not None:
        write_text(Path(out), text)
        written.append(str(out))
    return replace(calibration, written=tuple(written), notes=tuple(dict.fromkeys(notes)))


def _chosen(step: str, entries: Sequence[str] | None) -> frozenset[str]:
    known = frozenset(CalibrationSpec.model_fields)
    unknown = [name for name in entries or () if name not in known]
    if unknown:
        raise DataError(
            f"calibrate {step}: {', '.join(unknown)}: no entry of [calibration]; expected out of "
            f"{', '.join(sorted(known))}."
        )
    if entries is None:
        return known
    pair = _PAIR if _PAIR & set(entries) else set()
    return frozenset(entries) | pair


def _to_write(calibration: Calibration, chosen: frozenset[str]) -> dict[str, CalibrationSpec]:
    """Return the chosen entries that stand, participant by participant, rounded."""
    specifications = {}
    for participant, known in calibration.specifications().items():
        entries = {n: _rounded(getattr(known, n)) for n in known.model_fields_set if n in chosen}
        if entries:
            specifications[participant] = CalibrationSpec(**entries)
    return specifications


def _estimated(
    study: Study, step: str, protocol: str | os.PathLike[str] | Protocol | None
) -> Calibration:
    fits = {}
    problems: list[str] = []
    for person in study.spec.participants:
        try:
            recordings = read_participant(study, person.id, {})
            loads = _loads(study, step, person.id, protocol)
            data = step_data(step, recordings, loads=loads, model=study.spec.torque_model)
        except StudyError as exc:
            problems += [f"{person.id}: {problem}" for problem in exc.problems]
            continue
        fits[person.id] = fit_step(step, data)
    if problems:
        raise StudyError(f"{study.root}, step {step}", problems)
    return Calibration(step=step, fits=fits, study=str(study.root))


def _loads(
    study: Study, step: str, participant: str, protocol: str | os.PathLike[str] | Protocol | None
) -> dict[str, LoadSpec]:
    """Return the known loads of a step, those of the protocol that was run by default."""
    if not STEP_RULES[step].loads:
        return {}
    if protocol is not None:
        spec = protocol if isinstance(protocol, Protocol) else load_protocol(protocol)
        return {load.name: load for load in spec.loads}
    file = study.root / SESSIONS / participant / "session.json"
    if not file.is_file():
        return {}
    protocol_run = read_twice(file)[0].get("protocol")
    loads = protocol_run.get("loads") if isinstance(protocol_run, Mapping) else None
    try:
        # JSON has null where a load states nothing.
        checked = [
            LoadSpec.model_validate(
                {k: v for k, v in load.items() if v is not None}
                if isinstance(load, Mapping)
                else load
            )
            for load in (loads if isinstance(loads, list) else [])
        ]
    except ValidationError as exc:
        raise DataError(
            f"{file}: damaged, its loads cannot be read. Restore it from a copy, or give the "
            "protocol (--protocol).",
            path=str(file),
        ) from exc
    return {load.name: load for load in checked}


def _rounded(entry: Calibrated) -> Calibrated:
    """Return an entry to four digits of its sd."""
    if entry.sd == 0.0:
        return entry
    places = _SD_DIGITS - 1 - floor(log10(entry.sd))
    return Calibrated(value=round(entry.value, places), sd=round(entry.sd, places))


def _file_with(file: Path, calibrations: Mapping[str, CalibrationSpec]) -> tuple[str, list[str]]:
    """Return the text of a calibration file with more entries, and notes."""
    if not file.exists():
        return calibration_toml(calibrations), []
    notes = _less_precise(read_calibration(file).participants, calibrations, str(file))
    return calibration_toml(calibrations, earlier=file_text(file)), notes


def _less_precise(
    before: Mapping[str, CalibrationSpec | None], now: Mapping[str, CalibrationSpec], where: str
) -> list[str]:
    """Return notes of entries that are replaced by others of a larger sd."""
    notes = []
    for participant, known in now.items():
        for name in sorted(known.model_fields_set):
            old, new = getattr(before.get(participant), name, None), getattr(known, name)
            if old is not None and new.sd > old.sd:
                notes.append(
                    f"{where}: {participant}'s {name} was {old.value:g} +- {old.sd:g}, known "
                    f"better than {new.value:g} +- {new.sd:g} that stands there now"
                )
    return notes


def _of_study(
    study: Study, calibrations: Mapping[str, CalibrationSpec]
) -> tuple[dict[str, CalibrationSpec], list[str]]:
    """Return the entries of a study's own participants, and notes."""
    ids = [person.id for person in study.spec.participants]
    mine = {name: known for name, known in calibrations.items() if name in ids}
    if not mine:
        raise StudyError(
            str(study.root),
            [
                f"participants: none of {', '.join(calibrations)}, who were calibrated, is there; "
                f"found {', '.join(ids)}. Give the same ids."
            ],
        )
    others = [name for name in calibrations if name not in mine]
    notes = [f"{', '.join(others)}: not in {study.root}, left out there"] if others else []
    before = {person.id: person.calibration for person in study.spec.participants}
    notes += _less_precise(before, mine, str(study.root / "study.toml"))
    for recording in study.spec.recordings:
        own = recording.calibration
        given = mine.get(recording.participant)
        if own is not None and given is not None:
            hidden = sorted(own.model_fields_set & given.model_fields_set)
            notes += [f"{recording.file} has {name} of its own, which holds" for name in hidden]
    return mine, notes
