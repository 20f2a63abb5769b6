"""Markers of other programs on Lab Streaming Layer, such as their sync pulses.

Tried with liblsl between two programs of one computer, never over a network.
"""

import contextlib
from typing import Any, NamedTuple

from jointz.core.errors import DeviceError, NotConnectedError
from jointz.devices.driver_base import ACTIVE, INACTIVE, UNCONFIGURED, DriverBase
from jointz.devices.lsl import LIBRARY_ERRORS, load_pylsl, open_inlet

_MOST_MARKERS = 256


class Marker(NamedTuple):
    """A marker and its time."""

    # by LSL's clock of this computer; on Linux that of :class:`jointz.core.clock.RealClock`
    time_ns: int
    text: str  # text of the marker


class LslMarkers(DriverBase):
    """A stream of markers; it comes when it comes and is no sensor."""

    def __init__(self, stream: str, *, source_id: str = "", timeout_s: float = 5.0) -> None:
        super().__init__(f"LSL markers {stream}")
        self._known_by = ("source_id", source_id) if source_id else ("name", stream)
        self._timeout_s = timeout_s
        self._inlet: Any = None

    def configure(self) -> None:
        """Find the stream and connect, which takes a second; afterwards ``INACTIVE``."""
        self._require(UNCONFIGURED)
        self._inlet = open_inlet(
            self._name, self._known_by, timeout_s=self._timeout_s, check=self._check
        )
        self._state = INACTIVE

    def activate(self) -> None:
        """Begin to listen; afterwards ``ACTIVE``."""
        self._require(INACTIVE)
        self._pulled()
        self._state = ACTIVE

    def read(self) -> list[Marker]:
        """Return the markers since the last read, oldest first."""
        self._require(ACTIVE)
        return self._pulled()

    def _release(self) -> None:
        inlet, self._inlet = self._inlet, None
        if inlet is not None:
            with contextlib.suppress(*LIBRARY_ERRORS):
                inlet.close_stream()

    def _pulled(self) -> list[Marker]:
        try:
            rows, stamps = self._inlet.pull_chunk(timeout=0.0, max_samples=_MOST_MARKERS)
            offset_s = self._inlet.time_correction(0.0) if stamps else 0.0
        except LIBRARY_ERRORS as exc:
            raise NotConnectedError(self._name, f"does not answer ({exc}).") from exc
        return [
            Marker(round((stamp + offset_s) * 1e9), row[0])
            for stamp, row in zip(stamps, rows, strict=True)
        ]

    def _check(self, info: Any) -> None:
        if info.channel_format() != load_pylsl(self._name).cf_string:
            raise DeviceError(self._name, "expected text, it sends numbers.")
