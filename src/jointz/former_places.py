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
# ``from jointz.sim import plant`` asks for the module in the present place of ``jointz.sim``.
_SIM = ("jointz.sim", "jointz.rig.sim")
#: Former place -> present place, also of what is in it.
PRESENT = {
    **{f"{sim}.{name}": f"jointz.rig.sim.sensors.{name}" for sim in _SIM for name in _SENSORS},
    **{f"{sim}.{name}": f"jointz.rig.sim.walking.{name}" for sim in _SIM for name in _WALKING},
    **{f"jointz.{name}": f"jointz.rig.{name}" for name in _RIG},
    "jointz.analysis.certificate.study_protocol": "jointz.analysis.study_protocol",
    "jointz.rig.certificate.study_protocol": "jointz.analysis.study_protocol",
    "jointz.analysis.certificate": "jointz.rig.certificate",
    "jointz.control.controllers": "jointz.rig.phase_controllers",
    "jointz.explorer.traces": "jointz.analysis.pulse_traces",
    "jointz.identify.methods": "jointz.identify.regression",
    "jointz.identify.series": "jointz.identify.record",
}


class FormerPlaces:
    """Finder that gives the module of the present place, not a second one."""

    def find_spec(self, name: str, path: object, target: object = None) -> ModuleSpec | None:
        """Return where to load a former name from; None for every other name."""
        del path, target
        if not (present := _present(name)):
            return None
        try:
            # Now, so that no other thread meets the empty module while this one is loaded.
            return ModuleSpec(name, _Loader(import_module(present)))  # type: ignore[arg-type]
        except ModuleNotFoundError as exc:
            if exc.name != present:
                raise
            return None  # it never was


class _Loader:
    def __init__(self, module: ModuleType) -> None:
        self._module = module

    def create_module(self, spec: ModuleSpec) -> None:
        """Have Python make an empty module, which nobody sees."""

    def exec_module(self, module: ModuleType) -> None:
        """Put the module of the present place under the former name."""
        sys.modules[module.__name__] = self._module


def _present(name: str) -> str:
    """Return the present name, "" if the name is no former one."""
    former = name
    while former and former not in PRESENT:
        former = former.rpartition(".")[0]
    return PRESENT[former] + name.removeprefix(former) if former else ""
