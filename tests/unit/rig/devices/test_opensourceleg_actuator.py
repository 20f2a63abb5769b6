"""Our actuators as opensourceleg's, with the real package where it is installed."""

import importlib
import math
import signal

import pytest

from jointz.core.clock import RealClock, VirtualClock
from jointz.core.errors import DeviceError, NotConnectedError
from jointz.rig.devices import opensourceleg_actuator
from jointz.rig.devices.interface import Lifecycle
from jointz.rig.devices.opensourceleg import OpenSourceLegActuator
from jointz.rig.devices.opensourceleg_actuator import as_opensourceleg
from jointz.rig.devices.opensourceleg_setup import ActuatorSetup
from jointz.rig.session.rigs.opensourceleg_rig import simulated_opensourceleg_actuator
from jointz.rig.testing import ActuatorContract, Deviation, ScriptedActuator
from jointz.rig.testing.scripted import SCRIPTED_ACTUATOR

from .fakes import HeldClock, needs, wait

needs_library = needs("opensourceleg")
MODEL, LIMITS = SCRIPTED_ACTUATOR.torque_model, SCRIPTED_ACTUATOR.limits
GEAR, CONSTANT = MODEL.gear_ratio, MODEL.torque_constant


@pytest.fixture(autouse=True)
def workplace(tmp_path, monkeypatch):
    """opensourceleg writes a log into the working directory, and its loop takes the signals."""
    monkeypatch.chdir(tmp_path)
    taken = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)
    before = {number: signal.getsignal(number) for number in taken}
    yield
    for number, handler in before.items():
        signal.signal(number, handler)


@pytest.fixture
def modes():
    return importlib.import_module("opensourceleg.actuators.base").CONTROL_MODES


@pytest.fixture
def clock():
    return VirtualClock(7_000_000_000)


def scripted(clock, **other):
    return ScriptedActuator(clock, angle=lambda t: 0.3 + 0.5 * t, **other)


def test_without_the_library_the_command_that_installs_it_is_named(monkeypatch, clock):
    def importing(module):
        raise ModuleNotFoundError(f"No module named {module!r}", name="opensourceleg")

    monkeypatch.setattr(opensourceleg_actuator.importlib, "import_module", importing)
    opensourceleg_actuator._class.cache_clear()
    with pytest.raises(DeviceError, match=r'pip install "jointz\[osl\]"'):
        as_opensourceleg(scripted(clock), clock=clock)


# --- there and back again: the contract through the real package ---------------------------------


class _ThereAndBack:
    def make_clock(self):
        self.clock = HeldClock()
        return self.clock

    def adapted(self, ours, clock):
        self.ours = ours
        theirs = as_opensourceleg(ours, clock=clock)
        told = ours.describe()
        setup = ActuatorSetup(torque_model=told.torque_model, limits=told.limits)
        return OpenSourceLegActuator(theirs, setup, clock=clock, polling=clock.polling)


@needs_library
class TestThereAndBackAgain(_ThereAndBack, ActuatorContract):
    def make(self, clock):
        return self.adapted(scripted(clock), clock)

    def disconnect(self, device):  # noqa: ARG002
        self.ours.disconnect()
        wait(self.clock, 0.004)

    def test_nothing_is_turned_or_scaled_on_the_way(self):
        with self.active() as (device, clock):
            device.command_torque(1.8)
            wait(clock, 0.008)
            sample = device.read()[-1]
        direct = scripted(VirtualClock())._measured(0, 0, time_s=0.0)
        assert sample.velocity == pytest.approx(direct.velocity)
        assert 0.3 < sample.angle < 0.32
        assert sample.current == pytest.approx(1.8 / (GEAR * CONSTANT))
        assert (sample.voltage, sample.temperature_c) == pytest.approx((48.0, 30.0))


# --- units and what holds ------------------------------------------------------------------------


