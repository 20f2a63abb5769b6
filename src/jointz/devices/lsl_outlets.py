"""A running session on Lab Streaming Layer: every channel of its log, and what happens as markers.

It is fed by the files of the session and belongs into a process of its own, so that the loop of
the experiment is never touched::

    outlets = SessionOutlets(session / "logs", session / "journal.jsonl")
    publish(outlets, clock=RealClock(), until=lambda: finished)

Tried with liblsl between two programs of one computer, never beside a real experiment.

Samples carry the time of their tick, markers that are read off the log (``pulse_on``,
``pulse_off``, ``tripped``) the time of the tick where they first stand, both as exact as the
loop; what comes out of the journal carries the time at which it was read here, some
:data:`PERIOD_S` late. This holds where a session runs under the real clock on the same computer.
"""

import json
import zlib
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np

from jointz.core.clock import Clock
from jointz.core.errors import DataError
from jointz.core.session_log import Flag, Layout, decode_header
from jointz.devices.lsl import load_pylsl

#: How often the files are looked at.
PERIOD_S = 0.01
#: At most so much of a file at a time.
_MOST_BYTES = 1 << 20
_TRIPPED = int(Flag.TRIPPED)
#: Of liblsl's buffer for who does not fetch, s.
_BUFFER_S = 10


