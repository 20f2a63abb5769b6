"""Walking with doublets and a device strapped to the leg: a study that the method strapped decides.

The person is one of the preset ``anthropometric`` of :mod:`jointz.rig.sim`, not of this package's
physics; mistakes and files are the benchmark's.
"""

from typing import Any

import numpy as np
import xarray as xr
from benchmarks.planted_errors.physics import CLIP, POINTS, Recording, Truth, actuate

from jointz.core.protocols.pulse_models import DoubletPulse
from jointz.identify.preparation.conditioning import torque_from_current
from jointz.rig.devices.interface import Stretch
from jointz.rig.sim import direct_walk
from jointz.rig.sim.descriptions import exoskeleton
from jointz.rig.sim.direct_walk import QUICK_GRID, Walk, WalkPlan, walk_directly
from jointz.rig.sim.people import Person, draw_person
from jointz.rig.sim.presets import preset
from jointz.rig.sim.rig import SimulatedRig

Params = dict[str, Any]
WINDOW_S = 0.15
_PULSES = (
    DoubletPulse(
        name="short",
        kind="doublet",
        amplitudes_nm=(10.0, 17.0),
        durations_s=(0.040, 0.022),
        direction="both",
    ),
    DoubletPulse(
        name="long",
        kind="doublet",
        amplitudes_nm=(7.0, 12.0),
        durations_s=(0.092, 0.050),
        direction="both",
    ),
)
_PLAN = WalkPlan(pulses=_PULSES, per_point=48, timing_points=POINTS)
_UNPERTURBED = WalkPlan(per_point=0, warm_up_strides=60)
_RATE = 500


def person_of(seed: int) -> Person:
    """Draw a person."""
    return draw_person(0, seed=seed)


def drawn_strapped(seed: int) -> Params:
    """Settings of the files; the pulses are those of the protocol ``walking_doublets``."""
    person = person_of(seed)
    return {
        "seed": seed,
        "mass": person.mass_kg,
        "height": person.height_m,
        "points": list(POINTS),
        "rate": _RATE,
        "amplitude": 17.0,
        "motor_s": 0.006,
        "people": 1,
        "body": True,
        "lag_known": False,
        "clock": True,
        "table": True,
    }


def walk_strapped(p: Params, condition: str, *, perturbed: bool) -> tuple[Recording, Truth]:
    """One recording of the person of a seed, and what K, B and J are at each timing point."""
    rig = SimulatedRig(person_of(p["seed"]), preset("anthropometric"), grid=QUICK_GRID)
    plan = _PLAN if perturbed else _UNPERTURBED
    clipped = p["fault"] == "clip_applied"
    walk = _clipped_walk(rig, condition, plan) if clipped else _walk(rig, condition, plan)
    recording = Recording(
        rate=_RATE,
        angle=np.asarray(walk.channels["angle"]),
        torque=_torque(rig, walk),
        command=np.asarray(walk.channels["command"]),
        contact=np.asarray(walk.channels["contact"]),
    )
    if clipped:
        missing = recording.command - _clipped(recording.command)
        every = 2000 // _RATE
        recording.torque = (
            recording.torque + actuate(np.repeat(missing, every), p["motor_s"])[::every]
        )
    names = ["onset_s", "duration_s", "amplitude_nm", "timing_point"]
    recording.pulses = walk.pulses[names].to_dict("records")
    return recording, _truth(rig, walk, plan) if perturbed else {}


def _walk(rig: SimulatedRig, condition: str, plan: WalkPlan) -> Walk:
    return walk_directly(rig, condition, plan=plan)


def _clipped(command: np.ndarray) -> np.ndarray:
    limit = CLIP * max(size for pulse in _PULSES for size in pulse.amplitudes_nm)
    return np.clip(command, -limit, limit)


def _clipped_walk(rig: SimulatedRig, condition: str, plan: WalkPlan) -> Walk:
    """Walk with a motor that gives less than its command."""
    advance = direct_walk._advance
    try:
        direct_walk._advance = lambda build, strides, command, *others: advance(
            build, strides, _clipped(command), *others
        )
        return _walk(rig, condition, plan)
    finally:
        direct_walk._advance = advance


def _torque(rig: SimulatedRig, walk: Walk) -> np.ndarray:
    """Torque of the actuator, without its friction and the inertia of its rotor."""
    model = exoskeleton(rig.build(worn=True)).torque_model
    names = ("current", "motor_angle", "motor_velocity")
    data = xr.Dataset(
        {name: ("time", walk.channels[name]) for name in names}, coords={"time": walk.time_s}
    )
    torque, _ = torque_from_current(data, model, cutoff_hz=20.0)
    return np.nan_to_num(np.asarray(torque))


def _truth(rig: SimulatedRig, walk: Walk, plan: WalkPlan) -> Truth:
    """Means over the window of the pulses; K includes gravity, J the device."""
    told = rig.truth(
        "perturbed",
        worn=True,
        stretches=[Stretch(0, 0.0, walk.end_s)],
        pulses=walk.pulses,
        shapes=plan.shapes,
        window_s=WINDOW_S,
    )
    truth: Truth = {"*": {}}
    for name, means in told["timing_points"].items():
        stiffness = means["stiffness"] + means["gravity_stiffness"]
        point = {"stiffness": stiffness, "damping": means["damping"], "inertia": means["inertia"]}
        for per_mass in ("stiffness", "damping"):
            point[f"{per_mass}_per_mass"] = point[per_mass] / rig.person.mass_kg
        truth[name] = point
    return truth
