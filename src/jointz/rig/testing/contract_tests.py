"""Contract tests of drivers.

Subclass a contract in a test module of yours and say how a device is made::

    from jointz.rig.testing import ActuatorContract

    class TestMyActuator(ActuatorContract):
        def make(self, clock):
            return MyActuator("/dev/ttyACM0", clock=clock)

pytest does the rest. An actuator is commanded ``torque_nm`` for moments: mount it on a bench,
free to move. Every test closes its device, also when it fails.
"""

import json
import time
from abc import ABC, abstractmethod
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import partial
from itertools import pairwise
from math import isfinite
from typing import ClassVar, Generic, TypeVar
from unittest import SkipTest

from jointz.core.clock import Clock, RealClock
from jointz.core.errors import DeviceError, NotConnectedError
from jointz.rig.devices.interface import Actuator, ActuatorSample, Lifecycle, Sensor, SensorSample

DeviceT = TypeVar("DeviceT", Actuator, Sensor)
SampleT = TypeVar("SampleT", ActuatorSample, SensorSample)


def _expect(condition: bool, message: str) -> None:  # noqa: FBT001 - it is an assertion
    if not condition:
        raise AssertionError(message)


def _expect_raised(error: type[DeviceError], call: Callable[[], object], action: str) -> None:
    try:
        call()
    except error:
        return
    raise AssertionError(f"{action}: expected {error.__name__}, nothing was raised.")


