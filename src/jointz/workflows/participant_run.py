"""One participant of an experiment: the session, its recordings and its report."""

import json
import os
import signal
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from types import FrameType
from typing import Any, Literal

import numpy as np
import pandas as pd

from jointz.core.clock import RealClock, VirtualClock
from jointz.core.errors import OutputError
from jointz.core.protocol import ConditionSpec, Protocol
from jointz.devices.interface import Rig
from jointz.experiment.journal import Event, read_journal
from jointz.experiment.onset_accuracy import onset_accuracy
from jointz.experiment.plan import PlannedPulse
from jointz.experiment.session import (
    JOURNAL_FILE,
    Operator,
    Progress,
    Session,
    SessionPlan,
    plan_of,
)
from jointz.experiment.timing import timing_report
from jointz.gait.heel_strikes import find_heel_strikes
from jointz.gait.strides import find_strides
from jointz.gait.timestamps import find_gaps
from jointz.io.netcdf import write_recording
from jointz.workflows.session_recordings import ConditionRecord, condition_record

PULSE_COLUMNS = ["onset_s", "duration_s", "amplitude_nm", "timing_point"]
REPORT_FILE = "report.json"


@dataclass(frozen=True, slots=True)
class RunSettings:
    """How an experiment is run.

    Parameters
    ----------
    protocol : Protocol
        What to do.
    seed : int
        Of plan and simulation.
    clock : {"fast", "real"}
        Virtual or the machine's.
    study : pathlib.Path
        The study's folder.
    """

    protocol: Protocol
    seed: int
    clock: Literal["fast", "real"]
    study: Path

    def session_folder(self, participant: str) -> Path:
        """Return where a participant's session is kept.

        Parameters
        ----------
        participant : str
            Id.
        """
        return self.study / "sessions" / participant


def run_participant(
    rig: Rig, settings: RunSettings, *, operator: Operator, progress: Progress
) -> dict[str, Any]:
    """Run what is left of a participant's session and write the recordings.

    Parameters
    ----------
    rig : Rig
        The participant and the devices.
    settings : RunSettings
        What to do and where to write.
    operator : Operator
        Asked before every condition.
    progress : callable
        Told after every accepted stride.

    Returns
    -------
    dict
        The participant's part of the report: ``onsets``, ``gaps``, ``timing``,
        ``aborted`` (pulses that the study leaves out), ``torque_model`` of the
        actuator and ``truth`` (of a simulated rig).

    Raises
    ------
    DeviceError
        When a device failed or the safety gate tripped.
    OutputError
        When the disk does not take the records.
    KeyboardInterrupt
        When the operator stopped the session.
    """
    folder = settings.session_folder(rig.wearer.id)
    report_file = folder / REPORT_FILE
    if report_file.exists():
        return dict(json.loads(report_file.read_text(encoding="utf-8")))
    session = Session(
        SessionPlan(settings.protocol, settings.seed, folder),
        rig,
        clocks=VirtualClock if settings.clock == "fast" else RealClock,
        operator=operator,
        progress=progress,
        real_time=settings.clock == "real",
    )
    try:
        with _stopped_by_ctrl_c(session):
            session.run()
        report = _write_recordings(rig, settings, folder)
        partial = report_file.with_suffix(".partial")
        partial.write_text(json.dumps(report), encoding="utf-8")
        os.replace(partial, report_file)
    except OSError as exc:
        raise OutputError(
            f"{exc.filename or folder}: cannot be written ({exc.strerror or exc}). Make room, then "
            "go on with --resume."
        ) from exc
    return report


def _write_recordings(rig: Rig, settings: RunSettings, folder: Path) -> dict[str, Any]:
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
        )
        write_recording(record.recording, settings.study / name)
        actuator = record.logs[0].header["devices"]["actuator"]
        report["torque_model"] = actuator["torque_model"] if actuator else report["torque_model"]
        report["timing"] += _timing(wearer, condition, record, settings)
        if condition.perturbations is not None:
            _write_pulses(record, settings.study / pulses_name(wearer, condition.name))
            report["onsets"] += _onsets(wearer, protocol, condition, plan, record, events)
            report["gaps"].append(_gaps(wearer, condition, record))
            report["aborted"] += _aborted(wearer, name, record)
        truth = getattr(rig, "truth", None)
        if truth is not None:
            report["truth"][condition.name] = _truth(truth, condition, record)
    return report


def recording_name(participant: str, condition: str) -> str:
    """Return the name of a recording's file in the study.

    Parameters
    ----------
    participant, condition : str
        Whose and which.
    """
    return f"{participant}_{condition}.nc"


def pulses_name(participant: str, condition: str) -> str:
    """Return the name of the table of pulses of a recording.

    Parameters
    ----------
    participant, condition : str
        Whose and which.
    """
    return f"{participant}_{condition}_pulses.csv"


@contextmanager
def _stopped_by_ctrl_c(session: Session) -> Iterator[None]:
    """Let the first Ctrl-C end the session gently and the second at once."""
    if threading.current_thread() is not threading.main_thread():
        yield
        return

    def stop(number: int, frame: FrameType | None) -> None:
        del number, frame
        signal.signal(signal.SIGINT, signal.default_int_handler)
        session.request_stop()

    before = signal.signal(signal.SIGINT, stop)
    try:
        yield
    finally:
        signal.signal(signal.SIGINT, before)


def _timing(
    wearer: str, condition: ConditionSpec, record: ConditionRecord, settings: RunSettings
) -> list[dict[str, Any]]:
    period_ns = round(1e9 / settings.protocol.rates.control_hz)
    return [
        {
            "participant": wearer,
            "condition": condition.name,
            "segment": log.header["segment"],
            **timing_report(log.records, period_ns),
        }
        for log in record.logs
    ]


def _write_pulses(record: ConditionRecord, file: Path) -> None:
    table = record.pulses[PULSE_COLUMNS]
    partial = file.with_suffix(".partial")
    table.to_csv(partial, index=False, float_format="%.9g")
    os.replace(partial, file)


def _aborted(wearer: str, file: str, record: ConditionRecord) -> list[dict[str, Any]]:
    rows = record.pulses[~record.pulses["completed"].astype(bool)]
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
) -> list[dict[str, Any]]:
    recording = record.recording
    time = recording["time"].to_numpy()
    strides = find_strides(find_heel_strikes(recording).time_s, find_gaps(time))
    points = (condition.perturbations and condition.perturbations.timing_points) or {}
    accuracy = onset_accuracy(
        record.pulses[record.pulses["completed"].astype(bool)],
        strides,
        timing_points=points,
        strides_in_mean=protocol.gait.strides_in_mean if protocol.gait else 1,
    )
    by_number = {pulse.number: pulse.timing_point for pulse in plan}

    def count(event: str, point: str) -> int:
        return len(
            [
                e
                for e in events
                if e["event"] == event
                and e["condition"] == condition.name
                and by_number[e["pulse"]] == point
            ]
        )

    return [
        {
            "participant": wearer,
            "condition": condition.name,
            "planned": sum(pulse.timing_point == row["timing_point"] for pulse in plan),
            "completed": count("pulse_completed", row["timing_point"]),
            "missed": count("pulse_missed", row["timing_point"]),
            "aborted": count("pulse_aborted", row["timing_point"]),
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
    truth: Callable[..., dict[str, Any]], condition: ConditionSpec, record: ConditionRecord
) -> dict[str, Any]:
    onsets: pd.DataFrame = record.pulses
    return truth(condition.name, worn=condition.worn, offsets_s=record.offsets_s, pulses=onsets)
