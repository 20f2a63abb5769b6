"""The simulated devices: three faces of one running plant."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Literal

from jointz.core.clock import Clock
from jointz.core.errors import DeviceError, NotConnectedError
from jointz.core.limits import SafetyLimits
from jointz.core.study import TorqueModelSpec
from jointz.devices.interface import (
    ActuatorDescription,
    ActuatorSample,
    Lifecycle,
    SensorDescription,
    SensorSample,
)
from jointz.sim.injection import DeviceName, Injection, Misbehaviour
from jointz.sim.layout import Fault
from jointz.sim.plant_build import PlantBuild
from jointz.sim.running_plant import RunningPlant, Sample

_NAN = float("nan")
_new = tuple.__new__  # of named tuples: half the time of their constructors
_DOUBLE_CYCLES = (0.25, 0.35)

_ACTIVE, _FAULT = Lifecycle.ACTIVE, Lifecycle.FAULT  # looking these up costs 40 ns a time

#: What the simulated actuator may be asked for and must not reach.
SIMULATED_LIMITS = SafetyLimits(
    torque_nm=25.0,
    torque_rate_nm_s=40000.0,
    current_a=30.0,
    angle_min_rad=-0.6,
    angle_max_rad=2.4,
    velocity_rad_s=25.0,
    temperature_c=90.0,
    sensor_age_s=0.02,
    pulse_count=2000,
    pulse_duty=0.3,
    consecutive_overruns=5,
    fade_s=0.05,
)


@dataclass(frozen=True, slots=True)
class Wiring:
    """What the devices of one stretch have in common.

    Parameters
    ----------
    build : PlantBuild
        The constants.
    plant : RunningPlant
        The physics.
    clock : Clock
        The host's.
    inject : Injection
        What is to go wrong.
    """

    build: PlantBuild
    plant: RunningPlant
    clock: Clock
    inject: Injection


class _SimulatedDevice:
    """Lifecycle and queue; the time of every call is the clock's."""

    _device: DeviceName

    def __init__(self, wiring: Wiring) -> None:
        self._wiring = wiring
        self._now_ns: Callable[[], int] = wiring.clock.now_ns
        self._plant = wiring.plant
        self._orders = wiring.inject.orders
        self._state = Lifecycle.UNCONFIGURED
        self._queue: list[Sample] = []
        self._last_ns = 0

    @property
    def state(self) -> Lifecycle:
        """Where the device is in its life."""
        return self._state

    def configure(self) -> None:
        """Connect; afterwards ``INACTIVE``."""
        self._require(Lifecycle.UNCONFIGURED, "configured")
        self._check_connected()
        self._state = Lifecycle.INACTIVE

    def activate(self) -> None:
        """Begin to sample; afterwards ``ACTIVE``."""
        self._require(Lifecycle.INACTIVE, "activated")
        self._check_connected()
        if self._plant.samples:  # what passed before is not this device's to tell
            self._plant.look(self._now_ns())
        self._queue = self._plant.queue()
        self._state = _ACTIVE

    def stop(self) -> None:
        """Stop sampling and go to ``INACTIVE``; never raises."""
        self._plant.forget(self._queue)
        self._queue = []
        if self._state is _ACTIVE:
            self._state = Lifecycle.INACTIVE

    def close(self) -> None:
        """Stop for ever; afterwards ``FINALISED``."""
        self.stop()
        self._state = Lifecycle.FINALISED

    def _require(self, state: Lifecycle, wanted: str) -> None:
        if self._state is not state:
            raise DeviceError(
                self._device,
                f"cannot be {wanted}: it is {self._state.value}, expected {state.value}.",
            )

    def _check_connected(self) -> None:
        if self._orders and self._found("disconnect"):
            raise NotConnectedError(self._device, "does not answer. Check cable and supply.")

    def _found(self, kind: str) -> list[Misbehaviour]:
        """Return what goes wrong at the newest sample."""
        newest_ns = self._queue[-1][0] if self._queue else self._last_ns
        found = self._wiring.inject.found(self._device, newest_ns)
        return [order for order in found if order.kind == kind]


