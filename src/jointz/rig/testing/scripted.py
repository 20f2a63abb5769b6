"""Devices that measure what they are told, misbehave when they are told, and remember commands.

They know no physics: the angle does not depend on the torque. Time is the clock's;
under a :class:`jointz.core.clock.VirtualClock` everything repeats to the bit.
"""

from bisect import bisect_left
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, Generic, Literal, TypeVar

from jointz.core.clock import Clock
from jointz.core.errors import NotConnectedError
from jointz.core.limits import SafetyLimits
from jointz.core.study import TorqueModelSpec
from jointz.rig.devices.driver_base import (
    ACTIVE,
    FAULT,
    INACTIVE,
    UNCONFIGURED,
    DriverBase,
    refuse_infinite,
)
from jointz.rig.devices.interface import (
    ActuatorDescription,
    ActuatorSample,
    SensorDescription,
    SensorSample,
)

#: A value over the time since the first activation, s.
Signal = Callable[[float], float]
SampleT = TypeVar("SampleT", ActuatorSample, SensorSample)
DescriptionT = TypeVar("DescriptionT", ActuatorDescription, SensorDescription)

_VELOCITY_STEP_S = 1e-4

#: What a scripted actuator says about itself unless it is told otherwise.
SCRIPTED_ACTUATOR = ActuatorDescription(
    name="scripted actuator",
    model="jointz scripted actuator",
    serial="0",
    firmware="0",
    sample_rate_hz=500.0,
    command_timeout_s=0.1,
    limits=SafetyLimits(
        torque_nm=30.0,
        torque_rate_nm_s=10_000.0,
        current_a=40.0,
        angle_min_rad=-0.2,
        angle_max_rad=1.9,
        velocity_rad_s=15.0,
        temperature_c=80.0,
        sensor_age_s=0.02,
        pulse_count=1000,
        pulse_duty=0.3,
        consecutive_overruns=5,
        fade_s=0.05,
    ),
    torque_model=TorqueModelSpec(gear_ratio=9.0, torque_constant=0.1),
    fault_names={1: "over-temperature", 2: "over-current", 4: "encoder"},
)

#: The same for a sensor.
SCRIPTED_SENSOR = SensorDescription(
    name="scripted sensor",
    model="jointz scripted sensor",
    serial="0",
    channel="angle",
    unit="rad",
    sample_rate_hz=500.0,
)


@dataclass(frozen=True, slots=True)
class Deviation:
    """What a scripted device does wrong, and over which samples.

    Parameters
    ----------
    kind : {"replace", "freeze", "silence", "disconnect"}
        ``replace``: fields of the sample get other values (NaN, fault bits, a temperature,
        a device time that stands still). ``freeze``: samples come in time but repeat the last
        measurement. ``silence``: no samples. ``disconnect``: every call but ``stop`` and
        ``close`` raises, for good.
    first : int
        Number of the first sample, 0 at the first activation.
    last : int, optional
        Number of the last sample; to the end without it.
    values : mapping of str to int or float
        Field of the sample -> value, for ``replace``.

    Examples
    --------
    >>> Deviation("replace", 100, values={"faults": 4}).covers(100)
    True
    >>> Deviation("silence", 10, 20).covers(21)
    False
    """

    kind: Literal["replace", "freeze", "silence", "disconnect"]
    first: int
    last: int | None = None
    values: Mapping[str, Any] = field(default_factory=dict)

    def covers(self, number: int) -> bool:
        """Tell whether a sample is one of those that deviate."""
        return self.first <= number and (self.last is None or number <= self.last)


def replay(values: Sequence[float], sample_rate_hz: float) -> Signal:
    """Return a signal that goes through values and stays at the last.

    Parameters
    ----------
    values : sequence of float
        One a sample.
    sample_rate_hz : float, Hz
        How fast.

    Examples
    --------
    >>> knee = replay([0.1, 0.2, 0.3], 500.0)
    >>> knee(0.0), knee(0.002), knee(9.0)
    (0.1, 0.2, 0.3)
    """
    return lambda time_s: values[min(round(time_s * sample_rate_hz), len(values) - 1)]


