"""Actuators and sensors of opensourceleg 3.5 as devices of an experiment.

Install the library with ``pip install "jointz[osl]"``; it wants numpy below 2. What holds here
was read off its code and tested against the real package, whose DephyActuator,
TMotorServoActuator, AS5048B and ADS131M0x ran on fakes of their buses. **None of it was ever
tried on hardware.**

What to know before torque comes near a person:

- opensourceleg offers no command timeout and no heartbeat. The timeout that is described is
  kept by threads of this program: they cover a loop that hangs and an ``update`` that hangs, not
  a process that is killed, a computer that freezes, or a library that hangs while it keeps its
  port or Python's interpreter lock. An emergency stop must cut the supply.
- It tells no time of the device. Samples carry the host's time after ``update`` returned, and
  where a frozen device cannot be told from one that stands still its samples look fresh.
- Its classes do not agree: DephyActuator counts in mA and mV, TMotorServoActuator in A, and
  MoteusActuator cannot be used here (its calls are coroutines). ``PROFILES`` of
  :mod:`jointz.rig.devices.opensourceleg_setup` knows them.
- Its torque constants are not used. Current is commanded with the calibrated torque model.
- Its software thermal limit ends an actuator with a fault; its derating is left to the limits.
"""

import json
import logging
import threading
import time
from collections import deque
from collections.abc import Callable, Mapping
from contextlib import suppress
from typing import Any
from weakref import WeakValueDictionary

from jointz.core.clock import Clock
from jointz.core.errors import DeviceError
from jointz.rig.devices.driver_base import (
    ACTIVE,
    FAULT,
    INACTIVE,
    UNCONFIGURED,
    DriverBase,
    drained,
    refuse_infinite,
)
from jointz.rig.devices.drivers import Driver
from jointz.rig.devices.interface import Actuator, ActuatorDescription, ActuatorSample, Lifecycle
from jointz.rig.devices.opensourceleg_polling import (
    NEVER_TRIED,
    QUEUE_LENGTH,
    PolledDevice,
    PollingOf,
    PollingThread,
    made,
)
from jointz.rig.devices.opensourceleg_sensors import OpenSourceLegSensor, OpenSourceLegSource
from jointz.rig.devices.opensourceleg_setup import (
    ActuatorKeys,
    ActuatorSetup,
    SensorKeys,
    check_port,
    check_usable,
    profile_of,
)
from jointz.rig.devices.repeating import Repeat, Repeating, RepeatingThread

NO_HEARTBEAT = "not read; no heartbeat: only this program keeps the command timeout"
#: Exceptions of opensourceleg's ``update`` that are faults of a device which still answers.
FAULTS: Mapping[str, int] = {"ThermalLimitException": 1, "I2tLimitException": 2}
_DRIVER_ERROR, _HANG = 4, 8
_FAULT_NAMES = {
    1: "software thermal limit",
    2: "I2t limit",
    _DRIVER_ERROR: "error of the motor driver",
    _HANG: "a call of opensourceleg hung for longer than the command timeout",
}
_log = logging.getLogger(__name__)
#: One sensor for all channels that name it, for as long as one of them is there.
_sources: WeakValueDictionary[str, OpenSourceLegSource] = WeakValueDictionary()


