"""jointz: joint mechanical impedance from recordings, with honest intervals.

Importing the package does nothing but define where its names live; each name
is loaded when it is first used.
"""

import sys
from importlib import import_module

from jointz.former_places import FormerPlaces

TYPE_CHECKING = False  # the module typing takes as long to load as Python
if TYPE_CHECKING:
    from typing import Any

    from jointz import reference, stats
    from jointz.analysis.analyze import analyze
    from jointz.analysis.certify import certify
    from jointz.analysis.saved_analysis import load
    from jointz.control.make_profile import impedance_profile
    from jointz.identify.actuators.actuator import identify_actuator
    from jointz.identify.actuators.bandwidth import identify_bandwidth
    from jointz.identify.bench.dither_stiffness import identify_dither_stiffness
    from jointz.identify.bench.paired_runs import identify_paired_runs
    from jointz.identify.bench.static_stiffness import identify_static_stiffness
    from jointz.identify.over_cycle.phase_curve import phase_curve
    from jointz.identify.over_cycle.time_varying import identify_time_varying
    from jointz.identify.record.joint import identify_joint
    from jointz.io.one_recording import read
    from jointz.io.study_reader import open_study
    from jointz.planning.plan_study import plan
    from jointz.pooling.pool import pool
    from jointz.rig.calibration.calibrate import calibrate
    from jointz.rig.session.run import run
    from jointz.verification.verify import verify

__version__ = "0.1.0"

sys.meta_path.insert(0, FormerPlaces())

_HOMES = {
    "analyze": "jointz.analysis.analyze",
    "calibrate": "jointz.rig.calibration.calibrate",
    "certify": "jointz.analysis.certify",
    "identify_actuator": "jointz.identify.actuators.actuator",
    "identify_bandwidth": "jointz.identify.actuators.bandwidth",
    "identify_dither_stiffness": "jointz.identify.bench.dither_stiffness",
    "identify_joint": "jointz.identify.record.joint",
    "identify_paired_runs": "jointz.identify.bench.paired_runs",
    "identify_static_stiffness": "jointz.identify.bench.static_stiffness",
    "identify_time_varying": "jointz.identify.over_cycle.time_varying",
    "impedance_profile": "jointz.control.make_profile",
    "load": "jointz.analysis.saved_analysis",
    "open_study": "jointz.io.study_reader",
    "phase_curve": "jointz.identify.over_cycle.phase_curve",
    "plan": "jointz.planning.plan_study",
    "pool": "jointz.pooling.pool",
    "read": "jointz.io.one_recording",
    "run": "jointz.rig.session.run",
    "verify": "jointz.verification.verify",
}

#: Packages that belong to the public face.
_ROOMS = ("reference", "stats")

__all__ = [
    "__version__",
    "analyze",
    "calibrate",
    "certify",
    "identify_actuator",
    "identify_bandwidth",
    "identify_dither_stiffness",
    "identify_joint",
    "identify_paired_runs",
    "identify_static_stiffness",
    "identify_time_varying",
    "impedance_profile",
    "load",
    "open_study",
    "phase_curve",
    "plan",
    "pool",
    "read",
    "reference",
    "run",
    "stats",
    "verify",
]


def __getattr__(name: str) -> "Any":
    """Load a public name from its home on first use."""
    if name in _HOMES:
        return getattr(import_module(_HOMES[name]), name)
    if name in _ROOMS:
        return import_module(f"jointz.{name}")
    raise AttributeError(f"module 'jointz' has no attribute {name!r}")


def __dir__() -> list[str]:
    """List the public names."""
    return sorted(__all__)
