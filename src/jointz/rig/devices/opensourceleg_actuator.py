"""Any actuator of ours as an ``ActuatorBase`` of opensourceleg 3.5: existing scripts run on it.

::

    from opensourceleg.actuators.base import CONTROL_MODES
    from opensourceleg.utilities import SoftRealtimeLoop

    actuator = as_opensourceleg(ours, clock=RealClock())
    with actuator:
        actuator.set_control_mode(mode=CONTROL_MODES.CURRENT)
        for t in SoftRealtimeLoop(dt=0.002):
            actuator.update()
            actuator.set_output_torque(value=2.0)

Install the library with ``pip install "jointz[osl]"``; it wants numpy below 2. Units are the
library's: motor current in mA, supply (``battery_voltage``) in mV, angles of motor and output in
rad, torque in N*m. Directions are ours: positive in the study's direction, torque on the joint.

There is no safety gate here. Torque and current are clamped to the device's limits, and a
script that no longer calls ``update`` is cut off by the device's command timeout; nothing else
that a session watches is watched. It was never tried on hardware.
"""

import importlib
import logging
from collections.abc import Callable
from functools import cache
from math import tau
from typing import Any

from jointz.core.clock import Clock, RealClock
from jointz.core.errors import DeviceError, JointzError, NotConnectedError
from jointz.rig.devices.driver_base import refuse_infinite
from jointz.rig.devices.interface import Actuator, ActuatorSample, Lifecycle

#: How long the first sample is waited for, s.
_FIRST_SAMPLE_S = 0.5
_STEP_NS = 1_000_000
#: Commands that it takes, in the modes that opensourceleg asks for.
_TAKEN = ("set_motor_current", "set_motor_torque", "set_output_torque", "set_current_gains")
_log = logging.getLogger(__name__)


def as_opensourceleg(
    actuator: Actuator, *, tag: str | None = None, clock: Clock | None = None
) -> Any:
    """Return an actuator of ours as one of opensourceleg, not started.

    It has the modes ``IDLE``, ``CURRENT`` and ``TORQUE``; what it cannot do (voltage, position,
    velocity, impedance) raises. ``stop`` leaves the actuator ``INACTIVE``, to be started again;
    closing it is left to whoever made it.

    Parameters
    ----------
    actuator : Actuator
        ``UNCONFIGURED`` or ``INACTIVE``.
    tag : str, optional
        Its name for opensourceleg; by default the one it has.
    clock : Clock, optional
        The one the actuator was made with; the machine's own by default.

    Returns
    -------
    opensourceleg.actuators.base.ActuatorBase
        An instance of a subclass named ``JointzActuator``.

    Raises
    ------
    DeviceError
        When opensourceleg is not installed.
    """
    return _class()(actuator, tag=tag, clock=clock or RealClock())


@cache
def _class() -> type:
    """Return the class; its base exists only where opensourceleg is installed."""
    base = _library("actuators.base").ActuatorBase
    # What it can never do says so itself, instead of asking for a mode that there is not.
    needed = {n: m for n, m in base._METHOD_REQUIRED_MODES.items() if n in _TAKEN}
    described = {"__doc__": as_opensourceleg.__doc__, "_METHOD_REQUIRED_MODES": needed}
    return type("JointzActuator", (_Face, base), described)


def _library(module: str) -> Any:
    try:
        return importlib.import_module(f"opensourceleg.{module}")
    except ImportError as exc:
        raise DeviceError(
            "opensourceleg",
            f'cannot be imported: {exc}. Install it: pip install "jointz[osl]" (it needs numpy '
            "below 2).",
        ) from exc


def _let_go(actuator: Any) -> None:
    """Leave a mode, so that the next begins without torque."""
    actuator._hold(0.0)


