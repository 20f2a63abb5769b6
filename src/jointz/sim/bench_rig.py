"""A simulated bench with a known load, as an experiment is handed it."""

from collections.abc import Mapping
from dataclasses import asdict
from math import hypot
from typing import Any
from zlib import crc32

import numpy as np

from jointz.core.clock import Clock
from jointz.core.errors import DataError
from jointz.core.limits import SafetyLimits
from jointz.core.protocol import LoadSpec
from jointz.core.study import Calibrated, CalibrationSpec, TorqueModelSpec
from jointz.devices.interface import (
    ActuatorDescription,
    Devices,
    PositionerDescription,
    SensorDescription,
    Wearer,
)
from jointz.sim.bench_load import BenchLoad, draw_load
from jointz.sim.devices import SimulatedActuator, SimulatedPositioner, SimulatedSensor, Wiring
from jointz.sim.injection import Injection
from jointz.sim.layout import Fault
from jointz.sim.qdd_bench import QddSettings, draw_mounting, qdd_preset
from jointz.sim.qdd_bench_plant import QddBenchPlant
from jointz.sim.running_bench import RunningBench
from jointz.sim.running_plant import Sample
from jointz.sim.sea import SeaSettings, draw_torque_gain, sea_preset
from jointz.sim.sea_plant import SeaPlant

_COMMAND_TIMEOUT_S = 0.1
_SEA_LIMITS = SafetyLimits(
    torque_nm=90.0,
    torque_rate_nm_s=60_000.0,
    current_a=15.0,
    angle_min_rad=-0.7,
    angle_max_rad=0.7,
    velocity_rad_s=40.0,
    temperature_c=110.0,
    sensor_age_s=0.02,
    pulse_count=5000,
    pulse_duty=0.5,
    consecutive_overruns=5,
    fade_s=0.2,
)
#: The sides turn as far as they like.
_TURNS_RAD = 1e4
_AMBIENT_C = 25.0
_QDD_LIMITS = SafetyLimits(
    torque_nm=20.0,
    torque_rate_nm_s=20_000.0,
    current_a=25.0,
    angle_min_rad=-_TURNS_RAD,
    angle_max_rad=_TURNS_RAD,
    velocity_rad_s=30.0,
    temperature_c=90.0,
    sensor_age_s=0.02,
    pulse_count=5000,
    pulse_duty=0.5,
    consecutive_overruns=5,
    fade_s=0.2,
)
#: Sd of the intrinsic impedance (2.3.1), N*m/rad, N*m*s/rad, kg*m^2.
_INTRINSIC_SD = {"stiffness": 0.194, "damping": 0.0130, "inertia": 2.65e-5}