@needs_library
def test_it_is_an_actuator_of_opensourceleg_with_its_units(clock, modes):
    base = importlib.import_module("opensourceleg.actuators.base")
    ours = scripted(clock)
    with as_opensourceleg(ours, clock=clock) as actuator:
        assert isinstance(actuator, base.ActuatorBase)
        actuator.set_control_mode(mode=modes.CURRENT)
        actuator.set_motor_current(value=2000)
        wait(clock, 0.002)
        actuator.update()
        assert ours.commands[-1][1] == pytest.approx(2.0 * GEAR * CONSTANT)
        assert actuator.motor_current == pytest.approx(2000.0)
        assert actuator.motor_torque == pytest.approx(0.2)
        assert actuator.output_torque == pytest.approx(1.8)
        assert actuator.output_position == pytest.approx(0.301)
        assert actuator.motor_position == pytest.approx(0.301 * GEAR)
        assert actuator.output_velocity == pytest.approx(0.5)
        assert actuator.motor_velocity == pytest.approx(0.5 * GEAR)
        assert actuator.battery_voltage == pytest.approx(48_000.0)
        assert actuator.case_temperature == actuator.winding_temperature == 30.0
        assert (actuator.gear_ratio, actuator.frequency) == (GEAR, 500)
        assert actuator.MOTOR_CONSTANTS.NM_PER_AMP == CONSTANT
        assert actuator.tag == ours.describe().name


@needs_library
@pytest.mark.parametrize(
    ("method", "value", "torque_nm"),
    [
        ("set_motor_current", 1e9, LIMITS.torque_nm),
        ("set_output_torque", -3.0, -3.0),
        ("set_motor_torque", 0.5, 0.5 * GEAR),
        ("set_output_torque", 1e6, LIMITS.torque_nm),
        ("set_motor_torque", -1e6, -LIMITS.torque_nm),
    ],
)
def test_torques_reach_the_joint_within_the_limits(clock, modes, method, value, torque_nm):
    ours = scripted(clock)
    with as_opensourceleg(ours, clock=clock) as actuator:
        actuator.set_control_mode(modes.CURRENT if "current" in method else modes.TORQUE)
        getattr(actuator, method)(value=value)
        assert ours.commands[-1][1] == pytest.approx(torque_nm)
        with pytest.raises(DeviceError, match="finite torque"):
            getattr(actuator, method)(value=math.nan)


@needs_library
def test_a_torque_holds_while_the_script_updates_and_not_when_it_hangs(clock, modes):
    ours = scripted(clock)
    with as_opensourceleg(ours, clock=clock) as actuator:
        actuator.set_control_mode(modes.CURRENT)
        actuator.set_output_torque(4.0)
        for _ in range(200):
            wait(clock, 0.002)
            actuator.update()
        assert ours.torque_nm == 4.0
        wait(clock, ours.describe().command_timeout_s + 0.001)
        assert ours.torque_nm == 0.0


@needs_library
def test_torque_ends_with_the_mode_with_the_block_and_with_an_exception(clock, modes):
    ours = scripted(clock)
    actuator = as_opensourceleg(ours, clock=clock)
    with actuator:
        actuator.set_control_mode(modes.CURRENT)
        actuator.set_output_torque(4.0)
        actuator.set_control_mode(modes.TORQUE)
        assert ours.torque_nm == 0.0
        actuator.set_output_torque(4.0)
    assert ours.torque_nm == 0.0
    assert ours.state is Lifecycle.INACTIVE

    def script():
        with actuator:  # it can be started again
            actuator.set_control_mode(modes.CURRENT)
            actuator.set_output_torque(4.0)
            raise ZeroDivisionError

    with pytest.raises(ZeroDivisionError):
        script()
    assert ours.torque_nm == 0.0
    assert ours.state is Lifecycle.INACTIVE
    assert actuator.mode is modes.IDLE


# --- what cannot be done -------------------------------------------------------------------------


