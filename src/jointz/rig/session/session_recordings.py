"""Recordings of a study, made from the logs of a session.

:class:`SessionRecordings` does what walking and benches share; its subclasses hold what differs.
"""

import hashlib
from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from pathlib import Path
from typing import Any, ClassVar

import numpy as np
import pandas as pd
import xarray as xr

from jointz.core.channels import MOTION_SENSORS, PULSE_COLUMNS
from jointz.core.protocols.protocol import Protocol
from jointz.core.protocols.protocol_models import ConditionSpec
from jointz.core.recording import build_recording
from jointz.core.session_log import Flag
from jointz.gait.heel_strikes import find_heel_strikes
from jointz.gait.strides import find_strides
from jointz.gait.timestamps import find_gaps
from jointz.io.log_reader import SessionLog, read_log
from jointz.rig.devices.interface import Stretch
from jointz.rig.experiment.files.journal import (
    Event,
    events_of,
    pulses_done,
    pulses_withdrawn,
    segments_begun,
)
from jointz.rig.experiment.files.session_files import has_content, log_path
from jointz.rig.experiment.gait.onset_errors import onset_accuracy
from jointz.rig.experiment.trial_kinds import BENCH_TRIALS, WALKING_TRIALS, TrialKind
from jointz.rig.session.log_pulses import damaged_s, pulse_rows, ticks_of
from jointz.rig.session.run_settings import recording_name
from jointz.rig.session.stream_alignment import LogStreams

#: Between two stretches of a recording: longer than any stride, so it counts as a gap.
PAUSE_S = 10.0
_CLOCKS = {
    "actuator": "actuator_time_ns",
    "angle": "angle_sensor_time_ns",
    "torque": "torque_sensor_time_ns",
    "positioner": "positioner_time_ns",
    "contact": "contact_time_ns",
    "moment": "moment_time_ns",
    **{name: f"{name}_time_ns" for name in MOTION_SENSORS},
}
#: Units of channels that no schema knows, or that may have several.
_UNITS = {
    "applied_torque": "N*m",
    "joint_moment": "N*m",
    "reference": "N*m",
    "position": "rad",
    "reference_position": "rad",
    "trial": "1",
}
_MOTOR = {name: name for name in ("motor_angle", "motor_velocity", "current")}
Rows = list[dict[str, Any]]
#: Calibrated levels of a footswitch that gives volts: off, on; None if not calibrated.
Levels = tuple[float, float] | None


def gives_volts(devices: Mapping[str, Any]) -> bool:
    """Return whether a footswitch gives volts, for which calibrated levels are used."""
    switch = devices.get("contact")
    return bool(switch and switch.get("kind") == "voltage")


@dataclass(frozen=True, slots=True, eq=False)
class ConditionRecord:
    """Recording of a condition, all its stretches one after the other."""

    recording: xr.Dataset
    # one row for each pulse that began, without shams: ``onset_s, duration_s, amplitude_nm``, in
    # walking also ``pulse, timing_point, completed, damaged``
    pulses: pd.DataFrame
    stretches: tuple[Stretch, ...]  # number, offset and end of each log
    logs: tuple[SessionLog, ...]  # logs of the stretches


@dataclass(frozen=True, slots=True)
class _Piece:
    """One log on the time of the recording."""

    log: SessionLog
    streams: LogStreams
    time_s: np.ndarray  # times of all samples of the master device
    counted: np.ndarray  # bool: whether each sample is recorded
    channels: dict[str, np.ndarray]


