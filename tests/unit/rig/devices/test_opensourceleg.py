"""Actuators and sensors of opensourceleg: on fakes everywhere, on the real package where it is."""

import asyncio
import enum
import importlib
import logging
import math
import sys
import threading
import time
import types
from contextlib import nullcontext

import numpy as np
import pytest

from jointz.core.clock import RealClock
from jointz.core.errors import DeviceError, NotConnectedError
from jointz.core.study import TorqueModelSpec
from jointz.rig.devices import opensourceleg as output_module
from jointz.rig.devices import opensourceleg_polling as polling_module
from jointz.rig.devices.interface import Lifecycle
from jointz.rig.devices.opensourceleg import OpenSourceLegActuator, open_actuator, open_sensor
from jointz.rig.devices.opensourceleg_polling import QUEUE_LENGTH, PollingThread, made
from jointz.rig.devices.opensourceleg_sensors import OpenSourceLegSensor, OpenSourceLegSource
from jointz.rig.devices.opensourceleg_setup import (
    ActuatorKeys,
    ActuatorSetup,
    Profile,
    Reading,
    SensorKeys,
)
from jointz.rig.experiment.session import _stop
from jointz.rig.testing import ActuatorContract, SensorContract
from jointz.rig.testing.scripted import SCRIPTED_ACTUATOR

from .fakes import HeldClock, begin, names_of, needs, wait

needs_library = needs("opensourceleg")
GEAR, CONSTANT = 9.0, 0.1
MODEL = TorqueModelSpec(gear_ratio=GEAR, torque_constant=CONSTANT)
LIMITS = SCRIPTED_ACTUATOR.limits


@pytest.fixture(autouse=True)
def workplace(tmp_path, monkeypatch):
    """opensourceleg writes a log into the working directory."""
    monkeypatch.chdir(tmp_path)


# --- the library, faked --------------------------------------------------------------------------


class Modes(enum.Enum):
    IDLE = -1
    VOLTAGE = 1
    CURRENT = 2
    TORQUE = 5


class FakeActuator:
    """What the adapter uses of opensourceleg's ``ActuatorBase``; mA, rad before the gear."""

    def __init__(self, tag="knee", gear_ratio=GEAR, frequency=500, offline=False):
        self.tag, self.gear_ratio, self.frequency = tag, gear_ratio, frequency
        self.is_offline = offline
        self.mode = Modes.IDLE
        self.calls, self.error, self.stuck = [], None, False
        self.motor_position, self.motor_velocity, self.motor_current = 1.8, 0.9, 0.0
        self.battery_voltage, self.winding_temperature = 36_000.0, 31.0
        self._asked, self._data = 0.0, None

    output_position = property(lambda self: self.motor_position / self.gear_ratio)
    output_velocity = property(lambda self: self.motor_velocity / self.gear_ratio)

    def _call(self, *call):
        self.calls.append(call)
        if self.error is not None:
            raise self.error

    def start(self):
        self._call("start")

    def stop(self):
        self._call("stop")

    def set_control_mode(self, mode):
        self._call("mode", mode)
        self.mode = mode

    def set_current_gains(self, kp=40, ki=400, kd=0, ff=128):
        self._call("gains", kp, ki, kd, ff)

    def set_motor_current(self, value):
        assert self.mode is Modes.CURRENT
        self._call("current", value)
        self._asked = value

    def set_output_torque(self, value):
        assert self.mode is Modes.TORQUE
        self._call("torque", value)
        self._asked = value / (self.gear_ratio * CONSTANT) * 1e3

    def update(self):
        self._call("update")
        self.motor_current = self._asked
        if not self.stuck:
            self._data = {"state_time": len(self.calls), "mot_cur": self.motor_current}

    def currents(self):
        return [call[1] for call in self.calls if call[0] == "current"]


class DephyActuator(FakeActuator):
    """By this name its profile is known."""


class TMotorServoActuator(FakeActuator):
    """By this name it counts in A, and has no supply voltage to tell."""


class ThermalLimitException(Exception):  # noqa: N818 - as opensourceleg names it
    pass


