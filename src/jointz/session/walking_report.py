"""The recordings of a walking participant, and the report of what was done."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from jointz.core.protocols.protocol import ConditionSpec, Protocol, PulseSpec
from jointz.devices.interface import Rig
from jointz.experiment.files.journal import Event, pulses_done, read_journal
from jointz.experiment.files.session_files import JOURNAL_FILE, plan_of
from jointz.experiment.files.whole_files import write_whole
from jointz.experiment.gait.onset_errors import onset_accuracy
from jointz.experiment.plan import PlannedPulse
from jointz.gait.heel_strikes import find_heel_strikes
from jointz.gait.strides import find_strides
from jointz.gait.timestamps import find_gaps
from jointz.io.formats.netcdf_recording import write_recording
from jointz.session.run_settings import RunSettings, pulses_name, recording_name, timing_rows
from jointz.session.session_recordings import ConditionRecord, condition_record
from jointz.session.study_file import pulses_csv


def write_walking(rig: Rig, settings: RunSettings, folder: Path) -> dict[str, Any]:
    """Write the recordings of a participant and return the report of what was done."""
    protocol, wearer = settings.protocol, rig.wearer.id
    events, plans = read_journal(folder / JOURNAL_FILE), plan_of(folder)
    report: dict[str, Any] = {"onsets": [], "gaps": [], "timing": [], "aborted": [], "truth": {}}
    report["torque_model"] = None
    for condition in protocol.conditions:
        name = recording_name(wearer, condition.name)
        plan = plans.get(condition.name, ())
        record = condition_record(
            folder,
            condition,
            events=events,
            plan=plan,
            file=name,
            participant=wearer,
            protocol=protocol,
            salvage=settings.salvage,
        )
        write_recording(record.recording, settings.study / name)
        report["devices"] = record.logs[0].header["devices"]
        actuator = report["devices"]["actuator"]
        report["torque_model"] = actuator["torque_model"] if actuator else report["torque_model"]
        report["timing"] += timing_rows(wearer, condition.name, record.logs, settings)
        if condition.perturbations is not None:
            write_whole(
                settings.study / pulses_name(wearer, condition.name), pulses_csv(record.pulses)
            )
            levels_v = rig.calibration.contact_levels_v
            report["onsets"] += _onsets(
                wearer, protocol, condition, plan, record, events, levels_v=levels_v
            )
            report["gaps"].append(_gaps(wearer, condition, record))
            report["aborted"] += _aborted(wearer, name, record)
        truth = getattr(rig, "truth", None)
        if truth is not None:
            report["truth"][condition.name] = _truth(truth, condition, record, protocol.pulse)
    return report


def _aborted(wearer: str, file: str, record: ConditionRecord) -> list[dict[str, Any]]:
    pulses = record.pulses  # those that are damaged have a code of their own
    rows = pulses[~(pulses["completed"] | pulses["damaged"]).astype(bool)]
    return [
        {"participant": wearer, "recording": file, "onset_s": float(onset)}
        for onset in rows["onset_s"]
    ]


def _onsets(
    wearer: str,
    protocol: Protocol,
    condition: ConditionSpec,
    plan: tuple[PlannedPulse, ...],
    record: ConditionRecord,
    events: list[Event],
    *,
    levels_v: tuple[float, float] | None,
) -> list[dict[str, Any]]:
    recording = record.recording
    time = recording["time"].to_numpy()
    strikes = find_heel_strikes(recording, levels_v=levels_v)
    strides = find_strides(strikes.time_s, find_gaps(time))
    points = (condition.perturbations and condition.perturbations.timing_points) or {}
    accuracy = onset_accuracy(
        record.pulses,
        strides,
        timing_points=points,
        strides_in_mean=protocol.gait.strides_in_mean if protocol.gait else 1,
    )
    # Shams are in plan and journal, not among the pulses.
    felt = [pulse for pulse in plan if not pulse.sham]
    by_number = {pulse.number: pulse.timing_point for pulse in felt}

    completed = pulses_done(events, condition.name)

    def count(event: str, point: str) -> int:
        return len(
            [
                e
                for e in events
                if e["event"] == event
                and e["condition"] == condition.name
                and by_number.get(e["pulse"]) == point
            ]
        )

    return [
        {
            "participant": wearer,
            "condition": condition.name,
            "planned": sum(pulse.timing_point == row["timing_point"] for pulse in felt),
            "completed": sum(by_number.get(n) == row["timing_point"] for n in completed),
            "missed": count("pulse_missed", row["timing_point"]),
            "aborted": count("pulse_aborted", row["timing_point"]),
            "lost": count("pulse_lost", row["timing_point"]),
            **{str(name): value for name, value in row.items()},
        }
        for row in accuracy.to_dict("records")
    ]


def _gaps(wearer: str, condition: ConditionSpec, record: ConditionRecord) -> dict[str, Any]:
    """Return strides between pulses of one stretch, as the device counted them."""
    gaps: list[int] = []
    for log in record.logs:
        records = log.records
        number = records["pulse"].astype(np.int64)
        begins = np.flatnonzero((np.diff(number, prepend=0) != 0) & (number > 0))
        gaps += np.diff(records["stride"][begins].astype(int)).tolist()
    planned = (condition.perturbations and condition.perturbations.gap_strides) or (0, 0)
    return {
        "participant": wearer,
        "condition": condition.name,
        "fewest": min(gaps, default=0),
        "most": max(gaps, default=0),
        "longer_than_planned": sum(gap > planned[1] for gap in gaps),
        "planned_fewest": planned[0],
        "planned_most": planned[1],
    }


def _truth(
    truth: Callable[..., dict[str, Any]],
    condition: ConditionSpec,
    record: ConditionRecord,
    pulse: PulseSpec | None,
) -> dict[str, Any]:
    onsets: pd.DataFrame = record.pulses
    return truth(
        condition.name,
        worn=condition.worn,
        stretches=record.stretches,
        pulses=onsets,
        shape=pulse,
    )
