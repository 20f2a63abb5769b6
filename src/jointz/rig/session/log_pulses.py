"""Ticks, damage and pulses of a session's log."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from jointz.core.session_log import Flag
from jointz.io.log_reader import SessionLog
from jointz.rig.experiment.files.journal import Event, events_of, pulses_done
from jointz.rig.experiment.plan import PlannedPulse


@dataclass(frozen=True, slots=True)
class PulseOfLog:
    """A pulse that began in a log."""

    number: int  # number in the plan
    onset_slot: int  # first tick of the pulse
    # first tick after the pulse; None where the log ends before or leaves it open
    end_slot: int | None
    touched: bool  # whether damaged records lie in the pulse or next to it
    faded: bool  # whether the safety gate aborted the pulse, by a fade or at once


def ticks_of(records: np.ndarray) -> np.ndarray:
    """Return the first record of every tick that there is."""
    slots = records["slot"]
    first = np.append(True, slots[1:] != slots[:-1])[: slots.size]
    return records if first.all() else np.asarray(records[first])  # a copy of hundreds of MB


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


def damaged_s(log: SessionLog, time_s: np.ndarray, new: np.ndarray) -> list[tuple[float, float]]:
    """Return the stretches of a log that were left out, from intact sample to intact sample, s.

    ``new`` tells which records hold the samples of ``time_s``.
    """
    records = log.records
    before = np.concatenate([[0], np.cumsum(new)])
    holes = []
    for at, (_, after) in zip((d.at for d in log.damage), damaged_ticks(log), strict=True):
        first = before[at] == 0  # only the ticks tell how long it was
        lost_s = after / log.header["control_hz"] if first else 0.0
        begin = time_s[0] - lost_s if first else time_s[before[at] - 1]
        end = time_s[min(before[at], time_s.size - 1)]
        if at == records.size:
            end = end + (after - int(records["slot"][-1])) / log.header["control_hz"]
        holes.append((float(begin), float(end)))
    return holes


def begun_pulses(events: Sequence[Event], condition: str, segment: int) -> dict[int, int]:
    """Return the pulses that began in a log by the journal: first tick -> number."""
    started = events_of(events, "pulse_started", condition)
    return {e["slot"]: e["pulse"] for e in started if e.get("segment") == segment}


def pulses_of_log(log: SessionLog, begun: Mapping[int, int]) -> list[PulseOfLog]:
    """Return the pulses of a log in order, with shams and with those that damage hides."""
    ticks = ticks_of(log.records)
    number, slot = ticks["pulse"].astype(int), ticks["slot"].astype(int)
    # A pulse in a lost end stands in the journal alone, and is lost.
    holes = [hole for hole in damaged_ticks(log) if hole[1] <= slot.max(initial=-1)]
    onsets = {}
    for at in np.flatnonzero((np.diff(number, prepend=0) != 0) & (number > 0)):
        onsets[int(slot[at])] = int(number[at])
    for before, after in holes:  # a pulse that began in a hole shows later, or never
        hidden = {s: n for s, n in begun.items() if before <= s <= after}
        if onsets.get(after) in hidden.values():
            del onsets[after]
        onsets |= hidden
    changes = np.flatnonzero(np.diff(number)) + 1
    pulses = []
    for onset_slot, pulse in sorted(onsets.items()):
        first = int(np.searchsorted(slot, onset_slot))
        end = first  # it began and ended in the damage
        if number[first] == pulse:
            end = int(min(changes[changes > first], default=number.size))
        last = int(slot[min(end, number.size - 1)])
        pulses.append(
            PulseOfLog(
                pulse,
                onset_slot,
                end_slot=int(slot[end]) if end < number.size else None,
                touched=any(before <= last and after >= onset_slot for before, after in holes),
                faded=bool(np.any(ticks["flags"][first:end] & (Flag.FADING | Flag.CUT))),
            )
        )
    return pulses


def pulse_rows(
    log: SessionLog,
    time_s: np.ndarray,
    plan: Sequence[PlannedPulse],
    events: Sequence[Event],
    *,
    new: np.ndarray,
) -> list[dict[str, Any]]:
    """Return the pulses of a stretch of walking as its log shows them, shams left out.

    ``new`` tells which records hold the samples of ``time_s``.
    """
    name, segment = log.header["condition"], log.header["segment"]
    done = pulses_done(events, name)
    completed = events_of(events, "pulse_completed", name)
    ended = {e["onset_slot"]: e.get("slot") for e in completed if e.get("segment") == segment}
    last_slot = int(log.records["slot"][-1])
    felt = [
        pulse
        for pulse in pulses_of_log(log, begun_pulses(events, name, segment))
        if not plan[pulse.number - 1].sham
    ]
    ends = [(ended.get(p.onset_slot) if p.touched else None) or p.end_slot for p in felt]
    slots = np.array([[p.onset_slot for p in felt], [end or last_slot for end in ends]], dtype=int)
    onsets_s, ends_s = _times_of(slots, log, time_s, new)
    rows = []
    for shown, onset_s, end_s in zip(felt, onsets_s, ends_s, strict=True):
        pulse, event = plan[shown.number - 1], done.get(shown.number, {})
        rows.append(
            {
                "pulse": pulse.number,
                "onset_s": onset_s,
                "duration_s": end_s - onset_s,
                "amplitude_nm": pulse.amplitude_nm,
                "timing_point": pulse.timing_point,
                "shape": pulse.shape,
                "completed": (event.get("segment"), event.get("onset_slot"))
                == (segment, shown.onset_slot),
                "damaged": shown.touched,
            }
        )
    return rows


def _times_of(
    slots: np.ndarray, log: SessionLog, time_s: np.ndarray, new: np.ndarray
) -> np.ndarray:
    """Return the times of ticks, by the newest sample read until then, s."""
    sampled = log.records["slot"][new].astype(np.int64)
    newest = (np.searchsorted(sampled, slots, side="right") - 1).clip(0)
    late = (slots - sampled[newest]) / float(log.header["control_hz"])
    return np.asarray(time_s[newest] + late)
