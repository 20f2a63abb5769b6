"""Calibration of a study's instruments: one step, all participants."""

import os
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from math import floor, log10
from pathlib import Path

import numpy as np
from pydantic import ValidationError

from jointz.analysis.participant_jobs import read_participant
from jointz.core.errors import DataError, StudyError
from jointz.core.protocols.protocol import Protocol
from jointz.core.protocols.protocol_calibration_checks import STEP_RULES
from jointz.core.protocols.protocol_models import LoadSpec
from jointz.core.study import Calibrated, CalibrationSpec, Study, TorqueModelSpec
from jointz.identify.calibration.footswitch_levels import fit_footswitch
from jointz.identify.calibration.frame import fit_frame
from jointz.identify.calibration.hanging_model import KnownWeight
from jointz.identify.calibration.hinge import fit_hinge
from jointz.identify.calibration.leg import fit_leg
from jointz.identify.calibration.pulse_averages import PulsedRecord
from jointz.identify.calibration.spring import fit_spring
from jointz.identify.calibration.torsion import fit_torsion
from jointz.identify.calibration.zero import fit_zero
from jointz.identify.preparation.conditioning import torque_from_current
from jointz.identify.preparation.pulses import (
    pulses_from_command,
    pulses_from_table,
    with_measured_amplitudes,
)
from jointz.identify.preparation.sources import RecordingInput
from jointz.io.calibration_file import (
    calibration_toml,
    file_text,
    read_calibration,
    write_into_study,
    write_text,
)
from jointz.io.protocols import load_protocol
from jointz.io.study_reader import open_study
from jointz.results.bench.calibration_fit import STEPS, CalibrationFit
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
        fits[person.id] = _STEPS[step].fit(data)
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


_UNIT_GAIN, _ZERO = Calibrated(value=1.0, sd=0.0), Calibrated(value=0.0, sd=0.0)
_CUTOFF_HZ = 20.0


@dataclass(frozen=True, slots=True, eq=False)
class StepData:
    """Recordings of one participant for a step, and what is known about them."""

    recordings: Mapping[str, RecordingInput]  # condition -> its recording
    loads: Mapping[str, LoadSpec]  # condition -> known load on the joint
    model: TorqueModelSpec | None  # torque model of the actuator, as stated

    def channels(self, condition: str, *names: str) -> list[np.ndarray]:
        """Return time and channels of a condition."""
        recording = self.recordings[condition].recording
        return [recording[name].to_numpy() for name in ("time", *names)]

    def known(self, condition: str) -> CalibrationSpec:
        """Return the entries of the instruments that the study has already."""
        return self.recordings[condition].calibration

    @property
    def torque_model(self) -> TorqueModelSpec:
        """The actuator's model; :func:`step_data` has checked that there is one."""
        if self.model is None:
            raise ValueError("no torque model; step_data reports it before")
        return self.model

    def torque_and_friction(self, condition: str) -> tuple[np.ndarray, np.ndarray]:
        """Return the torque out of the current, and the friction in it, N*m."""
        recording = self.recordings[condition].recording
        return torque_from_current(recording, self.torque_model, cutoff_hz=_CUTOFF_HZ)


@dataclass(frozen=True, slots=True)
class _Step:
    channels: tuple[str, ...]  # required channels
    fit: Callable[[StepData], CalibrationFit]


def step_data(
    step: str,
    recordings: Sequence[RecordingInput],
    *,
    loads: Mapping[str, LoadSpec],
    model: TorqueModelSpec | None,
) -> StepData:
    """Assign recordings to the conditions of a step; raise StudyError with all problems."""
    participant = str(recordings[0].recording.attrs["participant"]) if recordings else "nobody"
    conditions = STEP_RULES[step].conditions
    sessions = [str(r.recording.attrs["session"]) for r in recordings]
    if len(conditions) == 1 and sessions == [""]:  # the only one of a step of one
        sessions = list(conditions)
    by_condition: dict[str, RecordingInput] = {}
    problems: list[str] = []
    for name in conditions:
        matching = [r for r, s in zip(recordings, sessions, strict=True) if s == name]
        if len(matching) == 1:
            by_condition[name] = matching[0]
            continue
        found = ", ".join(sorted(set(sessions) - {""})) or "none"
        problems.append(
            f'expected one recording with session = "{name}", found {len(matching)} (sessions: '
            f"{found}). Name it in study.toml, one a participant."
        )
    data = StepData(by_condition, loads, model)
    problems += [p for name in by_condition for p in _recording_problems(step, name, data)]
    needs_model = "current" in _STEPS[step].channels or (
        step == "torsion" and any("torque" not in r.recording for r in by_condition.values())
    )
    if needs_model and model is None and not problems:
        problems.append("[torque_model]: missing; torque is computed from current with it.")
    problems += [
        f"the known load of the condition '{name}' is missing. Give the protocol that states it "
        "(--protocol), with [[loads]] of that name."
        for name in STEP_RULES[step].loads
        if name not in loads
    ]
    if problems:
        raise StudyError(f"step {step}, participant {participant}", problems)
    return data


