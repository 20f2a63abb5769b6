"""A session on Lab Streaming Layer, from its files: ``jointz stream``.

A running session is followed from now on: samples carry the time of their tick, and markers from
the log (``pulse_on``, ``pulse_off``, ``tripped``) the time of the tick at which they first appear,
both as exact as the loop; markers from the journal carry the time at which it was read, some
:data:`PERIOD_S` late. A finished session is replayed at the pace it had, its stretches one after
the other, events of the journal at the tick that they name.
"""

import json
import time
from collections.abc import Callable, Iterator, Mapping
from operator import itemgetter
from pathlib import Path
from typing import Any

import numpy as np

from jointz.core.clock import Clock, RealClock
from jointz.core.errors import DataError
from jointz.core.session_log import LAYOUTS, Flag, Layout
from jointz.io.log_reader import read_log
from jointz.rig.devices.lsl_outlets import SessionOutlets
from jointz.rig.experiment.files.journal import Event, read_journal
from jointz.rig.experiment.files.session_files import JOURNAL_FILE, has_content, log_path
from jointz.rig.experiment.files.whole_files import read_object
from jointz.rig.session.live.live_session import is_held, newest_session
from jointz.rig.session.live.live_tail import JournalTail, LogTail
from jointz.rig.session.run_claim import RUN_FILE
from jointz.rig.session.run_settings import SESSIONS

#: How often the files are looked at.
PERIOD_S = 0.01
#: And how often whether the session still runs.
_LOOK_S = 0.5
_TRIPPED = int(Flag.TRIPPED)
_AT_THE_END = 2**62
#: An event, and the tick at which it happened.
_Timed = tuple[int, Event]


class Sending:
    """Sends records and events to the streams, and counts them."""

    def __init__(self, outlets: SessionOutlets) -> None:
        self._outlets = outlets
        self._pulse = 0
        self._was_tripped = False
        self.samples = self.markers = 0

    def records(self, header: Mapping[str, Any], records: np.ndarray, times_ns: np.ndarray) -> None:
        """Send records, and a marker for everything that begins and ends in them."""
        self._outlets.send(_layout_of(header), records, times_ns)
        self.samples += len(records)
        about = {key: header.get(key, "") for key in ("participant", "condition")}
        for event, time_ns in self._changes(records, times_ns):
            self.event({**event, **about}, time_ns)

    def offer(self, header: Mapping[str, Any]) -> None:
        """Create the stream of a log, if it does not exist yet."""
        self._outlets.offer(_layout_of(header))

    def event(self, event: Mapping[str, Any], time_ns: int) -> None:
        """Send a marker."""
        self._outlets.mark(json.dumps(dict(event)), time_ns)
        self.markers += 1

    def _changes(self, records: np.ndarray, times_ns: np.ndarray) -> Iterator[tuple[Event, int]]:
        columns = records["pulse"].tolist(), records["flags"].tolist(), times_ns.tolist()
        for pulse, flags, time_ns in zip(*columns, strict=True):
            if pulse != self._pulse:
                if self._pulse:
                    yield {"event": "pulse_off", "pulse": self._pulse}, time_ns
                if pulse:
                    yield {"event": "pulse_on", "pulse": pulse}, time_ns
                self._pulse = pulse
            tripped = bool(flags & _TRIPPED)
            if tripped and not self._was_tripped:
                yield {"event": "tripped"}, time_ns
            self._was_tripped = tripped


class Following:
    """Sends the content that a running session writes from now on, participant by participant."""

    def __init__(self, study: Path, sending: Sending, *, clock: Clock) -> None:
        self._study = study
        self._sending = sending
        self._clock = clock
        self._folder: Path | None = None
        self._journal: JournalTail | None = None
        self._logs: dict[Path, LogTail] = {}
        self._begin(newest_session(study), from_end=True)

    def update(self) -> int:
        """Send new content of the files; return the number of samples and markers sent."""
        before = self._sending.samples + self._sending.markers
        newest = newest_session(self._study)
        if newest != self._folder:
            self._begin(newest, from_end=False)
        self._find_logs(from_end=False)
        for log in self._logs.values():
            records = log.poll()
            if log.header:
                self._sending.offer(log.header)
            if records.size:
                self._sending.records(log.header, records, records["host_time_ns"])
        if self._journal is not None and self._folder is not None:
            about = {"participant": self._folder.name}
            for event in self._journal.poll():
                self._sending.event(event | about, self._clock.now_ns())
        return self._sending.samples + self._sending.markers - before

    def _begin(self, folder: Path | None, *, from_end: bool) -> None:
        self._folder, self._logs, self._journal = folder, {}, None
        if folder is not None:
            self._journal = JournalTail(folder / JOURNAL_FILE, from_end=from_end)
            self._find_logs(from_end=from_end)

    def _find_logs(self, *, from_end: bool) -> None:
        if self._folder is None:
            return
        for path in sorted((self._folder / "logs").glob("*.jzlog")):
            if path not in self._logs:
                self._logs[path] = LogTail(path, from_end=from_end)


