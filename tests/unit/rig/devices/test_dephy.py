# ruff: noqa: N802, ARG002 - names and arguments are those of flexsea and its library
"""The Dephy driver on a stand-in for flexsea's class, which is called as the real one is."""

import importlib
import importlib.util
import sys
import time
from dataclasses import dataclass, field
from itertools import pairwise
from types import ModuleType
from typing import Any, ClassVar

import pytest

from jointz.core.clock import Clock, RealClock
from jointz.core.errors import DeviceError, NotConnectedError
from jointz.core.study import TorqueModelSpec
from jointz.rig.devices import dephy
from jointz.rig.devices.config import DephySpec
from jointz.rig.devices.dephy import DephyActPack
from jointz.rig.devices.dephy_units import DeviceClock, Winding, WindingSpec
from jointz.rig.devices.interface import Actuator, Lifecycle
from jointz.rig.devices.repeating import RepeatingThread
from jointz.rig.testing import ActuatorContract
from jointz.rig.testing.scripted import SCRIPTED_ACTUATOR

from .fakes import HeldClock, arguments_of, begin, needs, wait

FIELDS = ["state_time", "mot_ang", "mot_vel", "mot_cur", "batt_volt", "temperature", "status_ex"]
FIELDS += ["mot_volt", "batt_curr", "accelx"]
NO_CURRENT, CURRENT = 4, 2

LIMITS = SCRIPTED_ACTUATOR.limits.model_copy(update={"current_a": 15.0})


def spec(**changed: Any) -> DephySpec:
    return DephySpec(
        **{
            "port": "/dev/ttyACM0",
            "firmware": "12.0.0",
            "side": "right",
            "torque_model": TorqueModelSpec(gear_ratio=9.0, torque_constant=0.14),
            "limits": LIMITS,
            **changed,
        }
    )


