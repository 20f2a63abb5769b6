# ruff: noqa: N802, N815, ARG002 - names and arguments are those of flexsea and its library
"""The Dephy driver on a stand-in for the compiled library that flexsea talks to.

The stand-in has the functions of the C library. In an environment with flexsea its real classes
run on it; elsewhere a small class of the same calls does.
"""

import functools
import importlib
import importlib.util
import sys
import time
from dataclasses import dataclass, field
from itertools import pairwise
from types import ModuleType, SimpleNamespace
from typing import Any, ClassVar

import pytest

from jointz.core.clock import Clock, RealClock, VirtualClock
from jointz.core.errors import DeviceError, NotConnectedError
from jointz.core.study import TorqueModelSpec
from jointz.devices import dephy
from jointz.devices.config import DephySpec
from jointz.devices.dephy import DephyActPack
from jointz.devices.dephy_units import DeviceClock, Winding, WindingSpec
from jointz.devices.interface import Actuator, Lifecycle
from jointz.devices.repeating import RepeatingThread
from jointz.testing import ActuatorContract
from jointz.testing.scripted import SCRIPTED_ACTUATOR

from .fakes import HeldClock, arguments_of, begin, needs, wait

pytestmark = pytest.mark.alone

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
class FakeLibrary:
    """The functions of ``libfx_plan_stack`` on an actuator that carries any load.

    The current is what was commanded last; every field can be scripted by sample.
    """

    clock: Clock
    script: dict[int, dict[str, int]] = field(default_factory=dict)
    first_stamp: int = 5_000
    rate_hz: int = 0
    is_open: bool = False
    is_streaming: bool = False
    gone: bool = False
    silent: bool = False
    calls: list[tuple[Any, ...]] = field(default_factory=list)
    queue: list[list[int]] = field(default_factory=list)
    currents: list[tuple[int, int]] = field(default_factory=list)
    number: int = 0
    next_ns: int = 0
    side: str = ""
    fields: list[str] = field(default_factory=lambda: list(FIELDS))

    def __getattr__(self, name: str) -> Any:
        # flexsea sets argtypes and restype on functions, which bound methods do not take.
        if not name.startswith("fx"):
            raise AttributeError(name)
        function = functools.partial(getattr(type(self), f"do_{name}"), self)
        self.__dict__[name] = function
        return function

    def do_fxOpen(self, port: bytes, baud_rate: int, log_level: int) -> int:
        self.calls.append(("open", port, baud_rate, log_level))
        self.is_open = not self.gone
        return 77 if self.is_open else -1

    def do_fxClose(self, _: int) -> int:
        self.calls.append(("close",))
        self.is_open = self.is_streaming = False
        return 1

    def do_fxIsOpen(self, _: int) -> bool:
        return self.is_open and not self.gone

    def do_fxIsStreaming(self, _: int) -> bool:
        return self.is_streaming and not self.gone

    def do_fxStartStreaming(self, _: int, rate_hz: int, log: int) -> int:
        return self.stream("start", rate_hz, log)

    def do_fxStartStreamingWithSafety(
        self, _: int, rate_hz: int, log: int, heartbeat_ms: int
    ) -> int:
        return self.stream("start with safety", rate_hz, log, heartbeat_ms)

    def stream(self, *call: Any) -> int:
        self.calls.append(call)
        self.is_streaming, self.rate_hz = True, call[1]
        self.next_ns = self.clock.now_ns()
        return 1

    def do_fxStopStreaming(self, _: int) -> int:
        self.calls.append(("stop streaming",))
        self.is_streaming = False
        return 1

    def do_fxSetGains(self, _: int, *gains: int) -> int:
        self.calls.append(("gains", *gains))
        return 1

    def do_fxSendMotorCommand(self, _: int, controller: Any, value: int) -> int:
        if self.gone:
            return 2
        kind = getattr(controller, "value", controller)
        self.calls.append(("command", kind, value))
        self.currents.append((self.clock.now_ns(), value if kind == CURRENT else 0))
        return 1

    def do_fxGetReadDataQueueSize(self, _: int) -> int:
        self.fill()
        return len(self.queue)

    def do_fxReadDeviceAllWrapper(self, _: int, data: Any, count: Any) -> None:
        for i, values in enumerate(self.queue):
            for j, value in enumerate(values):
                data[i][j] = value
        count._obj.value = len(self.fields) if self.queue else 0
        self.queue = []

    def do_fxReadDevice(self, *_: Any) -> int:
        return 2

    def do_fxGetMaxDeviceNameLength(self) -> int:
        return 16

    do_fxGetMaxDeviceSideNameLength = do_fxGetMaxDataLabelLength = do_fxGetMaxDeviceNameLength

    def do_fxGetDeviceTypeNameWrapper(self, _: int, name: Any) -> int:
        name.value = b"ActPack"
        return 1

    def do_fxGetDeviceSideNameWrapper(self, _: int, name: Any) -> int:
        name.value = self.side.encode()
        return 1

    def do_fxGetMaxDataElements(self) -> int:
        return 64

    def do_fxGetDataLabelsWrapper(self, _: int, labels: Any, count: Any) -> int:
        for i, name in enumerate(self.fields):
            for j, letter in enumerate(name.encode()):
                labels[i][j] = bytes([letter])
        count._obj.value = len(self.fields)
        return 1

    def do_fxGetLibsVersion(self, *parts: Any) -> int:
        for part, value in zip(parts, (12, 0, 0), strict=True):
            part._obj.value = value
        return 1

    def fill(self) -> None:
        if not self.is_streaming or self.silent or self.gone:
            return
        period_ns = 1_000_000_000 // self.rate_hz
        now_ns = self.clock.now_ns()
        while self.next_ns <= now_ns:
            self.queue.append(self.measured(self.next_ns, self.number * period_ns))
            self.number += 1
            self.next_ns += period_ns

    def measured(self, time_ns: int, since_ns: int) -> list[int]:
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
        return [values.get(name, 0) for name in self.fields]