class _Face:
    """Methods that ``JointzActuator`` adds to opensourceleg's ``ActuatorBase``."""

    # of ActuatorBase
    gear_ratio: float
    motor_zero_position: float
    _data: ActuatorSample | None
    _is_homed: bool
    _is_open: bool
    _is_streaming: bool

    def __init__(self, actuator: Actuator, *, tag: str | None, clock: Clock) -> None:
        base, described = _library("actuators.base"), actuator.describe()
        self._ours, self._clock, self._limits = actuator, clock, described.limits
        self._constant = described.torque_model.torque_constant
        self._held_nm = 0.0
        self._modes = base.CONTROL_MODES
        mode = base.ControlModeConfig(entry_callback=_let_go, exit_callback=_let_go)
        self._configs = base.CONTROL_MODE_CONFIGS(IDLE=mode, CURRENT=mode, TORQUE=mode)
        hottest_c = described.limits.temperature_c
        super().__init__(  # type: ignore[call-arg]
            tag=tag or described.name,
            gear_ratio=described.torque_model.gear_ratio,
            motor_constants=base.MOTOR_CONSTANTS(
                MOTOR_COUNT_PER_REV=tau,  # there are no counts: one is a radian
                NM_PER_AMP=abs(self._constant),
                MAX_WINDING_TEMPERATURE=hottest_c,
                MAX_CASE_TEMPERATURE=0.95 * hottest_c,  # only the order of these is ours
                WINDING_SOFT_LIMIT=0.9 * hottest_c,
                CASE_SOFT_LIMIT=0.85 * hottest_c,
            ),
            frequency=round(described.sample_rate_hz),
        )

    def __repr__(self) -> str:
        return f"{self._name}[JointzActuator]"

    @property
    def _name(self) -> str:
        return str(self.tag)  # type: ignore[attr-defined]

    @property
    def _CONTROL_MODE_CONFIGS(self) -> Any:  # noqa: N802 - the library's name
        return self._configs

    # --- life ------------------------------------------------------------------------------

    def start(self) -> None:
        """Configure where that was not done, activate, and wait for the first sample."""
        if self._ours.state is Lifecycle.UNCONFIGURED:
            self._ours.configure()
        self._ours.activate()
        self._is_open = self._is_streaming = True
        try:
            self._await_sample()
        except JointzError:
            self.stop()
            raise

    def _await_sample(self) -> None:
        self._data = None
        until_ns = self._clock.now_ns() + round(_FIRST_SAMPLE_S * 1e9)
        self.update()
        while self._data is None:
            if self._clock.now_ns() >= until_ns:
                raise NotConnectedError(
                    self._name, f"no sample came in {_FIRST_SAMPLE_S} s. Check cable and supply."
                )
            self._clock.wait_until_ns(self._clock.now_ns() + _STEP_NS)
            self.update()

    def stop(self) -> None:
        """Go to zero torque and leave the actuator ``INACTIVE``."""
        self._held_nm = 0.0
        self._ours.stop()
        self._is_open = self._is_streaming = False
        self.set_control_mode(self._modes.IDLE)

    def update(self) -> None:
        """Read the newest sample and repeat the torque command: it holds until changed."""
        samples = self._ours.read()
        if samples:
            self._data = samples[-1]
        if self._data is not None and self._data.faults:
            described = self._ours.describe().fault_names
            names = [name for bit, name in described.items() if bit & self._data.faults]
            raise DeviceError(self._name, f"is in fault: {', '.join(names) or self._data.faults}.")
        self._ours.command_torque(self._held_nm)

    def set_control_mode(self, mode: Any) -> None:
        """Change the mode; the torque is zero afterwards."""
        if getattr(self._configs, mode.name) is None:
            raise self._cannot(f"the mode {mode.name}")
        super().set_control_mode(mode)  # type: ignore[misc]

    def home(
        self,
        homing_voltage: int = 2000,
        homing_frequency: int | None = None,
        homing_direction: int = -1,
        output_position_offset: float = 0.0,
        current_threshold: int = 5000,
        velocity_threshold: float = 0.001,
        callback: Callable[[], None] | None = None,
    ) -> None:
        """Move nothing, since the angle is that of the joint; subtract an offset from it."""
        del homing_voltage, homing_frequency, homing_direction
        del current_threshold, velocity_threshold
        self.set_motor_zero_position(output_position_offset * self.gear_ratio)  # type: ignore[attr-defined]
        self._is_homed = True
        if callback is not None:
            callback()

    # --- commands --------------------------------------------------------------------------

    def _hold(self, torque_nm: float) -> None:
        """Command a torque on the joint, within the limits, until it is changed."""
        refuse_infinite(self._name, torque_nm)
        limits, ratio = self._limits, self.gear_ratio * abs(self._constant)
        most = min(limits.torque_nm, limits.current_a * ratio)
        self._held_nm = min(max(float(torque_nm), -most), most)
        if self._is_streaming:
            self._ours.command_torque(self._held_nm)

    def set_output_torque(self, value: float) -> None:
        """Command a torque on the joint, N*m."""
        self._hold(value)

    def set_motor_torque(self, value: float) -> None:
        """Command a torque before the gear, N*m."""
        self._hold(value * self.gear_ratio)

    def set_motor_current(self, value: float) -> None:
        """Command a motor current, mA: the torque that it gives without friction."""
        self._hold(value * 1e-3 * self._constant * self.gear_ratio)

    def set_current_gains(
        self, kp: float = 0.0, ki: float = 0.0, kd: float = 0.0, ff: float = 0.0
    ) -> None:
        """Keep the gains of the actuator's own current loop, and say so."""
        if any((kp, ki, kd, ff)):
            _log.warning("%s: its current loop keeps its own gains.", self._name)

    def set_motor_voltage(self, value: float) -> None:
        """Raise: a voltage cannot be asked for."""
        raise self._cannot(f"a motor voltage ({value:g} mV)")

    def set_motor_position(self, value: float) -> None:
        """Raise: a position cannot be asked for."""
        raise self._cannot(f"a motor position ({value:g} rad)")

    def set_motor_velocity(self, value: float) -> None:
        """Raise: a velocity cannot be asked for."""
        raise self._cannot(f"a motor velocity ({value:g} rad/s)")

    def set_motor_impedance(self, *given: float, **named: float) -> None:
        """Raise: an impedance cannot be asked for."""
        raise self._cannot(f"an impedance {(*given, *named.values())}")

    set_output_impedance = _set_impedance_gains = set_motor_impedance

    def set_position_gains(self, *given: float, **named: float) -> None:
        """Raise: there is no position control."""
        raise self._cannot(f"position gains {(*given, *named.values())}")

    def _cannot(self, wanted: str) -> DeviceError:
        return DeviceError(
            self._name,
            f"cannot take {wanted}: it takes torque. Use CONTROL_MODES.CURRENT or TORQUE, and "
            "set_motor_current, set_motor_torque or set_output_torque.",
        )

    # --- what was measured -----------------------------------------------------------------

    @property
    def _sample(self) -> ActuatorSample:
        if self._data is None:
            raise _library("logging.exceptions").ActuatorStreamException(tag=self._name)
        return self._data

    @property
    def motor_position(self) -> float:
        """Angle before the gear, rad, after the zero position."""
        return self._sample.angle * self.gear_ratio - self.motor_zero_position

    @property
    def motor_velocity(self) -> float:
        """Before the gear, rad/s."""
        return self._sample.velocity * self.gear_ratio

    @property
    def motor_current(self) -> float:
        """In mA."""
        return self._sample.current * 1e3

    @property
    def motor_torque(self) -> float:
        """Torque of the current before the gear, without friction, N*m."""
        return self._sample.current * self._constant

    @property
    def output_torque(self) -> float:
        """Torque of the current after the gear, without friction, N*m."""
        return self.motor_torque * self.gear_ratio

    @property
    def motor_voltage(self) -> float:
        """Raise: the voltage at the motor is not measured."""
        raise NotImplementedError("The voltage at the motor is not measured; see battery_voltage.")

    @property
    def battery_voltage(self) -> float:
        """Supply, mV."""
        return self._sample.voltage * 1e3

    @property
    def case_temperature(self) -> float:
        """The one measured temperature, degrees Celsius; also that of the winding."""
        return self._sample.temperature_c

    winding_temperature = case_temperature