class SeaBench:
    """The series-elastic exoskeleton on its bench, with one load.

    Its joint angle is the encoder's at the output; its torque is the beam's. In
    position control the same motor moves the output.

    Parameters
    ----------
    settings : SeaSettings
        Of the bench.
    load : BenchLoad
        What really hangs there.
    seed : int
        Of everything random.
    sample_rate_hz : float, Hz
        Of all devices.

    Attributes
    ----------
    inject : Injection
        What is to go wrong; nothing at first.
    """

    def __init__(
        self, settings: SeaSettings, load: BenchLoad, *, seed: int, sample_rate_hz: float
    ) -> None:
        self.settings = settings
        self.load = load
        self.inject = Injection()
        self._seed = seed
        self._rate_hz = sample_rate_hz

    @property
    def wearer(self) -> Wearer:
        """The load, in a wearer's place."""
        return Wearer(self.load.name)

    @property
    def calibration(self) -> CalibrationSpec:
        """What the lab knows: the torque's gain and the intrinsic impedance, with their sd.

        The lab does not know the error of its beam, but how far off it may be.
        """
        errors, machine = self.settings.errors, self.settings.machine
        gain_sd = hypot(errors.torque_gain_sd, errors.beam_error)
        known = {
            f"intrinsic_{name}": Calibrated(value=getattr(machine, name), sd=sd)
            for name, sd in _INTRINSIC_SD.items()
        }
        if gain_sd > 0.0:
            known["torque_gain"] = Calibrated(value=1.0, sd=gain_sd)
        return CalibrationSpec(**known)

    def open(self, condition: str, *, worn: bool, segment: int, clock: Clock) -> Devices:
        """Return the devices, ``UNCONFIGURED``, for one trial.

        Parameters
        ----------
        condition : str
            Name of the trial.
        worn : bool
            Without meaning on a bench.
        segment : int
            One more for every time the trial is begun again.
        clock : Clock
            The host's.
        """
        del worn
        noise = bench_stream(self._seed, self.load.name, condition, segment)
        plant = SeaPlant(self.settings, self.load, sample_rate_hz=self._rate_hz, noise=noise)
        running = RunningBench(
            _SeaSamples(plant),
            period_ns=round(1e9 / self._rate_hz),
            timeout_s=_COMMAND_TIMEOUT_S,
            one_motor=True,
        )
        wiring = Wiring(running, clock, self.inject)
        return Devices(
            actuator=SimulatedActuator(wiring, self._actuator()),
            torque=SimulatedSensor(wiring, "torque", self._torque_sensor()),
            positioner=SimulatedPositioner(wiring, running, self._positioner()),
        )

    def notes(self) -> Mapping[str, Any]:
        """Return which bench it is: that it is a simulation is no secret, its truth is."""
        return {
            "simulated": True,
            "bench": "series-elastic",
            "preset": self.settings.name,
            "seed": self._seed,
        }

    def bench_truth(self) -> dict[str, Any]:
        """Return the truth about load and bench, ready for JSON."""
        return {
            "load": asdict(self.load),
            "intrinsic": {name: getattr(self.settings.machine, name) for name in _INTRINSIC_SD},
            "torque_gain": self.settings.total_torque_gain,
            "errors": asdict(self.settings.errors),
            "machine": asdict(self.settings.machine),
            "control": asdict(self.settings.control),
        }

    def _actuator(self) -> ActuatorDescription:
        machine = self.settings.machine
        return ActuatorDescription(
            name="actuator",
            model="jointz simulated series-elastic exoskeleton",
            serial="1",
            firmware="1",
            sample_rate_hz=self._rate_hz,
            command_timeout_s=_COMMAND_TIMEOUT_S,
            limits=_SEA_LIMITS,
            torque_model=TorqueModelSpec(
                gear_ratio=machine.lever_m / machine.nut_travel_m,
                torque_constant=machine.torque_constant,
            ),
            fault_names={int(fault): fault.name.lower() for fault in Fault},
        )

    def _torque_sensor(self) -> SensorDescription:
        return SensorDescription(
            name="beam",
            model="jointz simulated beam between two encoders",
            serial="1",
            channel="torque",
            unit="N*m",
            sample_rate_hz=self._rate_hz,
        )

    def _positioner(self) -> PositionerDescription:
        return PositionerDescription(
            name="motor",
            model="jointz simulated series-elastic exoskeleton, position control",
            serial="1",
            channel="motor_angle",
            sample_rate_hz=self._rate_hz,
            command_timeout_s=_COMMAND_TIMEOUT_S,
            angle_min_rad=-self.settings.machine.stop_rad,
            angle_max_rad=self.settings.machine.stop_rad,
            velocity_rad_s=40.0,
        )


class _SeaSamples:
    """Rows of the physics as the devices give them."""

    __slots__ = ("_plant",)

    def __init__(self, plant: SeaPlant) -> None:
        self._plant = plant

    def sample(self, torque_nm: float, angle_rad: float) -> Sample:
        row = self._plant.advance(torque_nm, angle_rad)
        _, stamp_s, motor_angle, _, current, supply, heat, faults, angle, torque = row
        motor = (angle, self._plant.velocity, current, supply, heat, int(faults))
        return round(stamp_s * 1e9), motor, torque, motor_angle


