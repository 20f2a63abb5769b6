"""Simulated devices, all of one running plant."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, Generic, TypeVar, cast

from jointz.core.channels import MOTION_SENSORS
from jointz.core.clock import Clock
from jointz.core.errors import DeviceError, NotConnectedError
from jointz.rig.devices.driver_base import DriverBase
from jointz.rig.devices.interface import (
    ActuatorDescription,
    ActuatorSample,
    Lifecycle,
    PositionerDescription,
    SensorDescription,
    SensorSample,
)
from jointz.rig.sim.benches.running_bench import RunningBench
from jointz.rig.sim.benches.running_plant import RunningPlant
from jointz.rig.sim.sensors.sampled_time import Sample, SampledTime
from jointz.rig.sim.walking.injection import DeviceName, Injection, Kind, Misbehaviour

_NAN = float("nan")
_new = tuple.__new__  # of named tuples: half the time of their constructors
_DOUBLE_CYCLES = (0.25, 0.35)

_MOTION_PLACES: dict[str, int] = dict(zip(MOTION_SENSORS, (5, 6, 7), strict=True))

_ACTIVE, _FAULT = Lifecycle.ACTIVE, Lifecycle.FAULT  # looking these up costs 40 ns a time
DescriptionT = TypeVar(
    "DescriptionT", ActuatorDescription, SensorDescription, PositionerDescription
)
SensorDescriptionT = TypeVar("SensorDescriptionT", SensorDescription, PositionerDescription)


@dataclass(frozen=True, slots=True)
class Wiring:
    """Plant, clock and misbehaviour that the devices of one stretch share."""

    plant: SampledTime  # simulated physics
    clock: Clock  # clock of the host
    inject: Injection  # ordered misbehaviour


class _SimulatedDevice(DriverBase, Generic[DescriptionT]):
    """Lifecycle and queue; the time of every call is the clock's."""

    def __init__(self, wiring: Wiring, device: DeviceName, description: DescriptionT) -> None:
        super().__init__(device)
        self._device: DeviceName = device
        self._description: DescriptionT = description
        self._wiring = wiring
        self._now_ns: Callable[[], int] = wiring.clock.now_ns
        self._plant: SampledTime = wiring.plant
        self._orders = wiring.inject.orders
        self._queue: list[Sample] = []
        self._last_ns = 0

    def describe(self) -> DescriptionT:
        """Return the description of the device, in any state."""
        return self._description

    def configure(self) -> None:
        """Connect; afterwards ``INACTIVE``."""
        self._require_for("configured", Lifecycle.UNCONFIGURED)
        self._check_connected()
        self._state = Lifecycle.INACTIVE

    def activate(self) -> None:
        """Begin to sample; afterwards ``ACTIVE``."""
        self._require_for("activated", Lifecycle.INACTIVE)
        self._check_connected()
        if self._plant.samples:  # samples from before the activation are not queued
            self._plant.look(self._now_ns())
        self._queue = self._plant.queue()
        self._state = _ACTIVE

    def stop(self) -> None:
        """Stop sampling and go to ``INACTIVE``; never raises."""
        self._plant.forget(self._queue)
        self._queue = []
        super().stop()

    def _require_for(self, action: str, state: Lifecycle = _ACTIVE) -> None:
        if self._state is not state:
            raise DeviceError(
                self._device,
                f"cannot be {action}: it is {self._state.value}, expected {state.value}.",
            )

    def _check_connected(self) -> None:
        """Raise if a disconnection is ordered for the newest sample."""
        if not self._orders:
            return
        newest_ns = self._queue[-1][0] if self._queue else self._last_ns
        orders = self._wiring.inject.found(self._device, newest_ns)
        if any(order.kind == "disconnect" for order in orders):
            raise NotConnectedError(self._device, "does not answer. Check cable and supply.")


class SimulatedActuator(_SimulatedDevice[ActuatorDescription]):
    """An actuator: of an exoskeleton, or on a bench."""

    def __init__(self, wiring: Wiring, description: ActuatorDescription) -> None:
        super().__init__(wiring, "actuator", description)
        self._frozen: ActuatorSample | None = None

    def read(self) -> list[ActuatorSample]:
        """Return all samples queued since the last read, oldest first."""
        if self._state is not _FAULT:
            self._require_for("read")
        now = self._now_ns()
        if now >= self._plant.due_ns:
            self._plant.look(now)
        queue = self._queue
        if not queue:
            return []
        if self._orders:
            return self._misread(now)
        if len(queue) == 1:  # the common case, without a comprehension
            sample = queue.pop()
            samples = [_new(ActuatorSample, (sample[0], now, *sample[1]))]
        else:
            samples = [ActuatorSample(sample[0], now, *sample[1]) for sample in queue]
            queue.clear()
        if samples[-1][7]:
            self._state = _FAULT
        self._last_ns = samples[-1][0]
        return samples

    def command_torque(self, torque_nm: float) -> None:
        """Command a torque on the joint until the next command or the command timeout."""
        self._require_for("commanded")
        self._check_connected()
        if not -1e9 < torque_nm < 1e9:
            raise DeviceError(self._device, f"expected a finite torque, got {torque_nm}.")
        self._plant.command(torque_nm, self._now_ns())

    def stop(self) -> None:
        """Go to zero torque and ``INACTIVE``; never raises."""
        if self._state is _ACTIVE:
            self._plant.release(self._now_ns())
        super().stop()

    def _misread(self, now: int) -> list[ActuatorSample]:
        """Read with what was ordered to go wrong."""
        self._check_connected()
        samples = []
        for time_ns, motor, *_ in self._queue:
            sample = ActuatorSample(time_ns, now, *motor)
            orders = self._wiring.inject.found(self._device, time_ns)
            altered = self._altered(sample, orders)
            if altered is not None:
                samples.append(altered)
        self._last_ns = self._queue[-1][0]
        self._queue.clear()
        if samples and samples[-1].faults:
            self._state = _FAULT
        return samples

    def _altered(self, sample: ActuatorSample, orders: list[Misbehaviour]) -> ActuatorSample | None:
        kinds = {order.kind: order.value for order in orders}
        if "silence" in kinds:
            return None
        if "freeze" in kinds and self._frozen is not None:
            frozen = self._frozen
            return frozen._replace(
                device_time_ns=sample.device_time_ns, host_time_ns=sample.host_time_ns
            )
        if "nan" in kinds:
            sample = sample._replace(angle=_NAN, velocity=_NAN)
        if "heat" in kinds:
            sample = sample._replace(temperature_c=sample.temperature_c + kinds["heat"])
        if "fault" in kinds:
            self._plant.fail(int(kinds["fault"]))
            sample = sample._replace(faults=sample.faults | int(kinds["fault"]))
        self._frozen = sample
        return sample