class _DeviceContract(ABC, Generic[DeviceT]):
    """Tests that hold for every device."""

    watched_s: ClassVar[float] = 0.3  # s: how long samples are watched
    stop_s: ClassVar[float] = 0.1  # s: how long ``stop`` may take

    @abstractmethod
    def make(self, clock: Clock) -> DeviceT:
        """Return a new device, ``UNCONFIGURED``."""

    def make_clock(self) -> Clock:
        """Return the clock of a test: the machine's own unless this is overridden."""
        return RealClock()

    def disconnect(self, device: DeviceT) -> None:
        """Cut the device off; without it the tests of a lost device are skipped."""
        raise SkipTest(f"{type(self).__name__} does not say how {device!r} is cut off.")

    @contextmanager
    def made(self) -> Iterator[tuple[DeviceT, Clock]]:
        """Give a new device and its clock, and close the device afterwards."""
        clock = self.make_clock()
        device = self.make(clock)
        try:
            yield device, clock
        finally:
            device.close()

    @contextmanager
    def active(self) -> Iterator[tuple[DeviceT, Clock]]:
        """Give an ``ACTIVE`` device and its clock, and close the device afterwards."""
        with self.made() as (device, clock):
            device.configure()
            device.activate()
            yield device, clock

    def test_its_life_goes_from_unconfigured_to_finalised(self) -> None:
        """Every step leads to the state that the interface names."""
        with self.made() as (device, _):
            states = [device.state]
            for step in (device.configure, device.activate, device.stop, device.close):
                step()
                states.append(device.state)
        expected = [
            Lifecycle.UNCONFIGURED,
            Lifecycle.INACTIVE,
            Lifecycle.ACTIVE,
            Lifecycle.INACTIVE,
            Lifecycle.FINALISED,
        ]
        _expect(states == expected, f"states: expected {expected}, got {states}.")

    def test_it_can_be_activated_again_after_a_stop(self) -> None:
        """A stop is not the end."""
        with self.active() as (device, clock):
            device.stop()
            device.activate()
            _expect(device.state is Lifecycle.ACTIVE, f"expected active, got {device.state}.")
            _wait(clock, self.watched_s)
            _expect(bool(device.read()), "no samples after the second activation.")

    def test_steps_out_of_order_raise(self) -> None:
        """A device cannot be activated before it is configured, nor after it is closed."""
        with self.made() as (device, _):
            _expect_raised(DeviceError, device.activate, "activate while unconfigured")
            device.configure()
            device.activate()
            _expect_raised(DeviceError, device.activate, "activate while active")
            device.close()
            _expect_raised(DeviceError, device.activate, "activate while finalised")

    def test_it_describes_itself_the_same_in_any_state(self) -> None:
        """The description needs no connection and can be written as JSON."""
        with self.made() as (device, _):
            descriptions = [device.describe().to_dict()]
            for step in (device.configure, device.activate, device.stop, device.close):
                step()
                descriptions.append(device.describe().to_dict())
            rate_hz = device.describe().sample_rate_hz
        same = all(description == descriptions[0] for description in descriptions)
        _expect(same, f"the description changes: {descriptions}.")
        _expect(bool(json.dumps(descriptions[0])), "the description is empty.")
        _expect(rate_hz > 0.0, f"sample_rate_hz: expected more than 0, got {rate_hz}.")

    def test_it_is_read_only_while_active(self) -> None:
        """There is nothing to read before, between and after."""
        self._expect_only_while_active("read", lambda device: device.read())

    def test_stop_never_raises_and_never_blocks(self) -> None:
        """In any state, also twice."""
        with self.made() as (device, _):
            self._stop_twice(device, Lifecycle.UNCONFIGURED)
            device.configure()
            self._stop_twice(device, Lifecycle.INACTIVE)
            device.activate()
            self._stop_twice(device, Lifecycle.INACTIVE)
            device.close()
            self._stop_twice(device, Lifecycle.FINALISED)

    def test_it_may_be_closed_twice_and_in_any_state(self) -> None:
        """The end is the end."""
        with self.made() as (device, _):
            device.close()
            device.close()
            _expect(device.state is Lifecycle.FINALISED, f"expected finalised: {device.state}.")
        with self.active() as (device, _):
            device.close()
            _expect(device.state is Lifecycle.FINALISED, f"expected finalised: {device.state}.")

    def test_samples_come_once_in_order_and_at_the_stated_rate(self) -> None:
        """Device times rise strictly, host times do not lie in the future."""
        with self.active() as (device, clock):
            samples, elapsed_s = self._watch(device, clock)
            expected = elapsed_s * device.describe().sample_rate_hz
        times = [sample.device_time_ns for sample in samples]
        _expect(
            all(late > early for early, late in pairwise(times)),
            "device_time_ns: expected rising times, each once.",
        )
        _expect(
            abs(len(samples) - expected) <= 0.1 * expected + 2.0,
            f"expected about {expected:.0f} samples in {elapsed_s:.3f} s, got {len(samples)}.",
        )

    def test_a_device_that_is_gone_says_so_and_can_be_stopped(self) -> None:
        """Every call except ``stop`` and ``close`` raises."""
        with self.active() as (device, _):
            self.disconnect(device)
            _expect_raised(NotConnectedError, device.read, "read of a device that is gone")
            self._check_lost(device)
            device.stop()
            device.close()
            _expect(device.state is Lifecycle.FINALISED, f"expected finalised: {device.state}.")

    def _check_lost(self, device: DeviceT) -> None:
        """Check what else raises when a device is gone."""

    def _expect_only_while_active(self, name: str, call: Callable[[DeviceT], object]) -> None:
        with self.made() as (device, _):
            on_device = partial(call, device)
            _expect_raised(DeviceError, on_device, f"{name} while unconfigured")
            device.configure()
            _expect_raised(DeviceError, on_device, f"{name} while inactive")
            device.activate()
            call(device)
            device.stop()
            _expect_raised(DeviceError, on_device, f"{name} after a stop")
            device.close()
            _expect_raised(DeviceError, on_device, f"{name} while finalised")

    def _stop_twice(self, device: DeviceT, afterwards: Lifecycle) -> None:
        began = time.perf_counter()
        device.stop()
        device.stop()
        took_s = time.perf_counter() - began
        _expect(
            took_s <= 2.0 * self.stop_s, f"stop: expected {self.stop_s} s, took {took_s:.3f} s."
        )
        _expect(device.state is afterwards, f"expected {afterwards}, got {device.state}.")

    def _watch(
        self, device: DeviceT, clock: Clock
    ) -> tuple[list[ActuatorSample | SensorSample], float]:
        """Return what is read over a while and how long it was; check host times on the way."""
        device.read()
        began_ns = now_ns = clock.now_ns()
        watched: list[ActuatorSample | SensorSample] = []
        for _ in range(10):
            _wait(clock, self.watched_s / 10.0)
            samples = [*device.read(), *device.read()]
            now_ns = clock.now_ns()
            _expect(
                all(sample.host_time_ns <= now_ns for sample in samples),
                "host_time_ns: expected times of the clock that was handed in, got the future.",
            )
            watched += samples
        return watched, (now_ns - began_ns) * 1e-9


