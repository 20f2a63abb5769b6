"""Writes the recordings of a participant or a load, and reports what was done."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from jointz.core.protocols.protocol import Protocol
from jointz.core.protocols.protocol_models import ConditionSpec
from jointz.core.protocols.pulse_models import name_of
from jointz.core.study import PerturbationsSpec
from jointz.io.formats.netcdf_recording import write_recording
from jointz.rig.devices.interface import Rig
from jointz.rig.experiment.files.journal import (
    Event,
    events_of,
    pulses_done,
    read_journal,
)
from jointz.rig.experiment.files.session_files import JOURNAL_FILE
from jointz.rig.experiment.files.whole_files import write_whole
from jointz.rig.experiment.timing import timing_report
from jointz.rig.session.run_settings import (
    RunSettings,
    has_pulse_table,
    pulses_name,
    recording_name,
)
from jointz.rig.session.session_recordings import (
    BenchRecordings,
    ConditionRecord,
    SessionRecordings,
    WalkingRecordings,
)
from jointz.rig.session.study_file import pulses_csv


def open_recordings(
    folder: Path,
    protocol: Protocol,
    events: Sequence[Event],
    *,
    salvage: bool,
    until: Mapping[str, int] | None = None,
) -> SessionRecordings:
    """Return the recordings of a session, of the kind of its protocol.

    ``until``: file of a log -> last slot that is read of it.
    """
    kind = WalkingRecordings if protocol.by_gait else BenchRecordings
    plans = kind.KIND.read_plan(folder, events)
    return kind(folder, folder.name, protocol, events, plans, salvage, until or {})


def write_recordings(rig: Rig, settings: RunSettings, folder: Path) -> dict[str, Any]:
    """Write the recordings of a participant or load and return the report of what was done."""
    protocol, wearer, events = settings.protocol, rig.wearer.id, read_journal(folder / JOURNAL_FILE)
    session = open_recordings(folder, protocol, events, salvage=settings.salvage)
    levels_v = rig.calibration.contact_levels_v
    report: dict[str, Any] = {"onsets": [], "gaps": [], "timing": [], "aborted": [], "truth": {}}
    report["decisions"] = []
    report["torque_model"] = None
    for condition in protocol.conditions:
        record = session.record(condition)
        write_condition(settings.study, session, condition, record)
        report["devices"] = record.logs[0].header["devices"]
        actuator = report["devices"]["actuator"]
        report["torque_model"] = actuator["torque_model"] if actuator else report["torque_model"]
        report["timing"] += _timing_rows(wearer, protocol, condition, record)
        report["onsets"] += session.onset_rows(condition, record, levels_v)
        report["gaps"] += session.gap_rows(condition, record)
        report["decisions"] += _decision_rows(wearer, condition, session)
        report["aborted"] += session.aborted_rows(condition, record)
        if hasattr(rig, "truth"):
            report["truth"][condition.name] = rig.truth(
                condition.name,
                worn=condition.worn,
                stretches=record.stretches,
                pulses=record.pulses,
                shapes={name_of(pulse): pulse for pulse in protocol.shapes},
                window_s=protocol.window_s or PerturbationsSpec().window_s,
            )
    if hasattr(rig, "bench_truth"):
        report["truth"] = rig.bench_truth()
    return report


def write_condition(
    study: Path, session: SessionRecordings, condition: ConditionSpec, record: ConditionRecord
) -> None:
    """Write the recording of a condition into a study, with its table of pulses."""
    person = session.participant
    write_recording(record.recording, study / recording_name(person, condition.name))
    if has_pulse_table(session.protocol, condition):
        write_whole(study / pulses_name(person, condition.name), pulses_csv(record.pulses))


def _decision_rows(
    wearer: str, condition: ConditionSpec, session: SessionRecordings
) -> list[dict[str, Any]]:
    """Return what live estimates decided, a row for a condition with decisions."""
    decided = events_of(session.events, "decided", condition.name)
    if not decided:
        return []
    return [
        {
            "participant": wearer,
            "condition": condition.name,
            "decisions": len(decided),
            "steered": sum(bool(event["pulses"]) for event in decided),
            "without_estimate": sum("problem" in event for event in decided),
            "stopped": any(event["stop"] for event in decided),
            "planned": len(session.plans[condition.name]),
            "completed": len(pulses_done(session.events, condition.name)),
        }
    ]


def _timing_rows(
    wearer: str, protocol: Protocol, condition: ConditionSpec, record: ConditionRecord
) -> list[dict[str, Any]]:
    """Return how well the loop kept its time, a row a log."""
    period_ns = round(1e9 / protocol.rates.control_hz)
    return [
        {"participant": wearer, "condition": condition.name, "segment": log.header["segment"]}
        | timing_report(log.records, period_ns)
        for log in record.logs
    ]