class _Scripted(DriverBase, Generic[SampleT, DescriptionT]):
    """Description, lifecycle, grid of samples and deviations."""

    def __init__(
        self, clock: Clock, description: DescriptionT, script: Sequence[Deviation]
    ) -> None:
        super().__init__(description.name)
        self._clock = clock
        self._description: DescriptionT = description
        self._period_ns = round(1e9 / description.sample_rate_hz)
        self._script = tuple(script)
        self._first: int | None = None
        self._next = 0
        self._last: SampleT | None = None
        self._gone = False

    def describe(self) -> DescriptionT:
        """Return what the device says about itself, in any state."""
        return self._description

    def configure(self) -> None:
        """Connect; afterwards ``INACTIVE``."""
        self._check_connected()
        self._require(UNCONFIGURED)
        self._state = INACTIVE

    def activate(self) -> None:
        """Begin to sample; afterwards ``ACTIVE``."""
        self._check_connected()
        self._require(INACTIVE)
        self._next = self._slot()
        self._first = self._next if self._first is None else self._first
        self._state = ACTIVE

    def disconnect(self) -> None:
        """Disconnect: from now on every call except ``stop`` and ``close`` raises."""
        self._gone = True

    def read(self) -> list[SampleT]:
        """Return the samples since the last read, oldest first."""
        self._check_connected()
        if self._state is not FAULT:
            self._require(ACTIVE)
        newest, host_ns = self._slot(), self._clock.now_ns()
        samples = [self._sample(slot, host_ns) for slot in range(self._next, newest + 1)]
        self._next = newest + 1
        return [sample for sample in samples if sample is not None]

    def _measured(self, device_ns: int, host_ns: int, *, time_s: float) -> SampleT:
        raise NotImplementedError

    def _sample(self, slot: int, host_ns: int) -> SampleT | None:
        number = slot - (self._first or 0)
        time_ns = slot * self._period_ns
        deviations = [d for d in self._script if d.covers(number)]
        kinds = {d.kind for d in deviations}
        if "silence" in kinds:
            return None
        if "freeze" in kinds and self._last is not None:
            return self._last._replace(device_time_ns=time_ns, host_time_ns=host_ns)
        sample = self._measured(time_ns, host_ns, time_s=number * self._period_ns * 1e-9)
        for deviation in deviations:
            sample = sample._replace(**deviation.values)
        self._last = sample
        return sample

    def _slot(self) -> int:
        return self._clock.now_ns() // self._period_ns

    def _check_connected(self) -> None:
        if self._first is not None:
            number = self._slot() - self._first
            disconnected = (d for d in self._script if d.kind == "disconnect")
            self._gone = self._gone or any(d.first <= number for d in disconnected)
        if self._gone:
            raise NotConnectedError(self._name, "does not answer, as the script says.")