class FakeSensor:
    """What the adapter uses of opensourceleg's ``SensorBase``."""

    def __init__(self, tag="encoder", offline=False):
        self.tag, self.is_offline, self.error, self.calls = tag, offline, None, []
        self.position, self.data = 0.25, np.array([500.0, 1200.0])

    _call = FakeActuator._call
    start, stop = FakeActuator.start, FakeActuator.stop

    def update(self):
        self._call("update")


def setup(**other):
    return ActuatorSetup(**{"torque_model": MODEL, "limits": LIMITS, **other})


def adapted(fake, clock, **other):
    return OpenSourceLegActuator(
        fake,
        setup(**other),
        clock=clock,
        polling=clock.polling,
        repeat=lambda *_: types.SimpleNamespace(cancel=lambda: None),
    )


def active(**other):
    """Return an active actuator on a fake, the fake, and the clock."""
    fake, clock = DephyActuator(), HeldClock()
    actuator = adapted(fake, clock, **other)
    begin(actuator)
    return actuator, fake, clock


def source_of(sensor, clock):
    return OpenSourceLegSource(sensor, clock=clock, sample_rate_hz=500.0, polling=clock.polling)


# --- the contracts, on fakes ---------------------------------------------------------------------


class Polled:
    def make_clock(self):
        self.clock = HeldClock()
        return self.clock

    def disconnect(self, device):  # noqa: ARG002
        self.fake.error = OSError("cable")
        wait(self.clock, 0.003)


class TestAnActuatorOfOpensourceleg(Polled, ActuatorContract):
    def make(self, clock):
        self.fake = DephyActuator()
        return adapted(self.fake, clock)


class TestAnActuatorWithTorqueControlOnly(Polled, ActuatorContract):
    def make(self, clock):
        self.fake = FakeActuator()
        return adapted(self.fake, clock, profile=Profile(command="torque"))


class TestAnEncoderOfOpensourceleg(Polled, SensorContract):
    def make(self, clock):
        self.fake = FakeSensor()
        return OpenSourceLegSensor(
            source_of(self.fake, clock), Reading(channel="angle", unit="rad")
        )


# --- units, signs, limits ------------------------------------------------------------------------


@pytest.mark.parametrize("sign", [1, -1])
def test_values_are_si_after_the_gear_and_turn_together_with_the_sign(sign):
    actuator, fake, clock = active(sign=sign, angle_offset_rad=0.5)
    actuator.command_torque(1.8)
    wait(clock, 0.004)
    sample = actuator.read()[-1]
    assert fake.currents()[-1] == pytest.approx(sign * 2000.0)
    assert sample[2:] == pytest.approx((0.5 + sign * 0.2, sign * 0.1, 2.0, 36.0, 31.0, 0))
    assert sample.host_time_ns == sample.device_time_ns <= clock.now_ns()


def test_an_actuator_that_counts_in_amperes_is_asked_for_amperes():
    fake, clock = TMotorServoActuator(), HeldClock()
    actuator = adapted(fake, clock)
    begin(actuator)
    actuator.command_torque(1.8)
    wait(clock, 0.004)
    sample = actuator.read()[-1]
    assert fake.currents()[-1] == sample.current == pytest.approx(2.0)
    assert math.isnan(sample.voltage)


@pytest.mark.parametrize(
    ("limits", "most_nm"), [({}, 30.0), ({"current_a": 10.0}, 9.0), ({"torque_nm": 3.0}, 3.0)]
)
@pytest.mark.parametrize("way", [1, -1])
def test_the_current_is_clamped_whatever_is_asked_for(limits, most_nm, way):
    actuator, fake, _ = active(limits=LIMITS.model_copy(update=limits))
    actuator.command_torque(way * 1e6)
    assert fake.currents()[-1] == pytest.approx(way * most_nm / (GEAR * CONSTANT) * 1e3)


def test_a_torque_that_is_no_number_is_refused_and_the_one_before_holds():
    actuator, fake, _ = active()
    actuator.command_torque(1.8)
    with pytest.raises(DeviceError, match="finite torque"):
        actuator.command_torque(math.nan)
    assert fake.currents()[-1] == pytest.approx(2000.0)