class FakeDevice:
    """The calls of flexsea's ``Device`` that the driver makes, on the stand-in."""

    library: ClassVar[FakeLibrary]

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
        if not debug:
            sys.tracebacklimit = 0
        print(f"Using firmware version: {firmwareVersion}")  # noqa: T201 - as flexsea does
        self.firmwareVersion, self.port = firmwareVersion, port
        self.id = 0
        self._clib = self.library

    def open(self, bootloading: bool = False) -> None:
        self.id = self._clib.fxOpen(self.port.encode(), 230400, 6)
        if self.id == -1:
            raise RuntimeError("Failed to connect to device.")

    @property
    def side(self) -> str:
        return self._clib.side or "undefined"

    @property
    def streaming(self) -> bool:
        return self._clib.fxIsOpen(self.id) and self._clib.fxIsStreaming(self.id)

    def start_streaming(self, frequency: int, heartbeat: int = 0, useSafety: bool = False) -> None:
        if useSafety:
            assert 50 <= heartbeat < frequency
            self._clib.fxStartStreamingWithSafety(self.id, frequency, 1, heartbeat)
        else:
            self._clib.fxStartStreaming(self.id, frequency, 1)

    def stop_streaming(self) -> None:
        if not self.streaming:
            raise RuntimeError("Error: not streaming.")
        self._clib.fxStopStreaming(self.id)

    def set_gains(self, kp: int, ki: int, kd: int, k: int, b: int, ff: int) -> None:
        self._clib.fxSetGains(self.id, kp, ki, kd, k, b, ff)

    def command_motor_current(self, value: int) -> int:
        return self._send(CURRENT, value)

    def stop_motor(self) -> int:
        return self._send(NO_CURRENT, 0)

    def _send(self, controller: int, value: int) -> int:
        if self._clib.fxSendMotorCommand(self.id, controller, value) != 1:
            raise RuntimeError("Command: command_motor_current failed.")
        return 1

    def read(self, allData: bool = False) -> Any:
        if not self.streaming:
            raise RuntimeError("Error: not streaming.")
        queue, self._clib.queue = self._clib.queue, []
        return [dict(zip(self._clib.fields, values, strict=True)) for values in queue]

    def close(self) -> None:
        self._clib.fxClose(self.id)


def put_in_place(monkeypatch: pytest.MonkeyPatch, library: FakeLibrary, *, real: bool) -> None:
    """Let the driver find the library: below the real flexsea, or below a stand-in for it."""
    if not real:
        module = ModuleType("flexsea.device")
        module.Device = type("Device", (FakeDevice,), {"library": library})
        monkeypatch.setitem(sys.modules, "flexsea", ModuleType("flexsea"))
        monkeypatch.setitem(sys.modules, "flexsea.device", module)
        return
    device = importlib.import_module("flexsea.device")
    version = importlib.import_module("semantic_version").Version
    monkeypatch.setattr(device, "get_c_library", lambda *_: (library, "fake"))
    monkeypatch.setattr(device, "validate_given_firmware_version", lambda v, *_: version(v))
    constants = SimpleNamespace(
        **{**vars(device.fxc), "dephyPath": SimpleNamespace(mkdir=lambda **_: 0)}
    )
    monkeypatch.setattr(device, "fxc", constants)


