"""From the raw logs of a session on a bench to the recordings of a study."""

import hashlib
from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pandas as pd
import xarray as xr

from jointz.core.protocols.protocol import ConditionSpec, Protocol
from jointz.core.recording import build_recording
from jointz.core.session_log import Flag
from jointz.experiment.bench.bench_plan import TimedPulse
from jointz.experiment.files.journal import Event, segments_begun
from jointz.experiment.files.session_files import log_path
from jointz.io.log_reader import SessionLog, read_log
from jointz.session.session_recordings import (
    PAUSE_S,
    command_at_samples,
    damage_step,
    damaged_s,
)
from jointz.session.stream_alignment import clock_notes, fresh, onto

_CLOCKS = {
    "actuator": "actuator_time_ns",
    "angle": "angle_sensor_time_ns",
    "torque": "torque_sensor_time_ns",
    "positioner": "positioner_time_ns",
    "contact": "contact_time_ns",
}
_MASTER = _CLOCKS["actuator"]
#: Channel of the recording -> field of the log.
_ACTUATOR_FIELDS = {
    "motor_angle": "motor_angle",
    "motor_velocity": "motor_velocity",
    "current": "current",
    "reference": "reference_torque",
}
#: Units of channels that no schema knows, or that may have several.
_UNITS = {
    "reference": "N*m",
    "position": "rad",
    "reference_position": "rad",
    "trial": "1",
    "contact": "V",
}


def bench_record(
    folder: Path,
    condition: ConditionSpec,
    *,
    events: Sequence[Event],
    file: str,
    participant: str,
    protocol: Protocol,
    salvage: bool = False,
) -> tuple[xr.Dataset, tuple[SessionLog, ...]]:
    """Put the trials of a condition together, one after the other."""
    paths = [
        log_path(folder, name, segments_begun(events, name) - 1) for name in condition.trial_names
    ]
    logs = tuple(read_log(path, salvage=salvage) for path in paths)
    repeated = any(one.trials > 1 for one in protocol.conditions)
    pieces, end_s = [], -PAUSE_S
    damage_s: list[tuple[float, float]] = []
    for number, log in enumerate(logs, start=1):
        time, channels, holes_s = _trial(log)
        offset_s = end_s + PAUSE_S - time[0]
        time = time + offset_s
        damage_s += [(begin + offset_s, end + offset_s) for begin, end in holes_s]
        if repeated:
            channels["trial"] = np.full(time.size, float(number))
        pieces.append((time, channels))
        end_s = max([float(time[-1]), *(end + offset_s for _, end in holes_s)])
    recording = build_recording(
        np.concatenate([time for time, _ in pieces]),
        {name: np.concatenate([c[name] for _, c in pieces]) for name in pieces[0][1]},
        units={name: unit for name, unit in _UNITS.items() if name in pieces[0][1]},
        condition=condition.condition,
        file=file,
        contact_kind="voltage" if "contact" in pieces[0][1] else "",
        history=(
            {
                "step": "converted from the session's logs",
                "logs": [path.name for path in paths],
                "sha256": [hashlib.sha256(path.read_bytes()).hexdigest() for path in paths],
                "clocks": [clock_notes(log.records, _clocks(log)) for log in logs],
            },
            *damage_step(damage_s),
        ),
        participant=participant,
        joint=protocol.joint,
        positive=protocol.positive,
    )
    return recording, logs


def pulse_table(recording: xr.Dataset, plan: Sequence[TimedPulse]) -> pd.DataFrame:
    """Return the pulses of one trial as its command shows them."""
    time = recording["time"].to_numpy()
    on = np.concatenate([[False], recording["command"].to_numpy() != 0.0, [False]])
    begins, ends = np.flatnonzero(on[1:] & ~on[:-1]), np.flatnonzero(on[:-1] & ~on[1:])
    ends = np.minimum(ends, time.size - 1)  # one that is on in the last sample
    felt = [pulse.amplitude_nm for pulse in plan if pulse.amplitude_nm != 0.0]
    return pd.DataFrame(
        {
            "onset_s": time[begins],
            "duration_s": time[ends] - time[begins],
            "amplitude_nm": felt[: begins.size],
        }
    )


def _clocks(log: SessionLog) -> dict[str, str]:
    """Return the clocks that the log's layout has."""
    fields = log.records.dtype.names or ()
    return {device: clock for device, clock in _CLOCKS.items() if clock in fields}


def _trial(
    log: SessionLog,
) -> tuple[np.ndarray, dict[str, np.ndarray], list[tuple[float, float]]]:
    """Return time, channels and damage of a trial, while its reference was followed."""
    records, devices = log.records, log.header["devices"]
    new = fresh(records, _MASTER)
    rows = records[new]
    channels = {name: rows[field].astype(float) for name, field in _ACTUATOR_FIELDS.items()}
    channels["command"] = command_at_samples(records, new)
    channels["angle"] = channels["motor_angle"]
    if devices["angle"] is not None:
        channels["angle"] = onto(records, "angle", clock="angle_sensor_time_ns", master=_MASTER)
    if devices["torque"] is not None:
        name = devices["torque"]["channel"]
        channels[name] = onto(
            records, "measured_torque", clock="torque_sensor_time_ns", master=_MASTER
        )
    if devices["positioner"] is not None:
        name = devices["positioner"]["channel"]
        channels[name] = onto(records, "position", clock="positioner_time_ns", master=_MASTER)
        channels["reference_position"] = rows["reference_position"].astype(float)
    if devices["contact"] is not None:
        channels["contact"] = onto(
            records, "contact", clock=_CLOCKS["contact"], master=_MASTER, interpolated=False
        )
    counts = (rows["flags"] & Flag.LEAD) == 0
    time_s = rows[_MASTER] * 1e-9
    holes_s = damaged_s(log, time_s, _MASTER)
    return time_s[counts], {name: v[counts] for name, v in channels.items()}, holes_s
