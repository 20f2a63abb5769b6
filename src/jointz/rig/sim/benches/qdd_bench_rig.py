"""The simulated quasi-direct drive on its bench, as an experiment is handed it."""

from dataclasses import asdict, replace
from math import hypot
from typing import Any, ClassVar

from jointz.core.limits import SafetyLimits
from jointz.core.study import Calibrated, CalibrationSpec, TorqueModelSpec
from jointz.rig.sim.benches.loaded_bench import BenchLabels, LoadedBench
from jointz.rig.sim.benches.qdd_bench import QddSettings
from jointz.rig.sim.benches.qdd_bench_plant import QddBenchPlant

#: The sides turn as far as they like.
_TURNS_RAD = 1e4
_LIMITS = SafetyLimits(
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


class QddBench(LoadedBench[QddSettings]):
    """The quasi-direct-drive actuator on its test bench, with one spring.

    The joint angle is the torque motor's own; the far side's stands beside it. Torque is
    computed from the current by model 3.3 with the constants stated; the torque sensor
    stands beside it too.
    """

    LABELS: ClassVar[BenchLabels] = BenchLabels(
        kind="quasi-direct-drive",
        one_motor=False,
        actuator_model="jointz simulated quasi-direct drive",
        limits=_LIMITS,
        torque_sensor=("torque sensor", "jointz simulated torque sensor", "sensor_torque"),
        positioner=("position motor", "jointz simulated position motor behind 50:1", "position"),
        positioner_rad_s=20.0,
    )

    PLANT = QddBenchPlant

    @property
    def calibration(self) -> CalibrationSpec:
        """What the lab knows of model 3.3: how far its gain may be off.

        The model was fitted to the torque sensor, and is off by that sensor's gain; what it
        is off besides the lab does not know, but how much that may be.
        """
        errors = self.settings.errors
        gain_sd = hypot(errors.sensor_gain_sd, errors.torque_constant_error)
        if gain_sd == 0.0:
            return CalibrationSpec()
        return CalibrationSpec(torque_gain=Calibrated(value=1.0, sd=gain_sd))

    def bench_truth(self) -> dict[str, Any]:
        """Return the truth about load and bench, ready for JSON."""
        damping = self.settings.machine.spring_damping + self.load.damping
        return {
            "load": asdict(replace(self.load, damping=damping)),
            "sensor_gain": self.settings.sensor_gain,
            "ripple_phase_rad": self.settings.ripple_phase_rad,
            "errors": asdict(self.settings.errors),
            "machine": asdict(self.settings.machine),
        }

    @property
    def _torque_model(self) -> TorqueModelSpec:
        machine = self.settings.machine
        return TorqueModelSpec(
            gear_ratio=machine.gear_ratio,
            torque_constant=machine.torque_constant,
            coulomb_friction=machine.coulomb_friction,
            gear_friction=machine.gear_friction,
            rotor_inertia=machine.rotor_inertia,
        )

    @property
    def _reach_rad(self) -> float:
        return _TURNS_RAD
