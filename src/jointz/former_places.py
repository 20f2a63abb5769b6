"""Modules that have moved: packages and scripts of labs import them from where they were."""

import sys
from importlib import import_module
from importlib.machinery import ModuleSpec
from types import ModuleType

_RIG = ("calibration", "console", "devices", "experiment", "session", "sim", "testing")
_SENSORS = (
    "footswitch_model",
    "moment_measurement",
    "motion_sensors",
    "sampled_time",
    "sensor_settings",
)
_WALKING = (
    "gait_motion",
    "impedance_curves",
    "injection",
    "internal_moment",
    "knee_joint",
    "layout",
    "path",
    "plant",
    "plant_build",
)
#: Former place -> present place, also of what is in it.
PRESENT = {
    **{f"jointz.sim.{name}": f"jointz.rig.sim.sensors.{name}" for name in _SENSORS},
    **{f"jointz.sim.{name}": f"jointz.rig.sim.walking.{name}" for name in _WALKING},
    **{f"jointz.{name}": f"jointz.rig.{name}" for name in _RIG},
    "jointz.analysis.certificate.study_protocol": "jointz.analysis.study_protocol",
    "jointz.analysis.certificate": "jointz.rig.certificate",
    "jointz.control.controllers": "jointz.rig.phase_controllers",
    "jointz.identify.methods": "jointz.identify.regression",
    "jointz.identify.series": "jointz.identify.record",
}


class FormerPlaces:
    """Finder and loader that give the module of the present place, not a second one."""

    def find_spec(self, name: str, path: object, target: object = None) -> ModuleSpec | None:
        """Return where to load a former name from; None for every other name."""
        del path, target
        return ModuleSpec(name, self) if _present(name) else None  # type: ignore[arg-type]

    def create_module(self, spec: ModuleSpec) -> None:
        """Have Python make an empty module, which nobody sees."""

    def exec_module(self, module: ModuleType) -> None:
        """Put the module of the present place under the former name."""
        sys.modules[module.__name__] = import_module(_present(module.__name__))


def _present(name: str) -> str:
    """Return the present name, "" if the name is no former one."""
    for former, present in PRESENT.items():
        if name == former or name.startswith(f"{former}."):
            return present + name.removeprefix(former)
    return ""