class OpenSourceLegActuator(DriverBase):
    """An actuator of opensourceleg (a subclass of its ``ActuatorBase``) as ours.

    A thread updates it and writes the commands; reading and commanding never wait for it. A zero
    that it is late with is written by a watchdog. It was never tried on hardware, and has no
    heartbeat: see the module.
    """

    def __init__(
        self,
        actuator: Any,
        setup: ActuatorSetup,
        *,
        clock: Clock,
        polling: PollingOf = PollingThread,
        repeat: Repeat = RepeatingThread,
    ) -> None:
        super().__init__(str(actuator.tag))
        self._profile = setup.profile or profile_of(actuator)
        check_usable(actuator, setup)
        self._device = PolledDevice(
            actuator,
            name=self._name,
            sample_rate_hz=float(actuator.frequency),
            clock=clock,
            polling=polling,
        )
        model = setup.torque_model
        self._setup, self._sign = setup, setup.sign
        self._constant = model.gear_ratio * model.torque_constant
        self._timeout_ns = round(setup.command_timeout_s * 1e9)
        self._late_ns = max(self._timeout_ns, round(2e9 / self._device.sample_rate_hz))
        self._queue: deque[ActuatorSample] = deque(maxlen=QUEUE_LENGTH)
        self._wanted = (0.0, 0)  # torque (N*m) and when it was asked for (ns), in one write
        self._polled_ns = 0
        self._output = TorqueOutput(self._name, self._write, self._may_be_on)
        self._repeat = repeat
        self._watchdog: Repeating | None = None
        self._faults = 0
        self._seen: object = None

    @property
    def state(self) -> Lifecycle:
        """State of the device in its lifecycle."""
        faulty = self._faults and self._state in (ACTIVE, INACTIVE)
        return FAULT if faulty else self._state

    @property
    def stop_confirmed(self) -> bool:
        """True if the library took a zero after the last torque."""
        return self._output.is_zero

    def describe(self) -> ActuatorDescription:
        """Return the description of the actuator; it says that nobody tried it on hardware."""
        return ActuatorDescription(
            name=self._name,
            model=f"opensourceleg {type(self._device.library).__name__}; {NEVER_TRIED}",
            serial="not read",
            firmware=NO_HEARTBEAT,
            sample_rate_hz=self._device.sample_rate_hz,
            command_timeout_s=self._setup.command_timeout_s,
            limits=self._setup.limits,
            torque_model=self._setup.torque_model,
            fault_names=dict(_FAULT_NAMES),
        )

    def configure(self) -> None:
        """Start the library's actuator, in its current or torque mode, at zero torque."""
        self._require(UNCONFIGURED)
        check_port(self._device.library, self._name)
        _log.warning("%s: firmware %s.", self._name, NO_HEARTBEAT)
        self._device.begin(self._enter_mode, self._poll)
        self._watchdog = self._repeat(self._output.look, LOOK_S)
        self._state = INACTIVE

    def activate(self) -> None:
        """Begin to queue samples and to obey; afterwards ``ACTIVE``, also after a hang."""
        self._require(INACTIVE)
        self._faults &= ~_HANG
        self._check_sound()
        self._wanted = (0.0, 0)
        self._queue.clear()
        self._state = ACTIVE

    def read(self) -> list[ActuatorSample]:
        """Return all samples queued since the last read, oldest first."""
        if self.state is not FAULT:
            self._require(ACTIVE)
        self._device.check()
        return drained(self._queue)

    def command_torque(self, torque_nm: float) -> None:
        """Command a torque on the joint until the next command or the command timeout."""
        self._require(ACTIVE)
        self._check_sound()
        refuse_infinite(self._name, torque_nm)
        self._wanted = (torque_nm, self._device.clock.now_ns())
        self._device.wake()

    def stop(self) -> None:
        """Go to zero torque and ``INACTIVE``; ``stop_confirmed`` tells whether zero was taken.

        It takes up to 40 ms if the library hangs.
        """
        super().stop()
        self._wanted = (0.0, 0)
        self._device.wake()
        self._output.settle()

    def _release(self) -> None:
        """End the thread and release the actuator."""
        is_let_go = self._device.end(lambda: self._output.write(0.0))
        if self._watchdog is not None and (is_let_go or self.stop_confirmed):
            self._watchdog.cancel()  # else it goes on sending zero

    def _check_sound(self) -> None:
        self._device.check()
        if self._faults:
            raise DeviceError(
                self._name,
                f"is in fault: {_names_of(self._faults)}. Let it cool down, or check its cable.",
            )

    def _enter_mode(self) -> None:
        library, profile = self._device.library, self._profile
        modes = type(library.mode)
        library.set_control_mode(modes.CURRENT if profile.command == "current" else modes.TORQUE)
        if profile.gains is not None:
            library.set_current_gains(**profile.gains)
        self._output.write(0.0)
        self._is_new()  # marks a measurement of before this session as old
        self._polled_ns = self._device.clock.now_ns()

    def _target_nm(self) -> float:
        """Return the torque that holds now, N*m; a polling thread that is late is a fault."""
        now_ns, (torque_nm, asked_ns) = self._device.clock.now_ns(), self._wanted
        if torque_nm and self._state is ACTIVE and now_ns - self._polled_ns > self._late_ns:
            self._faults |= _HANG
        in_time = now_ns - asked_ns <= self._timeout_ns
        return torque_nm if in_time and self.state is ACTIVE else 0.0

    def _may_be_on(self) -> bool:
        """Return whether a torque is commanded that the polling thread can still take back."""
        return self._device.failure is None and self._target_nm() != 0.0

    def _poll(self, due: bool) -> None:  # noqa: FBT001 - a Poll
        target_nm = self._target_nm()  # first: it looks at when the last poll began
        self._polled_ns = self._device.clock.now_ns()
        try:
            self._output.write(target_nm)
            if target_nm and not self._target_nm():  # no longer, after a write that took long
                self._output.write(0.0)
            if due:
                self._update()
        except Exception:
            with suppress(Exception):  # it may still take a command
                self._output.write(0.0)
            raise

    def _update(self) -> None:
        fault = 0
        try:
            self._device.library.update()
        except Exception as exc:
            fault = FAULTS.get(type(exc).__name__, 0)
            if not fault:
                raise
        if getattr(self._device.library, "error_info", None):  # TMotor: what its driver reports
            fault = _DRIVER_ERROR
        if fault:
            is_known, self._faults = fault & self._faults, fault | self._faults
            self._output.write(0.0)  # before the log, which may take its time
            if not is_known:
                _log.error("%s: in fault (%s), at zero torque.", self._name, _names_of(fault))
        if (self._is_new() or fault) and self._state is ACTIVE:
            self._queue.append(self._sample())

    def _write(self, torque_nm: float) -> None:
        """Command a torque within the limits: the last line of defence."""
        limits, library = self._setup.limits, self._device.library
        most = min(limits.torque_nm, limits.current_a * abs(self._constant))
        torque_nm = self._sign * min(max(torque_nm, -most), most)
        if self._profile.command == "torque":
            library.set_output_torque(torque_nm)
        else:
            library.set_motor_current(torque_nm / self._constant / self._profile.ampere)

    def _is_new(self) -> bool:
        """Return whether the measurement is new, as far as the library shows it."""
        library, before = self._device.library, self._seen
        message = getattr(library, "_motor_state_async", None)  # TMotor: one object a message
        if message is not None:
            self._seen = message
            return message is not before
        self._seen = getattr(library, "_data", None)  # Dephy: a mapping with the device's time
        return not isinstance(self._seen, Mapping | tuple) or self._seen != before

    def _sample(self) -> ActuatorSample:
        library, profile, sign = self._device.library, self._profile, self._sign
        now_ns = self._device.clock.now_ns()
        supply = float(getattr(library, profile.supply)) if profile.supply else float("nan")
        return ActuatorSample(
            device_time_ns=now_ns,
            host_time_ns=now_ns,
            angle=sign * float(library.output_position) + self._setup.angle_offset_rad,
            velocity=sign * float(library.output_velocity),
            current=sign * float(library.motor_current) * profile.ampere,
            voltage=supply * profile.volt,
            temperature_c=float(library.winding_temperature),
            faults=self._faults,
        )


