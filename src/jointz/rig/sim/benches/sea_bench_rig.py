"""The simulated series-elastic exoskeleton on its bench, as an experiment is handed it."""

from dataclasses import asdict
from math import hypot
from typing import Any

from jointz.core.limits import SafetyLimits
from jointz.core.study import Calibrated, CalibrationSpec, TorqueModelSpec
from jointz.rig.sim.benches.loaded_bench import LoadedBench
from jointz.rig.sim.benches.sea import SeaSettings
from jointz.rig.sim.benches.sea_plant import SeaPlant

_LIMITS = SafetyLimits(
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
#: Sd of the intrinsic impedance (2.3.1), N*m/rad, N*m*s/rad, kg*m^2.
_INTRINSIC_SD = {"stiffness": 0.194, "damping": 0.0130, "inertia": 2.65e-5}


class SeaBench(LoadedBench[SeaSettings]):
    """The series-elastic exoskeleton on its bench, with one load.

    Its joint angle is the encoder's at the output; its torque is the beam's. In
    position control the same motor moves the output.
    """

    PLANT = SeaPlant
    BENCH = "series-elastic"
    ONE_MOTOR = True
    ACTUATOR_MODEL = "jointz simulated series-elastic exoskeleton"
    LIMITS = _LIMITS
    TORQUE_SENSOR = ("beam", "jointz simulated beam between two encoders", "torque")
    POSITIONER = ("motor", f"{ACTUATOR_MODEL}, position control", "motor_angle")
    POSITIONER_RAD_S = 40.0

    @property
    def calibration(self) -> CalibrationSpec:
        """Gain of the torque and intrinsic impedance as a laboratory knows them, with SD.

        Of the beam's error the laboratory knows the size only.
        """
        errors, machine = self.settings.errors, self.settings.machine
        gain_sd = hypot(errors.torque_gain_sd, errors.beam_error)
        entries = {
            f"intrinsic_{name}": Calibrated(value=getattr(machine, name), sd=sd)
            for name, sd in _INTRINSIC_SD.items()
        }
        if gain_sd > 0.0:
            entries["torque_gain"] = Calibrated(value=1.0, sd=gain_sd)
        return CalibrationSpec(**entries)

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

    @property
    def _torque_model(self) -> TorqueModelSpec:
        machine = self.settings.machine
        return TorqueModelSpec(
            gear_ratio=machine.lever_m / machine.nut_travel_m,
            torque_constant=machine.torque_constant,
        )

    @property
    def _reach_rad(self) -> float:
        return self.settings.machine.stop_rad