class _Rig(ActuatorContract):
    """The contract; every test in virtual time with the watchdog on it."""

    real: ClassVar[bool]
    settle_s = 0.05

    @pytest.fixture(autouse=True)
    def _place(self, monkeypatch: pytest.MonkeyPatch) -> None:
        self.monkeypatch = monkeypatch

    def make_clock(self) -> Clock:
        return HeldClock()

    def make(self, clock: Clock) -> Actuator:
        assert isinstance(clock, HeldClock)
        self.library = FakeLibrary(clock)
        put_in_place(self.monkeypatch, self.library, real=self.real)
        return DephyActPack(spec(), clock=clock, repeat=clock.repeat)

    def disconnect(self, device: Actuator) -> None:
        self.library.gone = True


class TestContractOnAStandIn(_Rig):
    real = False


@needs("flexsea")
class TestContractOnTheRealClasses(_Rig):
    real = True


class TestContractWithTheThreadOfTheWatchdog(_Rig):
    real = False

    def make_clock(self) -> Clock:
        return RealClock()

    def make(self, clock: Clock) -> Actuator:
        self.library = FakeLibrary(clock)
        put_in_place(self.monkeypatch, self.library, real=False)
        return DephyActPack(spec(), clock=clock, repeat=RepeatingThread)


@pytest.fixture(
    params=[False, pytest.param(True, marks=needs("flexsea"))], ids=["stand-in", "flexsea"]
)
def made(request, monkeypatch):
    """Make a device that is not open yet, its library and its clock."""
    devices = []

    def make(**changed):
        clock = HeldClock()
        library = FakeLibrary(clock)
        put_in_place(monkeypatch, library, real=request.param)
        devices.append(DephyActPack(spec(**changed), clock=clock, repeat=clock.repeat))
        return devices[-1], library, clock

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


@pytest.mark.parametrize(("rate_hz", "samples"), [(500.0, 51), (1000.0, 101)])
def test_all_queued_samples_are_read_at_either_rate(begun, rate_hz, samples) -> None:
    device, library, clock = begun(sample_rate_hz=rate_hz)
    wait(clock, 0.1)
    assert len(device.read()) == samples - 1  # the first was dropped with what stood there before
    assert device.read() == []
    assert ("start with safety", int(rate_hz), 1, 50) in library.calls


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


def test_a_stop_that_does_not_reach_the_motor_is_said_loudly(begun, caplog) -> None:
    device, library, _ = begun()
    library.gone = True
    device.stop()
    assert "Switch its power off" in caplog.text


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


def test_an_old_firmware_is_streamed_without_heartbeat_and_it_says_so(monkeypatch, caplog) -> None:
    clock = HeldClock()
    library = FakeLibrary(clock)
    put_in_place(monkeypatch, library, real=False)
    device = DephyActPack(spec(firmware="9.0.4"), clock=clock, repeat=clock.repeat)
    begin(device)
    assert "holds its last current" in caplog.text
    assert ("start", 500, 1) in library.calls
    assert "NO HEARTBEAT" in device.describe().firmware
    device.close()
    new = DephyActPack(spec(firmware="9.1.0"), clock=clock)
    assert new.has_heartbeat
    assert "NO HEARTBEAT" not in new.describe().firmware
    assert "never tried on hardware" in new.describe().model


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
    with pytest.raises(DeviceError, match="side: expected right, the device says left"):
        device.configure()


def test_another_firmware_than_stated_is_refused(monkeypatch) -> None:
    library = FakeLibrary(VirtualClock())
    put_in_place(monkeypatch, library, real=False)
    real_init = FakeDevice.__init__

    def other(self: Any, *args: Any, **kwargs: Any) -> None:
        real_init(self, *args, **kwargs)
        self.firmwareVersion = "12.0.9"

    monkeypatch.setattr(FakeDevice, "__init__", other)
    with pytest.raises(DeviceError, match=r"knows no 12\.0\.0 and would take 12\.0\.9"):
        DephyActPack(spec(), clock=VirtualClock()).configure()


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
