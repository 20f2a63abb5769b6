"""From the raw logs of a session to the recordings of a study."""

import hashlib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import xarray as xr

from jointz.core.protocols.protocol import ConditionSpec, Protocol
from jointz.core.recording import build_recording
from jointz.core.session_log import Flag
from jointz.devices.interface import Stretch
from jointz.experiment.files.journal import Event, pulses_done, segments_begun
from jointz.experiment.files.session_files import has_content, log_path
from jointz.experiment.plan import PlannedPulse
from jointz.io.log_reader import SessionLog, read_log
from jointz.session.stream_alignment import clock_notes, fresh, onto

#: Channel of the recording -> field of the log; the same name and unit in both.
_MOTOR_FIELDS = ("motor_angle", "motor_velocity", "current", "applied_torque")
_MOTOR_UNITS = {"applied_torque": "N*m"}
_PULSE_COLUMNS = (
    "pulse",
    "onset_s",
    "duration_s",
    "amplitude_nm",
    "timing_point",
    "completed",
    "damaged",
)
#: Between two stretches of a recording: a hole that nobody takes for walking.
PAUSE_S = 10.0
_CLOCKS = {
    "actuator": "actuator_time_ns",
    "angle": "angle_sensor_time_ns",
    "contact": "contact_time_ns",
}


@dataclass(frozen=True, slots=True, eq=False)
class ConditionRecord:
    """What was recorded in a condition, all its stretches one after the other."""

    recording: xr.Dataset
    # ``pulse, onset_s, duration_s, amplitude_nm, timing_point, completed, damaged``, one row a
    # pulse that began, shams left out
    pulses: pd.DataFrame
    stretches: tuple[Stretch, ...]  # number, offset and end of each log
    logs: tuple[SessionLog, ...]  # the logs of the stretches


def condition_record(
    folder: Path,
    condition: ConditionSpec,
    *,
    events: Sequence[Event],
    plan: Sequence[PlannedPulse],
    file: str,
    participant: str,
    protocol: Protocol,
    salvage: bool = False,
) -> ConditionRecord:
    """Put the logs of a condition together."""
    paths = [
        path
        for segment in range(segments_begun(events, condition.name))
        if has_content(path := log_path(folder, condition.name, segment))
    ]
    logs = [read_log(path, salvage=salvage) for path in paths]
    worn = condition.worn
    pieces, tables, stretches, end_s = [], [], [], -PAUSE_S
    damage_s: list[tuple[float, float]] = []
    for log in logs:
        time, channels = _aligned(log.records, worn=worn)
        if time.size == 0:
            continue
        holes_s = damaged_s(log, time, _master(worn=worn))
        begin_s = min([float(time[0]), *(begin for begin, _ in holes_s)])
        offset_s = end_s + PAUSE_S - begin_s
        damage_s += [(begin + offset_s, end + offset_s) for begin, end in holes_s]
        pieces.append((time + offset_s, channels))
        stretches.append(Stretch(int(log.header["segment"]), offset_s, float(time[-1])))
        tables.append(_pulses(log, time + offset_s, plan, events, worn=worn))
        end_s = max([float(time[-1]), *(end for _, end in holes_s)]) + offset_s
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
            *damage_step(damage_s),
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
    """Tell whether a footswitch gives volts, whose calibrated levels the loop and analysis take."""
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


def damaged_s(log: SessionLog, time_s: np.ndarray, master: str) -> list[tuple[float, float]]:
    """Return the stretches of a log that were left out, from intact sample to intact sample, s."""
    records = log.records
    before = np.concatenate([[0], np.cumsum(fresh(records, master))])
    holes = []
    for at, (_, after) in zip((d.at for d in log.damage), damaged_ticks(log), strict=True):
        first = before[at] == 0  # how long it was is told by the ticks alone
        lost_s = after / log.header["control_hz"] if first else 0.0
        begin = time_s[0] - lost_s if first else time_s[before[at] - 1]
        end = time_s[min(before[at], time_s.size - 1)]
        if at == records.size:
            end = end + (after - int(records["slot"][-1])) / log.header["control_hz"]
        holes.append((float(begin), float(end)))
    return holes


def damage_step(damage_s: Sequence[tuple[float, float]]) -> tuple[dict[str, Any], ...]:
    """Return what the history of a recording says of damaged stretches; nothing without one."""
    if not damage_s:
        return ()
    step = "left out damaged records of the session's logs"
    return ({"step": step, "damaged_s": [list(hole) for hole in damage_s]},)


def command_at_samples(records: np.ndarray, new: np.ndarray) -> np.ndarray:
    """Return the pulse torque that was asked for when each sample was taken, N*m.

    Of several samples that came with a tick all but the last were taken before its
    command was given.
    """
    ticks = ticks_of(records)
    before = np.concatenate([[0.0], ticks["command"].astype(float)[:-1]])
    rows = records[new]
    last = np.append(rows["slot"][1:] != rows["slot"][:-1], True)[: rows.size]
    tick = np.searchsorted(ticks["slot"], rows["slot"])
    return np.asarray(np.where(last, rows["command"].astype(float), before[tick]))