def replay(folder: Path, sending: Sending, *, clock: Clock) -> None:
    """Send the content of a finished session, at the pace it had."""
    for path, events in _stretches(folder):
        if has_content(path):
            _replay_stretch(path, events, sending, clock)


def _stretches(folder: Path) -> list[tuple[Path, list[_Timed]]]:
    """Return the logs of a session, each with the events up to the next, and their ticks."""
    events: list[_Timed] = []
    stretches: list[tuple[Path, list[_Timed]]] = []
    for event in read_journal(folder / JOURNAL_FILE):
        slot = event.get("slot", -1)
        at = slot if isinstance(slot, int) and slot >= 0 else _AT_THE_END
        if event["event"] == "segment_started":
            events = [] if stretches else [(0, before) for _, before in events]
            path = log_path(folder, event["condition"], event["segment"])
            stretches.append((path, events))
            at = 0
        events.append((at, {**event, "participant": folder.name}))
    return stretches


def _replay_stretch(path: Path, events: list[_Timed], sending: Sending, clock: Clock) -> None:
    log = read_log(path)
    records = log.records
    if not records.size:
        return
    times_ns = records["host_time_ns"] + (clock.now_ns() - int(records["host_time_ns"][0]))
    slots = records["slot"].astype(np.int64)
    left = sorted(events, key=itemgetter(0))
    sent = 0
    while sent < records.size:
        upto = int(np.searchsorted(times_ns, clock.now_ns(), side="right"))
        sending.records(log.header, records[sent:upto], times_ns[sent:upto])
        sent = max(sent, upto)
        while left and sent and (sent == records.size or left[0][0] <= slots[sent - 1]):
            slot, event = left.pop(0)
            at = min(int(np.searchsorted(slots, slot)), records.size - 1)
            sending.event(event, int(times_ns[at]))
        if sent < records.size:
            clock.wait_until_ns(clock.now_ns() + round(PERIOD_S * 1e9))


def _layout_of(header: Mapping[str, Any]) -> Layout:
    """Return the layout of the records of a log."""
    return LAYOUTS[header.get("layout", "walking")]


def stream_session(
    path: Path,
    *,
    name: str = "jointz",
    clock: Clock | None = None,
    announce: Callable[[str, str], None],
    count: Callable[[int, int], None],
) -> None:
    """Stream a session: one that runs until it ends, or a finished one at its own pace."""
    folder, study = found_session(path)
    clock = clock or RealClock(spin_ns=0)
    outlets = SessionOutlets(clock=clock, name=name)
    sending = Sending(outlets)
    try:
        if study is not None:
            following = Following(study, sending, clock=clock)
            announce(*outlets.names)
            _follow(following, study, clock)
        elif folder is not None:
            announce(*outlets.names)
            replay(folder, sending, clock=clock)
    finally:
        count(sending.samples, sending.markers)


def _follow(following: Following, study: Path, clock: Clock) -> None:
    looked_s, runs = time.monotonic(), True
    while following.update() or runs:
        if time.monotonic() - looked_s > _LOOK_S:
            looked_s, runs = time.monotonic(), is_held(study)
        clock.wait_until_ns(clock.now_ns() + round(PERIOD_S * 1e9))


def found_session(path: Path) -> tuple[Path | None, Path | None]:
    """Return the session that is over to be played, or the study that runs to be followed."""
    is_session = (path / JOURNAL_FILE).is_file()
    study = path.parent.parent if is_session else path
    if is_held(study) and (not is_session or newest_session(study) == path):
        if read_object(study / RUN_FILE).get("clock") == "fast":
            raise DataError(
                f"{study}: runs in virtual time, which nothing else keeps. Stream it when it is "
                "over.",
                path=str(study),
            )
        return None, study
    if is_session:
        return path, None
    sessions = sorted(one.parent for one in (path / SESSIONS).glob(f"*/{JOURNAL_FILE}"))
    if len(sessions) != 1:
        holds, advice = "no session", "Name a folder that jointz run made."
        if sessions:
            holds = f"{len(sessions)} sessions, all of them over"
            advice = f"Name one: {sessions[0]}, ..."
        raise DataError(f"{path}: holds {holds}; expected one. {advice}", path=str(path))
    return sessions[0], None
