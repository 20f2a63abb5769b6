"""From the raw logs of a session to the recordings of a study."""

import hashlib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import xarray as xr

from jointz.core.protocol import ConditionSpec, Protocol
from jointz.core.recording import build_recording
from jointz.core.session_log import Flag
from jointz.devices.interface import Stretch
from jointz.experiment.journal import Event, pulses_done, segments_begun
from jointz.experiment.plan import PlannedPulse
from jointz.experiment.session_files import has_content, log_path
from jointz.io.session_log import SessionLog, read_log
from jointz.workflows.stream_alignment import clock_notes, fresh, onto

#: Channel of the recording -> field of the log; the same name and unit in both.
_MOTOR_FIELDS = ("motor_angle", "motor_velocity", "current", "applied_torque")
_MOTOR_UNITS = {"applied_torque": "N*m"}
#: Between two stretches of a recording: a hole that nobody takes for walking.
PAUSE_S = 10.0
_CLOCKS = {
    "actuator": "actuator_time_ns",
    "angle": "angle_sensor_time_ns",
    "contact": "contact_time_ns",
}


@dataclass(frozen=True, slots=True, eq=False)
class ConditionRecord:
    """What was recorded in a condition, all its stretches one after the other.

    Parameters
    ----------
    recording : xarray.Dataset
        The recording.
    pulses : pandas.DataFrame
        ``pulse, onset_s, duration_s, amplitude_nm, timing_point, completed``, one row
        a pulse that began, shams left out.
    stretches : tuple of Stretch
        Number, offset and end of each log.
    logs : tuple of SessionLog
        The logs of the stretches.
    """

    recording: xr.Dataset
    pulses: pd.DataFrame
    stretches: tuple[Stretch, ...]
    logs: tuple[SessionLog, ...]


def condition_record(
    folder: Path,
    condition: ConditionSpec,
    *,
    events: Sequence[Event],
    plan: Sequence[PlannedPulse],
    file: str,
    participant: str,
    protocol: Protocol,
) -> ConditionRecord:
    """Put the logs of a condition together.

    Parameters
    ----------
    folder : pathlib.Path
        Of the session.
    condition : ConditionSpec
        Which.
    events : sequence of Event
        The session's journal.
    plan : sequence of PlannedPulse
        The condition's.
    file : str
        Name of the recording's file in the study.
    participant : str
        Whose.
    protocol : Protocol
        For joint and positive direction.

    Returns
    -------
    ConditionRecord
        Recording and pulses.
    """
    paths = [
        path
        for segment in range(segments_begun(events, condition.name))
        if has_content(path := log_path(folder, condition.name, segment))
    ]
    logs = [read_log(path) for path in paths]
    worn = condition.worn
    pieces, tables, stretches, end_s = [], [], [], -PAUSE_S
    done = pulses_done(events, condition.name)
    for log in logs:
        time, channels = _aligned(log.records, worn=worn)
        if time.size == 0:
            continue
        offset_s = end_s + PAUSE_S - float(time[0])
        pieces.append((time + offset_s, channels))
        stretches.append(Stretch(int(log.header["segment"]), offset_s, float(time[-1])))
        tables.append(_pulses(log, time + offset_s, plan, done, worn=worn))
        end_s = float(time[-1]) + offset_s
    hashes = [hashlib.sha256(path.read_bytes()).hexdigest() for path in paths]
    volts = gives_volts(logs[0].header.get("devices", {}))
    recording = build_recording(
        np.concatenate([time for time, _ in pieces]),
        {name: np.concatenate([c[name] for _, c in pieces]) for name in pieces[0][1]},
        units={"contact": "V" if volts else "1", **_MOTOR_UNITS},
        condition=condition.condition,
        file=file,
        contact_kind="voltage" if volts else "contact",
        history=(
            {
                "step": "converted from the session's logs",
                "logs": [path.name for path in paths],
                "sha256": hashes,
                "clocks": [clock_notes(log.records, _CLOCKS) for log in logs],
            },
        ),
        participant=participant,
        joint=protocol.joint,
        positive=protocol.positive,
    )
    return ConditionRecord(
        recording=recording,
        pulses=pd.concat(tables, ignore_index=True),
        stretches=tuple(stretches),
        logs=tuple(logs),
    )