def _recording_problems(step: str, condition: str, data: StepData) -> list[str]:
    source = data.recordings[condition]
    recording = source.recording
    missing = [c for c in _STEPS[step].channels if c not in recording]
    if step == "torsion" and not {"torque", "current"} & set(recording):
        missing.append("current")
    problems = [
        f"{source.file}: the channel '{channel}' is missing; '{condition}' cannot do without it. "
        f"Declare [channels.{channel}] in study.toml."
        for channel in missing
    ]
    if step == "footswitch" and recording.attrs["contact_kind"] != "voltage":
        problems.append(
            f'{source.file}: the switch gives no volts. Declare kind = "voltage" under '
            "[channels.contact], or leave the step out: other kinds need no levels."
        )
    needs_pulses = STEP_RULES[step].torque == "pulses" and source.pulse_table is None
    if needs_pulses and "command" not in recording:
        problems.append(
            f"{source.file}: no pulses. Give it a pulse table (perturbations), or the command."
        )
    return problems


def _pulsed(condition: str, data: StepData) -> PulsedRecord:
    """Return a record with its pulses, those of its table or of the command."""
    source = data.recordings[condition]
    recording, table = source.recording, source.pulse_table
    torque, friction = data.torque_and_friction(condition)
    encoder = recording["motor_angle"].to_numpy()
    pulses = pulses_from_command(recording) if table is None else pulses_from_table(table)
    pulses = with_measured_amplitudes(pulses, recording.assign(torque=("time", torque)))
    return PulsedRecord(
        time=recording["time"].to_numpy(),
        angle=recording["angle"].to_numpy() if "angle" in recording else encoder,
        motor_angle=encoder,
        driving=torque - friction,
        friction=friction,
        onset_s=np.array([pulse.onset_s for pulse in pulses]),
        amplitude_nm=np.array([pulse.amplitude for pulse in pulses]),
    )


def _leg(data: StepData) -> CalibrationFit:
    load = data.loads["weighted"]
    return fit_leg(
        _pulsed("bare", data),
        _pulsed("weighted", data),
        weight=KnownWeight(load.inertia or _ZERO, load.stiffness or _ZERO),
        known=data.known("bare"),
    )


def _torsion(data: StepData) -> CalibrationFit:
    recording = data.recordings["locked"].recording
    time, angle = data.channels("locked", "angle")
    if "torque" in recording:
        torque = recording["torque"].to_numpy()
    else:
        torque = np.subtract(*data.torque_and_friction("locked"))
    return fit_torsion(
        time,
        angle,
        torque,
        motor_angle=recording["motor_angle"].to_numpy() if "motor_angle" in recording else None,
        torque_gain=data.known("locked").torque_gain or _UNIT_GAIN,
    )


_STEPS: Mapping[str, _Step] = {
    "zero": _Step(("angle",), lambda data: fit_zero(*data.channels("straight", "angle"))),
    "footswitch": _Step(
        ("contact",), lambda data: fit_footswitch(*data.channels("walking", "contact"))
    ),
    "hinge": _Step(
        ("angle", "motor_angle"),
        lambda data: fit_hinge(*data.channels("swing", "angle", "motor_angle")),
    ),
    "frame": _Step(
        ("motor_angle", "current"),
        lambda data: fit_frame(_pulsed("pulses", data), known=data.known("pulses")),
    ),
    "leg": _Step(("angle", "motor_angle", "current"), _leg),
    "torsion": _Step(("angle",), _torsion),
    "spring": _Step(
        ("motor_angle", "current"),
        lambda data: fit_spring(
            *data.channels("spring", "motor_angle", "current"),
            model=data.torque_model,
            stiffness=data.loads["spring"].stiffness or _ZERO,
        ),
    ),
}