def _names_of(faults: int) -> str:
    return ", ".join(name for bit, name in _FAULT_NAMES.items() if bit & faults)


def open_actuator(
    keys: ActuatorKeys, *, clock: Clock, before: Actuator | None = None
) -> OpenSourceLegActuator:
    """Return the actuator of a ``device.toml``, ``UNCONFIGURED``."""
    del before
    return OpenSourceLegActuator(made(keys.device, keys.arguments), keys, clock=clock)


def open_sensor(keys: SensorKeys, channel: str, *, clock: Clock) -> OpenSourceLegSensor:
    """Return a sensor of a ``device.toml``, ``UNCONFIGURED``."""
    shared = json.dumps(
        [keys.device, keys.arguments, keys.sample_rate_hz, id(clock)], sort_keys=True, default=str
    )
    source = _sources.get(shared)
    if source is None:
        source = OpenSourceLegSource(
            made(keys.device, keys.arguments), clock=clock, sample_rate_hz=keys.sample_rate_hz
        )
        _sources[shared] = source
    return OpenSourceLegSensor(source, keys.reading(channel))


ACTUATOR_DRIVER = Driver(ActuatorKeys, open_actuator, package="opensourceleg")
SENSOR_DRIVER = Driver(SensorKeys, open_sensor, package="opensourceleg")


