"""Comparison of the logs of a session with its journal, before the session continues."""

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

from jointz.core.errors import DataError
from jointz.core.protocols.protocol import Protocol
from jointz.core.protocols.protocol_models import ConditionSpec
from jointz.io.log_reader import SessionLog, read_log
from jointz.rig.experiment.decisions import pulses_needed
from jointz.rig.experiment.files.journal import (
    Event,
    Journal,
    events_of,
    is_completed,
    pulses_done,
    read_journal,
    salvage_journal,
    segments_begun,
    write_salvaged,
)
from jointz.rig.experiment.files.session_files import JOURNAL_FILE, has_content, log_path
from jointz.rig.experiment.trial import COOL_DOWN_STRIDES
from jointz.rig.experiment.trial_kinds import WALKING_TRIALS
from jointz.rig.session.log_pulses import begun_pulses, damaged_ticks, pulses_of_log, ticks_of

_SAME = ("event", "condition", "segment", "pulse", "slot")


def write_down_losses(folder: Path, protocol: Protocol, *, salvage: bool = False) -> None:
    """Write into the journal what it counts as done and the logs have lost; it is done again.

    A log that is gone, was cut or lost its end to the power keeps a pulse or a condition
    from being done, whatever the journal says.
    """
    if not folder.exists():
        return
    file = folder / JOURNAL_FILE
    if salvage:
        salvage_journal(file)
    with Journal(file) as journal:
        trials = [name for condition in protocol.conditions for name in condition.trial_names]
        if salvage:
            for event in missing_events(folder, protocol, read_journal(file)):
                journal.write(**event)
        events = read_journal(file)
        _refuse_unknown_logs(folder, trials, events)
        for name in trials:
            logs = _logs(folder, name, events, salvage=salvage)
            write_salvaged(journal, events, _damage_texts(logs, events))
            for lost in _losses(name, logs, events):
                journal.write(**lost)


def missing_events(folder: Path, protocol: Protocol, events: list[Event]) -> list[dict[str, Any]]:
    """Return the events that the logs show and a damaged journal lacks."""
    known = {tuple(event.get(key) for key in _SAME) for event in events}
    missing: list[dict[str, Any]] = []
    for condition in protocol.conditions:
        for name in condition.trial_names:
            for segment in _segments_on_disk(folder, name):
                shown = _shown(folder, condition, name, segment, [*events, *missing])
                missing += [
                    {**event, "from": "log"}
                    for event in shown
                    if tuple(event.get(key) for key in _SAME) not in known
                ]
    return missing


def _refuse_unknown_logs(folder: Path, trials: list[str], events: list[Event]) -> None:
    known = {
        log_path(folder, name, segment)
        for name in trials
        for segment in range(segments_begun(events, name))
    }
    unknown = sorted(set((folder / "logs").glob("*.jzlog")) - known)
    if unknown:
        raise DataError(
            f"{unknown[0]}: a log that the journal knows nothing of ({len(unknown)} in all). "
            f"Restore {JOURNAL_FILE} from a copy, add --salvage, which restores it from the logs, "
            "or move the log away.",
            path=str(unknown[0]),
        )


def _segments_on_disk(folder: Path, name: str) -> list[int]:
    """Return the stretches of a trial that have a log."""
    numbers = (p.stem.removeprefix(f"{name}-") for p in (folder / "logs").glob(f"{name}-*.jzlog"))
    return sorted(int(number) for number in numbers if number.isdecimal())


def _shown(
    folder: Path, condition: ConditionSpec, name: str, segment: int, events: list[Event]
) -> Iterator[dict[str, Any]]:
    """Yield what a log shows to have happened."""
    about = {"condition": name, "segment": segment}
    yield {"event": "segment_started", **about}
    file = log_path(folder, name, segment)
    if not has_content(file):
        return
    log = read_log(file, salvage=True)
    if "stride" not in (log.records.dtype.names or ()) or not log.records.size:
        return  # a trial on a bench is done again from its beginning
    done = set(pulses_done(events, name))
    needed_strides = condition.strides or 0
    for pulse in pulses_of_log(log, begun_pulses(events, name, segment)):
        yield {"event": "pulse_started", **about, "pulse": pulse.number, "slot": pulse.onset_slot}
        if pulse.end_slot is None or pulse.touched or pulse.faded:
            continue
        if pulse.number not in done:
            slots = {"slot": pulse.end_slot, "onset_slot": pulse.onset_slot}
            yield {"event": "pulse_completed", **about, "pulse": pulse.number, **slots}
            done.add(pulse.number)
        ticks = ticks_of(log.records)
        at_end = ticks["stride"][np.searchsorted(ticks["slot"], pulse.end_slot)]
        needed_strides = int(at_end) + COOL_DOWN_STRIDES
    planned = WALKING_TRIALS.read_plan(folder, events).get(name, ())
    if done >= pulses_needed(planned, events, name) and log.records["stride"][-1] >= needed_strides:
        yield {"event": "condition_completed", **about, "log_bytes": log.whole_bytes}


