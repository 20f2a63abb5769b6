# ruff: noqa: ARG002 - arguments are those of smbus2
"""The driver of the ADS1115 on a stand-in for the chip, byte by byte."""

import importlib
import importlib.util
import math
import sys
from collections.abc import Callable
from dataclasses import dataclass, field
from types import ModuleType
from typing import Any, ClassVar

import pytest

from jointz.core.clock import Clock, RealClock, VirtualClock
from jointz.core.errors import DeviceError, NotConnectedError
from jointz.rig.devices.adc import Ads1115Sensor
from jointz.rig.devices.config import Ads1115Spec
from jointz.rig.devices.interface import Lifecycle, Sensor
from jointz.rig.devices.repeating import RepeatingThread
from jointz.rig.testing import SensorContract

from .fakes import HeldClock, arguments_of, begin, needs, wait


@dataclass
class Chip:
    """The registers of an ADS1115 with a voltage over the number of the reading."""

    volts: Callable[[int], float] = lambda n: 1.0 + 0.001 * n
    address: int = 0x48
    registers: dict[int, bytes] = field(default_factory=lambda: {1: b"\x85\x83"})
    readings: int = 0
    gone: bool = False
    fail: frozenset[int] = frozenset()

    def check(self, address: int) -> None:
        if self.gone or address != self.address:
            raise OSError(121, "Remote I/O error")

    def write(self, address: int, pointer: int, data: bytes) -> None:
        self.check(address)
        assert len(data) == 2
        self.registers[pointer] = bytes([data[0] & 0x7F, data[1]])  # no conversion is single

    def read(self, address: int, pointer: int, length: int) -> bytes:
        self.check(address)
        assert length == 2
        if pointer != 0:
            return self.registers[pointer]
        self.readings += 1
        if self.readings in self.fail:
            raise OSError(121, "Remote I/O error")
        full_scale = (6.144, 4.096, 2.048, 1.024, 0.512, 0.256)[self.registers[1][0] >> 1 & 0b111]
        counts = round(self.volts(self.readings) / full_scale * 32768)
        return max(-32768, min(32767, counts)).to_bytes(2, "big", signed=True)


class FakeBus:
    """The calls of smbus2's ``SMBus`` that the driver makes, on the chip."""

    chip: ClassVar[Chip]

    def __init__(self, bus: Any = None, force: bool = False) -> None:
        self.closed = False

    def read_i2c_block_data(
        self, i2c_addr: int, register: int, length: int, force: Any = None
    ) -> list[int]:
        return list(self.chip.read(i2c_addr, register, length))

    def write_i2c_block_data(
        self, i2c_addr: int, register: int, data: list[int], force: Any = None
    ) -> None:
        self.chip.write(i2c_addr, register, bytes(data))

    def close(self) -> None:
        self.closed = True


def put_in_place(monkeypatch: pytest.MonkeyPatch, chip: Chip) -> None:
    module = ModuleType("smbus2")
    module.SMBus = type("SMBus", (FakeBus,), {"chip": chip})
    monkeypatch.setitem(sys.modules, "smbus2", module)


class TestContractOfAGoniometer(SensorContract):
    @pytest.fixture(autouse=True)
    def _place(self, monkeypatch: pytest.MonkeyPatch) -> None:
        self.monkeypatch = monkeypatch

    def make_clock(self) -> Clock:
        return HeldClock()

    def make(self, clock: Clock) -> Sensor:
        self.chip = Chip()
        put_in_place(self.monkeypatch, self.chip)
        repeat = clock.repeat if isinstance(clock, HeldClock) else RepeatingThread
        return Ads1115Sensor(Ads1115Spec(), "angle", clock=clock, repeat=repeat)

    def disconnect(self, device: Sensor) -> None:
        self.chip.gone = True
        clock = device._now_ns.__self__
        wait(clock, 0.05)


@pytest.mark.alone
class TestContractWithTheSamplingThread(TestContractOfAGoniometer):
    def make_clock(self) -> Clock:
        return RealClock()

    def disconnect(self, device: Sensor) -> None:
        pytest.skip("it would wait; the same is tested in virtual time")


@pytest.fixture
def made(monkeypatch):
    """Make a sensor that is not open yet, its chip and its clock."""
    sensors = []

    def make(channel="angle", *, chip=None, **keys):
        clock, chip = HeldClock(), chip or Chip()
        put_in_place(monkeypatch, chip)
        spec = Ads1115Spec(**keys)
        sensors.append(Ads1115Sensor(spec, channel, clock=clock, repeat=clock.repeat))
        return sensors[-1], chip, clock

    yield make
    for sensor in sensors:
        sensor.close()


