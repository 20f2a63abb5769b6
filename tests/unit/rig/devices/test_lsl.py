# ruff: noqa: ARG002 - arguments are those of pylsl
"""The sensor of Lab Streaming Layer, on a stand-in for pylsl and between real streams."""

import importlib
import importlib.util
import math
import sys
from collections.abc import Callable
from dataclasses import dataclass, field
from types import ModuleType
from typing import Any

import pytest

from jointz.core.clock import Clock, RealClock, VirtualClock
from jointz.core.errors import DeviceError, NotConnectedError
from jointz.rig.devices.config import LslSpec
from jointz.rig.devices.interface import Lifecycle, Sensor
from jointz.rig.devices.lsl import LslSensor
from jointz.rig.testing import SensorContract

from .fakes import begin, needs, wait

FLOAT, STRING = 2, 3


class LostError(RuntimeError):
    """As pylsl has it."""


@dataclass
class Sender:
    """A stream by another clock than the host's."""

    clock: Clock
    rate_hz: float = 500.0
    ahead_s: float = 40.0
    names: tuple[str, ...] = ("knee",)
    channels: int = 2
    kind: int = FLOAT
    values: Callable[[int], list[Any]] = lambda n: [0.01 * n, -1.0]
    stamps: dict[int, float] = field(default_factory=dict)
    silent: bool = False
    gone: bool = False
    number: int = 0
    next_ns: int = 0
    offsets: list[float] = field(default_factory=list)


class FakeInfo:
    def __init__(self, sender: Sender, source: str) -> None:
        self.sender, self.source = sender, source

    def channel_count(self) -> int:
        return self.sender.channels

    def channel_format(self) -> int:
        return self.sender.kind

    def nominal_srate(self) -> float:
        return self.sender.rate_hz

    def source_id(self) -> str:
        return self.source


class FakeInlet:
    """The calls of pylsl's ``StreamInlet`` that the sensor makes."""

    def __init__(
        self,
        info: FakeInfo,
        max_buflen: int = 360,
        max_chunklen: int = 0,
        recover: bool = True,
        processing_flags: int = 0,
        as_numpy: bool = False,
    ) -> None:
        assert not recover
        self.sender, self.buffer_s = info.sender, max_buflen

    def open_stream(self, timeout: float = 32_000_000.0) -> None:
        self.check()
        self.sender.next_ns = self.sender.clock.now_ns()

    def close_stream(self) -> None:
        pass

    def time_correction(self, timeout: float = 32_000_000.0) -> float:
        self.check()
        offset = -self.sender.ahead_s
        self.sender.offsets.append(offset)
        return offset

    def flush(self) -> int:
        self.check()
        return len(self.pull(10**6)[1])

    def pull_chunk(
        self,
        timeout: float = 0.0,
        max_samples: int = 1024,
        dest_obj: Any = None,
        min_samples: Any = None,
        as_numpy: Any = None,
    ) -> Any:
        assert timeout == 0.0, "it must not block"
        self.check()
        return self.pull(max_samples)

    def pull(self, most: int) -> tuple[list[list[float]], list[float]]:
        sender, values, stamps = self.sender, [], []
        now_ns = sender.clock.now_ns()
        while sender.next_ns <= now_ns and len(stamps) < most and not sender.silent:
            stamp = sender.next_ns * 1e-9 + sender.ahead_s
            stamps.append(sender.stamps.get(sender.number, stamp))
            values.append(sender.values(sender.number))
            sender.number += 1
            sender.next_ns += round(1e9 / sender.rate_hz)
        return values, stamps

    def check(self) -> None:
        if self.sender.gone:
            raise LostError("the stream has been lost.")


def put_in_place(monkeypatch: pytest.MonkeyPatch, sender: Sender) -> None:
    module = ModuleType("pylsl")
    module.cf_string = STRING
    module.StreamInlet = FakeInlet
    module.asked = []

    def resolve_byprop(prop: str, value: str, minimum: int = 1, timeout: float = 32e6) -> Any:
        module.asked.append((prop, value, timeout))
        return [] if sender.gone else [FakeInfo(sender, name) for name in sender.names]

    module.resolve_byprop = resolve_byprop
    monkeypatch.setitem(sys.modules, "pylsl", module)


