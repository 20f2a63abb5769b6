"""Every device keeps the contract, and the contract notices one that does not."""

import dataclasses
import math
import unittest

import pytest

from jointz.core.clock import RealClock, VirtualClock
from jointz.core.errors import DeviceError, NotConnectedError
from jointz.core.protocols.protocol_models import LoadSpec
from jointz.core.study import Calibrated
from jointz.rig.devices.interface import Lifecycle
from jointz.rig.sim.benches.bench_rig import simulated_bench
from jointz.rig.sim.rig import simulated_rig
from jointz.rig.testing import (
    ActuatorContract,
    Deviation,
    ScriptedActuator,
    ScriptedSensor,
    SensorContract,
)
from jointz.rig.testing.scripted import SCRIPTED_ACTUATOR

MS = 1_000_000


class Virtual:
    def make_clock(self):
        return VirtualClock(12_345)


# --- every device there is -----------------------------------------------------------------------


class Scripted(Virtual):
    def disconnect(self, device):
        device.disconnect()


class TestScriptedActuator(Scripted, ActuatorContract):
    def make(self, clock):
        return ScriptedActuator(clock, angle=lambda t: 0.3 + 0.1 * math.sin(6.0 * t))


@pytest.mark.alone
class TestScriptedActuatorInRealTime(TestScriptedActuator):
    watched_s = 0.1
    settle_s = 0.05

    def make_clock(self):
        return RealClock()


class TestScriptedSensor(Scripted, SensorContract):
    def make(self, clock):
        return ScriptedSensor(clock, math.sin)


class _Simulated(Virtual):
    device = "actuator"

    def rig_and_condition(self):
        return simulated_rig(0, preset="nominal"), "perturbed"

    def make(self, clock):
        self.rig, condition = self.rig_and_condition()
        return getattr(self.rig.open(condition, worn=True, segment=0, clock=clock), self.device)

    def disconnect(self, device):  # noqa: ARG002
        self.rig.inject.order(self.device, "disconnect")


class TestSimulatedActuator(_Simulated, ActuatorContract):
    pass


class TestSimulatedGoniometer(_Simulated, SensorContract):
    device = "angle"


class TestSimulatedFootswitch(_Simulated, SensorContract):
    device = "contact"


class TestSimulatedInverseDynamics(_Simulated, SensorContract):
    device = "torque"


class _OnABench(_Simulated):
    bench = "series-elastic"

    def rig_and_condition(self):
        load = LoadSpec(name="springs", stiffness=Calibrated(value=146.39, sd=0.0))
        return simulated_bench(self.bench, load, sample_rate_hz=500.0), "trial"


class TestSeriesElasticActuator(_OnABench, ActuatorContract):
    pass


class TestSeriesElasticBeam(_OnABench, SensorContract):
    device = "torque"


class TestQuasiDirectDrive(_OnABench, ActuatorContract):
    bench = "quasi-direct-drive"


class TestTorqueSensor(_OnABench, SensorContract):
    bench = "quasi-direct-drive"
    device = "torque"


# --- the contract notices ------------------------------------------------------------------------


class Forgiving(ScriptedActuator):
    def _require(self, states):
        pass


class RaisesInStop(ScriptedActuator):
    def stop(self):
        raise OSError("port is closed")

    def close(self):
        self._state = Lifecycle.FINALISED


class BlocksInStop(ScriptedActuator):
    def stop(self):
        RealClock().wait_until_ns(RealClock.now_ns() + 250 * MS)
        super().stop()


class KeepsItsTorque(ScriptedActuator):
    def _let_go(self):
        pass


class NeverTimesOut(ScriptedActuator):
    def _torque_before(self, time_ns):  # noqa: ARG002
        return self._torques[-1][1] if self._torques else 0.0


class Milliamperes(ScriptedActuator):
    def _measured(self, *args, **kwargs):
        sample = super()._measured(*args, **kwargs)
        return sample._replace(current=1e3 * sample.current)


