"""The journal of a session: what happened, one line an event, kept through a crash.

Every line is JSON followed by its CRC-32, written in one piece. A line that a
crash cut off is recognised and left out. The journal decides what counts as
done: a pulse is done when its end stands here, and then only once. What stands
here and not in the log was lost, and is written down as that.
"""

import json
import os
import zlib
from collections.abc import Iterable
from pathlib import Path
from types import TracebackType
from typing import Any

from jointz.core.errors import DataError, WriteError
from jointz.experiment import file_lock
from jointz.experiment.whole_files import append_whole, open_to_append

Event = dict[str, Any]

#: What says whether a condition is done; the last one counts.
_ENDS = ("condition_completed", "pulse_lost", "records_lost")


class Journal:
    """Appends events to a file, each by one unbuffered write; one process at a time.

    Parameters
    ----------
    path : pathlib.Path
        The file; it is made, or gone on with.

    Raises
    ------
    OutputError
        When another process is at it: both would count its pulses.
    WriteError
        When it cannot be written.
    """

    def __init__(self, path: Path) -> None:
        self._path = path
        try:
            self._fd = open_to_append(path)
        except OSError as exc:
            raise WriteError(str(path), exc) from exc
        try:
            file_lock.hold(self._fd, path)
            _cut_off_torn_line(self._fd, path)
        except BaseException:
            os.close(self._fd)
            raise

    def __enter__(self) -> "Journal":
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        os.close(self._fd)

    def write(self, event: str, **details: Any) -> None:
        """Append an event.

        Parameters
        ----------
        event : str
            What happened.
        **details
            Values that JSON holds.

        Raises
        ------
        WriteError
            When the line could not be written whole.
        """
        text = json.dumps({"event": event, **details}).encode()
        append_whole(self._fd, text + b" %08x\n" % zlib.crc32(text), self._path)


def read_journal(path: Path) -> list[Event]:
    """Return the events of a journal, the oldest first.

    Parameters
    ----------
    path : pathlib.Path
        The file; one that does not exist has no events.

    Raises
    ------
    DataError
        When a line in the middle was altered.
    """
    if not path.exists():
        return []
    lines = path.read_bytes().split(b"\n")
    events = []
    for number, line in enumerate(lines[:-1], start=1):
        event = decode_event(line)
        if event is None:
            raise DataError(
                f"{path}: line {number} was altered or damaged: its checksum does not fit. "
                "Restore the file from a copy.",
                path=str(path),
                row=number,
            )
        events.append(event)
    return events


def decode_event(line: bytes) -> Event | None:
    """Return the event of a line, None where its checksum does not fit.

    Parameters
    ----------
    line : bytes
        Of a journal, without its end.
    """
    text, _, check = line.rpartition(b" ")
    if check != b"%08x" % zlib.crc32(text):
        return None
    event: Event = json.loads(text)
    return event


def pulses_done(events: Iterable[Event], condition: str) -> dict[int, Event]:
    """Return the pulses of a condition that were completed, by their number in the plan.

    Parameters
    ----------
    events : iterable of Event
        Of the journal.
    condition : str
        Name of the condition.

    Raises
    ------
    DataError
        When a pulse was completed twice: two processes ran the session.
    """
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
        elif event["event"] == "pulse_lost":
            done.pop(event["pulse"], None)
    return done


def pulses_begun(events: Iterable[Event], condition: str) -> list[int]:
    """Return the numbers of the pulses of a condition that began, once for every time.

    Parameters
    ----------
    events : iterable of Event
        Of the journal.
    condition : str
        Name of the condition.
    """
    return [
        event["pulse"]
        for event in events
        if event["event"] == "pulse_started" and event["condition"] == condition
    ]


def segments_begun(events: Iterable[Event], condition: str) -> int:
    """Return how many times a condition was begun or taken up again.

    Parameters
    ----------
    events : iterable of Event
        Of the journal.
    condition : str
        Name of the condition.
    """
    return sum(
        event["event"] == "segment_started" and event["condition"] == condition for event in events
    )


def is_completed(events: Iterable[Event], condition: str) -> bool:
    """Tell whether a condition is done.

    Parameters
    ----------
    events : iterable of Event
        Of the journal.
    condition : str
        Name of the condition.
    """
    completed = False
    for event in events:
        if event["condition"] == condition and event["event"] in _ENDS:
            completed = event["event"] == "condition_completed"
    return completed


def _cut_off_torn_line(fd: int, path: Path) -> None:
    """Remove what a crash left of a last line, so that the next one stands alone."""
    content = path.read_bytes()
    whole = content.rfind(b"\n") + 1
    if whole < len(content):
        os.ftruncate(fd, whole)