@pytest.fixture
def begun(made):
    """Make an active sensor, its chip and its clock."""

    def make(channel="angle", **settings):
        sensor, chip, clock = made(channel, **settings)
        begin(sensor)
        return sensor, chip, clock

    return make


@needs("smbus2")
def test_the_stand_in_is_called_like_the_real_bus():
    real = importlib.import_module("smbus2").SMBus
    for name in ("read_i2c_block_data", "write_i2c_block_data", "close"):
        assert arguments_of(getattr(FakeBus, name)) == arguments_of(getattr(real, name)), name


@pytest.mark.parametrize(
    ("keys", "register"),
    [
        # single-ended 0, 4.096 V, continuous, 860 a second, no comparator
        ({"sample_rate_hz": 500.0}, 0b0_100_001_0_111_00011),
        ({"input": "0-1", "full_scale_v": 6.144, "sample_rate_hz": 100.0}, 0b0_000_000_0_100_00011),
        ({"input": "3", "full_scale_v": 0.256, "sample_rate_hz": 774.0}, 0b0_111_101_0_111_00011),
    ],
)
def test_the_chip_is_set_up_by_the_bits_of_its_data_sheet(made, keys, register) -> None:
    sensor, chip, _ = made(**keys)
    sensor.configure()
    assert int.from_bytes(chip.registers[1], "big") == register


@pytest.mark.parametrize(
    ("channel", "volts", "keys", "value"),
    [
        ("angle", 2.5, {"gain_per_v": -0.8, "offset_v": 1.5}, -0.8),
        ("angle", -1.0, {"input": "0-1"}, -1.0),
        ("angle", 9.0, {}, math.nan),  # beyond the range
        ("angle", -9.0, {}, math.nan),
        ("contact", 3.0, {}, 3.0),
    ],
)
def test_volts_become_the_value_of_the_channel(begun, channel, volts, keys, value):
    sensor, _, clock = begun(channel, chip=Chip(volts=lambda _: volts), **keys)
    wait(clock, 0.01)
    assert sensor.read()[-1].value == pytest.approx(value, abs=4.096 / 32768, nan_ok=True)


def test_a_contact_has_two_thresholds(begun) -> None:
    volts = [0.2, 1.4, 1.6, 1.2, 1.4, 0.9, 1.2]
    sensor, _, clock = begun(
        "contact", chip=Chip(volts=lambda n: volts[n - 1]), kind="contact", sample_rate_hz=100.0
    )
    wait(clock, 0.075)
    assert [sample.value for sample in sensor.read()] == [0, 0, 1, 1, 1, 0, 0]
    assert sensor.describe().unit == "1"


def test_the_queue_is_bounded_and_counts_what_it_lost(begun) -> None:
    sensor, _, clock = begun(sample_rate_hz=100.0)
    wait(clock, 3.0)
    assert sensor.dropped == 99
    assert len(sensor.read()) == 201


def test_one_failure_of_the_bus_is_a_gap_and_no_end(begun) -> None:
    sensor, _, clock = begun(chip=Chip(fail=frozenset({5, 6})))
    wait(clock, 0.04)
    assert len(sensor.read()) == 18
    assert sensor.dropped == 2


def test_a_chip_that_lost_its_settings_is_not_read_on(begun) -> None:
    sensor, chip, clock = begun()
    wait(clock, 0.5)
    assert sensor.read()
    chip.registers[1] = b"\x85\x83"  # of its data sheet, after power-up: converts no more
    wait(clock, 0.3)
    with pytest.raises(NotConnectedError, match="supply was interrupted"):
        sensor.read()


def test_a_bus_that_hangs_is_told(begun) -> None:
    sensor, _, clock = begun()
    clock.repeated[-1].cancel()
    wait(clock, 0.9)
    assert sensor.read() == []
    wait(clock, 0.2)
    with pytest.raises(NotConnectedError, match="no sample for a second"):
        sensor.read()


def test_nothing_at_the_address_says_what_to_look_at(made) -> None:
    sensor, _, _ = made(address=0x4A)
    with pytest.raises(NotConnectedError, match="i2cdetect -y 1"):
        sensor.configure()
    assert sensor.state is Lifecycle.UNCONFIGURED


def test_another_chip_at_the_address_is_refused(made, monkeypatch) -> None:
    sensor, chip, _ = made()
    monkeypatch.setattr(Chip, "write", lambda *_: None)
    with pytest.raises(DeviceError, match="no ADS1115"):
        sensor.configure()
    assert chip.registers[1] == b"\x85\x83"


def test_it_states_how_old_its_values_are() -> None:
    sensor = Ads1115Sensor(Ads1115Spec(), "angle", clock=VirtualClock())
    assert sensor.lag_s == pytest.approx(1 / 860)
    assert sensor.lag_sd_s == pytest.approx(0.34e-3, abs=0.01e-3)