def test_it_starts_in_current_mode_with_the_gains_of_its_class_at_zero_current():
    fake = DephyActuator()
    adapted(fake, HeldClock()).configure()
    entered = [("mode", Modes.CURRENT), ("gains", 40, 400, 0, 128)]
    assert fake.calls == [("start",), *entered, ("current", 0.0)]


def test_the_last_thing_it_hears_before_it_is_stopped_is_zero():
    actuator, fake, _ = active()
    actuator.command_torque(5.0)
    actuator.stop()
    assert fake.currents()[-1] == 0.0  # at once, not at the next sample
    actuator.close()
    assert fake.calls[-2:] == [("current", 0.0), ("stop",)]


# --- what goes wrong -----------------------------------------------------------------------------


def test_a_link_lost_between_two_samples_is_told_and_zero_was_tried():
    actuator, fake, clock = active()
    actuator.command_torque(5.0)
    fake.error = OSError("no such device")
    wait(clock, 0.003)
    assert fake.calls[-1] == ("current", 0.0)
    with pytest.raises(NotConnectedError, match=r"knee.*no such device"):
        actuator.read()
    actuator.stop()
    actuator.close()
    assert actuator.state is Lifecycle.FINALISED


def test_a_measurement_that_is_repeated_or_older_than_the_session_is_no_sample():
    fake, clock = DephyActuator(), HeldClock()
    fake.stuck, fake._data = True, {"state_time": 0}
    actuator = adapted(fake, clock)
    begin(actuator)
    wait(clock, 0.01)
    assert actuator.read() == []
    fake.stuck = False
    wait(clock, 0.01)
    assert len(actuator.read()) == 5
    fake.stuck = True
    wait(clock, 0.01)
    assert actuator.read() == []


def test_the_thermal_limit_of_the_library_is_a_fault_at_zero_torque(monkeypatch):
    actuator, fake, clock = active()
    logger, currents = logging.getLogger("jointz.rig.devices.opensourceleg"), []
    monkeypatch.setattr(logger, "handle", lambda _: currents.append(fake.currents()[-1]))
    actuator.command_torque(5.0)
    update, fake.update = fake.update, lambda: (_ for _ in ()).throw(ThermalLimitException("hot"))
    wait(clock, 0.003)
    assert actuator.state is Lifecycle.FAULT
    assert actuator.read()[-1].faults == 1
    assert fake.currents()[-1] == 0.0
    with pytest.raises(DeviceError, match="software thermal limit"):
        actuator.command_torque(1.0)
    fake.update = update
    wait(clock, 0.01)
    assert fake.currents()[-1] == 0.0  # it stays
    actuator.stop()
    assert actuator.state is Lifecycle.FAULT
    actuator.close()
    assert actuator.state is Lifecycle.FINALISED
    assert currents == [0.0]  # zero torque before the log tells of it, once


def test_after_a_hang_it_gives_no_torque_until_it_is_stopped_and_activated_again():
    actuator, fake, clock = active(command_timeout_s=0.1)
    actuator.command_torque(9.0)
    (polling,) = clock.repeated
    polling.cancelled = True
    for _ in range(20):
        wait(clock, 0.01)
        actuator.command_torque(9.0)
    polling.cancelled = False
    wait(clock, 0.004)
    assert set(fake.currents()[-2:]) == {0.0}
    assert actuator.state is Lifecycle.FAULT
    assert actuator.read()[-1].faults == 8
    with pytest.raises(DeviceError, match="a call of opensourceleg hung"):
        actuator.command_torque(9.0)
    actuator.stop()
    actuator.activate()
    actuator.command_torque(9.0)
    assert fake.currents()[-1] == pytest.approx(10_000.0)


def test_an_error_that_the_motor_driver_reports_is_a_fault_at_zero_torque():
    actuator, fake, clock = active()
    actuator.command_torque(5.0)
    fake.error_info = (6, "Over temp motor fault")
    wait(clock, 0.003)
    assert actuator.state is Lifecycle.FAULT
    assert actuator.read()[-1].faults == 4
    assert fake.currents()[-1] == 0.0