class QddBench:
    """The quasi-direct-drive actuator on its test bench, with one spring.

    The joint angle is the torque motor's own; the far side's stands beside it. Torque is
    computed from the current by model 3.3 with the constants stated; the torque sensor
    stands beside it too.

    Parameters
    ----------
    settings : QddSettings
        Of the bench.
    load : BenchLoad
        The spring that is really there.
    seed : int
        Of everything random.
    sample_rate_hz : float, Hz
        Of all devices.

    Attributes
    ----------
    inject : Injection
        What is to go wrong; nothing at first.
    """

    def __init__(
        self, settings: QddSettings, load: BenchLoad, *, seed: int, sample_rate_hz: float
    ) -> None:
        self.settings = settings
        self.load = load
        self.inject = Injection()
        self._seed = seed
        self._rate_hz = sample_rate_hz

    @property
    def wearer(self) -> Wearer:
        """The load, in a wearer's place."""
        return Wearer(self.load.name)

    @property
    def calibration(self) -> CalibrationSpec:
        """Nothing: the torque model is what is being calibrated."""
        return CalibrationSpec()

    def open(self, condition: str, *, worn: bool, segment: int, clock: Clock) -> Devices:
        """Return the devices, ``UNCONFIGURED``, for one trial.

        Parameters
        ----------
        condition : str
            Name of the trial.
        worn : bool
            Without meaning on a bench.
        segment : int
            One more for every time the trial is begun again.
        clock : Clock
            The host's.
        """
        del worn
        noise = bench_stream(self._seed, self.load.name, condition, segment)
        plant = QddBenchPlant(self.settings, self.load, sample_rate_hz=self._rate_hz, noise=noise)
        running = RunningBench(
            _QddSamples(plant, self._rate_hz),
            period_ns=round(1e9 / self._rate_hz),
            timeout_s=_COMMAND_TIMEOUT_S,
            one_motor=False,
        )
        wiring = Wiring(running, clock, self.inject)
        return Devices(
            actuator=SimulatedActuator(wiring, self._actuator()),
            torque=SimulatedSensor(wiring, "torque", self._torque_sensor()),
            positioner=SimulatedPositioner(wiring, running, self._positioner()),
        )

    def notes(self) -> Mapping[str, Any]:
        """Return which bench it is: that it is a simulation is no secret, its truth is."""
        return {
            "simulated": True,
            "bench": "quasi-direct-drive",
            "preset": self.settings.name,
            "seed": self._seed,
        }

    def bench_truth(self) -> dict[str, Any]:
        """Return the truth about load and bench, ready for JSON."""
        return {
            "load": asdict(self.load),
            "sensor_gain": self.settings.sensor_gain,
            "ripple_phase_rad": self.settings.ripple_phase_rad,
            "errors": asdict(self.settings.errors),
            "machine": asdict(self.settings.machine),
        }

    def _actuator(self) -> ActuatorDescription:
        machine = self.settings.machine
        return ActuatorDescription(
            name="actuator",
            model="jointz simulated quasi-direct drive",
            serial="1",
            firmware="1",
            sample_rate_hz=self._rate_hz,
            command_timeout_s=_COMMAND_TIMEOUT_S,
            limits=_QDD_LIMITS,
            torque_model=TorqueModelSpec(
                gear_ratio=machine.gear_ratio,
                torque_constant=machine.torque_constant,
                coulomb_friction=machine.coulomb_friction,
                gear_friction=machine.gear_friction,
                rotor_inertia=machine.rotor_inertia,
            ),
            fault_names={int(fault): fault.name.lower() for fault in Fault},
        )

    def _torque_sensor(self) -> SensorDescription:
        return SensorDescription(
            name="torque sensor",
            model="jointz simulated torque sensor",
            serial="1",
            channel="sensor_torque",
            unit="N*m",
            sample_rate_hz=self._rate_hz,
        )

    def _positioner(self) -> PositionerDescription:
        return PositionerDescription(
            name="position motor",
            model="jointz simulated position motor behind 50:1",
            serial="1",
            channel="position",
            sample_rate_hz=self._rate_hz,
            command_timeout_s=_COMMAND_TIMEOUT_S,
            angle_min_rad=-_TURNS_RAD,
            angle_max_rad=_TURNS_RAD,
            velocity_rad_s=20.0,
        )


class _QddSamples:
    """Rows of the physics as the devices give them."""

    __slots__ = ("_number", "_period_ns", "_plant")

    def __init__(self, plant: QddBenchPlant, rate_hz: float) -> None:
        self._plant = plant
        self._period_ns = round(1e9 / rate_hz)
        self._number = 0

    def sample(self, torque_nm: float, angle_rad: float) -> Sample:
        angle, velocity, current, supply, torque, far = self._plant.advance(torque_nm, angle_rad)
        time_ns = self._number * self._period_ns
        self._number += 1
        return time_ns, (angle, velocity, current, supply, _AMBIENT_C, 0), torque, far


def bench_stream(seed: int, *purpose: str | int) -> np.random.Generator:
    """Return the random numbers of one purpose; nothing else draws from them.

    Parameters
    ----------
    seed : int
        Of the bench.
    *purpose : str or int
        What they are for.
    """
    key = [crc32(str(part).encode()) for part in purpose]
    return np.random.default_rng([seed, *key])


def simulated_bench(
    bench: str, load: LoadSpec, *, preset: str = "nominal", seed: int = 1, sample_rate_hz: float
) -> SeaBench | QddBench:
    """Return a bench with one load.

    The bench is one and the same for all loads: its calibration error is drawn once.

    Parameters
    ----------
    bench : str
        ``series-elastic`` or ``quasi-direct-drive``.
    load : LoadSpec
        As the protocol states it; what really hangs there is drawn within its sd, but in
        the preset ``clean``.
    preset : str
        ``clean``, ``nominal`` or ``hard``.
    seed : int
        Of everything random.
    sample_rate_hz : float, Hz
        Of all devices.

    Raises
    ------
    DataError
        When there is no such bench.
    """
    hung = draw_load(load, seed=seed, spread=preset != "clean")
    gain = bench_stream(seed, "gain")
    if bench == "series-elastic":
        sea = draw_torque_gain(sea_preset(preset), gain)
        return SeaBench(sea, hung, seed=seed, sample_rate_hz=sample_rate_hz)
    if bench == "quasi-direct-drive":
        qdd = draw_mounting(qdd_preset(preset), gain)
        return QddBench(qdd, hung, seed=seed, sample_rate_hz=sample_rate_hz)
    raise DataError(f"bench: expected series-elastic or quasi-direct-drive; got {bench!r}.")
