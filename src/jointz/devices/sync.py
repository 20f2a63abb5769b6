"""Sync pulses on a digital line, in and out, so that other recorders can be aligned.

Lines are those of the kernel (``/dev/gpiochip0`` of a Raspberry Pi), through libgpiod 2:
``pip install "jointz[gpio]"``. **Never tried on hardware**; it was checked against the calls of
the package gpiod. A line of a Raspberry Pi takes 3.3 V and gives a few mA: put an optocoupler
between it and anything that hangs on the mains or on a person.

Edges that come in are stamped by the kernel, to some 10 us. A pulse that goes out carries a
marker of Lab Streaming Layer with the time between which the line was set, some 50 us wide.
"""

import contextlib
import json
from collections.abc import Callable
from typing import Any, Protocol

from jointz.core.clock import Clock
from jointz.core.errors import DeviceError, NotConnectedError
from jointz.devices.driver_base import ACTIVE, INACTIVE, UNCONFIGURED, DriverBase, load_library
from jointz.devices.interface import Device, SensorDescription, SensorSample

#: Edges that the kernel keeps for who does not fetch them.
_KEPT_EDGES = 1024
#: No more samples than of so long are made at a time.
_LONGEST_S = 2.0


class DigitalOutput(Device, Protocol):
    """A line that is set high or low."""

    def set_high(self, high: bool) -> None:  # noqa: FBT001 - it is the level
        """Set the line."""
        ...


class _Line(DriverBase):
    """A line of a chip, in or out."""

    def __init__(self, chip: str, line: int) -> None:
        super().__init__(f"line {line} of {chip}")
        self._chip = chip
        self._line = line
        self._request: Any = None

    def configure(self) -> None:
        """Request the line; afterwards ``INACTIVE``."""
        self._require(UNCONFIGURED)
        library = load_library("gpiod", device=self._name, extra="gpio")
        try:
            self._request = library.request_lines(
                self._chip,
                config={self._line: self._settings(library)},
                consumer="jointz",
                event_buffer_size=_KEPT_EDGES,
            )
        except (OSError, ValueError) as exc:
            raise NotConnectedError(
                self._name, f"cannot be taken ({exc}). Is it free, and the user in group gpio?"
            ) from exc
        self._state = INACTIVE

    def _release(self) -> None:
        request, self._request = self._request, None
        if request is not None:
            with contextlib.suppress(OSError):
                request.release()

    def _settings(self, library: Any) -> Any:
        raise NotImplementedError


class SyncInput(_Line):
    """A line that comes in, as a sensor of 0 and 1 in the channel ``sync``.

    Samples stand on a grid of ``sample_rate_hz``; the level at each is that after the last edge
    before it, by the kernel's stamps. The edges themselves are in :attr:`edges`.
    """

    def __init__(
        self, chip: str, line: int, *, clock: Clock, sample_rate_hz: float = 1000.0
    ) -> None:
        super().__init__(chip, line)
        self._now_ns = clock.now_ns
        self._rate_hz = sample_rate_hz
        self._period_ns = round(1e9 / sample_rate_hz)
        self._next_ns = 0
        self._level = 0
        self.edges: list[tuple[int, int]] = []

    def describe(self) -> SensorDescription:
        """Return the description of the sensor, in any state."""
        return SensorDescription(
            name=self._name,
            model="digital line through gpiod (driver never tried on hardware)",
            serial="",
            channel="sync",
            unit="1",
            sample_rate_hz=self._rate_hz,
        )

    def activate(self) -> None:
        """Begin to sample; afterwards ``ACTIVE``."""
        self._require(INACTIVE)
        self._fetched()
        self._level = self._asked(lambda: int(bool(self._request.get_value(self._line))))
        self._next_ns = self._now_ns() // self._period_ns * self._period_ns + self._period_ns
        self._state = ACTIVE

    def read(self) -> list[SensorSample]:
        """Return all samples since the last read, oldest first."""
        self._require(ACTIVE)
        self.edges = self._fetched()
        now_ns, at = self._now_ns(), 0
        self._next_ns = max(self._next_ns, now_ns - round(_LONGEST_S * 1e9))
        samples = []
        while self._next_ns <= now_ns:
            while at < len(self.edges) and self.edges[at][0] <= self._next_ns:
                self._level = self.edges[at][1]
                at += 1
            samples.append(SensorSample(self._next_ns, now_ns, float(self._level)))
            self._next_ns += self._period_ns
        self._level = self.edges[-1][1] if self.edges else self._level
        return samples

    def _fetched(self) -> list[tuple[int, int]]:
        edges: list[tuple[int, int]] = self._asked(self._fetch)
        return edges

    def _fetch(self) -> list[tuple[int, int]]:
        request = self._request
        edges: list[tuple[int, int]] = []
        while request.wait_edge_events(0) and len(edges) < _KEPT_EDGES:
            edges += [
                (event.timestamp_ns, int(event.event_type is event.Type.RISING_EDGE))
                for event in request.read_edge_events()
            ]
        return edges

    def _asked(self, question: Callable[[], Any]) -> Any:
        try:
            return question()
        except OSError as exc:
            raise NotConnectedError(self._name, f"is gone ({exc}).") from exc

    def _settings(self, library: Any) -> Any:
        return library.LineSettings(
            direction=library.line.Direction.INPUT,
            edge_detection=library.line.Edge.BOTH,
            bias=library.line.Bias.PULL_DOWN,
            event_clock=library.line.Clock.MONOTONIC,
        )


class SyncOutput(_Line):
    """A line that goes out; low unless it is set high."""

    def __init__(self, chip: str, line: int) -> None:
        super().__init__(chip, line)
        self._library: Any = None

    def activate(self) -> None:
        """Begin to obey; afterwards ``ACTIVE``."""
        self._require(INACTIVE)
        self._state = ACTIVE

    def stop(self) -> None:
        """Set the line low and go to ``INACTIVE``; never raises, never blocks."""
        if self._state is ACTIVE:
            with contextlib.suppress(DeviceError):
                self.set_high(False)
        super().stop()

    def set_high(self, high: bool) -> None:  # noqa: FBT001 - it is the level
        """Set the line."""
        self._require(ACTIVE)
        value = self._library.line.Value
        try:
            self._request.set_value(self._line, value.ACTIVE if high else value.INACTIVE)
        except OSError as exc:
            raise NotConnectedError(self._name, f"is gone ({exc}).") from exc

    def _settings(self, library: Any) -> Any:
        self._library = library
        return library.LineSettings(
            direction=library.line.Direction.OUTPUT, output_value=library.line.Value.INACTIVE
        )


def send_pulse(
    output: DigitalOutput,
    mark: Callable[[str, int], None],
    *,
    clock: Clock,
    width_s: float = 0.01,
) -> None:
    """Send one pulse, and a marker of when it rose.

    It waits for ``width_s``: never call it in the loop of an experiment.
    """
    before_ns = clock.now_ns()
    output.set_high(True)
    after_ns = clock.now_ns()
    try:
        marker = json.dumps({"event": "sync", "uncertain_ns": after_ns - before_ns})
        mark(marker, (before_ns + after_ns) // 2)
        clock.wait_until_ns(after_ns + round(width_s * 1e9))
    finally:
        output.set_high(False)