def test_a_device_that_does_not_start_says_why_and_is_let_go():
    fake = DephyActuator()
    fake.error = RuntimeError("no answer")
    actuator = adapted(fake, HeldClock())
    with pytest.raises(NotConnectedError, match="no answer"):
        actuator.configure()
    assert actuator.state is Lifecycle.UNCONFIGURED
    assert fake.calls == [("start",), ("stop",)]


def test_a_port_that_cannot_be_opened_is_found_before_the_library_ends_the_process(tmp_path):
    fake = DephyActuator()
    fake.port = str(tmp_path / "ttyACM0")
    with pytest.raises(NotConnectedError, match="dialout"):
        adapted(fake, HeldClock()).configure()
    assert fake.calls == []


def test_the_queue_is_bounded():
    actuator, _, clock = active()
    wait(clock, 1e-3 * (QUEUE_LENGTH * 2 + 500))
    samples = actuator.read()
    assert len(samples) == QUEUE_LENGTH
    assert clock.now_ns() - samples[-1].host_time_ns < 4_000_000  # the oldest are dropped


class _Awaited(DephyActuator):
    async def update(self):
        await asyncio.sleep(0)


@pytest.mark.parametrize(
    ("fake", "other", "told"),
    [
        (FakeActuator(), {}, "units of FakeActuator are not known"),
        (DephyActuator(gear_ratio=41.5), {}, r"gear ratio of the torque model, 9;.*has 41\.5"),
        (DephyActuator(offline=True), {}, "is offline"),
        (_Awaited(), {}, "_Awaited is awaited"),
        (
            DephyActuator(),
            {"torque_model": TorqueModelSpec(gear_ratio=9.0, torque_constant=0.0)},
            "torque constant other than 0",
        ),
    ],
)
def test_an_actuator_that_cannot_be_used_is_refused(fake, other, told):
    with pytest.raises(DeviceError, match=told):
        adapted(fake, HeldClock(), **other)


# --- sensors -------------------------------------------------------------------------------------


@pytest.fixture
def adc():
    """Two active channels of one ADC without a tag, the fake of it, and the clock."""
    fake, clock = FakeSensor(), HeldClock()
    del fake.tag
    source = source_of(fake, clock)
    angle = Reading(channel="angle", unit="rad", attribute="data", index=0, gain=-2e-3, offset=1.5)
    contact = Reading(
        channel="contact", unit="V", attribute="data", index=1, gain=1e-3, kind="voltage"
    )
    sensors = [OpenSourceLegSensor(source, reading) for reading in (angle, contact)]
    begin(*sensors)
    return *sensors, fake, clock


def test_two_channels_of_one_adc_are_converted_from_the_same_update(adc):
    angle, contact, fake, clock = adc
    assert angle.describe().name == "FakeSensor angle"
    wait(clock, 0.004)
    angles, voltages = angle.read(), contact.read()
    assert [s.value for s in angles] == pytest.approx([0.5] * len(angles))
    assert [s.value for s in voltages] == pytest.approx([1.2] * len(voltages))
    assert [s.host_time_ns for s in angles] == [s.host_time_ns for s in voltages]
    assert fake.calls.count(("start",)) == 1
    angle.close()
    assert ("stop",) not in fake.calls
    contact.close()
    assert fake.calls[-1] == ("stop",)


def test_a_lost_sensor_is_lost_for_all_its_channels(adc):
    *sensors, fake, clock = adc
    fake.error = RuntimeError("Couldn't connect to the ADC")
    wait(clock, 0.003)
    for sensor in sensors:
        with pytest.raises(NotConnectedError, match="Couldn't connect to the ADC"):
            sensor.read()


def test_an_offline_sensor_is_refused():
    with pytest.raises(DeviceError, match="offline"):
        source_of(FakeSensor(offline=True), HeldClock())


