"""Base class of simulated benches: one load, its devices, its random numbers."""

from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping
from typing import Any, ClassVar, Generic, TypeVar
from zlib import crc32

import numpy as np

from jointz.core.clock import Clock
from jointz.core.limits import SafetyLimits
from jointz.core.study import DeviceSpec, TorqueModelSpec
from jointz.rig.devices.interface import (
    ActuatorDescription,
    Devices,
    PositionerDescription,
    SensorDescription,
    Wearer,
)
from jointz.rig.sim.benches.bench_load import BenchLoad
from jointz.rig.sim.benches.compiled_bench import CompiledBench
from jointz.rig.sim.benches.qdd_bench import QddSettings
from jointz.rig.sim.benches.running_bench import RunningBench
from jointz.rig.sim.benches.sea import SeaSettings
from jointz.rig.sim.simulated_devices import (
    SimulatedActuator,
    SimulatedPositioner,
    SimulatedSensor,
    Wiring,
)
from jointz.rig.sim.walking.injection import Injection
from jointz.rig.sim.walking.layout import Fault

_COMMAND_TIMEOUT_S = 0.1
SettingsT = TypeVar("SettingsT", SeaSettings, QddSettings)


class LoadedBench(ABC, Generic[SettingsT]):
    """A simulated bench with one load; a subclass gives it physics and descriptions."""

    PLANT: ClassVar[Callable[..., CompiledBench]]
    BENCH: ClassVar[str]  # name of the bench in :meth:`notes`
    ONE_MOTOR: ClassVar[bool]  # whether the motor under test also moves the output
    ACTUATOR_MODEL: ClassVar[str]  # model of the motor under test
    LIMITS: ClassVar[SafetyLimits]  # limits of the motor under test
    TORQUE_SENSOR: ClassVar[tuple[str, str, str]]  # name, model and channel
    POSITIONER: ClassVar[tuple[str, str, str]]  # name, model and channel
    POSITIONER_RAD_S: ClassVar[float]  # largest speed of the positioner

    def __init__(
        self, settings: SettingsT, load: BenchLoad, *, seed: int, sample_rate_hz: float
    ) -> None:
        self.settings: SettingsT = settings
        self.load = load
        self.inject = Injection()
        self._seed = seed
        self._rate_hz = sample_rate_hz

    @property
    def wearer(self) -> Wearer:
        """The load, in place of a participant."""
        return Wearer(self.load.name)

    @property
    def device(self) -> DeviceSpec | None:
        """None: a bench has no limb."""
        return None

    def open(self, condition: str, *, worn: bool, segment: int, clock: Clock) -> Devices:
        """Return the devices, ``UNCONFIGURED``, for one trial."""
        del worn
        running = RunningBench(
            self.PLANT(
                self.settings,
                self.load,
                sample_rate_hz=self._rate_hz,
                noise=bench_stream(self._seed, self.load.name, condition, segment),
            ),
            period_ns=round(1e9 / self._rate_hz),
            timeout_s=_COMMAND_TIMEOUT_S,
            one_motor=self.ONE_MOTOR,
        )
        wiring = Wiring(running, clock, self.inject)
        return Devices(
            actuator=SimulatedActuator(wiring, self._actuator()),
            torque=SimulatedSensor(wiring, "torque", self._torque_sensor()),
            positioner=SimulatedPositioner(wiring, running, self._positioner()),
        )

    def notes(self) -> Mapping[str, Any]:
        """Return name and settings of the bench, without its truth."""
        return {
            "simulated": True,
            "bench": self.BENCH,
            "preset": self.settings.name,
            "seed": self._seed,
        }

    @property
    @abstractmethod
    def _torque_model(self) -> TorqueModelSpec:
        """The constants that are stated of the motor under test."""

    @property
    @abstractmethod
    def _reach_rad(self) -> float:
        """Largest angle of the positioner in either direction, rad."""

    def _actuator(self) -> ActuatorDescription:
        return ActuatorDescription(
            name="actuator",
            model=self.ACTUATOR_MODEL,
            serial="1",
            firmware="1",
            sample_rate_hz=self._rate_hz,
            command_timeout_s=_COMMAND_TIMEOUT_S,
            limits=self.LIMITS,
            torque_model=self._torque_model,
            fault_names={int(fault): fault.name.lower() for fault in Fault},
        )

    def _torque_sensor(self) -> SensorDescription:
        name, model, channel = self.TORQUE_SENSOR
        return SensorDescription(
            name=name,
            model=model,
            serial="1",
            channel=channel,
            unit="N*m",
            sample_rate_hz=self._rate_hz,
        )

    def _positioner(self) -> PositionerDescription:
        name, model, channel = self.POSITIONER
        return PositionerDescription(
            name=name,
            model=model,
            serial="1",
            channel=channel,
            sample_rate_hz=self._rate_hz,
            command_timeout_s=_COMMAND_TIMEOUT_S,
            angle_min_rad=-self._reach_rad,
            angle_max_rad=self._reach_rad,
            velocity_rad_s=self.POSITIONER_RAD_S,
        )


def bench_stream(seed: int, *purpose: str | int) -> np.random.Generator:
    """Return the random numbers of one purpose; nothing else draws from them."""
    key = [crc32(str(part).encode()) for part in purpose]
    return np.random.default_rng([seed, *key])