class ScriptedActuator(_Scripted[ActuatorSample, ActuatorDescription]):
    """An actuator that replays an angle and keeps every command.

    The current follows the command from sample to sample, without friction or lag;
    after the command timeout it is zero. A sample with fault bits puts it in ``FAULT``.

    Parameters
    ----------
    clock : Clock
        The host's.
    description : ActuatorDescription
        What it says about itself: rate, limits, torque model, command timeout.
    angle : callable
        Output angle (rad) over the time since activation (s); velocity is its derivative.
    script : sequence of Deviation
        What goes wrong.

    Attributes
    ----------
    commands : list of (int, float)
        Host time (ns) and torque (N*m) of every command.

    Examples
    --------
    >>> from jointz.core.clock import VirtualClock
    >>> clock = VirtualClock()
    >>> actuator = ScriptedActuator(clock, angle=lambda t: 0.5 * t,
    ...                             script=[Deviation("replace", 1, values={"faults": 4})])
    >>> actuator.configure(); actuator.activate()
    >>> actuator.command_torque(9.0)
    >>> clock.wait_until_ns(2_000_000)
    >>> [(s.angle, round(s.velocity, 3), s.current, s.faults) for s in actuator.read()]
    [(0.0, 0.5, 0.0, 0), (0.001, 0.5, 10.0, 4)]
    >>> actuator.state.value, actuator.commands, actuator.torque_nm
    ('fault', [(0, 9.0)], 0.0)
    """

    def __init__(
        self,
        clock: Clock,
        *,
        description: ActuatorDescription = SCRIPTED_ACTUATOR,
        angle: Signal = lambda _: 0.0,
        script: Sequence[Deviation] = (),
    ) -> None:
        super().__init__(clock, description, script)
        self._angle = angle
        self._torques: list[tuple[int, float]] = []
        self.commands: list[tuple[int, float]] = []

    @property
    def torque_nm(self) -> float:
        """The torque that is on the joint now, N*m."""
        return self._torque_before(self._clock.now_ns() + 1)

    def read(self) -> list[ActuatorSample]:
        """Return the samples since the last read, oldest first.

        Raises
        ------
        NotConnectedError
            After a disconnection.
        DeviceError
            When the actuator is neither ``ACTIVE`` nor in ``FAULT``.
        """
        samples = super().read()
        if any(sample.faults for sample in samples):
            self._state = FAULT
            self._let_go()
        return samples

    def command_torque(self, torque_nm: float) -> None:
        """Command a torque until the next command or the command timeout."""
        self._check_connected()
        self._require(ACTIVE)
        refuse_infinite(self._name, torque_nm)
        command = self._clock.now_ns(), torque_nm
        self.commands.append(command)
        self._torques.append(command)

    def stop(self) -> None:
        """Go to zero torque and ``INACTIVE``; never raises."""
        self._let_go()
        super().stop()

    def _let_go(self) -> None:
        self._torques.append((self._clock.now_ns(), 0.0))

    def _torque_before(self, time_ns: int) -> float:
        place = bisect_left(self._torques, time_ns, key=lambda command: command[0])
        if not place:
            return 0.0
        commanded_ns, torque_nm = self._torques[place - 1]
        held = time_ns - commanded_ns <= self._description.command_timeout_s * 1e9
        return torque_nm if held else 0.0

    def _measured(self, device_ns: int, host_ns: int, *, time_s: float) -> ActuatorSample:
        model, step_s = self._description.torque_model, _VELOCITY_STEP_S
        moved = self._angle(time_s + step_s) - self._angle(time_s - step_s)
        return ActuatorSample(
            device_time_ns=device_ns,
            host_time_ns=host_ns,
            angle=self._angle(time_s),
            velocity=moved / (2.0 * step_s),
            current=self._torque_before(device_ns) / (model.gear_ratio * model.torque_constant),
            voltage=48.0,
            temperature_c=30.0,
            faults=0,
        )


class ScriptedSensor(_Scripted[SensorSample, SensorDescription]):
    """A sensor that replays a signal.

    Parameters
    ----------
    clock : Clock
        The host's.
    signal : callable
        Value over the time since activation (s).
    description : SensorDescription
        What it says about itself.
    script : sequence of Deviation
        What goes wrong.

    Examples
    --------
    >>> from jointz.core.clock import VirtualClock
    >>> clock = VirtualClock()
    >>> sensor = ScriptedSensor(clock, lambda t: 100.0 * t,
    ...                         script=[Deviation("replace", 1, 1, {"value": float("nan")})])
    >>> sensor.configure(); sensor.activate()
    >>> clock.wait_until_ns(4_000_000)
    >>> [sample.value for sample in sensor.read()]
    [0.0, nan, 0.4]
    """

    def __init__(
        self,
        clock: Clock,
        signal: Signal,
        *,
        description: SensorDescription = SCRIPTED_SENSOR,
        script: Sequence[Deviation] = (),
    ) -> None:
        super().__init__(clock, description, script)
        self._signal = signal

    def _measured(self, device_ns: int, host_ns: int, *, time_s: float) -> SensorSample:
        return SensorSample(device_ns, host_ns, self._signal(time_s))