def test_a_sensor_whose_update_hangs_is_lost(adc):
    angle, _, _, clock = adc
    wait(clock, 0.004)
    assert angle.read()
    clock.repeated[0].cancel()
    wait(clock, 0.9)
    assert angle.read() == []
    wait(clock, 0.2)
    with pytest.raises(NotConnectedError, match="gave no sample for a second"):
        angle.read()


# --- the thread ----------------------------------------------------------------------------------


def test_a_thread_polls_on_its_grid_is_woken_in_between_and_ends():
    polls, sampled, woken = [], threading.Event(), threading.Event()

    def poll(due):
        polls.append(due)
        (sampled if due else woken).set()

    thread = PollingThread("knee", poll, 5.0)
    thread.begin()
    assert sampled.wait(5.0)
    thread.wake()
    assert woken.wait(5.0)
    assert thread.end()
    assert polls[0] is True
    assert not [t for t in threading.enumerate() if t.name == "poll knee"]


# --- a library that hangs, in real time ----------------------------------------------------------

TIMEOUT_S, ZERO_S = 0.1, 0.05


class HangingActuator(DephyActuator):
    """``hang`` makes the next update wait for ``released``; ``locked``: all other calls, too."""

    def __init__(self, *, locked=False):
        super().__init__()
        self.hang, self.hangs = threading.Event(), threading.Event()
        self.released, self.lock = threading.Event(), threading.Lock()
        self.locked, self.refused, self.heard = locked, 0, []

    def update(self):
        with self.lock if self.locked else nullcontext():
            if self.hang.is_set():
                self.hangs.set()
                self.released.wait(10.0)
        super().update()

    def set_motor_current(self, value):
        with self.lock if self.locked else nullcontext():
            if self.hang.is_set() and self.refused:
                self.refused -= 1
                raise OSError("bus is busy")
            super().set_motor_current(value)
            self.heard.append((time.perf_counter(), value))

    def zero_after_s(self, since_s, patience_s=2.0):
        """When zero came last, after a while without another torque."""
        while time.perf_counter() - since_s < patience_s and self.heard[-1][1] != 0.0:
            time.sleep(0.001)
        on = [at_s for at_s, value in self.heard if value != 0.0]
        zeros = [at_s for at_s, value in self.heard if value == 0.0 and at_s > max(on)]
        return zeros[0] - since_s if zeros else math.inf


@pytest.fixture
def hanging():
    """An actuator that asks for 9 N*m (10 A) as its library begins to hang, and how to end it."""
    made = []

    def hang(**other):
        fake = HangingActuator(**other)
        actuator = OpenSourceLegActuator(
            fake, setup(command_timeout_s=TIMEOUT_S), clock=RealClock()
        )
        made.append((fake, actuator))
        begin(actuator)
        actuator.command_torque(9.0)
        while fake.heard[-1][1] == 0.0:
            time.sleep(0.001)
        fake.hang.set()
        assert fake.hangs.wait(5.0)
        return fake, actuator

    yield hang
    for fake, actuator in made:
        fake.released.set()
        actuator.close()


def _keep_commanding(actuator):
    until_s = time.perf_counter() + TIMEOUT_S + ZERO_S
    while time.perf_counter() < until_s:
        actuator.command_torque(9.0)
        time.sleep(0.002)


def _command_until_refused(actuator):
    with pytest.raises(DeviceError, match="a call of opensourceleg hung"):
        _keep_commanding(actuator)


@pytest.mark.alone
@pytest.mark.parametrize(
    ("end", "allowed_s"),
    [
        (OpenSourceLegActuator.stop, ZERO_S),
        (OpenSourceLegActuator.close, ZERO_S),
        (lambda actuator: actuator.command_torque(0.0), ZERO_S),
        (lambda _: None, TIMEOUT_S + ZERO_S),
        (_command_until_refused, TIMEOUT_S + ZERO_S),
    ],
    ids=["stop", "close", "zero asked for", "no commands", "commands that nobody takes"],
)
@pytest.mark.parametrize("refused", [0, 1])
def test_zero_torque_does_not_wait_for_an_update_that_hangs(hanging, end, allowed_s, refused):
    fake, actuator = hanging()
    fake.refused = refused
    since_s = time.perf_counter()
    end(actuator)
    took_s = time.perf_counter() - since_s
    assert fake.zero_after_s(since_s) < allowed_s
    assert took_s < 0.5
    assert actuator.stop_confirmed


