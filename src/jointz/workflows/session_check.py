"""Before a session goes on: see that the logs hold what the journal claims."""

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

from jointz.core.errors import DataError
from jointz.core.protocol import Protocol
from jointz.experiment.journal import (
    Event,
    Journal,
    is_completed,
    pulses_done,
    read_journal,
    segments_begun,
)
from jointz.experiment.session_files import JOURNAL_FILE, has_content, log_path
from jointz.io.session_log import SessionLog, read_log


def write_down_losses(folder: Path, protocol: Protocol) -> None:
    """Write into the journal what it counts as done and the logs have lost; it is done again.

    A log that is gone, was cut or lost its end to the power keeps a pulse or a condition
    from being done, whatever the journal says.

    Parameters
    ----------
    folder : pathlib.Path
        Of the session; one that does not exist has lost nothing.
    protocol : Protocol
        Of the experiment.

    Raises
    ------
    DataError
        When a log is damaged in its middle, or one is there that the journal does not know.
    OutputError
        When another process is at the journal.
    """
    if not folder.exists():
        return
    with Journal(folder / JOURNAL_FILE) as journal:
        events = read_journal(folder / JOURNAL_FILE)
        trials = [name for one in protocol.conditions for name in one.trial_names]
        _refuse_unknown_logs(folder, trials, events)
        for name in trials:
            for lost in _losses(folder, name, events):
                journal.write(**lost)


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
            f"Restore {JOURNAL_FILE} from a copy, or move the log away.",
            path=str(unknown[0]),
        )


def _losses(folder: Path, name: str, events: list[Event]) -> Iterator[dict[str, Any]]:
    """Return the events to write for one trial."""
    done = pulses_done(events, name)
    ended = is_completed(events, name)
    for segment in range(segments_begun(events, name)):
        file = log_path(folder, name, segment)
        log = read_log(file) if has_content(file) else None
        about = {"condition": name, "segment": segment, "reason": f"not in {file.name}"}
        for number, event in done.items():
            if event["segment"] == segment and not _holds_pulse(log, event):
                yield {"event": "pulse_lost", "pulse": number, **about}
                ended = False
        if ended and not _holds_end(log, _size_at_end(events, name, segment)):
            yield {"event": "records_lost", **about}


def _holds_pulse(log: SessionLog | None, completed: Event) -> bool:
    """Tell whether a log has a pulse from its onset to the tick before its end."""
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
    """Tell whether a log goes on to its end, or to within its last second: that loses nothing."""
    if log is None:
        return size_bytes == 0
    second = log.header["record_bytes"] * log.header["control_hz"]
    return bool(log.whole_bytes >= size_bytes - second)