class LogFollower:
    """Reads what is appended to a log, record by record.

    A record that is not whole yet, or whose checksum does not fit yet, is waited for.

    Parameters
    ----------
    path : pathlib.Path
        The log.
    from_end : bool
        Whether to leave out what stands there already.

    Attributes
    ----------
    header : dict
        Its first line.
    layout : Layout
        Of its records.

    Raises
    ------
    DataError
        When it is no log of this version.
    """

    def __init__(self, path: Path, *, from_end: bool = False) -> None:
        self._path = path
        with path.open("rb") as file:
            line = file.readline()
        try:
            self.header, self.layout = decode_header(line)
        except ValueError as exc:
            raise DataError(f"{path}: {exc}", path=str(path)) from exc
        self._at = len(line)
        if from_end:
            size = self.layout.record_bytes
            self._at += (path.stat().st_size - self._at) // size * size

    def read(self) -> np.ndarray:
        """Return the whole records since the last time, as a structured array."""
        size = self.layout.record_bytes
        if self._path.stat().st_size < self._at + size:
            return np.empty(0, dtype=self.layout.dtype)
        with self._path.open("rb") as file:
            file.seek(self._at)
            data = file.read(_MOST_BYTES // size * size)
        view = memoryview(data)
        whole = 0
        while whole + size <= len(data):
            check = int.from_bytes(view[whole + size - 4 : whole + size], "little")
            if zlib.crc32(view[whole : whole + size - 4]) != check:
                break
            whole += size
        self._at += whole
        return np.frombuffer(data, dtype=self.layout.dtype, count=whole // size)


class JournalFollower:
    """Reads what is appended to a journal, event by event.

    Parameters
    ----------
    path : pathlib.Path
        The journal; it may not be there yet. What stands there already is left out.
    """

    def __init__(self, path: Path) -> None:
        self._path = path
        self._at = path.stat().st_size if path.exists() else 0

    def read(self) -> list[str]:
        """Return the events since the last time, each as JSON."""
        if not self._path.exists():
            return []
        with self._path.open("rb") as file:
            file.seek(self._at)
            data = file.read(_MOST_BYTES)
        whole = data.rfind(b"\n") + 1
        self._at += whole
        pairs = (line.rpartition(b" ") for line in data[:whole].splitlines())
        return [text.decode() for text, _, check in pairs if check == b"%08x" % zlib.crc32(text)]


class SessionOutlets:
    """Streams of a running session: its channels, and its markers.

    The stream of channels is named ``NAME`` and has one channel a field of the log, of which the
    description gives label and unit; NaN and -1 stand where a device had no sample. It is
    irregular: a tick has as many samples as its fastest device. The stream of markers is named
    ``NAME markers``; each is a JSON object with ``event``.

    Parameters
    ----------
    logs : pathlib.Path
        Folder of the session's logs; one that is being written is followed from now on.
    journal : pathlib.Path
        The session's journal.
    name : str
        Of the streams.
    clock : Clock
        The one that stamps the log.

    Raises
    ------
    DeviceError
        When pylsl is not installed.
    """

    def __init__(self, logs: Path, journal: Path, *, clock: Clock, name: str = "jointz") -> None:
        self._pylsl = load_pylsl(name)
        self._name = name
        self._logs = logs
        self._journal = JournalFollower(journal)
        self._followed: dict[Path, LogFollower] = {}
        self._samples: dict[str, Any] = {}
        self._pulse = 0
        self._was_tripped = False
        # Both count the same time from different zeros, if at all.
        self._shift_s = self._pylsl.local_clock() - clock.now_ns() * 1e-9
        self._markers = self._outlet(f"{name} markers", "Markers", 1, "string")
        for path in self._paths():
            self._follow(path, from_end=True)

    def update(self) -> int:
        """Send what is new in the files; return how many samples and markers went out.

        Raises
        ------
        DataError
            When a file in the folder of logs is no log.
        """
        sent = 0
        for path in self._paths():
            if path not in self._followed:
                self._follow(path, from_end=False)
        for follower in self._followed.values():
            sent += self._send(follower)
        for text in self._journal.read():
            self._markers.push_sample([text], self._pylsl.local_clock())
            sent += 1
        return sent

    def mark(self, marker: str, time_ns: int) -> None:
        """Send a marker, such as that of a sync pulse.

        Parameters
        ----------
        marker : str
            JSON with ``event``.
        time_ns : int, ns
            When, by the clock of the session.
        """
        self._markers.push_sample([marker], time_ns * 1e-9 + self._shift_s)

    def _paths(self) -> list[Path]:
        return sorted(self._logs.glob("*.jzlog")) if self._logs.is_dir() else []

    def _follow(self, path: Path, *, from_end: bool) -> None:
        follower = LogFollower(path, from_end=from_end)
        self._followed[path] = follower
        layout = follower.layout
        if layout.name not in self._samples:
            self._samples[layout.name] = self._outlet(
                self._name, "jointz", len(layout.fields), "double64", layout
            )

    def _send(self, follower: LogFollower) -> int:
        records = follower.read()
        names = [field.name for field in follower.layout.fields]
        outlet = self._samples[follower.layout.name]
        stamps = records["host_time_ns"] * 1e-9 + self._shift_s
        columns = zip(*(records[name].tolist() for name in names), strict=True)
        for stamp, row in zip(stamps.tolist(), columns, strict=True):
            outlet.push_sample([float(value) for value in row], stamp)
        markers = list(self._changes(records, stamps, follower.header.get("condition", "")))
        for text, stamp in markers:
            self._markers.push_sample([text], stamp)
        return len(records) + len(markers)

    def _changes(
        self, records: np.ndarray, stamps: np.ndarray, condition: str
    ) -> Iterator[tuple[str, float]]:
        """Give what begins and ends in the records, with the time of the tick."""
        columns = zip(
            records["pulse"].tolist(), records["flags"].tolist(), stamps.tolist(), strict=True
        )
        for pulse, flags, stamp in columns:
            if pulse != self._pulse:
                if self._pulse:
                    yield _marker("pulse_off", condition=condition, pulse=self._pulse), stamp
                if pulse:
                    yield _marker("pulse_on", condition=condition, pulse=pulse), stamp
                self._pulse = pulse
            tripped = bool(flags & _TRIPPED)
            if tripped and not self._was_tripped:
                yield _marker("tripped", condition=condition), stamp
            self._was_tripped = tripped

    def _outlet(
        self, name: str, kind: str, channels: int, numbers: str, layout: Layout | None = None
    ) -> Any:
        pylsl = self._pylsl
        source = f"{name} {layout.name}" if layout is not None else name
        info = pylsl.StreamInfo(name, kind, channels, pylsl.IRREGULAR_RATE, numbers, source)
        if layout is not None:
            described = info.desc().append_child("channels")
            for field in layout.fields:
                channel = described.append_child("channel")
                channel.append_child_value("label", field.name)
                channel.append_child_value("unit", field.unit)
                channel.append_child_value("meaning", field.meaning)
        return pylsl.StreamOutlet(info, max_buffered=_BUFFER_S)


def publish(outlets: SessionOutlets, *, clock: Clock, until: Callable[[], bool]) -> int:
    """Send what is new, again and again, until told otherwise; return how much went out.

    Parameters
    ----------
    outlets : SessionOutlets
        Of the session.
    clock : Clock
        To wait with.
    until : callable
        Whether to end; asked after each look at the files.
    """
    sent = 0
    while True:
        sent += outlets.update()
        if until():
            return sent
        clock.wait_until_ns(clock.now_ns() + round(PERIOD_S * 1e9))


def _marker(event: str, **details: Any) -> str:
    return json.dumps({"event": event, **details})