#: How often the watchdog looks, s.
LOOK_S = 0.005
#: How long the polling thread may be late with a zero before another thread writes it, s.
_LATE_S = 0.02
#: A zero that is not confirmed after so many looks is reported.
_REPORT_LOOKS = 10
#: How long a thread goes on writing zero before another one replaces it, s: it may hang.
_ATTEMPT_S = 1.0


class TorqueOutput:
    """Writes torques, and knows whether the last of them was a zero that the library took.

    Only the polling thread writes other torques than zero.
    """

    def __init__(
        self, name: str, write: Callable[[float], None], may_be_on: Callable[[], bool]
    ) -> None:
        self._name, self._write, self._may_be_on = name, write, may_be_on
        self._begun = self._ended = self._zeroed = 0  # writes other than zero; the last undone
        self._late_looks = 0
        self._attempt = threading.Thread()
        self._attempted_s = 0.0

    @property
    def is_zero(self) -> bool:
        """True if the library took a zero after the last other torque."""
        return self._zeroed == self._begun

    def write(self, torque_nm: float) -> None:
        """Write a torque, N*m; what the library raises is raised."""
        if torque_nm:
            self._begun += 1
            try:
                self._write(torque_nm)
            finally:
                self._ended = self._begun
            return
        begun = self._begun
        was_idle = self._ended == begun  # else a torque may still arrive after the zero
        self._write(0.0)
        if was_idle and begun == self._begun:
            self._zeroed = begun

    def settle(self) -> None:
        """Wait a moment for the zero, written by this call where the polling thread is late."""
        if not self._is_zero_within(_LATE_S):
            self._attempt_zero()
            self._is_zero_within(_LATE_S)

    def look(self) -> None:
        """Write the zero that the polling thread is late with; called by the watchdog."""
        if self._may_be_on() or self.is_zero:
            self._late_looks = 0
            return
        self._late_looks += 1
        if self._late_looks * LOOK_S >= _LATE_S:
            self._attempt_zero()
        if self._late_looks == _REPORT_LOOKS:
            _log.error(
                "%s: did not confirm zero torque. Use the emergency stop; zero is sent again and "
                "again.",
                self._name,
            )

    def _is_zero_within(self, patience_s: float) -> bool:
        until_s = time.perf_counter() + patience_s
        while not self.is_zero and time.perf_counter() < until_s:
            time.sleep(0.0005)
        return self.is_zero

    def _attempt_zero(self) -> None:
        """Start a thread that writes zero until it is confirmed, and another one a second later."""
        now_s = time.perf_counter()
        if not self._attempt.is_alive() or now_s - self._attempted_s > _ATTEMPT_S:
            thread = threading.Thread(target=self._zero, name=f"zero {self._name}", daemon=True)
            with suppress(RuntimeError):  # no thread can be had now; the next look tries again
                thread.start()
                self._attempt, self._attempted_s = thread, now_s

    def _zero(self) -> None:
        until_s = time.perf_counter() + _ATTEMPT_S
        while not (self.is_zero or self._may_be_on()) and time.perf_counter() < until_s:
            with suppress(Exception):  # what a bus raises
                self.write(0.0)
            time.sleep(LOOK_S)
