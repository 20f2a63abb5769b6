"""The journal of a session: what happened, one line an event, kept through a crash.

Every line is JSON followed by its CRC-32, written in one piece. A line that a
crash cut off is recognised and left out. The journal decides what counts as
done: a pulse is done when its end stands here, and then only once.
"""

import json
import os
import zlib
from collections.abc import Iterable
from pathlib import Path
from types import TracebackType
from typing import Any

from jointz.core.errors import DataError

Event = dict[str, Any]


class Journal:
    """Appends events to a file, each by one unbuffered write.

    Parameters
    ----------
    path : pathlib.Path
        The file; it is made, or gone on with.
    """

    def __init__(self, path: Path) -> None:
        _cut_off_torn_line(path)
        self._fd = os.open(path, os.O_WRONLY | os.O_CREAT | os.O_APPEND, 0o644)

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
        OSError
            When the line could not be written whole.
        """
        text = json.dumps({"event": event, **details}).encode()
        line = text + b" %08x\n" % zlib.crc32(text)
        if os.write(self._fd, line) != len(line):
            raise OSError(f"journal: the disk took only a part of the event {event!r}.")


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
        text, _, check = line.rpartition(b" ")
        if check != b"%08x" % zlib.crc32(text):
            raise DataError(
                f"{path}: line {number} was altered or damaged: its checksum does not fit. "
                "Restore the file from a copy.",
                path=str(path),
                row=number,
            )
        events.append(json.loads(text))
    return events


def pulses_done(events: Iterable[Event], condition: str) -> dict[int, Event]:
    """Return the pulses of a condition that were completed, by their number in the plan.

    Parameters
    ----------
    events : iterable of Event
        Of the journal.
    condition : str
        Name of the condition.
    """
    return {
        event["pulse"]: event
        for event in events
        if event["event"] == "pulse_completed" and event["condition"] == condition
    }


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
    return any(
        event["event"] == "condition_completed" and event["condition"] == condition
        for event in events
    )


def _cut_off_torn_line(path: Path) -> None:
    """Remove what a crash left of a last line, so that the next one stands alone."""
    if not path.exists():
        return
    content = path.read_bytes()
    whole = content.rfind(b"\n") + 1
    if whole < len(content):
        os.truncate(path, whole)