def spec(**changed: Any) -> LslSpec:
    return LslSpec(**{"stream": "Goniometer", "sample_rate_hz": 500.0, **changed})


class TestContractOfAGoniometer(SensorContract):
    @pytest.fixture(autouse=True)
    def _place(self, monkeypatch: pytest.MonkeyPatch) -> None:
        self.monkeypatch = monkeypatch

    def make_clock(self) -> Clock:
        return VirtualClock(1_000_000_000)

    def make(self, clock: Clock) -> Sensor:
        self.sender = Sender(clock)
        put_in_place(self.monkeypatch, self.sender)
        return LslSensor(spec(), "angle", clock=clock)

    def disconnect(self, device: Sensor) -> None:
        self.sender.gone = True


@pytest.fixture
def made(monkeypatch):
    """Make a sensor that is not open yet, its sender and its clock."""
    sensors = []

    def make(*, sender=None, **keys):
        clock = VirtualClock(1_000_000_000)
        source = Sender(clock, **(sender or {}))
        put_in_place(monkeypatch, source)
        sensors.append(LslSensor(spec(**keys), "angle", clock=clock))
        return sensors[-1], source, clock

    yield make
    for sensor in sensors:
        sensor.close()


@pytest.fixture
def begun(made):
    """Make an active sensor, its sender and its clock."""

    def make(**settings):
        sensor, source, clock = made(**settings)
        begin(sensor)
        return sensor, source, clock

    return make


@pytest.mark.parametrize(("raw", "angle"), [(59.0, math.pi / 2), (math.nan, math.nan)])
def test_gain_and_offset_make_it_rad_and_no_number_stays_none(begun, raw, angle):
    degrees = {"index": 1, "gain": 0.0174532925, "offset": -31.0}
    sensor, _, clock = begun(**degrees, sender={"values": lambda _: [0.0, raw]})
    wait(clock, 0.01)
    assert sensor.read()[-1].value == pytest.approx(angle, nan_ok=True)


def test_stamps_are_moved_by_the_offset_of_the_clocks(begun) -> None:
    sensor, sender, clock = begun()
    wait(clock, 0.01)
    assert sensor.read()[-1].device_time_ns == clock.now_ns()
    sender.ahead_s = 40.0005  # the clocks drifted
    wait(clock, 0.01)
    sender.stamps.clear()
    assert sensor.read()[-1].device_time_ns == pytest.approx(clock.now_ns(), abs=10)
    assert sensor.offset_s == -40.0005


def test_all_that_arrived_is_read_in_more_than_one_chunk(begun) -> None:
    sensor, _, clock = begun()
    wait(clock, 1.2)
    samples = sensor.read()
    assert len(samples) == 600
    assert sensor.read() == []


@pytest.mark.parametrize("stamp", [0.0, float("nan"), -5.0])
def test_stamps_that_do_not_rise_are_left_out(begun, stamp: float) -> None:
    sensor, _, clock = begun(sender={"stamps": {5: stamp}})
    wait(clock, 0.02)
    samples = sensor.read()
    assert len(samples) == 9
    assert sensor.dropped == 1


@pytest.mark.parametrize("late_s", [0.05, 0.5])
def test_what_was_held_up_on_its_way_is_not_reported_as_new(begun, late_s: float) -> None:
    sensor, sender, clock = begun()
    wait(clock, 0.1)
    assert len(sensor.read()) == 50
    sender.ahead_s -= late_s  # stamps of the past, in the order they were taken
    sensor._inlet.time_correction = lambda _: -40.0
    wait(clock, late_s + 0.1)
    sensor.read()
    got = 0
    for _ in range(50):
        wait(clock, 0.002)
        got += len(sensor.read())
    assert got == (50 if late_s < 0.1 else 0)


