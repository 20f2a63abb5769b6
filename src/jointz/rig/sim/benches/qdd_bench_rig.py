"""The simulated quasi-direct drive on its bench, as an experiment is handed it."""

from dataclasses import asdict, replace
from math import hypot
from typing import Any

from jointz.core.limits import SafetyLimits
from jointz.core.study import Calibrated, CalibrationSpec, TorqueModelSpec
from jointz.rig.sim.benches.loaded_bench import LoadedBench
from jointz.rig.sim.benches.qdd_bench import QddSettings
from jointz.rig.sim.benches.qdd_bench_plant import QddBenchPlant
from jointz.rig.sim.descriptions import torque_model_of

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

    PLANT = QddBenchPlant
    BENCH = "quasi-direct-drive"
    ONE_MOTOR = False
    ACTUATOR_MODEL = "jointz simulated quasi-direct drive"
    LIMITS = _LIMITS
    TORQUE_SENSOR = ("torque sensor", "jointz simulated torque sensor", "sensor_torque")
    POSITIONER = ("position motor", "jointz simulated position motor behind 50:1", "position")
    POSITIONER_RAD_S = 20.0

    @property
    def calibration(self) -> CalibrationSpec:
        """SD of the gain of model 3.3, as a laboratory knows it.

        The model was fitted to the torque sensor and has the error of that sensor's gain, and an
        error of its own; of both the laboratory knows the size only.
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
        return torque_model_of(self.settings.machine)

    @property
    def _reach_rad(self) -> float:
        return _TURNS_RAD