class OtherDirection(ScriptedActuator):
    def _measured(self, *args, **kwargs):
        sample = super()._measured(*args, **kwargs)
        return sample._replace(current=-sample.current)


class Repeats(ScriptedActuator):
    def read(self):
        samples = super().read()
        self._next = max(self._next - 1, 0)
        return samples


class DropsHalf(ScriptedActuator):
    def read(self):
        return super().read()[::2]


class AheadOfTime(ScriptedActuator):
    def read(self):
        return [s._replace(host_time_ns=s.host_time_ns + MS) for s in super().read()]


class DiesOnce(ScriptedActuator):
    def stop(self):
        super().stop()
        self._state = Lifecycle.FINALISED


class SaysNothing(ScriptedActuator):
    def read(self):
        super().read()
        return []


class QuietWhenGone(ScriptedActuator):
    def disconnect(self):
        pass


class Changes(ScriptedActuator):
    def describe(self):
        return SCRIPTED_ACTUATOR if self._first is None else self._other()

    def _other(self):
        return dataclasses.replace(SCRIPTED_ACTUATOR, serial="1")


def broken(driver, contract=TestScriptedActuator):
    class Broken(contract):
        def make(self, clock):
            return driver(clock)

    return Broken()


@pytest.mark.parametrize(
    ("driver", "test", "told"),
    [
        (Forgiving, "steps_out_of_order_raise", "nothing was raised"),
        (Forgiving, "it_is_commanded_only_while_active", "nothing was raised"),
        (BlocksInStop, "stop_never_raises_and_never_blocks", "took"),
        (KeepsItsTorque, "stop_takes_the_torque_away", "after a stop"),
        (NeverTimesOut, "it_goes_to_zero_torque_without_commands", "command timeout"),
        (Milliamperes, "current_follows_the_command_in_sign_and_size", "torque model"),
        (SaysNothing, "current_follows_the_command_in_sign_and_size", "got none"),
        (SaysNothing, "it_can_be_activated_again_after_a_stop", "second activation"),
        (OtherDirection, "current_follows_the_command_in_sign_and_size", "-1.00 of"),
        (Repeats, "samples_come_once_in_order_and_at_the_stated_rate", "each once"),
        (DropsHalf, "samples_come_once_in_order_and_at_the_stated_rate", "expected about 150"),
        (AheadOfTime, "samples_come_once_in_order_and_at_the_stated_rate", "the future"),
        (DiesOnce, "its_life_goes_from_unconfigured_to_finalised", "states"),
        (QuietWhenGone, "a_device_that_is_gone_says_so_and_can_be_stopped", "NotConnectedError"),
        (Changes, "it_describes_itself_the_same_in_any_state", "changes"),
    ],
)
def test_the_contract_notices_a_driver_that_breaks_it(driver, test, told):
    with pytest.raises(AssertionError, match=told):
        getattr(broken(driver), f"test_{test}")()


def test_an_error_in_stop_is_not_swallowed():
    with pytest.raises(OSError, match="port is closed"):
        broken(RaisesInStop).test_stop_never_raises_and_never_blocks()


@pytest.mark.parametrize(
    ("contract", "test", "told"),
    [
        (TestScriptedActuator, "it_is_an_actuator", "is no Actuator"),
        (TestScriptedSensor, "it_is_a_sensor", "is no Sensor"),
    ],
)
def test_the_contract_notices_a_class_that_is_no_device(contract, test, told):
    class NoDevice:
        def __init__(self, clock):
            self.clock = clock

        def close(self):
            pass

    with pytest.raises(AssertionError, match=told):
        getattr(broken(NoDevice, contract), f"test_{test}")()


def test_a_driver_that_cannot_be_cut_off_skips_that_test():
    class Plain(Virtual, ActuatorContract):
        def make(self, clock):
            return ScriptedActuator(clock)

    with pytest.raises(unittest.SkipTest, match="Plain"):
        Plain().test_a_device_that_is_gone_says_so_and_can_be_stopped()