@dataclass(frozen=True, slots=True)
class SessionRecordings(ABC):
    """The recordings of one session."""

    KIND: ClassVar[TrialKind]

    folder: Path
    participant: str
    protocol: Protocol
    events: Sequence[Event]  # events of the journal
    plans: Mapping[str, Sequence[Any]]  # pulses of every trial
    salvage: bool = False  # whether damaged records are left out instead of refused
    # file of a log -> last slot that is read of it
    until: Mapping[str, int] = field(default_factory=dict)

    def record(self, condition: ConditionSpec) -> ConditionRecord:
        """Join the logs of a condition, one after the other."""
        paths = self._paths(condition)
        logs = [self._log(path) for path in paths]
        of_logs = [LogStreams(log.records) for log in logs]
        master = _CLOCKS["actuator" if condition.worn else "angle"]
        pieces: list[_Piece] = []
        stretches: list[Stretch] = []
        damage_s: list[tuple[float, float]] = []
        end_s = -PAUSE_S
        for log, streams in zip(logs, of_logs, strict=True):
            time_s = streams.values(master, master) * 1e-9
            if not time_s.size:
                continue
            counted = (streams.values("flags", master) & Flag.LEAD) == 0
            holes_s = damaged_s(log, time_s, streams.fresh(master))
            recorded_s = time_s[counted]
            offset_s = end_s + PAUSE_S - self._begin_s(recorded_s, holes_s)
            damage_s += [(begin + offset_s, end + offset_s) for begin, end in holes_s]
            stretches.append(Stretch(int(log.header["segment"]), offset_s, float(recorded_s[-1])))
            channels = self._channels(log, streams, master)
            pieces.append(_Piece(log, streams, time_s + offset_s, counted, channels))
            end_s = max([float(recorded_s[-1]), *(end for _, end in holes_s)]) + offset_s
        notes = [streams.clock_notes(_clocks(streams)) for streams in of_logs]
        recording = self._build(condition, pieces, paths, notes, damage_s)
        pulses = self._pulses(condition, recording, pieces, master)
        return ConditionRecord(recording, pulses, tuple(stretches), tuple(logs))

    def _log(self, path: Path) -> SessionLog:
        log = read_log(path, salvage=self.salvage)
        if path.name not in self.until:
            return log
        return replace(log, records=log.records[log.records["slot"] <= self.until[path.name]])

    def _paths(self, condition: ConditionSpec) -> list[Path]:
        """Return the logs that count: all stretches, or the last of each trial."""
        paths = []
        for name in condition.trial_names:
            count = segments_begun(self.events, name)
            segments = range(count) if self.KIND.resumes else [count - 1]
            files = [log_path(self.folder, name, segment) for segment in segments]
            paths += [file for file in files if not self.KIND.resumes or has_content(file)]
        return paths

    def _build(
        self,
        condition: ConditionSpec,
        pieces: list[_Piece],
        paths: list[Path],
        clocks: list[dict[str, dict[str, float]]],
        damage_s: list[tuple[float, float]],
    ) -> xr.Dataset:
        channels = {
            name: np.concatenate([piece.channels[name][piece.counted] for piece in pieces])
            for name in pieces[0].channels
        }
        if any(one.trials > 1 for one in self.protocol.conditions):
            numbers = np.arange(1.0, len(pieces) + 1.0)
            channels["trial"] = np.repeat(numbers, [piece.counted.sum() for piece in pieces])
        volts = gives_volts(pieces[0].log.header.get("devices", {}))
        contact = ("voltage" if volts else "contact") if "contact" in channels else ""
        history: list[dict[str, Any]] = [
            {
                "step": "converted from the session's logs",
                "logs": [path.name for path in paths],
                "sha256": [hashlib.sha256(path.read_bytes()).hexdigest() for path in paths],
                "clocks": clocks,
            }
        ]
        if damage_s:
            step = "left out damaged records of the session's logs"
            history.append({"step": step, "damaged_s": [list(hole) for hole in damage_s]})
        return build_recording(
            np.concatenate([piece.time_s[piece.counted] for piece in pieces]),
            channels,
            units=_UNITS | {"contact": "V" if volts else "1"},
            condition=condition.condition,
            file=recording_name(self.participant, condition.name),
            contact_kind=contact,
            history=tuple(history),
            participant=self.participant,
            joint=self.protocol.joint,
            positive=self.protocol.positive,
        )

    @abstractmethod
    def _begin_s(self, time_s: np.ndarray, holes_s: list[tuple[float, float]]) -> float:
        """Return where a stretch begins, s."""

    @abstractmethod
    def _channels(self, log: SessionLog, streams: LogStreams, master: str) -> dict[str, np.ndarray]:
        """Return the channels of a log at the samples of the master clock."""

    @abstractmethod
    def _pulses(
        self, condition: ConditionSpec, recording: xr.Dataset, pieces: list[_Piece], master: str
    ) -> pd.DataFrame:
        """Return the pulses of a condition."""

    @abstractmethod
    def onset_rows(
        self, condition: ConditionSpec, record: ConditionRecord, levels_v: Levels
    ) -> Rows:
        """Return how many pulses were done, and where in the gait cycle they began."""

    @abstractmethod
    def gap_rows(self, condition: ConditionSpec, record: ConditionRecord) -> Rows:
        """Return how many strides lay between the pulses."""

    @abstractmethod
    def aborted_rows(self, condition: ConditionSpec, record: ConditionRecord) -> Rows:
        """Return the pulses that were broken off, whose recording holds them all the same."""


