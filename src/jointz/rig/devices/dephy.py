"""Dephy ActPack through flexsea: ``pip install "jointz[dephy]"`` (flexsea 12).

**Never tried on hardware.** It was run against the classes of flexsea 12 on a stand-in for the
compiled library that talks to the device. What only the device can tell - the sign of its
current, the real units of its fields, what its firmware does when the cable is pulled - is to
be checked on a bench before anybody wears it.

What guards the wearer, from inside outwards:

- the current is clamped here, to the limits of this device and less when it is warm, whatever
  the safety gate lets through;
- a thread sends zero current when no command came for ``command_timeout_s``: this covers a loop
  that hangs, not a program that was killed or a computer that froze;
- from firmware 9.1 on the device stops its motor when the heartbeats of flexsea stay away for
  250 ms. They are sent by flexsea's own thread: this covers a cable, a killed program and a
  frozen computer, not a loop that hangs. **Below 9.1 the motor holds its last current for ever
  when program or cable die: only an emergency stop in the supply helps then.**

The angle counts from where the encoder stood when the device was powered, within one turn of
the motor: ``zero_counts`` has to be found anew after every power-up.
"""

import contextlib
import io
import logging
import sys
import threading
from collections.abc import Iterator, Mapping
from typing import Any

from jointz.core.clock import Clock
from jointz.core.errors import DeviceError, NotConnectedError
from jointz.rig.devices.config import DephySpec
from jointz.rig.devices.dephy_units import DeviceClock, Units, Winding
from jointz.rig.devices.driver_base import (
    ACTIVE,
    FAULT,
    FINALISED,
    INACTIVE,
    UNCONFIGURED,
    DriverBase,
    load_library,
    refuse_infinite,
)
from jointz.rig.devices.drivers import Driver
from jointz.rig.devices.interface import Actuator, ActuatorDescription, ActuatorSample
from jointz.rig.devices.repeating import Repeat, Repeating, RepeatingThread

_LOG = logging.getLogger(__name__)

#: The least that flexsea takes, ms; the device waits for five of them.
HEARTBEAT_MS = 50
_HEARTBEAT_FIRMWARE = (9, 1, 0)

#: Without a sample for so long a device is gone, whatever the library says.
_SILENCE_NS = 1_000_000_000
#: The watchdog looks so many times a timeout.
_LOOKS = 5
_LOCK_S = 0.02
#: What flexsea's calls let through, besides what the system says.
_LIBRARY_ERRORS = (RuntimeError, OSError, ValueError, AssertionError, AttributeError, TypeError)