@needs_library
def test_modes_that_it_has_not_are_refused_and_the_mode_stays(clock, modes):
    with as_opensourceleg(scripted(clock), clock=clock) as actuator:
        actuator.set_control_mode(modes.CURRENT)
        for mode in (modes.POSITION, modes.VOLTAGE, modes.VELOCITY, modes.IMPEDANCE):
            with pytest.raises(DeviceError, match=mode.name):
                actuator.set_control_mode(mode)
            assert actuator.mode is modes.CURRENT


@needs_library
def test_commands_in_the_wrong_mode_and_those_it_never_takes_raise(clock):
    told = importlib.import_module("opensourceleg.logging.exceptions")
    ours = scripted(clock)
    with as_opensourceleg(ours, clock=clock) as actuator:
        for command in (actuator.set_motor_current, actuator.set_output_torque):
            with pytest.raises(told.ControlModeException):
                command(1.0)
        with pytest.raises(DeviceError, match="voltage"):
            actuator.set_motor_voltage(1000)
        for method, given, told in (
            ("set_output_position", {"value": 0.1}, "a motor position"),
            ("set_motor_velocity", {"value": 1.0}, "a motor velocity"),
            ("set_output_impedance", {"k": 100.0, "b": 3.0}, "an impedance"),
            ("set_position_gains", {"kp": 5}, "position gains"),
        ):
            with pytest.raises(DeviceError, match=f"cannot take {told}"):
                getattr(actuator, method)(**given)
        with pytest.raises(NotImplementedError, match="battery_voltage"):
            _ = actuator.motor_voltage
    assert {torque_nm for _, torque_nm in ours.commands} == {0.0}


@needs_library
def test_homing_moves_nothing(clock):
    ours = scripted(clock)
    with as_opensourceleg(ours, clock=clock) as actuator:
        before = actuator.output_position
        actuator.home(output_position_offset=0.1)
        assert actuator.is_homed
        assert actuator.output_position == pytest.approx(before - 0.1)
    assert {torque_nm for _, torque_nm in ours.commands} == {0.0}


# --- what goes wrong -----------------------------------------------------------------------------


@needs_library
def test_a_fault_ends_the_script_with_its_name_at_zero_torque(clock, modes):
    ours = scripted(clock, script=[Deviation("replace", 3, values={"faults": 2})])

    def script():
        with as_opensourceleg(ours, clock=clock) as actuator:
            actuator.set_control_mode(modes.CURRENT)
            actuator.set_output_torque(4.0)
            for _ in range(5):
                wait(clock, 0.002)
                actuator.update()

    with pytest.raises(DeviceError, match="in fault: over-current"):
        script()
    assert ours.torque_nm == 0.0


@needs_library
def test_without_a_first_sample_it_does_not_start(clock):
    ours = scripted(clock, script=[Deviation("silence", 0)])
    with pytest.raises(NotConnectedError, match="no sample came"):
        as_opensourceleg(ours, clock=clock).start()
    assert ours.state is Lifecycle.INACTIVE


@needs_library
def test_a_lost_device_is_told_and_the_block_can_still_be_left(clock):
    ours = scripted(clock)

    def script():
        with as_opensourceleg(ours, clock=clock) as actuator:
            ours.disconnect()
            actuator.update()

    with pytest.raises(NotConnectedError):
        script()
    assert ours.state is Lifecycle.INACTIVE


# --- a script, in real time, on the simulated exoskeleton ----------------------------------------


@needs_library
def test_a_step_of_current_runs_on_the_simulated_exoskeleton(modes):
    clock = RealClock()
    with simulated_opensourceleg_actuator(preset="clean", seed=3) as actpack:
        actpack.set_control_mode(mode=modes.CURRENT)
        actpack.set_motor_current(value=600)
        for _ in range(50):
            wait(clock, 0.004)
            actpack.update()
        assert actpack.motor_current == pytest.approx(600.0, abs=60.0)  # mA