class WalkingRecordings(SessionRecordings):
    """Recordings of walking: all stretches of a condition, pulses at points of the gait cycle.

    Those with a controller are the same, without pulses.
    """

    KIND = WALKING_TRIALS

    def _begin_s(self, time_s: np.ndarray, holes_s: list[tuple[float, float]]) -> float:
        return min([float(time_s[0]), *(begin for begin, _ in holes_s)])

    def _channels(self, log: SessionLog, streams: LogStreams, master: str) -> dict[str, np.ndarray]:
        del log
        aligned, clocks = partial(_aligned, streams, master), _clocks(streams)
        channels = {"angle": aligned("angle"), "contact": aligned("contact")}
        if "moment" in clocks:
            channels["joint_moment"] = aligned("moment", "joint_moment")
        channels |= {name: aligned(name) for name in MOTION_SENSORS if name in clocks}
        if master == _CLOCKS["actuator"]:
            channels |= _motor(streams, _MOTOR | {"applied_torque": "applied_torque"})
        return channels

    def _pulses(
        self, condition: ConditionSpec, recording: xr.Dataset, pieces: list[_Piece], master: str
    ) -> pd.DataFrame:
        del recording
        plan = self.plans.get(condition.name, ())
        rows = [
            row
            for piece in pieces
            for row in pulse_rows(
                piece.log, piece.time_s, plan, self.events, new=piece.streams.fresh(master)
            )
        ]
        return pd.DataFrame(rows, columns=[*PULSE_COLUMNS, "damaged"])

    def onset_rows(
        self, condition: ConditionSpec, record: ConditionRecord, levels_v: Levels
    ) -> Rows:
        """Return how many pulses of each timing point were done, and where they began."""
        if condition.perturbations is None:
            return []
        strikes = find_heel_strikes(record.recording, levels_v=levels_v)
        strides = find_strides(strikes.time_s, find_gaps(record.recording["time"].to_numpy()))
        accuracy = onset_accuracy(
            record.pulses,
            strides,
            timing_points=condition.perturbations.timing_points or {},
            strides_in_mean=self.protocol.gait.strides_in_mean if self.protocol.gait else 1,
        )
        # Shams are in plan and journal, not among the pulses.
        plan = self.plans.get(condition.name, ())
        point_of = {pulse.number: pulse.timing_point for pulse in plan if not pulse.sham}
        outcomes = {
            "planned": list(point_of),
            "completed": list(pulses_done(self.events, condition.name)),
            "withdrawn": list(pulses_withdrawn(self.events, condition.name)),
            **{
                outcome: [
                    event["pulse"]
                    for event in events_of(self.events, f"pulse_{outcome}", condition.name)
                ]
                for outcome in ("missed", "aborted", "lost")
            },
        }
        rows: Rows = []
        for row in accuracy.to_dict("records"):
            counts = {
                outcome: sum(point_of.get(number) == row["timing_point"] for number in numbers)
                for outcome, numbers in outcomes.items()
            }
            about = {"participant": self.participant, "condition": condition.name}
            rows.append(about | counts | {str(name): value for name, value in row.items()})
        return rows

    def gap_rows(self, condition: ConditionSpec, record: ConditionRecord) -> Rows:
        """Return strides between pulses of one stretch, as the device counted them."""
        if condition.perturbations is None:
            return []
        gaps: list[int] = []
        for log in record.logs:
            number = log.records["pulse"].astype(np.int64)
            begins = np.flatnonzero((np.diff(number, prepend=0) != 0) & (number > 0))
            gaps += np.diff(log.records["stride"][begins].astype(int)).tolist()
        fewest, most = condition.perturbations.gap_strides or (0, 0)
        return [
            {
                "participant": self.participant,
                "condition": condition.name,
                "fewest": min(gaps, default=0),
                "most": max(gaps, default=0),
                "longer_than_planned": sum(gap > most for gap in gaps),
                "planned_fewest": fewest,
                "planned_most": most,
            }
        ]

    def aborted_rows(self, condition: ConditionSpec, record: ConditionRecord) -> Rows:
        """Return the pulses that were broken off; those that are damaged have another code."""
        if condition.perturbations is None:
            return []
        file, pulses = recording_name(self.participant, condition.name), record.pulses
        aborted = pulses[~(pulses["completed"] | pulses["damaged"]).astype(bool)]
        return [
            {"participant": self.participant, "recording": file, "onset_s": float(onset)}
            for onset in aborted["onset_s"]
        ]