def _logs(
    folder: Path, name: str, events: list[Event], *, salvage: bool
) -> list[tuple[Path, SessionLog | None]]:
    """Return the logs of a trial, None for one that is gone."""
    files = [log_path(folder, name, segment) for segment in range(segments_begun(events, name))]
    return [(f, read_log(f, salvage=salvage) if has_content(f) else None) for f in files]


def _damage_texts(logs: list[tuple[Path, SessionLog | None]], events: list[Event]) -> Iterator[str]:
    """Yield sentences about the seconds and pulses that damage costs."""
    for file, log in logs:
        if log is None:
            continue
        if log.damaged_copy:
            copy = log.damaged_copy
            yield f"{file.name}: the {copy} copy of its header is damaged; the other was taken."
        if log.damage:
            yield _damage_text(file, log, events)


def _damage_text(file: Path, log: SessionLog, events: list[Event]) -> str:
    hz = log.header["control_hz"]
    seconds = [f"{max(a, 0) / hz:.3f} to {b / hz:.3f} s" for a, b in damaged_ticks(log)]
    n_records = sum(-(-n // log.header["record_bytes"]) for _, n in log.damage)
    touched = [str(number) for number in [*_touched(log, events), *_beyond_end(log, events)]]
    cost = f"pulses {', '.join(touched)} are lost" if touched else "no pulse is lost"
    return (
        f"{file.name}: {n_records} damaged records left out, from {', '.join(seconds)} after its "
        f"start; {cost}."
    )


def _touched(log: SessionLog, events: list[Event]) -> list[int]:
    """Return the numbers of the pulses that damage touches."""
    if "stride" not in (log.records.dtype.names or ()):
        return []
    begun = begun_pulses(events, log.header["condition"], log.header["segment"])
    return [pulse.number for pulse in pulses_of_log(log, begun) if pulse.touched]


def _beyond_end(log: SessionLog, events: list[Event]) -> list[int]:
    """Return the numbers of the pulses that ended after the last intact record."""
    last = log.records["slot"].max(initial=0)
    return [
        event["pulse"]
        for event in events_of(events, "pulse_completed", log.header["condition"])
        if event["segment"] == log.header["segment"] and event.get("slot", 0) - 1 > last
    ]


def _losses(
    name: str, logs: list[tuple[Path, SessionLog | None]], events: list[Event]
) -> Iterator[dict[str, Any]]:
    """Return the events to write for one trial."""
    done = pulses_done(events, name)
    ended = is_completed(events, name)
    for segment, (file, log) in enumerate(logs):
        about = {"condition": name, "segment": segment, "reason": f"not in {file.name}"}
        damaged = _touched(log, events) if log is not None and log.damage else []
        for number, event in done.items():
            if event["segment"] != segment:
                continue
            if number in damaged:  # a condition that is done stays done
                yield {"event": "pulse_damaged", "pulse": number, **about}
            elif not _holds_pulse(log, event):
                yield {"event": "pulse_lost", "pulse": number, **about}
                ended = False
        if ended and not _holds_end(log, _size_at_end(events, name, segment)):
            yield {"event": "records_lost", **about}


def _holds_pulse(log: SessionLog | None, completed: Event) -> bool:
    """Return whether a log has a pulse from its onset to the tick before its end."""
    if log is None or log.records.size == 0:
        return False
    records = log.records
    began = records["pulse"][records["slot"] == completed["onset_slot"]]
    return bool(np.any(began == completed["pulse"])) and bool(
        records["slot"][-1] >= completed["slot"] - 1
    )


def _size_at_end(events: list[Event], name: str, segment: int) -> int:
    """Return the bytes of a log when its condition was completed.

    0 where it was not, and where what it lost stands in the journal already: that was done again.
    """
    size_bytes = 0
    for event in events:
        if (event["condition"], event.get("segment")) != (name, segment):
            continue
        if event["event"] == "condition_completed":
            size_bytes = event["log_bytes"]
        elif event["event"] in ("pulse_lost", "records_lost"):
            size_bytes = 0
    return size_bytes


def _holds_end(log: SessionLog | None, size_bytes: int) -> bool:
    """Return whether a log is complete to within its last second, which loses nothing."""
    if log is None:
        return size_bytes == 0
    second = log.header["record_bytes"] * log.header["control_hz"]
    return bool(log.whole_bytes >= size_bytes - second)