class ActuatorContract(_DeviceContract[Actuator]):
    """What holds for every actuator; subclass it and say how one is made.

    Attributes
    ----------
    torque_nm : float, N*m
        What is asked for in these tests.
    settle_s : float, s
        How long the current may take to follow.
    """

    torque_nm: ClassVar[float] = 2.0
    settle_s: ClassVar[float] = 0.15

    def test_it_is_an_actuator(self) -> None:
        """All methods of the interface are there."""
        with self.made() as (device, _):
            _expect(isinstance(device, Actuator), f"{type(device).__name__} is no Actuator.")

    def test_it_states_a_command_timeout(self) -> None:
        """A program that hangs must not leave torque on the joint."""
        with self.made() as (device, _):
            timeout_s = device.describe().command_timeout_s
        _expect(timeout_s > 0.0 and isfinite(timeout_s), f"command_timeout_s: got {timeout_s}.")

    def test_it_is_commanded_only_while_active(self) -> None:
        """Commands are refused before, between and after."""
        self._expect_only_while_active("command", lambda device: device.command_torque(0.0))

    def test_current_follows_the_command_in_sign_and_size(self) -> None:
        """Units and directions are right: within a half, friction and gains aside."""
        for torque_nm in (self.torque_nm, -self.torque_nm):
            with self.active() as (device, clock):
                share = self._hold(device, clock, torque_nm) / self._expected_a(device, torque_nm)
            _expect(
                0.5 < share < 1.5,
                f"current at {torque_nm} N*m: {share:.2f} of what the torque model says.",
            )

    def test_it_goes_to_zero_torque_without_commands(self) -> None:
        """After the command timeout that it states."""
        with self.active() as (device, clock):
            self._hold(device, clock, self.torque_nm)
            _wait(clock, device.describe().command_timeout_s + self.settle_s)
            self._expect_no_torque(device, "after the command timeout")

    def test_stop_takes_the_torque_away(self) -> None:
        """It is still away when the actuator is activated again."""
        with self.active() as (device, clock):
            self._hold(device, clock, self.torque_nm)
            device.stop()
            _wait(clock, min(self.settle_s, 0.5 * device.describe().command_timeout_s))
            device.activate()
            _wait(clock, 5.0 / device.describe().sample_rate_hz)
            self._expect_no_torque(device, "after a stop")

    def _check_lost(self, device: Actuator) -> None:
        _expect_raised(NotConnectedError, lambda: device.command_torque(0.0), "command, gone")

    def _hold(self, device: Actuator, clock: Clock, torque_nm: float) -> float:
        """Command a torque until the current has settled and return the current, A."""
        step_s = min(0.25 * device.describe().command_timeout_s, 0.01)
        samples: list[ActuatorSample] = []
        for _ in range(round(self.settle_s / step_s) + 1):
            device.command_torque(torque_nm)
            _wait(clock, step_s)
            samples += device.read()
        return self._newest(samples).current

    def _newest(self, samples: list[ActuatorSample]) -> ActuatorSample:
        _expect(bool(samples), "expected samples of the active actuator, got none.")
        return samples[-1]

    def _expected_a(self, device: Actuator, torque_nm: float) -> float:
        model = device.describe().torque_model
        return torque_nm / (model.gear_ratio * model.torque_constant)

    def _expect_no_torque(self, device: Actuator, when: str) -> None:
        current = self._newest(device.read()).current
        most = 0.25 * abs(self._expected_a(device, self.torque_nm))
        _expect(abs(current) < most, f"{when}: expected no current, got {current:.2f} A.")


class SensorContract(_DeviceContract[Sensor]):
    """Tests that hold for every sensor; a subclass says how one is made."""

    def test_it_is_a_sensor(self) -> None:
        """All methods of the interface are there."""
        with self.made() as (device, _):
            _expect(isinstance(device, Sensor), f"{type(device).__name__} is no Sensor.")

    def test_it_says_what_it_measures(self) -> None:
        """A channel and a unit; a contact also its kind."""
        with self.made() as (device, _):
            described = device.describe()
        _expect(bool(described.channel), "channel: expected a name, got nothing.")
        _expect(bool(described.unit), "unit: expected a unit, 1 for a contact.")
        if described.channel == "contact":
            kinds = ("contact", "voltage", "pulse")
            _expect(described.kind in kinds, f"kind: expected {kinds}, got {described.kind!r}.")


def _wait(clock: Clock, seconds: float) -> None:
    clock.wait_until_ns(clock.now_ns() + round(seconds * 1e9))