def gives_volts(devices: Mapping[str, Any]) -> bool:
    """Tell whether a footswitch gives volts, whose calibrated levels the loop and analysis take.

    Parameters
    ----------
    devices : mapping
        What the devices say about themselves, as in the header of a log.
    """
    switch = devices.get("contact")
    return bool(switch and switch.get("kind") == "voltage")


def _aligned(records: np.ndarray, *, worn: bool) -> tuple[np.ndarray, dict[str, np.ndarray]]:
    """Bring all streams to the time of the actuator's samples, or the goniometer's without it."""
    master = _master(worn=worn)
    rows = records[fresh(records, master)]
    time_ns = rows[master]
    channels = {
        "angle": onto(records, "angle", clock="angle_sensor_time_ns", master=master),
        "contact": onto(
            records, "contact", clock="contact_time_ns", master=master, interpolated=False
        ),
    }
    if worn:
        channels |= {name: rows[name].astype(float) for name in _MOTOR_FIELDS}
        channels["command"] = command_at_samples(records, fresh(records, master))
    return time_ns * 1e-9, channels


def _master(*, worn: bool) -> str:
    return _CLOCKS["actuator" if worn else "angle"]


def command_at_samples(records: np.ndarray, new: np.ndarray) -> np.ndarray:
    """Return the pulse torque that was asked for when each sample was taken, N*m.

    Of several samples that came with a tick all but the last were taken before its
    command was given.

    Parameters
    ----------
    records : (n,) structured array
        Of a log.
    new : (n,) bool
        Which records hold a sample of the actuator.
    """
    ticks = records[records["part"] == 0]
    before = np.concatenate([[0.0], ticks["command"].astype(float)[:-1]])
    rows = records[new]
    last = np.append(rows["slot"][1:] != rows["slot"][:-1], True)[: rows.size]
    tick = np.searchsorted(ticks["slot"], rows["slot"])
    return np.asarray(np.where(last, rows["command"].astype(float), before[tick]))


def _tick_times(log: SessionLog, time_s: np.ndarray, *, worn: bool) -> np.ndarray:
    """Return when each tick was, by the time of the newest sample read by then, s."""
    records = log.records
    ticks = records[records["part"] == 0]["slot"].astype(np.int64)
    sampled = records["slot"][fresh(records, _master(worn=worn))].astype(np.int64)
    newest = (np.searchsorted(sampled, ticks, side="right") - 1).clip(0)
    late = (ticks - sampled[newest]) / float(log.header["control_hz"])
    return np.asarray(time_s[newest] + late)


def _pulses(
    log: SessionLog,
    time_s: np.ndarray,
    plan: Sequence[PlannedPulse],
    done: Mapping[int, Event],
    *,
    worn: bool,
) -> pd.DataFrame:
    """Return the pulses of a stretch as the log shows them."""
    records, segment = log.records, log.header["segment"]
    ticks = records[records["part"] == 0]
    number = np.where(ticks["flags"] & Flag.SHAM, 0, ticks["pulse"]).astype(int)
    begins = np.flatnonzero((np.diff(number, prepend=0) != 0) & (number > 0))
    changes = np.flatnonzero(np.diff(number)) + 1
    at_s = _tick_times(log, time_s, worn=worn)
    table = []
    for start in begins:
        pulse = plan[number[start] - 1]
        stop = min(changes[changes > start], default=number.size - 1)
        event = done.get(pulse.number)
        completed = (
            event is not None
            and event["segment"] == segment
            and event["onset_slot"] == int(ticks["slot"][start])
        )
        onset_s = at_s[start]
        table.append(
            {
                "pulse": pulse.number,
                "onset_s": onset_s,
                "duration_s": at_s[stop] - onset_s,
                "amplitude_nm": pulse.amplitude_nm,
                "timing_point": pulse.timing_point,
                "completed": completed,
            }
        )
    columns = ["pulse", "onset_s", "duration_s", "amplitude_nm", "timing_point", "completed"]
    return pd.DataFrame(table, columns=columns)