class _SimulatedSensor(_SimulatedDevice[SensorDescriptionT]):
    """A device that measures one value."""

    _place: int  # of its value in a sample of the plant
    _frozen: float | None = None

    def read(self) -> list[SensorSample]:
        """Return all samples queued since the last read, oldest first."""
        self._require_for("read")
        now = self._now_ns()
        if now >= self._plant.due_ns:
            self._plant.look(now)
        queue: list[Any] = self._queue
        if not queue:
            return []
        if self._orders:
            return self._misread(now)
        place = self._place
        if len(queue) == 1:  # the common case, without a comprehension
            sample = queue.pop()
            samples = [_new(SensorSample, (sample[0], now, sample[place]))]
        else:
            samples = [SensorSample(sample[0], now, sample[place]) for sample in queue]
            queue.clear()
        self._last_ns = samples[-1][0]
        return samples

    def _misread(self, now: int) -> list[SensorSample]:
        """Read with what was ordered to go wrong."""
        self._check_connected()
        samples = []
        for sample in self._queue:
            kinds = {o.kind for o in self._wiring.inject.found(self._device, sample[0])}
            if "silence" in kinds:
                continue
            value = cast(float, sample[self._place])
            if "freeze" in kinds and self._frozen is not None:
                value = self._frozen
            if "nan" in kinds:
                value = _NAN
            value = self._doubled(value, sample, kinds)
            self._frozen = value
            samples.append(SensorSample(sample[0], now, value))
        self._last_ns = self._queue[-1][0]
        self._queue.clear()
        return samples

    def _doubled(self, value: float, sample: Sample, kinds: set[Kind]) -> float:
        """Return a contact that opens once more than the foot does."""
        del sample, kinds
        return value


class SimulatedSensor(_SimulatedSensor[SensorDescription]):
    """A goniometer, or a torque sensor of a bench."""

    _place = 2


class SimulatedMoment(SimulatedSensor):
    """The internal moment of the joint by inverse dynamics."""

    _place = 4


class SimulatedMotionSensor(SimulatedSensor):
    """An encoder or gyroscope, whose clock may have a zero (s) and a rate of its own."""

    def __init__(
        self,
        wiring: Wiring,
        description: SensorDescription,
        *,
        clock: tuple[float, float],
    ) -> None:
        super().__init__(wiring, cast(DeviceName, description.channel), description)
        self._place = _MOTION_PLACES[description.channel]
        self._zero_ns, self._rate = round(clock[0] * 1e9), clock[1]

    def read(self) -> list[SensorSample]:
        """Return all samples queued since the last read, oldest first."""
        samples, zero_ns, rate = super().read(), self._zero_ns, self._rate
        if zero_ns == 0 and rate == 0.0:
            return samples
        return [
            _new(SensorSample, (zero_ns + time_ns + round(rate * time_ns), host_ns, value))
            for time_ns, host_ns, value in samples
        ]


class SimulatedFootswitch(_SimulatedSensor[SensorDescription]):
    """The switch under the heel."""

    _place = 3

    def __init__(self, wiring: Wiring, plant: RunningPlant, description: SensorDescription) -> None:
        super().__init__(wiring, "contact", description)
        self._walking = plant

    def _doubled(self, value: float, sample: Sample, kinds: set[Kind]) -> float:
        stride = self._walking.stride
        share = (sample[0] * 1e-9 - stride.start_s) / stride.duration_s
        low, high = _DOUBLE_CYCLES
        return 0.0 if "double" in kinds and low <= share < high else value


class SimulatedPositioner(_SimulatedSensor[PositionerDescription]):
    """The motor that moves the far side of a bench."""

    _place = 3

    def __init__(
        self, wiring: Wiring, plant: RunningBench, description: PositionerDescription
    ) -> None:
        super().__init__(wiring, "positioner", description)
        self._bench = plant

    def command_position(self, angle_rad: float) -> None:
        """Command an angle of the far side."""
        self._require_for("commanded")
        self._check_connected()
        if not -1e9 < angle_rad < 1e9:
            raise DeviceError(self._device, f"expected a finite angle, got {angle_rad}.")
        self._bench.move_to(angle_rad, self._now_ns())

    def stop(self) -> None:
        """Hold still and go to ``INACTIVE``; never raises."""
        if self._state is _ACTIVE:
            self._bench.hold_still(self._now_ns())
        super().stop()