@pytest.mark.alone
def test_a_stop_that_the_library_holds_up_is_reported_and_sent_as_soon_as_it_can(hanging, caplog):
    fake, actuator = hanging(locked=True)
    since_s = time.perf_counter()
    told = r"actuator: could not be stopped \(TimeoutError: it did not confirm its stop\)"
    with pytest.raises(DeviceError, match=told):
        _stop("actuator", actuator, {"actuator"}, None, None, None)
    assert time.perf_counter() - since_s < 0.2
    time.sleep(0.2)
    assert "emergency stop" in caplog.text
    threads = threading.active_count()
    time.sleep(0.1)
    assert threading.active_count() == threads  # attempts that hang do not pile up
    released_s = time.perf_counter()
    fake.released.set()
    assert fake.zero_after_s(released_s) < ZERO_S
    _stop("actuator", actuator, {"actuator"}, None, None, None)


def _raise():
    raise OSError("bus is gone")


@pytest.mark.alone
@pytest.mark.parametrize("hangs", [False, True], ids=["raises", "hangs"])
def test_zero_is_tried_until_the_library_takes_it_with_few_threads(hangs, monkeypatch):
    monkeypatch.setattr(output_module, "_ATTEMPT_S", 0.05)
    released, threads, attempts = threading.Event(), set(), []

    def write(torque_nm):
        if torque_nm == 0.0:
            threads.add(threading.current_thread())
            attempts.append(time.perf_counter())
            if len(attempts) < 7:
                released.wait(10.0) if hangs else _raise()

    output = output_module.TorqueOutput("knee", write, lambda: False)
    output.write(9.0)
    until_s = time.perf_counter() + 2.0
    while not output.is_zero and time.perf_counter() < until_s:
        output.look()
        time.sleep(output_module.LOOK_S)
    released.set()
    assert output.is_zero
    assert len(attempts) == 7
    assert len(threads) == (7 if hangs else 1)
    assert attempts[-1] - attempts[0] > 6 * 0.9 * (0.05 if hangs else output_module.LOOK_S)


@pytest.mark.alone
def test_a_torque_that_arrives_after_the_stop_is_taken_back(hanging):
    fake, actuator = hanging()
    fake.hang.clear()
    fake.released.set()
    write, late, go = fake.set_motor_current, threading.Event(), threading.Event()

    def slow(value):
        if value:
            late.set()
            go.wait(5.0)
        write(value)

    fake.set_motor_current = slow
    actuator.command_torque(9.0)
    assert late.wait(5.0)
    actuator.stop()
    assert not actuator.stop_confirmed  # the torque may still arrive after the zero
    go.set()
    assert fake.zero_after_s(time.perf_counter()) < ZERO_S
    time.sleep(0.01)
    assert actuator.stop_confirmed
    assert fake.heard[-1][1] == 0.0


# --- device.toml ---------------------------------------------------------------------------------

KEYS = {
    "driver": "opensourceleg",
    "device": "opensourceleg.actuators.dephy:DephyActuator",
    "arguments": {"gear_ratio": GEAR, "frequency": 500},
    "torque_model": MODEL.model_dump(),
    "limits": LIMITS.model_dump(),
    "sign": -1,
}
SENSOR_KEYS = {
    "driver": "opensourceleg",
    "device": "opensourceleg.sensors.encoder:AS5048B",
    "sample_rate_hz": 500.0,
}