class DephyActPack(DriverBase):
    """A Dephy ActPack as an actuator of an experiment; see the module for what guards the wearer.

    Friction is not compensated here: the experiment does it before the safety gate.
    """

    def __init__(
        self,
        spec: DephySpec,
        *,
        clock: Clock,
        repeat: Repeat = RepeatingThread,
        before: Actuator | None = None,
    ) -> None:
        super().__init__(f"Dephy ActPack at {spec.port}")
        sign = spec.direction if spec.side == "right" else -spec.direction
        model = spec.torque_model
        self._spec = spec
        self._now_ns = clock.now_ns
        self._repeat = repeat
        self._units = Units(gear_ratio=model.gear_ratio, sign=sign, zero_counts=spec.zero_counts)
        self._torque_per_ampere = model.gear_ratio * model.torque_constant
        cooled = before._cooled(clock) if isinstance(before, DephyActPack) else None
        self._winding = cooled or Winding(spec.winding)
        self._samples = Samples(self._name, self._units, self._winding)
        self._device: Any = None
        self._watchdog: Repeating | None = None
        self._sending = threading.Lock()
        self._commanded_ns = self._sampled_ns = 0
        self._relaxed = self._stop_confirmed = True

    @property
    def stop_confirmed(self) -> bool:
        """True if flexsea took the last stop."""
        return self._stop_confirmed

    @property
    def dropped(self) -> int:
        """Samples left out so far: repeated or corrupt."""
        return self._samples.dropped

    @property
    def has_heartbeat(self) -> bool:
        """Whether the firmware stops the motor by itself when the computer is gone."""
        firmware = tuple(int(part) for part in self._spec.firmware.split("."))
        return firmware >= _HEARTBEAT_FIRMWARE

    def describe(self) -> ActuatorDescription:
        """Return the description of the actuator, in any state."""
        spec = self._spec
        guard = (
            f"heartbeat {HEARTBEAT_MS} ms"
            if self.has_heartbeat
            else "NO HEARTBEAT: holds its current when program or cable die"
        )
        return ActuatorDescription(
            name=self._name,
            model=f"Dephy ActPack, {spec.side} (driver never tried on hardware)",
            serial=spec.serial,
            firmware=f"{spec.firmware}, {guard}",
            sample_rate_hz=spec.sample_rate_hz,
            command_timeout_s=spec.command_timeout_s,
            limits=spec.limits,
            torque_model=spec.torque_model,
            fault_names=FAULT_NAMES,
        )

    def configure(self) -> None:
        """Connect; afterwards ``INACTIVE``."""
        self._require(UNCONFIGURED)
        if not self.has_heartbeat:
            _LOG.warning(
                "%s: firmware %s has no heartbeat (9.1 has): when program or cable die the motor "
                "holds its last current. Keep an emergency stop in the supply at hand.",
                self._name,
                self._spec.firmware,
            )
        device_class = load_library("flexsea.device", device=self._name, extra="dephy").Device
        with flexsea_kept_quiet():
            try:
                device = device_class(
                    firmwareVersion=self._spec.firmware,
                    port=self._spec.port,
                    libFile=self._spec.library,
                    logLevel=6,
                    interactive=False,
                    stopMotorOnDisconnect=True,
                )
                self._check_firmware(str(device.firmwareVersion))
                device.open()
            except DeviceError:
                raise
            except Exception as exc:
                raise NotConnectedError(
                    self._name,
                    f"cannot be opened ({type(exc).__name__}: {exc}). Check power, cable and port, "
                    "and that the user is in the group dialout; the first time flexsea needs the "
                    "internet for its compiled library.",
                ) from exc
        self._device = device
        self._check_side(device)
        self._state = INACTIVE

    def activate(self) -> None:
        """Begin to sample and to obey; afterwards ``ACTIVE``."""
        self._require(INACTIVE)
        device, spec = self._device, self._spec
        kp, ki, ff = spec.current_gains
        try:
            with flexsea_kept_quiet():
                if not device.streaming:
                    device.start_streaming(
                        int(spec.sample_rate_hz),
                        heartbeat=HEARTBEAT_MS if self.has_heartbeat else 0,
                        useSafety=self.has_heartbeat,
                    )
                device.set_gains(kp=kp, ki=ki, kd=0, k=0, b=0, ff=ff)
                device.command_motor_current(0)
                self._queued()  # of before
        except _LIBRARY_ERRORS as exc:
            raise self._gone(exc) from exc
        self._commanded_ns = self._sampled_ns = self._now_ns()
        self._relaxed = True
        self._samples.begin()
        self._state = ACTIVE
        self._watchdog = self._repeat(self._relax_when_forgotten, spec.command_timeout_s / _LOOKS)

    def stop(self) -> None:
        """Go to zero torque and ``INACTIVE``, whatever the state; never raises, never blocks."""
        if self._watchdog is not None:
            self._watchdog.cancel()
            self._watchdog = None
        super().stop()
        if self._device is not None and self._state is not FINALISED:
            self._let_go()

    def _release(self) -> None:
        device, self._device = self._device, None
        if device is None:
            return
        for step in ("stop_streaming", "close"):
            with contextlib.suppress(*_LIBRARY_ERRORS), flexsea_kept_quiet():
                getattr(device, step)()

    def read(self) -> list[ActuatorSample]:
        """Return all samples queued since the last read, oldest first."""
        self._require(ACTIVE, FAULT)
        try:
            queued = self._queued()
        except _LIBRARY_ERRORS as exc:
            raise self._gone(exc) from exc
        host_ns = self._now_ns()
        if queued:
            self._sampled_ns = host_ns
        elif host_ns - self._sampled_ns > _SILENCE_NS:
            raise NotConnectedError(
                self._name, "sent no sample for a second. Check power and cable."
            )
        take = self._samples.take
        samples = [s for data in queued if (s := take(data, host_ns)) is not None]
        if self._state is ACTIVE and any(sample.faults for sample in samples):
            self._state = FAULT
            self._let_go()
        return samples

    def command_torque(self, torque_nm: float) -> None:
        """Ask for a torque on the joint, until the next command or the command timeout.

        Current by equation 4.1 without friction and inertia, clamped to the limit of this
        device, and to less the warmer the winding is.
        """
        self._require(ACTIVE)
        refuse_infinite(self._name, torque_nm)
        largest = self._spec.limits.current_a * self._winding.share
        wanted = torque_nm / self._torque_per_ampere
        milliamperes = self._units.milliamperes(max(-largest, min(largest, wanted)))
        try:
            with self._sending:
                self._commanded_ns = self._now_ns()
                self._relaxed = False
                self._device.command_motor_current(milliamperes)
        except _LIBRARY_ERRORS as exc:
            raise self._gone(exc) from exc

    def _cooled(self, clock: Clock) -> Winding:
        """Return the winding as it is now, without current since the last sample."""
        self._winding.rest(max(0.0, (clock.now_ns() - self._sampled_ns) * 1e-9))
        return self._winding

    # --- what is sent ------------------------------------------------------------------------

    def _relax_when_forgotten(self) -> None:
        """Send zero current when no command came for too long; called by the watchdog."""
        # One look earlier than the timeout: by then it has to be done.
        after_ns = self._spec.command_timeout_s * 1e9 * (1.0 - 1.0 / _LOOKS)
        locked = self._sending.acquire(timeout=_LOCK_S)
        try:
            forgotten = self._now_ns() - self._commanded_ns >= after_ns
            if self._state is ACTIVE and not self._relaxed and forgotten:
                self._relaxed = True
                self._device.command_motor_current(0)
        except _LIBRARY_ERRORS:
            self._relaxed = False  # again at the next look
        finally:
            if locked:
                self._sending.release()

    def _let_go(self) -> None:
        """Send zero current and switch the motor's controller off."""
        # A call that hangs holds the lock; zero torque does not wait for it.
        locked = self._sending.acquire(timeout=_LOCK_S)
        try:
            self._device.command_motor_current(0)
            self._device.stop_motor()
            self._stop_confirmed = True
        except _LIBRARY_ERRORS as exc:
            self._stop_confirmed = False
            _LOG.error("%s: could not be stopped (%s). Switch its power off.", self._name, exc)
        finally:
            self._relaxed = True
            if locked:
                self._sending.release()

    # --- what is received ----------------------------------------------------------------------

    def _queued(self) -> list[Mapping[str, int]]:
        """Return everything that the library has queued; never blocks."""
        device = self._device
        if not device.streaming:
            raise RuntimeError("not streaming")
        # Asked for an empty queue, flexsea prints a line and raises: look first.
        if device._clib.fxGetReadDataQueueSize(device.id) <= 0:
            return []
        return list(device.read(allData=True))

    # --- who it is -----------------------------------------------------------------------------

    def _check_firmware(self, firmware: str) -> None:
        if firmware != self._spec.firmware:
            raise DeviceError(
                self._name,
                f"firmware: flexsea knows no {self._spec.firmware} and would take {firmware}. "
                "Write the version that the device runs, as flexsea lists it.",
            )

    def _check_side(self, device: Any) -> None:
        side = device.side
        if side in ("left", "right") and side != self._spec.side:
            self.close()
            raise DeviceError(
                self._name,
                f"side: expected {self._spec.side}, the device says {side}: torque would "
                "act the wrong way. Correct side, or take the other device.",
            )

    def _gone(self, exc: Exception) -> NotConnectedError:
        return NotConnectedError(
            self._name, f"does not answer ({type(exc).__name__}: {exc}). Check power and cable."
        )