class SimulatedActuator(_SimulatedDevice):
    """The exoskeleton's quasi-direct-drive actuator.

    Parameters
    ----------
    wiring : Wiring
        Shared with the other devices.
    """

    _device: DeviceName = "actuator"

    def __init__(self, wiring: Wiring) -> None:
        super().__init__(wiring)
        self._frozen: ActuatorSample | None = None

    def describe(self) -> ActuatorDescription:
        """Return what the actuator says about itself."""
        settings = self._wiring.build.preset.actuator
        return ActuatorDescription(
            name="actuator",
            model="jointz simulated quasi-direct drive",
            serial=self._wiring.build.person.id,
            firmware="1",
            sample_rate_hz=self._wiring.build.grid.sample_rate_hz,
            command_timeout_s=settings.command_timeout_s,
            limits=SIMULATED_LIMITS,
            torque_model=TorqueModelSpec(
                gear_ratio=settings.gear_ratio,
                torque_constant=settings.torque_constant,
                coulomb_friction=settings.coulomb_friction,
                gear_friction=settings.gear_friction,
                rotor_inertia=settings.rotor_inertia,
            ),
            fault_names={int(fault): fault.name.lower() for fault in Fault},
        )

    def read(self) -> list[ActuatorSample]:
        """Return all samples queued since the last read, oldest first.

        Raises
        ------
        DeviceError
            When the actuator is neither ``ACTIVE`` nor in ``FAULT``.
        NotConnectedError
            When a disconnection was ordered.
        """
        if self._state is not _ACTIVE and self._state is not _FAULT:
            self._require(_ACTIVE, "read")
        now = self._now_ns()
        if now >= self._plant.due_ns:
            self._plant.look(now)
        queue = self._queue
        if not queue:
            return []
        if self._orders:
            return self._misread(now)
        if len(queue) == 1:  # the common case, without a comprehension
            time_ns, motor, _, _ = queue.pop()
            samples = [_new(ActuatorSample, (time_ns, now, *motor))]
        else:
            samples = [ActuatorSample(time_ns, now, *motor) for time_ns, motor, _, _ in queue]
            queue.clear()
        if samples[-1][7]:
            self._state = _FAULT
        self._last_ns = samples[-1][0]
        return samples

    def command_torque(self, torque_nm: float) -> None:
        """Ask for a torque on the joint until the next command or the command timeout.

        Parameters
        ----------
        torque_nm : float, N*m
            Wanted torque.

        Raises
        ------
        DeviceError
            When the actuator is not ``ACTIVE``; a request that is not finite is refused too.
        NotConnectedError
            When a disconnection was ordered.
        """
        if self._state is not _ACTIVE:
            self._require(_ACTIVE, "commanded")
        if self._orders:
            self._check_connected()
        if not -1e9 < torque_nm < 1e9:
            raise DeviceError(self._device, f"expected a finite torque, got {torque_nm}.")
        self._plant.command(torque_nm, self._now_ns())

    def stop(self) -> None:
        """Go to zero torque and ``INACTIVE``; never raises."""
        if self._state is _ACTIVE:
            self._plant.command(0.0, self._now_ns())
        super().stop()

    def _misread(self, now: int) -> list[ActuatorSample]:
        """Read with what was ordered to go wrong."""
        self._check_connected()
        samples = []
        for time_ns, motor, _, _ in self._queue:
            sample = ActuatorSample(time_ns, now, *motor)
            wrong = self._wiring.inject.found(self._device, time_ns)
            spoilt = self._spoilt(sample, wrong)
            if spoilt is not None:
                samples.append(spoilt)
        self._last_ns = self._queue[-1][0]
        self._queue.clear()
        if samples and samples[-1].faults:
            self._state = _FAULT
        return samples

    def _spoilt(self, sample: ActuatorSample, wrong: list[Misbehaviour]) -> ActuatorSample | None:
        kinds = {order.kind: order.value for order in wrong}
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


class _SimulatedSensor(_SimulatedDevice):
    """A device that only measures."""

    _place: Literal[2, 3]  # of its value in a sample of the plant

    def __init__(self, wiring: Wiring) -> None:
        super().__init__(wiring)
        self._frozen: float | None = None

    def read(self) -> list[SensorSample]:
        """Return all samples queued since the last read, oldest first.

        Raises
        ------
        DeviceError
            When the sensor is not ``ACTIVE``.
        NotConnectedError
            When a disconnection was ordered.
        """
        if self._state is not _ACTIVE:
            self._require(_ACTIVE, "read")
        now = self._now_ns()
        if now >= self._plant.due_ns:
            self._plant.look(now)
        queue = self._queue
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
            value = sample[self._place]
            if "freeze" in kinds and self._frozen is not None:
                value = self._frozen
            if "nan" in kinds:
                value = _NAN
            if "double" in kinds and self._mid_stance(sample):
                value = 0.0
            self._frozen = value
            samples.append(SensorSample(sample[0], now, value))
        self._last_ns = self._queue[-1][0]
        self._queue.clear()
        return samples

    def _mid_stance(self, sample: Sample) -> bool:
        stride = self._plant.stride
        share = (sample[0] * 1e-9 - stride.start_s) / stride.duration_s
        low, high = _DOUBLE_CYCLES
        return low <= share < high


class SimulatedGoniometer(_SimulatedSensor):
    """The electrogoniometer across the knee.

    Parameters
    ----------
    wiring : Wiring
        Shared with the other devices.
    """

    _device: DeviceName = "angle"
    _place = 2

    def describe(self) -> SensorDescription:
        """Return what the goniometer says about itself."""
        return SensorDescription(
            name="goniometer",
            model="jointz simulated electrogoniometer",
            serial=self._wiring.build.person.id,
            channel="angle",
            unit="rad",
            sample_rate_hz=self._wiring.build.grid.sample_rate_hz,
        )


class SimulatedFootswitch(_SimulatedSensor):
    """The switch under the heel.

    Parameters
    ----------
    wiring : Wiring
        Shared with the other devices.
    """

    _device: DeviceName = "contact"
    _place = 3

    def describe(self) -> SensorDescription:
        """Return what the footswitch says about itself."""
        return SensorDescription(
            name="footswitch",
            model="jointz simulated heel switch",
            serial=self._wiring.build.person.id,
            channel="contact",
            unit="1",
            sample_rate_hz=self._wiring.build.grid.sample_rate_hz,
            kind="contact",
        )