def test_late_samples_for_a_second_are_a_lost_sensor(begun) -> None:
    sensor, sender, clock = begun()
    wait(clock, 0.01)
    assert sensor.read()
    sensor._inlet.time_correction = lambda _: -40.0
    sender.ahead_s -= 0.5

    def follow() -> None:
        for _ in range(600):
            wait(clock, 0.002)
            sensor.read()

    with pytest.raises(NotConnectedError, match="came late"):
        follow()


def test_stamps_that_count_samples_may_run_away_slowly(begun) -> None:
    sensor, sender, clock = begun()
    sensor._inlet.time_correction = lambda _: -40.0
    for _ in range(600):
        wait(clock, 1.0)
        sender.ahead_s -= 2e-4  # 200 ppm; 0.12 s in all
        assert len(sensor.read()) >= 499


def test_a_first_sample_may_be_late_but_a_silent_sender_is_gone(made) -> None:
    sensor, sender, clock = made()
    sender.silent = True
    begin(sensor)
    wait(clock, 0.9)
    assert sensor.read() == []
    wait(clock, 0.2)
    with pytest.raises(NotConnectedError, match="nothing for a second"):
        sensor.read()


def test_a_sender_that_ends_before_the_activation_is_told(made) -> None:
    sensor, sender, _ = made()
    sensor.configure()
    sender.gone = True
    with pytest.raises(NotConnectedError, match="Check its sender"):
        sensor.activate()


def test_a_stream_that_is_not_there_says_what_to_do(made) -> None:
    sensor, sender, _ = made(timeout_s=0.5)
    sender.gone = True
    with pytest.raises(NotConnectedError, match=r"name is 'Goniometer' within 0\.5 s"):
        sensor.configure()
    assert sensor.state is Lifecycle.UNCONFIGURED


def test_it_is_looked_for_by_its_source_where_that_is_given(made) -> None:
    sensor, _, _ = made(source_id="gonio-7")
    sensor.configure()
    assert sys.modules["pylsl"].asked == [("source_id", "gonio-7", 5.0)]


@pytest.mark.parametrize(
    ("sender", "keys", "told"),
    [
        ({"names": ("a", "b")}, {}, "Give source_id: one of 'a', 'b'"),
        ({}, {"index": 2}, "index: expected less than its 2 channels, got 2"),
        ({"kind": STRING}, {}, "it sends text"),
        ({"rate_hz": 100.0}, {}, "expected 500 Hz, it states 100 Hz"),
        ({"rate_hz": 0.0}, {}, "expected 500 Hz, it states 0 Hz"),
    ],
)
def test_another_stream_than_described_is_refused(made, sender, keys, told) -> None:
    sensor, _, _ = made(sender=sender, **keys)
    with pytest.raises(DeviceError, match=told):
        sensor.configure()


@needs("pylsl")
@pytest.mark.alone
def test_what_a_real_outlet_sends_arrives_with_its_time_and_its_end_is_noticed() -> None:
    pylsl = importlib.import_module("pylsl")
    source = "jointz-test-sensor"
    info = pylsl.StreamInfo("jointz-test", "angle", 2, 500.0, "double64", source)
    outlet = pylsl.StreamOutlet(info, max_buffered=2)
    clock = RealClock()
    sensor = LslSensor(spec(stream="jointz-test", source_id=source, gain=2.0), "angle", clock=clock)
    begin(sensor)
    began_s = pylsl.local_clock()
    for i in range(300):
        outlet.push_sample([0.1 * i, 0.0], began_s + 0.002 * i)
    samples = []
    until_ns = clock.now_ns() + 5_000_000_000
    while len(samples) < 300 and clock.now_ns() < until_ns:
        samples += sensor.read()
    assert [sample.value for sample in samples] == pytest.approx([0.2 * i for i in range(300)])
    assert samples[0].device_time_ns * 1e-9 == pytest.approx(began_s, abs=1e-3)
    del outlet
    with pytest.raises(NotConnectedError):
        _read_until(sensor, clock, until_ns)
    sensor.close()


def _read_until(sensor: LslSensor, clock: Clock, until_ns: int) -> None:
    while clock.now_ns() < until_ns:
        sensor.read()