DRIVER = Driver(DephySpec, DephyActPack, package="flexsea")


I2T, TOO_HOT, CLOCK, GARBAGE = 1, 2, 4, 8
FAULT_NAMES: Mapping[int, str] = {
    I2T: "average current (I2t) limit of the firmware",
    TOO_HOT: "winding (estimated) or case too hot",
    CLOCK: "the device's clock went back: it was restarted",
    GARBAGE: "values that cannot be",
}
#: Bit of ``status_ex``. Single bits flip on the way: two samples in a row make a fault.
_STATUS_I2T = 0b10
_BELIEVED = {I2T: 2, CLOCK: 2, GARBAGE: 3}
_FIELDS = ("state_time", "mot_ang", "mot_vel", "mot_cur", "batt_volt", "temperature", "status_ex")
#: mA, mV, degrees Celsius: beyond these a field is garbage.
_MOST_MA, _MOST_MV, _COLDEST_C, _HOTTEST_C = 80_000, 100_000, -30, 200


class Samples:
    """Converts flexsea's data to samples, and monitors clock, winding and faults."""

    def __init__(self, name: str, units: Units, winding: Winding) -> None:
        self._name = name
        self._units = units
        self._winding = winding
        self._clock = DeviceClock()
        self._in_a_row = dict.fromkeys(_BELIEVED, 0)
        self.dropped = 0

    def begin(self) -> None:
        """Reset the counts of faults before another activation."""
        self._in_a_row = dict.fromkeys(_BELIEVED, 0)

    def take(self, data: Mapping[str, int], host_ns: int) -> ActuatorSample | None:
        """Return a sample in SI; None if it repeats the one before, or for a single corrupt one."""
        try:
            stamp, counts, deg_s, milliamperes, millivolts, case_c, status = [
                data[name] for name in _FIELDS
            ]
        except KeyError as exc:
            raise DeviceError(
                self._name,
                f"expected the fields {', '.join(_FIELDS)}; {exc} is missing. Is it an ActPack, "
                "and is firmware what it runs?",
            ) from exc
        sane = (
            -_MOST_MA <= milliamperes <= _MOST_MA
            and 0 <= millivolts <= _MOST_MV
            and _COLDEST_C <= case_c <= _HOTTEST_C
        )
        elapsed_ms = self._clock.elapsed_ms(stamp, host_ns) if sane else 0
        faults = self._believed(GARBAGE, seen=not sane)
        faults |= self._believed(CLOCK, seen=elapsed_ms is None)
        if not elapsed_ms and not faults:
            self.dropped += 1
            return None
        units, winding = self._units, self._winding
        current = units.current(milliamperes)
        if sane and elapsed_ms:
            winding.warm(current, case_c, elapsed_s=1e-3 * elapsed_ms)
        faults |= self._believed(I2T, seen=bool(status & _STATUS_I2T))
        return ActuatorSample(
            device_time_ns=self._clock.time_ns,
            host_time_ns=host_ns,
            angle=units.angle(counts),
            velocity=units.velocity(deg_s),
            current=current,
            voltage=1e-3 * millivolts,
            temperature_c=winding.temperature_c,
            faults=faults | (TOO_HOT if winding.too_hot else 0),
        )

    def _believed(self, fault: int, *, seen: bool) -> int:
        """Return the fault's bit once it was seen often enough in a row."""
        count = self._in_a_row[fault] + 1 if seen else 0
        self._in_a_row[fault] = count
        return fault if count >= _BELIEVED[fault] else 0


@contextlib.contextmanager
def traceback_limit_kept() -> Iterator[None]:
    """Restore ``sys.tracebacklimit``, which flexsea sets to 0, so that errors have a traceback."""
    missing = object()
    limit = getattr(sys, "tracebacklimit", missing)
    try:
        yield
    finally:
        if limit is not missing:
            sys.tracebacklimit = limit  # type: ignore[assignment]
        elif hasattr(sys, "tracebacklimit"):
            del sys.tracebacklimit


@contextlib.contextmanager
def flexsea_kept_quiet() -> Iterator[None]:
    """Keep its prints out of stdout, which belongs to ``--json``, and restore tracebacks."""
    output = io.StringIO()
    try:
        with traceback_limit_kept(), contextlib.redirect_stdout(output):
            yield
    finally:
        if text := output.getvalue().strip():
            _LOG.debug("flexsea: %s", text)