def test_a_device_is_closed_when_its_test_fails():
    made = []

    def make(clock):
        made.append(Milliamperes(clock))
        return made[-1]

    with pytest.raises(AssertionError):
        broken(make).test_current_follows_the_command_in_sign_and_size()
    assert [device.state for device in made] == [Lifecycle.FINALISED]


# --- scripted devices do what they are told ------------------------------------------------------


@pytest.fixture
def clock():
    return VirtualClock()


def started(device):
    device.configure()
    device.activate()
    return device


def read_ms(device, clock, until_ms):
    clock.wait_until_ns(until_ms * MS)
    return device.read()


@pytest.mark.parametrize(
    ("deviation", "expected"),
    [
        (Deviation("freeze", 2, 3), [(0, 0), (2, 2), (4, 2), (6, 2), (8, 8)]),
        (Deviation("silence", 1, 3), [(0, 0), (8, 8)]),
        (
            Deviation("replace", 2, values={"device_time_ns": 0}),
            [(0, 0), (2, 2), (0, 4), (0, 6), (0, 8)],
        ),
        (
            Deviation("replace", 1, 1, values={"value": 7e-3}),
            [(0, 0), (2, 7), (4, 4), (6, 6), (8, 8)],
        ),
    ],
)
def test_samples_deviate_as_the_script_says(clock, deviation, expected):
    device = started(ScriptedSensor(clock, lambda t: t, script=[deviation]))
    samples = read_ms(device, clock, 8)
    found = [(s.device_time_ns // MS, 1e3 * s.value) for s in samples]
    assert found == [pytest.approx(pair) for pair in expected]


@pytest.mark.parametrize(
    "kind", [ScriptedActuator, lambda clock, **k: ScriptedSensor(clock, math.sin, **k)]
)
def test_a_device_disconnects_at_its_sample(clock, kind):
    device = started(kind(clock, script=[Deviation("disconnect", 2)]))
    assert len(read_ms(device, clock, 3)) == 2
    with pytest.raises(NotConnectedError):
        read_ms(device, clock, 4)
    device.stop()
    with pytest.raises(NotConnectedError):
        device.activate()
    device.close()
    assert device.state is Lifecycle.FINALISED


def test_fault_bits_put_the_actuator_in_fault_without_torque(clock):
    device = started(
        ScriptedActuator(clock, script=[Deviation("replace", 2, values={"faults": 2})])
    )
    device.command_torque(9.0)
    assert [s.faults for s in read_ms(device, clock, 4)] == [0, 0, 2]
    assert device.state is Lifecycle.FAULT
    assert device.torque_nm == 0.0
    with pytest.raises(DeviceError, match="it is fault"):
        device.command_torque(1.0)
    assert [s.current for s in read_ms(device, clock, 8)] == [0.0, 0.0]
    device.stop()
    assert device.state is Lifecycle.FAULT


def test_commands_are_kept_and_shown_as_current_until_the_timeout(clock):
    device = started(ScriptedActuator(clock))
    device.read()
    device.command_torque(9.0)
    clock.wait_until_ns(1 * MS)
    device.command_torque(-4.5)
    assert device.torque_nm == -4.5
    assert [s.current for s in read_ms(device, clock, 4)] == [-5.0, -5.0]
    late = read_ms(device, clock, 200)
    assert [s.device_time_ns // MS for s in late if s.current][-1] == 100
    assert device.torque_nm == 0.0
    device.command_torque(9.0)
    device.stop()
    assert device.torque_nm == 0.0
    assert device.commands == [(0, 9.0), (MS, -4.5), (200 * MS, 9.0)]


@pytest.mark.parametrize("torque", [math.nan, math.inf])
def test_a_torque_that_is_no_number_is_refused(clock, torque):
    device = started(ScriptedActuator(clock))
    with pytest.raises(DeviceError, match="expected a finite torque"):
        device.command_torque(torque)
    assert device.commands == []
