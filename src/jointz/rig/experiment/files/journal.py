"""The journal of a session: its events, one a line, kept through a crash.

Every line is JSON followed by its CRC-32, written in one piece. A line that a
crash cut off is recognised and left out. The journal decides what counts as
done: a pulse is done once its end is written here. What the journal has and
the log has not is written down as lost.
"""

import json
import os
import re
from collections.abc import Iterable
from pathlib import Path
from typing import Any

from jointz.core.errors import DataError, WriteError
from jointz.core.session_log import checked_line, checked_text
from jointz.rig.experiment.files import file_lock
from jointz.rig.experiment.files.whole_files import (
    append_whole,
    kept_beside,
    open_to_append,
    write_whole,
)

Event = dict[str, Any]

#: Events that decide whether a condition is done; the last one counts.
_ENDS = ("condition_completed", "pulse_lost", "records_lost")
#: Events that happen once, unless the loss stands in between.
_LOSSES = {"pulse_completed": "pulse_lost", "condition_completed": "records_lost"}
_ANY_LINE = re.compile(rb'\{"event".*?\} [0-9a-f]{8}')


class Journal:
    """Appends events to a file, each by one unbuffered write; one process at a time."""

    def __init__(self, path: Path) -> None:
        self._path = path
        self._fd = _locked(path)
        try:
            _mend_torn_line(self._fd, path)
        except BaseException:
            os.close(self._fd)
            raise

    def __enter__(self) -> "Journal":
        return self

    def __exit__(self, *_: object) -> None:
        os.close(self._fd)

    def write(self, event: str, **details: Any) -> None:
        """Append an event."""
        append_whole(self._fd, _line({"event": event, **details}), self._path)


def salvage_journal(path: Path) -> None:
    """Remove damaged lines from a journal; the damaged file is kept beside it."""
    if not path.exists():
        return
    fd = _locked(path)
    try:
        content = path.read_bytes()
        intact = _intact_lines(content)
        if content == b"".join(line + b"\n" for line in intact):
            return
        lines = content.split(b"\n")
        numbers = [str(n) for n, line in enumerate(lines, 1) if line and checked_text(line) is None]
        text = (
            f"{path.name}: line {', '.join(numbers)} damaged and left out; the file as it was is "
            f"{kept_beside(path).name}."
        )
        events = [*_salvaged(intact), {"event": "salvaged", "condition": "", "text": text}]
        write_whole(path, b"".join(map(_line, events)).decode("ascii"))
    finally:
        os.close(fd)


def write_salvaged(journal: Journal, events: Iterable[Event], texts: Iterable[str]) -> None:
    """Write down what is damaged, unless it stands there already."""
    known_texts = set(salvaged_texts(events))
    for text in texts:
        if text not in known_texts:
            journal.write("salvaged", condition="", text=text)


def salvaged_texts(events: Iterable[Event]) -> list[str]:
    """Return the sentences about damaged files that stand in a journal."""
    return [event["text"] for event in events if event["event"] == "salvaged"]


def read_journal(path: Path, *, salvage: bool = False) -> list[Event]:
    """Return the events of a journal, the oldest first."""
    if not path.exists():
        return []
    content = path.read_bytes()
    if salvage:
        return _salvaged(_intact_lines(content))
    events = []
    for number, line in enumerate(content.split(b"\n")[:-1], start=1):
        event = decode_event(line)
        if event is None:
            raise _damaged_line(path, number)
        events.append(event)
    return events


def decode_event(line: bytes) -> Event | None:
    """Return the event of a line, None where its checksum does not fit."""
    text = checked_text(line)
    return None if text is None else dict(json.loads(text))


def events_of(events: Iterable[Event], kind: str, condition: str) -> list[Event]:
    """Return the events of one kind and condition."""
    return [event for event in events if (event["event"], event["condition"]) == (kind, condition)]


def pulses_withdrawn(events: Iterable[Event], condition: str) -> set[int]:
    """Return the pulses of a condition that are not tried again, by their number in the plan."""
    return {event["pulse"] for event in events_of(events, "pulse_withdrawn", condition)}


