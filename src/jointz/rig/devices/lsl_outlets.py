"""Streams of Lab Streaming Layer for a session: every channel of its log, and markers.

``pip install "jointz[lsl]"``. They belong into a process of their own, which ``jointz stream`` is,
so that the loop of an experiment is never touched. Tried with liblsl between two programs of one
computer, never beside a real experiment.
"""

from typing import Any

import numpy as np

from jointz.core.clock import Clock
from jointz.core.session_log import Layout
from jointz.rig.devices.lsl import load_pylsl

#: Of liblsl's buffer for who does not fetch, s.
_BUFFER_S = 10


class SessionOutlets:
    """A stream of channels and a stream of markers.

    The stream of channels is named ``NAME`` and has one channel a field of the log, of which the
    description gives label and unit; NaN and -1 stand where a device had no sample. It is
    irregular: a tick has as many samples as its fastest device. The stream of markers is named
    ``NAME markers``; each is a JSON object with ``event``.
    """

    def __init__(self, *, clock: Clock, name: str = "jointz") -> None:
        self._pylsl = load_pylsl(name)
        self._name = name
        self._samples: dict[str, Any] = {}
        # Both count the same time from different zeros, if at all.
        self._shift_s = self._pylsl.local_clock() - clock.now_ns() * 1e-9
        self._markers = self._outlet(f"{name} markers", "Markers", 1, "string")

    @property
    def names(self) -> tuple[str, str]:
        """Names of the two streams."""
        return self._name, f"{self._name} markers"

    def offer(self, layout: Layout) -> None:
        """Create the stream of the channels of a log, if it does not exist yet."""
        if layout.name not in self._samples:
            self._samples[layout.name] = self._outlet(
                self._name, "jointz", len(layout.fields), "double64", layout
            )

    def send(self, layout: Layout, records: np.ndarray, times_ns: np.ndarray) -> None:
        """Send records of a log."""
        self.offer(layout)
        outlet = self._samples[layout.name]
        stamps = times_ns * 1e-9 + self._shift_s
        columns = zip(*(records[field.name].tolist() for field in layout.fields), strict=True)
        for stamp, row in zip(stamps.tolist(), columns, strict=True):
            outlet.push_sample([float(value) for value in row], stamp)

    def mark(self, marker: str, time_ns: int) -> None:
        """Send a marker."""
        self._markers.push_sample([marker], time_ns * 1e-9 + self._shift_s)

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