def ticks_of(records: np.ndarray) -> np.ndarray:
    """Return the first record of every tick that there is."""
    slots = records["slot"]
    return np.asarray(records[np.append(True, slots[1:] != slots[:-1])[: slots.size]])


def _times_of(slots: np.ndarray, log: SessionLog, time_s: np.ndarray, *, worn: bool) -> np.ndarray:
    """Return when ticks were, by the time of the newest sample read by then, s."""
    records = log.records
    sampled = records["slot"][fresh(records, _master(worn=worn))].astype(np.int64)
    newest = (np.searchsorted(sampled, slots, side="right") - 1).clip(0)
    late = (slots - sampled[newest]) / float(log.header["control_hz"])
    return np.asarray(time_s[newest] + late)


@dataclass(frozen=True, slots=True)
class PulseOfLog:
    """A pulse that began in a log."""

    number: int  # in the plan
    onset_slot: int  # its first tick
    # the first tick without it; None where the log ends with it or does not tell
    end_slot: int | None
    touched: bool  # whether damaged records lie in it, or next to it
    faded: bool  # whether the safety gate broke it off


def begun_pulses(events: Sequence[Event], condition: str, segment: int) -> dict[int, int]:
    """Return the pulses that began in a log by the journal: first tick -> number."""
    return {
        event["slot"]: event["pulse"]
        for event in events
        if event["event"] == "pulse_started"
        and (event["condition"], event["segment"]) == (condition, segment)
    }


def pulses_of_log(log: SessionLog, begun: Mapping[int, int]) -> list[PulseOfLog]:
    """Return the pulses of a log, shams too, in order; also those that damage hides."""
    ticks = ticks_of(log.records)
    number, slot = ticks["pulse"].astype(int), ticks["slot"].astype(int)
    # What lies in a lost end shows in the journal alone, and is lost.
    holes = [hole for hole in damaged_ticks(log) if hole[1] <= slot.max(initial=-1)]
    onsets = {}
    for at in np.flatnonzero((np.diff(number, prepend=0) != 0) & (number > 0)):
        onsets[int(slot[at])] = int(number[at])
    for before, after in holes:  # one that began in it shows later, or never
        hidden = {s: n for s, n in begun.items() if before <= s <= after}
        if onsets.get(after) in hidden.values():
            del onsets[after]
        onsets |= hidden
    changes = np.flatnonzero(np.diff(number)) + 1
    found = []
    for onset_slot, pulse in sorted(onsets.items()):
        first = int(np.searchsorted(slot, onset_slot))
        end = first  # it began and ended in the damage
        if number[first] == pulse:
            end = int(min(changes[changes > first], default=number.size))
        last = int(slot[min(end, number.size - 1)])
        found.append(
            PulseOfLog(
                pulse,
                onset_slot,
                end_slot=int(slot[end]) if end < number.size else None,
                touched=any(before <= last and after >= onset_slot for before, after in holes),
                faded=bool(np.any(ticks["flags"][first:end] & Flag.FADING)),
            )
        )
    return found


def damaged_ticks(log: SessionLog) -> list[tuple[int, int]]:
    """Return the ticks before and after every stretch left out, after a lost end by its size."""
    slot = log.records["slot"].astype(int).tolist()
    last = slot[-1] if slot else -1
    ticks = []
    for at, n_bytes in log.damage:
        n_lost = n_bytes / log.header["record_bytes"] * ((last + 1) / len(slot) if slot else 1.0)
        after = slot[at] if at < len(slot) else last + round(n_lost)
        ticks.append((slot[at - 1] if at else -1, after))
    return ticks


def _pulses(
    log: SessionLog,
    time_s: np.ndarray,
    plan: Sequence[PlannedPulse],
    events: Sequence[Event],
    *,
    worn: bool,
) -> pd.DataFrame:
    """Return the pulses of a stretch as the log shows them, shams left out."""
    name, segment = log.header["condition"], log.header["segment"]
    done = pulses_done(events, name)
    ended = {
        event["onset_slot"]: event.get("slot")
        for event in events
        if event["event"] == "pulse_completed"
        and (event["condition"], event["segment"]) == (name, segment)
    }
    table = []
    for shown in pulses_of_log(log, begun_pulses(events, name, segment)):
        pulse, event = plan[shown.number - 1], done.get(shown.number)
        if pulse.sham:
            continue
        completed = (
            event is not None
            and event["segment"] == segment
            and event["onset_slot"] == shown.onset_slot
        )
        end_slot = ended.get(shown.onset_slot) if shown.touched else None
        last_slot = int(log.records["slot"][-1])
        slots = np.array([shown.onset_slot, end_slot or shown.end_slot or last_slot])
        onset_s, end_s = _times_of(slots, log, time_s, worn=worn)
        table.append(
            {
                "pulse": pulse.number,
                "onset_s": onset_s,
                "duration_s": end_s - onset_s,
                "amplitude_nm": pulse.amplitude_nm,
                "timing_point": pulse.timing_point,
                "completed": completed,
                "damaged": shown.touched,
            }
        )
    return pd.DataFrame(table, columns=list(_PULSE_COLUMNS))