class BenchRecordings(SessionRecordings):
    """Recordings of a bench: the trials of a condition, each while its reference was followed."""

    KIND = BENCH_TRIALS

    def _begin_s(self, time_s: np.ndarray, holes_s: list[tuple[float, float]]) -> float:
        del holes_s  # damage before the first sample lies in the lead, which is not recorded
        return float(time_s[0])

    def _channels(self, log: SessionLog, streams: LogStreams, master: str) -> dict[str, np.ndarray]:
        devices, aligned = log.header["devices"], partial(_aligned, streams, master)
        channels = _motor(streams, _MOTOR | {"reference": "reference_torque"})
        channels["angle"] = channels["motor_angle"]
        if devices["angle"] is not None:
            channels["angle"] = aligned("angle")
        if devices["torque"] is not None:
            channels[devices["torque"]["channel"]] = aligned("torque", "measured_torque")
        if devices["positioner"] is not None:
            channels[devices["positioner"]["channel"]] = aligned("positioner", "position")
            reference = streams.values("reference_position", master)
            channels["reference_position"] = reference.astype(float)
        if devices["contact"] is not None:
            channels["contact"] = aligned("contact")
        return channels

    def _pulses(
        self, condition: ConditionSpec, recording: xr.Dataset, pieces: list[_Piece], master: str
    ) -> pd.DataFrame:
        """Return the pulses of one trial as its command shows them; several have no table."""
        del pieces, master
        if condition.trials > 1:
            return pd.DataFrame()
        time = recording["time"].to_numpy()
        on = np.concatenate([[False], recording["command"].to_numpy() != 0.0, [False]])
        begins, ends = np.flatnonzero(on[1:] & ~on[:-1]), np.flatnonzero(on[:-1] & ~on[1:])
        ends = np.minimum(ends, time.size - 1)  # of a pulse that is on in the last sample
        plan = self.plans.get(condition.name, ())
        felt = [pulse.amplitude_nm for pulse in plan if pulse.amplitude_nm != 0.0]
        return pd.DataFrame(
            {
                "onset_s": time[begins],
                "duration_s": time[ends] - time[begins],
                "amplitude_nm": felt[: begins.size],
            }
        )

    def onset_rows(
        self, condition: ConditionSpec, record: ConditionRecord, levels_v: Levels
    ) -> Rows:
        """Return how many pulses a condition had: an interrupted trial was done again whole."""
        del record, levels_v
        count = sum(len(self.plans.get(name, ())) for name in condition.trial_names)
        row: dict[str, Any] = {"participant": self.participant, "condition": condition.name}
        row |= {"timing_point": "", "planned_pct": None, "planned": count, "completed": count}
        row |= dict.fromkeys(("missed", "aborted", "lost", "withdrawn", "n", "n_missing"), 0)
        row |= dict.fromkeys(("error_mean_pct", "error_sd_pct", "theory_sd_pct"))
        return [row] if count else []

    def gap_rows(self, condition: ConditionSpec, record: ConditionRecord) -> Rows:
        """Return nothing: there are no strides."""
        del condition, record
        return []

    aborted_rows = gap_rows


def _clocks(streams: LogStreams) -> dict[str, str]:
    """Return the clocks that the log's layout has."""
    fields = streams.records.dtype.names or ()
    return {device: clock for device, clock in _CLOCKS.items() if clock in fields}


def _aligned(streams: LogStreams, master: str, device: str, field: str = "") -> np.ndarray:
    """Return what a device measured at the samples of the master clock; a contact is held."""
    clock, held = _CLOCKS[device], device == "contact"
    return streams.onto(field or device, clock=clock, master=master, interpolated=not held)


def _motor(streams: LogStreams, fields: Mapping[str, str]) -> dict[str, np.ndarray]:
    """Return channels of the actuator's samples, and the pulse torque asked for then, N*m."""
    channels = {
        name: streams.values(field, _CLOCKS["actuator"]).astype(float)
        for name, field in (*fields.items(), ("command", "command"))
    }
    slot, ticks = streams.values("slot", _CLOCKS["actuator"]), ticks_of(streams.records)
    # Of several samples that came with a tick all but the last were taken before its command.
    before = np.concatenate([[0.0], ticks["command"].astype(float)[:-1]])
    last = np.append(slot[1:] != slot[:-1], True)[: slot.size]
    tick = np.searchsorted(ticks["slot"], slot)
    return channels | {"command": np.where(last, channels["command"], before[tick])}
