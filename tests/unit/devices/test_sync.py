# ruff: noqa: ARG002 - arguments are those of gpiod
"""Sync pulses on a stand-in for the lines of the kernel."""

import importlib
import importlib.util
import json
import sys
from dataclasses import dataclass, field
from enum import Enum
from types import ModuleType, SimpleNamespace
from typing import Any

import pytest

from jointz.core.clock import Clock, VirtualClock
from jointz.core.errors import DeviceError, NotConnectedError
from jointz.devices.interface import Sensor
from jointz.devices.sync import SyncInput, SyncOutput, send_pulse
from jointz.testing import SensorContract

from .fakes import begin, names_of, needs

Edge = Enum("Edge", "RISING_EDGE FALLING_EDGE")


@dataclass
class Wire:
    """A line as the kernel has it: edges with their stamps, and the levels that were set."""

    edges: list[tuple[int, bool]] = field(default_factory=list)
    levels: list[bool] = field(default_factory=list)
    high: bool = False
    gone: bool = False
    settings: list[Any] = field(default_factory=list)
    released: bool = False

    def check(self) -> None:
        if self.gone:
            raise OSError(19, "No such device")


class FakeRequest:
    """The calls of gpiod's ``LineRequest`` that are made."""

    def __init__(self, wire: Wire) -> None:
        self.wire = wire

    def get_value(self, line: int) -> bool:
        self.wire.check()
        return self.wire.high

    def set_value(self, line: int, value: bool) -> None:
        self.wire.check()
        self.wire.levels.append(value)

    def wait_edge_events(self, timeout: Any = None) -> bool:
        assert timeout == 0, "it must not block"
        self.wire.check()
        return bool(self.wire.edges)

    def read_edge_events(self, max_events: int | None = None) -> list[Any]:
        edges, self.wire.edges = self.wire.edges[:2], self.wire.edges[2:]
        return [
            SimpleNamespace(
                timestamp_ns=at_ns,
                event_type=Edge.RISING_EDGE if high else Edge.FALLING_EDGE,
                Type=Edge,
            )
            for at_ns, high in edges
        ]

    def release(self) -> None:
        self.wire.released = True


@pytest.fixture
def wire(monkeypatch: pytest.MonkeyPatch) -> Wire:
    return put_in_place(monkeypatch)


def put_in_place(monkeypatch: pytest.MonkeyPatch) -> Wire:
    wire = Wire()
    module = ModuleType("gpiod")
    names = SimpleNamespace
    module.line = names(
        Direction=names(INPUT="in", OUTPUT="out"),
        Edge=names(BOTH="both"),
        Bias=names(PULL_DOWN="down"),
        Clock=names(MONOTONIC="monotonic"),
        Value=names(ACTIVE=True, INACTIVE=False),
    )
    module.LineSettings = lambda **settings: wire.settings.append(settings)

    def request_lines(
        path: str, config: Any, consumer: Any = None, event_buffer_size: Any = None
    ) -> FakeRequest:
        wire.check()
        return FakeRequest(wire)

    module.request_lines = request_lines
    monkeypatch.setitem(sys.modules, "gpiod", module)
    return wire


class TestContractOfAnInput(SensorContract):
    @pytest.fixture(autouse=True)
    def _place(self, monkeypatch: pytest.MonkeyPatch) -> None:
        self.wire = put_in_place(monkeypatch)

    def make_clock(self) -> Clock:
        return VirtualClock(1_000_000_000)

    def make(self, clock: Clock) -> Sensor:
        return SyncInput("/dev/gpiochip0", 17, clock=clock)

    def disconnect(self, device: Sensor) -> None:
        self.wire.gone = True


def begun_input(start_ns: int = 0) -> tuple[SyncInput, VirtualClock]:
    clock = VirtualClock(start_ns)
    line = SyncInput("/dev/gpiochip0", 17, clock=clock)
    begin(line)
    return line, clock


def begun_output() -> SyncOutput:
    line = SyncOutput("/dev/gpiochip0", 27)
    begin(line)
    return line


def test_levels_stand_on_the_grid_by_the_stamps_of_the_edges(wire: Wire) -> None:
    line, clock = begun_input(1_000_000_000)
    wire.edges = [(1_002_500_000, True), (1_004_000_000, False), (1_006_100_000, True)]
    clock.wait_until_ns(1_007_000_000)
    samples = line.read()
    assert [s.device_time_ns // 1_000_000 for s in samples] == list(range(1001, 1008))
    assert [s.value for s in samples] == [0, 0, 1, 0, 0, 0, 1]
    assert line.edges == [(1_002_500_000, 1), (1_004_000_000, 0), (1_006_100_000, 1)]
    clock.wait_until_ns(1_008_000_000)
    assert line.read()[0].value == 1.0


def test_a_line_that_is_high_at_first_is_high(wire: Wire) -> None:
    wire.high = True
    line, clock = begun_input()
    clock.wait_until_ns(2_000_000)
    assert [sample.value for sample in line.read()] == [1.0, 1.0]


def test_what_nobody_read_for_long_is_not_all_made_up(wire: Wire) -> None:
    line, clock = begun_input()
    clock.wait_until_ns(3600 * 10**9)
    assert len(line.read()) == 2001


def test_an_output_is_low_after_a_stop(wire: Wire) -> None:
    line = begun_output()
    line.set_high(True)
    line.stop()
    assert wire.levels == [True, False]
    with pytest.raises(DeviceError, match="expected it active"):
        line.set_high(True)
    line.close()
    assert wire.released


def test_a_pulse_is_marked_by_the_time_at_which_it_rose(wire: Wire) -> None:
    clock = VirtualClock(5_000)
    line = begun_output()
    marks: list[tuple[str, int]] = []
    send_pulse(line, lambda text, at_ns: marks.append((text, at_ns)), clock=clock, width_s=0.01)
    assert wire.levels == [True, False]
    assert clock.now_ns() == 10_005_000
    assert [(json.loads(text)["event"], at_ns) for text, at_ns in marks] == [("sync", 5_000)]


def test_a_line_stays_low_when_its_marker_cannot_be_sent(wire: Wire) -> None:
    line = begun_output()

    def fail(_: str, __: int) -> None:
        raise RuntimeError("no network")

    with pytest.raises(RuntimeError):
        send_pulse(line, fail, clock=VirtualClock())
    assert wire.levels == [True, False]


def test_a_line_that_another_program_has_is_told(wire: Wire) -> None:
    wire.gone = True
    with pytest.raises(NotConnectedError, match="cannot be taken"):
        SyncOutput("/dev/gpiochip0", 27).configure()


def test_a_missing_gpiod_is_named_with_its_command(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "gpiod", None)
    with pytest.raises(DeviceError, match=r'pip install "jointz\[gpio\]"'):
        SyncOutput("/dev/gpiochip0", 27).configure()


@needs("gpiod")
def test_settings_and_calls_are_those_of_the_real_package() -> None:
    gpiod = importlib.import_module("gpiod")
    for line in (SyncInput("c", 1, clock=VirtualClock()), SyncOutput("c", 1)):
        assert isinstance(line._settings(gpiod), gpiod.LineSettings)
    real = importlib.import_module("gpiod.line_request").LineRequest
    for name in ("get_value", "set_value", "wait_edge_events", "read_edge_events", "release"):
        assert names_of(getattr(FakeRequest, name)) == names_of(getattr(real, name))
    assert {"config", "consumer", "event_buffer_size"} <= set(names_of(gpiod.request_lines))
    assert {"RISING_EDGE"} <= set(gpiod.EdgeEvent.Type.__members__)