@dataclass
class Motor:
    """An actuator that carries any load; the current is what was commanded last.

    Every field of a sample can be scripted by the number of the sample.
    """

    clock: Clock
    script: dict[int, dict[str, int]] = field(default_factory=dict)
    first_stamp: int = 5_000
    rate_hz: int = 0
    is_streaming: bool = False
    gone: bool = False
    silent: bool = False
    calls: list[tuple[Any, ...]] = field(default_factory=list)
    queue: list[dict[str, int]] = field(default_factory=list)
    currents: list[tuple[int, int]] = field(default_factory=list)
    number: int = 0
    next_ns: int = 0
    side: str = ""
    fields: list[str] = field(default_factory=lambda: list(FIELDS))

    def fxGetReadDataQueueSize(self, _: int) -> int:
        self.fill()
        return len(self.queue)

    def fill(self) -> None:
        if not self.is_streaming or self.silent or self.gone:
            return
        period_ns = 1_000_000_000 // self.rate_hz
        now_ns = self.clock.now_ns()
        while self.next_ns <= now_ns:
            self.queue.append(self.measured(self.next_ns, self.number * period_ns))
            self.number += 1
            self.next_ns += period_ns

    def measured(self, time_ns: int, since_ns: int) -> dict[str, int]:
        current = next((ma for at_ns, ma in reversed(self.currents) if at_ns <= time_ns), 0)
        values = {
            "state_time": (self.first_stamp + since_ns // 1_000_000 + 2**31) % 2**32 - 2**31,
            "mot_ang": 1000 + 3 * self.number,
            "mot_vel": 33,
            "mot_cur": current,
            "batt_volt": 36_000,
            "temperature": 30,
            "status_ex": 0,
            **self.script.get(self.number, {}),
        }
        return {name: values.get(name, 0) for name in self.fields}


class FakeDevice:
    """The calls of flexsea's ``Device`` that the driver makes, on the stand-in."""

    motor: ClassVar[Motor]

    def __init__(
        self,
        firmwareVersion: str,
        port: str,
        baudRate: int = 230400,
        libFile: str = "",
        logLevel: int = 4,
        interactive: bool = True,
        debug: bool = False,
        s3Timeout: int = 60,
        stopMotorOnDisconnect: bool = False,
    ) -> None:
        sys.tracebacklimit = 0
        print(f"Using firmware version: {firmwareVersion}")  # noqa: T201 - as flexsea does
        self.firmwareVersion, self.id = firmwareVersion, 77
        self._clib = self.motor

    def open(self, bootloading: bool = False) -> None:
        if self.motor.gone:
            raise RuntimeError("Failed to connect to device.")

    @property
    def side(self) -> str:
        return self.motor.side or "undefined"

    @property
    def streaming(self) -> bool:
        return self.motor.is_streaming and not self.motor.gone

    def start_streaming(self, frequency: int, heartbeat: int = 0, useSafety: bool = False) -> None:
        assert not useSafety or 50 <= heartbeat < frequency
        motor = self.motor
        motor.calls.append(("start with safety" if useSafety else "start", frequency, heartbeat))
        motor.is_streaming, motor.rate_hz = True, frequency
        motor.next_ns = motor.clock.now_ns()

    def stop_streaming(self) -> None:
        self.motor.calls.append(("stop streaming",))
        self.motor.is_streaming = False

    def set_gains(self, kp: int, ki: int, kd: int, k: int, b: int, ff: int) -> None:
        self.motor.calls.append(("gains", kp, ki, kd, k, b, ff))

    def command_motor_current(self, value: int) -> int:
        return self._send(CURRENT, value)

    def stop_motor(self) -> int:
        return self._send(NO_CURRENT, 0)

    def _send(self, controller: int, value: int) -> int:
        if self.motor.gone:
            raise RuntimeError("Command: command_motor_current failed.")
        self.motor.calls.append(("command", controller, value))
        self.motor.currents.append((self.motor.clock.now_ns(), value))
        return 1

    def read(self, allData: bool = False) -> Any:
        queue, self.motor.queue = self.motor.queue, []
        return queue

    def close(self) -> None:
        self.motor.calls.append(("close",))
        self.motor.is_streaming = False


def put_in_place(monkeypatch: pytest.MonkeyPatch, motor: Motor) -> None:
    """Let the driver find a stand-in for flexsea on this motor."""
    module = ModuleType("flexsea.device")
    module.Device = type("Device", (FakeDevice,), {"motor": motor})
    monkeypatch.setitem(sys.modules, "flexsea", ModuleType("flexsea"))
    monkeypatch.setitem(sys.modules, "flexsea.device", module)


class TestContract(ActuatorContract):
    """The contract; every test in virtual time with the watchdog on it."""

    settle_s = 0.05

    @pytest.fixture(autouse=True)
    def _place(self, monkeypatch: pytest.MonkeyPatch) -> None:
        self.monkeypatch = monkeypatch

    def make_clock(self) -> Clock:
        return HeldClock()

    def make(self, clock: Clock) -> Actuator:
        self.library = Motor(clock)
        put_in_place(self.monkeypatch, self.library)
        repeat = clock.repeat if isinstance(clock, HeldClock) else RepeatingThread
        return DephyActPack(spec(), clock=clock, repeat=repeat)

    def disconnect(self, device: Actuator) -> None:
        self.library.gone = True


@pytest.mark.alone
class TestContractWithTheThreadOfTheWatchdog(TestContract):
    def make_clock(self) -> Clock:
        return RealClock()


@pytest.fixture
def made(monkeypatch):
    """Make a device that is not open yet, its motor and its clock."""
    devices = []

    def make(**changed):
        clock = HeldClock()
        motor = Motor(clock)
        put_in_place(monkeypatch, motor)
        devices.append(DephyActPack(spec(**changed), clock=clock, repeat=clock.repeat))
        return devices[-1], motor, clock

    yield make
    for device in devices:
        device.close()


@pytest.fixture
def begun(made):
    """Make an active device, its library and its clock."""

    def make(**changed):
        device, library, clock = made(**changed)
        begin(device)
        return device, library, clock

    return make


@needs("flexsea")
def test_the_stand_in_is_called_like_the_real_class():
    real = importlib.import_module("flexsea.device").Device
    called = ("open", "close", "read", "set_gains", "command_motor_current", "stop_motor")
    for name in ("__init__", "start_streaming", "stop_streaming", *called):
        assert arguments_of(getattr(FakeDevice, name)) == arguments_of(getattr(real, name)), name


def test_the_next_condition_begins_with_the_heat_of_the_one_before(begun) -> None:
    device, _, clock = begun()
    device._winding.warm(0.0, 30.0, elapsed_s=0.0)
    device._winding.temperature_c = 90.0
    device._sampled_ns = clock.now_ns()
    device.close()
    wait(clock, 5.0)
    again = DephyActPack(spec(), clock=clock, repeat=clock.repeat, before=device)
    assert 70.0 < again._winding.temperature_c < 80.0
    assert again._samples._winding is again._winding
    wait(clock, 100.0)
    later = DephyActPack(spec(), clock=clock, repeat=clock.repeat, before=again)
    assert later._winding.temperature_c == pytest.approx(30.0, abs=0.5)


def test_heat_that_was_never_measured_is_not_handed_on(made) -> None:
    device, _, clock = made()
    device.close()
    again = DephyActPack(spec(), clock=clock, repeat=clock.repeat, before=device)
    again._winding.warm(0.0, 55.0, elapsed_s=0.0)
    assert again._winding.temperature_c == 55.0


def test_all_queued_samples_are_read_at_1_khz_too(begun) -> None:
    device, library, clock = begun(sample_rate_hz=1000.0)
    wait(clock, 0.1)
    assert len(device.read()) == 100  # the first was dropped with what stood there before
    assert device.read() == []
    assert ("start with safety", 1000, 50) in library.calls


def test_values_are_si_after_the_gear_and_turn_together_on_the_left(made) -> None:
    samples = {}
    for side, sent in (("right", 1000), ("left", -1000)):
        device, library, clock = made(side=side, zero_counts=1000)
        begin(device)
        device.command_torque(1.26)  # 1 A
        assert library.calls[-1] == ("command", CURRENT, sent)
        wait(clock, 0.01)
        samples[side] = device.read()[-1]
    right, left = samples["right"], samples["left"]
    assert right.current == pytest.approx(1.0)
    assert right.velocity == pytest.approx(33 * 0.017453292519943295 / 9)
    assert right.angle == pytest.approx(3 * 5 * 2 * 3.141592653589793 / 16384 / 9)
    assert (left.angle, left.velocity) == (-right.angle, -right.velocity)
    assert left.current == right.current  # asked for in the study's direction, on either side
    assert (right.voltage, right.temperature_c) == (36.0, pytest.approx(30.0, abs=0.01))


@pytest.mark.parametrize(("torque_nm", "milliamperes"), [(1e6, 15_000), (-1e6, -15_000)])
def test_current_is_clamped_whatever_is_asked_for(begun, torque_nm, milliamperes) -> None:
    device, library, _ = begun()
    device.command_torque(torque_nm)
    assert library.calls[-1] == ("command", CURRENT, milliamperes)


@pytest.mark.parametrize("torque_nm", [float("nan"), float("inf"), -float("inf")])
def test_no_number_is_no_torque(begun, torque_nm) -> None:
    device, library, _ = begun()
    sent = len(library.calls)
    with pytest.raises(DeviceError, match="finite torque"):
        device.command_torque(torque_nm)
    assert len(library.calls) == sent


def test_a_warm_case_takes_current_away(made) -> None:
    device, library, clock = made()
    library.script = {n: {"temperature": 70} for n in range(1000)}
    begin(device)
    wait(clock, 0.01)
    assert not device.read()[-1].faults
    device.command_torque(1e6)
    assert library.calls[-1] == ("command", CURRENT, 7500)  # half way from 60 to 80 degrees


def test_a_hot_winding_is_a_fault_and_ends_the_torque(begun) -> None:
    device, library, clock = begun()
    library.script = {n: {"mot_cur": 40_000} for n in range(100_000)}
    faults = 0
    for _ in range(20):
        wait(clock, 0.5)
        faults = device.read()[-1].faults
        if faults:
            break
    assert faults == dephy.TOO_HOT
    assert device.state is Lifecycle.FAULT
    assert library.calls[-2:] == [("command", CURRENT, 0), ("command", NO_CURRENT, 0)]
    with pytest.raises(DeviceError, match="expected it active"):
        device.command_torque(0.0)
    assert device.read() == []


@pytest.mark.parametrize(("run", "faults"), [(1, 0), (2, dephy.I2T)])
def test_one_flipped_bit_is_no_fault_and_two_in_a_row_are(made, run, faults) -> None:
    device, library, clock = made()
    library.script = {5 + i: {"status_ex": 2} for i in range(run)}
    begin(device)
    wait(clock, 0.05)
    assert max(sample.faults for sample in device.read()) == faults


@pytest.mark.parametrize(
    "odd",
    [{"mot_cur": 2**31 - 1}, {"temperature": -200}, {"batt_volt": -1}, {"state_time": 5_008}],
)
def test_garbage_or_the_same_stamp_again_is_left_out_once_and_garbage_that_stays_is_a_fault(
    made, odd
) -> None:
    device, library, clock = made()
    library.script = {5: odd}
    begin(device)
    wait(clock, 0.04)
    samples = device.read()
    assert len(samples) == 19
    assert device.dropped == 1
    assert not any(sample.faults for sample in samples)
    library.script = dict.fromkeys(range(1000), odd | {"batt_volt": -1})
    wait(clock, 0.04)
    device.command_torque(5.0)
    assert device.read()[-1].faults == dephy.GARBAGE
    assert device.state is Lifecycle.FAULT
    assert library.calls[-2:] == [("command", CURRENT, 0), ("command", NO_CURRENT, 0)]


@pytest.mark.parametrize("first", [2**31 - 10, 2**32 - 10])
def test_the_clock_comes_round_without_a_jump(made, first) -> None:
    device, library, clock = made()
    library.first_stamp = first
    begin(device)
    wait(clock, 0.1)
    times = [sample.device_time_ns for sample in device.read()]
    assert {b - a for a, b in pairwise(times)} == {2_000_000}
    assert device.state is Lifecycle.ACTIVE


def test_a_device_that_was_restarted_is_a_fault(made) -> None:
    device, library, clock = made()
    library.script = {n: {"state_time": 3 + 2 * n} for n in range(10, 1000)}
    library.first_stamp = 90_000
    begin(device)
    wait(clock, 0.06)
    assert device.read()[-1].faults == dephy.CLOCK


def test_a_first_sample_may_be_late_but_a_silent_device_is_gone(made) -> None:
    device, library, clock = made()
    library.silent = True
    begin(device)
    wait(clock, 0.9)
    assert device.read() == []
    wait(clock, 0.2)
    with pytest.raises(NotConnectedError, match="no sample for a second"):
        device.read()


def test_torque_that_nobody_renews_ends_by_the_timeout(begun) -> None:
    device, library, clock = begun(command_timeout_s=0.05)
    device.command_torque(5.0)
    given_ns = clock.now_ns()
    wait(clock, 0.2)
    ended_ns, milliamperes = library.currents[-1]
    assert milliamperes == 0
    assert 0.03e9 < ended_ns - given_ns <= 0.05e9
    assert device.state is Lifecycle.ACTIVE
    device.command_torque(5.0)
    assert library.currents[-1][1] > 0


def test_the_watchdog_tries_again_and_is_quiet_after_a_stop(begun) -> None:
    device, library, clock = begun(command_timeout_s=0.05)
    device.command_torque(5.0)
    library.gone = True
    wait(clock, 0.1)
    library.gone = False
    wait(clock, 0.02)
    assert library.currents[-1][1] == 0
    device.stop()
    sent = len(library.calls)
    wait(clock, 1.0)
    assert len(library.calls) == sent


def test_gains_are_set_again_after_a_stop(begun) -> None:
    device, library, _ = begun(current_gains=(30, 300, 100))
    device.stop()
    library.calls.clear()
    device.activate()
    assert ("gains", 30, 300, 0, 0, 0, 100) in library.calls
    assert not any(call[0].startswith("start") for call in library.calls)


def test_a_stop_that_does_not_reach_the_motor_is_not_confirmed_and_said(begun, caplog) -> None:
    device, library, _ = begun()
    library.gone = True
    device.stop()
    assert not device.stop_confirmed
    assert [record.levelname for record in caplog.records] == ["ERROR"]


def test_a_stop_after_a_fault_sends_zero_again(begun, monkeypatch) -> None:
    device, library, clock = begun()

    def refused(self: FakeDevice, value: int) -> int:
        raise RuntimeError("Command: command_motor_current failed.")

    device.command_torque(5.0)
    library.script = {n: {"status_ex": 2} for n in range(library.number, 100_000)}
    with monkeypatch.context() as patch:
        patch.setattr(FakeDevice, "command_motor_current", refused)
        wait(clock, 0.05)
        device.read()
    assert device.state is Lifecycle.FAULT
    calls = len(library.calls)
    device.stop()
    assert ("command", CURRENT, 0) in library.calls[calls:]
    assert device.stop_confirmed


def test_an_activation_that_fails_leaves_it_inactive(made) -> None:
    device, library, clock = made()
    device.configure()
    library.gone = True
    with pytest.raises(NotConnectedError, match="does not answer"):
        device.activate()
    assert device.state is Lifecycle.INACTIVE
    assert not clock.repeated
    library.gone = False
    device.activate()
    assert device.state is Lifecycle.ACTIVE


@pytest.mark.alone
def test_zero_torque_does_not_wait_for_a_call_that_hangs(begun) -> None:
    device, library, clock = begun(command_timeout_s=0.05)
    device.command_torque(5.0)
    with device._sending:  # as a call holds it that does not come back
        wait(clock, 0.1)
        assert library.currents[-1][1] == 0
        library.calls.clear()
        began = time.perf_counter()
        device.stop()
        took_s = time.perf_counter() - began
    assert took_s < 0.1
    assert library.calls == [("command", CURRENT, 0), ("command", NO_CURRENT, 0)]


def test_closing_stops_the_stream_too(begun) -> None:
    device, library, _ = begun()
    device.close()
    ends = [call for call in library.calls if call[0] != "command"]
    assert ends[-2:] == [("stop streaming",), ("close",)]
    assert library.currents[-1][1] == 0


def test_an_old_firmware_is_streamed_without_heartbeat_and_it_says_so(made, begun, caplog) -> None:
    device, library, _ = begun(firmware="9.0.4")
    assert [record.levelname for record in caplog.records] == ["WARNING"]
    assert ("start", 500, 0) in library.calls
    assert "NO HEARTBEAT" in device.describe().firmware
    new, _, _ = made(firmware="9.1.0")
    assert new.has_heartbeat
    assert "NO HEARTBEAT" not in new.describe().firmware


@pytest.mark.parametrize("limit", [None, 7])
def test_tracebacks_and_stdout_are_as_before(begun, monkeypatch, capsys, limit) -> None:
    monkeypatch.delattr(sys, "tracebacklimit", raising=False)
    if limit is not None:
        monkeypatch.setattr(sys, "tracebacklimit", limit, raising=False)
    device, _, _ = begun()
    device.close()
    assert getattr(sys, "tracebacklimit", None) == limit
    assert capsys.readouterr().out == ""


def test_a_device_that_is_not_there_says_what_to_look_at(made) -> None:
    device, library, _ = made()
    library.gone = True
    with pytest.raises(NotConnectedError, match="Check power, cable and port"):
        device.configure()
    assert device.state is Lifecycle.UNCONFIGURED


def test_the_wrong_side_is_refused(made) -> None:
    device, library, _ = made()
    library.side = "left"
    with pytest.raises(DeviceError, match=r"side.*right.*left"):
        device.configure()


def test_another_firmware_than_stated_is_refused(made, monkeypatch) -> None:
    device, _, _ = made()
    module = sys.modules["flexsea.device"]
    real = module.Device

    def other(**named: Any) -> FakeDevice:
        return real(**{**named, "firmwareVersion": "12.0.9"})

    monkeypatch.setattr(module, "Device", other)
    with pytest.raises(DeviceError, match=r"12\.0\.0.*12\.0\.9"):
        device.configure()


def test_a_device_of_other_fields_is_refused(made) -> None:
    device, library, clock = made()
    library.fields = [name for name in FIELDS if name != "mot_cur"]
    begin(device)
    wait(clock, 0.01)
    with pytest.raises(DeviceError, match="'mot_cur' is missing"):
        device.read()


def test_a_winding_follows_its_differential_equation() -> None:
    thermal = WindingSpec()
    winding = Winding(thermal)
    winding.warm(0.0, 30.0, elapsed_s=0.001)
    slow = 30.0
    for _ in range(30_000):
        resistance = thermal.resistance_ohm * (1 + thermal.resistance_per_k * (slow - 65.0))
        flow = 15.0**2 * resistance - (slow - 30.0) / thermal.to_case_k_w
        slow += 1e-4 * flow / thermal.capacitance_j_k
    for _ in range(150):
        winding.warm(15.0, 30.0, elapsed_s=0.02)
    assert winding.temperature_c == pytest.approx(slow, abs=0.01)


def test_a_winding_without_end_of_heat_stays_a_number() -> None:
    winding = Winding(WindingSpec())
    winding.warm(60.0, 30.0, elapsed_s=1e6)
    assert winding.too_hot
    assert winding.share == 0.0


def test_a_clock_refuses_a_stamp_ahead_of_the_host() -> None:
    clock = DeviceClock()
    clock.elapsed_ms(100, 0)
    assert clock.elapsed_ms(5_000, 1_000_000_000) is None
    assert clock.elapsed_ms(99, 1_000_000_000) is None
    assert clock.elapsed_ms(1_900, 1_000_000_000) == 1_800