@pytest.fixture
def package(monkeypatch):
    """Modules of opensourceleg with the fakes in them, and flexsea's manners."""
    actuators = types.ModuleType("opensourceleg.actuators.dephy")
    sensors = types.ModuleType("opensourceleg.sensors.encoder")

    class Rude(DephyActuator):
        def __init__(self, **arguments):
            sys.tracebacklimit = 0
            super().__init__(**arguments)

    actuators.DephyActuator, sensors.AS5048B = Rude, FakeSensor
    for name in ("opensourceleg", "opensourceleg.actuators", "opensourceleg.sensors"):
        monkeypatch.setitem(sys.modules, name, types.ModuleType(name))
    for module in (actuators, sensors):
        monkeypatch.setitem(sys.modules, module.__name__, module)
    return actuators


def test_an_actuator_is_made_from_a_device_file_and_tracebacks_stay(package):
    actuator = open_actuator(ActuatorKeys(**KEYS), clock=HeldClock())
    described = actuator.describe()
    assert described.sample_rate_hz == 500.0
    assert described.torque_model == MODEL
    assert described.limits == LIMITS
    assert not hasattr(sys, "tracebacklimit")


@pytest.mark.usefixtures("package")
def test_channels_that_name_the_same_sensor_share_it():
    clock = HeldClock()
    keys = {**SENSOR_KEYS, "attribute": "data", "arguments": {"tag": "adc"}}
    angle = open_sensor(SensorKeys(**keys, index=0), "angle", clock=clock)
    contact = open_sensor(SensorKeys(**keys, index=1, gain=1e-3), "contact", clock=clock)
    other = open_sensor(
        SensorKeys(**{**keys, "arguments": {"tag": "b"}}, index=0), "angle", clock=clock
    )
    assert angle._source is contact._source
    assert angle._source is not other._source
    told = [(s.describe().unit, s.describe().kind) for s in (angle, contact)]
    assert told == [("rad", ""), ("V", "voltage")]


def test_only_classes_of_opensourceleg_are_made():
    for kind in ("os:system", "opensourceleg.actuators.dephy", "opensourcelegs.a:B"):
        with pytest.raises(DeviceError, match="expected module and class"):
            made(kind, {})


@pytest.mark.usefixtures("package")
@pytest.mark.parametrize(
    ("kind", "arguments", "named"),
    [
        ("opensourceleg.actuators.dephy:Missing", {}, "Missing"),
        (KEYS["device"], {"colour": 1}, "colour"),
    ],
)
def test_a_class_that_cannot_be_made_is_named(kind, arguments, named):
    with pytest.raises(DeviceError, match=named):
        made(kind, arguments)


@pytest.mark.parametrize(
    ("lacks", "install"), [("opensourceleg", r"jointz\[osl\]"), ("can", "python-can")]
)
def test_a_missing_library_is_named_with_what_installs_it(monkeypatch, lacks, install):
    def lacking(_):
        raise ModuleNotFoundError(f"No module named {lacks!r}", name=lacks)

    monkeypatch.setattr(polling_module.importlib, "import_module", lacking)
    with pytest.raises(DeviceError, match=install):
        made(KEYS["device"], {})


# --- the real package ----------------------------------------------------------------------------


@needs_library
def test_the_fakes_have_what_the_library_has():
    actuators = importlib.import_module("opensourceleg.actuators.base")
    sensors = importlib.import_module("opensourceleg.sensors.base")
    base = actuators.ActuatorBase
    called = ("set_control_mode", "set_motor_current", "set_output_torque", "set_current_gains")
    for name in ("start", "stop", "update", *called):
        assert names_of(getattr(FakeActuator, name)) == names_of(getattr(base, name)), name
    read = ("tag", "gear_ratio", "frequency", "is_offline", "mode", "motor_current")
    for name in (*read, "output_position", "output_velocity", "winding_temperature"):
        assert isinstance(getattr(base, name), property), name
    for name in ("start", "stop", "update"):
        assert names_of(getattr(FakeSensor, name)) == names_of(getattr(sensors.SensorBase, name))
    for mode in Modes:
        assert actuators.CONTROL_MODES[mode.name].value == mode.value
    thermal = importlib.import_module("opensourceleg.math")
    assert issubclass(thermal.ThermalLimitException, Exception)
    assert issubclass(thermal.I2tLimitException, Exception)
