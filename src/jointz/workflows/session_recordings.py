"""From the raw logs of a session to the recordings of a study."""

import hashlib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pandas as pd
import xarray as xr

from jointz.core.protocol import ConditionSpec, Protocol
from jointz.core.recording import build_recording
from jointz.core.session_log import NO_SAMPLE, Flag
from jointz.experiment.journal import Event, pulses_done, segments_begun
from jointz.experiment.plan import PlannedPulse
from jointz.experiment.session import log_path
from jointz.io.session_log import SessionLog, read_log

#: Channel of the recording -> field of the log; the same name and unit in both.
_MOTOR_FIELDS = ("motor_angle", "motor_velocity", "current", "applied_torque", "command")
_MOTOR_UNITS = {"applied_torque": "N*m"}
#: Between two stretches of a recording: a hole that nobody takes for walking.
_PAUSE_S = 10.0
#: A stream is not filled over a hole of more than this many of its own sample periods.
_HOLE_PERIODS = 1.5


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
    offsets_s : tuple of float
        What was added to the time of each log's samples (device time, s).
    logs : tuple of SessionLog
        The logs of the stretches.
    """

    recording: xr.Dataset
    pulses: pd.DataFrame
    offsets_s: tuple[float, ...]
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
        if (path := log_path(folder, condition.name, segment)).exists()
    ]
    logs = [read_log(path) for path in paths]
    worn = condition.worn
    pieces, tables, offsets, end_s = [], [], [], -_PAUSE_S
    done = pulses_done(events, condition.name)
    for log in logs:
        time, channels = _aligned(log.records, worn=worn)
        if time.size == 0:
            offsets.append(end_s + _PAUSE_S)
            continue
        offset_s = end_s + _PAUSE_S - float(time[0])
        pieces.append((time + offset_s, channels))
        offsets.append(offset_s)
        tables.append(_pulses(log, time + offset_s, plan, done))
        end_s = float(time[-1]) + offset_s
    hashes = [hashlib.sha256(path.read_bytes()).hexdigest() for path in paths]
    recording = build_recording(
        np.concatenate([time for time, _ in pieces]),
        {name: np.concatenate([c[name] for _, c in pieces]) for name in pieces[0][1]},
        units={"contact": "1", **_MOTOR_UNITS},
        condition=condition.condition,
        file=file,
        contact_kind="contact",
        history=(
            {
                "step": "converted from the session's logs",
                "logs": [path.name for path in paths],
                "sha256": hashes,
            },
        ),
        participant=participant,
        joint=protocol.joint,
        positive=protocol.positive,
    )
    return ConditionRecord(
        recording=recording,
        pulses=pd.concat(tables, ignore_index=True),
        offsets_s=tuple(offsets),
        logs=tuple(logs),
    )


def _aligned(records: np.ndarray, *, worn: bool) -> tuple[np.ndarray, dict[str, np.ndarray]]:
    """Bring all streams to the time of the actuator's samples, or the goniometer's without it."""
    master = "actuator_time_ns" if worn else "angle_sensor_time_ns"
    rows = records[records[master] != NO_SAMPLE]
    time_ns = rows[master]
    channels = {
        "angle": _onto(time_ns, records, master=master, clock="angle_sensor_time_ns"),
        "contact": _onto(time_ns, records, master=master, clock="contact_time_ns"),
    }
    if worn:
        channels |= {name: rows[name].astype(float) for name in _MOTOR_FIELDS}
    return time_ns * 1e-9, channels


_SENSOR_FIELD = {"angle_sensor_time_ns": "angle", "contact_time_ns": "contact"}


def _onto(time_ns: np.ndarray, records: np.ndarray, *, master: str, clock: str) -> np.ndarray:
    """Return a sensor's samples at the master's times.

    Devices sampled in step share their times and are taken as they are. Others
    are placed by the shortest way of a sample to the host, and interpolated: the
    angle by straight lines, the contact by its last value; NaN over holes.
    """
    rows = records[records[clock] != NO_SAMPLE]
    values = rows[_SENSOR_FIELD[clock]].astype(float)
    own_ns = rows[clock] + _way(records, clock) - _way(records, master)
    if own_ns.size == time_ns.size and (own_ns == time_ns).all():
        return np.asarray(values)
    if own_ns.size < 2:
        return np.full(time_ns.size, np.nan)
    after = np.searchsorted(own_ns, time_ns, side="right").clip(1, own_ns.size - 1)
    hole = np.diff(own_ns) > _HOLE_PERIODS * np.median(np.diff(own_ns))
    inside = (time_ns > own_ns[after - 1]) & (time_ns < own_ns[after])
    outside = (time_ns < own_ns[0]) | (time_ns > own_ns[-1])
    if clock == "contact_time_ns":
        placed = values[after - (time_ns < own_ns[after])]
    else:
        placed = np.interp(time_ns, own_ns, values)
    return np.asarray(np.where((hole[after - 1] & inside) | outside, np.nan, placed))


def _way(records: np.ndarray, clock: str) -> int:
    """Return host time minus device time of the sample that came fastest, ns."""
    rows = records[records[clock] != NO_SAMPLE]
    return int((rows["host_time_ns"] - rows[clock]).min()) if rows.size else 0


def _pulses(
    log: SessionLog,
    time_s: np.ndarray,
    plan: Sequence[PlannedPulse],
    done: Mapping[int, Event],
) -> pd.DataFrame:
    """Return the pulses of a stretch as the log shows them."""
    records, segment = log.records, log.header["segment"]
    ticks = records[records["part"] == 0]
    number = np.where(ticks["flags"] & Flag.SHAM, 0, ticks["pulse"]).astype(int)
    begins = np.flatnonzero((np.diff(number, prepend=0) != 0) & (number > 0))
    changes = np.flatnonzero(np.diff(number)) + 1
    # A command given at a tick follows the newest of the samples read by then.
    sampled = records["slot"][records["actuator_time_ns"] != NO_SAMPLE]
    newest = (np.searchsorted(sampled, ticks["slot"], side="right") - 1).clip(0)
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
        onset_s = time_s[newest[start]]
        table.append(
            {
                "pulse": pulse.number,
                "onset_s": onset_s,
                "duration_s": time_s[newest[stop]] - onset_s,
                "amplitude_nm": pulse.amplitude_nm,
                "timing_point": pulse.timing_point,
                "completed": completed,
            }
        )
    columns = ["pulse", "onset_s", "duration_s", "amplitude_nm", "timing_point", "completed"]
    return pd.DataFrame(table, columns=columns)