def pulses_done(events: Iterable[Event], condition: str) -> dict[int, Event]:
    """Return the pulses of a condition that were completed, by their number in the plan."""
    done: dict[int, Event] = {}
    for event in events:
        if event["condition"] != condition:
            continue
        if event["event"] == "pulse_completed":
            if event["pulse"] in done:
                raise DataError(
                    f"journal: pulse {event['pulse']} of {condition} was completed twice; expected "
                    "once. The session was run by two programs at a time: leave it out."
                )
            done[event["pulse"]] = event
        elif event["event"] in ("pulse_lost", "pulse_damaged"):
            done.pop(event["pulse"], None)
    return done


def pulses_begun(events: Iterable[Event], condition: str) -> list[int]:
    """Return the numbers of the pulses of a condition that began, once for every time."""
    return [event["pulse"] for event in events_of(events, "pulse_started", condition)]


def last_controller(events: Iterable[Event], condition: str) -> Any:
    """Return the description of the controller of a condition's last stretch, None without."""
    started = events_of(events, "controller", condition)
    return started[-1]["description"] if started else None


def segments_begun(events: Iterable[Event], condition: str) -> int:
    """Return how many times a condition was begun or taken up again."""
    events_of_condition = [event for event in events if event["condition"] == condition]
    highest = max((int(event.get("segment", -1)) for event in events_of_condition), default=-1)
    # Lines may be damaged and left out: the highest number tells more than their count.
    return max(
        highest + 1, [event["event"] for event in events_of_condition].count("segment_started")
    )


def is_completed(events: Iterable[Event], condition: str) -> bool:
    """Return whether a condition is done."""
    completed = False
    for event in events:
        if event["condition"] == condition and event["event"] in _ENDS:
            completed = event["event"] == "condition_completed"
    return completed


def _line(event: Event) -> bytes:
    return checked_line(json.dumps(event).encode())


def _locked(path: Path) -> int:
    """Return the descriptor of a journal, locked against other processes."""
    try:
        fd = open_to_append(path)
    except OSError as exc:
        raise WriteError(str(path), exc) from exc
    try:
        file_lock.hold(fd, path)
    except BaseException:
        os.close(fd)
        raise
    return fd


def _mend_torn_line(fd: int, path: Path) -> None:
    """Remove a last line that a crash cut off, so that the next one begins a line."""
    content = path.read_bytes()
    whole = content.rfind(b"\n") + 1
    torn = content[whole:]
    if torn and decode_event(torn) is not None:  # all but its end
        append_whole(fd, b"\n", path)
    elif torn and decode_event(torn[:-1]) is not None:  # no crash wrote another end
        raise _damaged_line(path, content.count(b"\n") + 1)
    elif torn:
        os.ftruncate(fd, whole)


def _damaged_line(path: Path, number: int) -> DataError:
    return DataError(
        f"{path}: line {number} was altered or damaged: its checksum does not fit. "
        "Restore the file from a copy, or add --salvage, which leaves damaged lines out.",
        path=str(path),
        row=number,
    )


def _intact_lines(content: bytes) -> list[bytes]:
    """Return the lines whose checksum fits, also where the end of the one before is damaged."""
    lines: list[bytes] = []
    for line in content.split(b"\n"):
        candidates = [line] if checked_text(line) is not None else _ANY_LINE.findall(line)
        lines += [one for one in candidates if checked_text(one) is not None]
    return lines


def _salvaged(lines: Iterable[bytes]) -> list[Event]:
    """Return events between which some are missing: what happened twice was lost in between."""
    events: list[Event] = []
    happened: set[tuple[Any, ...]] = set()
    for line in lines:
        event = json.loads(line.rpartition(b" ")[0])
        what = (event["condition"], event.get("pulse"))
        if event["event"] in _LOSSES.values():
            happened.discard(what)
        elif event["event"] in _LOSSES:
            if what in happened:
                events.append({**event, "event": _LOSSES[event["event"]], "reason": "damaged line"})
            happened.add(what)
        events.append(event)
    return events
