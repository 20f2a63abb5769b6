r"""The physics of a calibration: the walking plant with another joint on another path.

Actuator and goniometer are those of the same person in walking. Joint and path are constant:
with x the deviation from the posture,
:math:`J\ddot x + B\dot x + Kx + g(\sin(s + x) - \sin s) = \tau`, s being the angle of what hangs
from the vertical, g weight times distance.
"""

from dataclasses import dataclass, replace
from math import exp, sqrt

import numpy as np

from jointz.core.protocols.protocol import LoadSpec
from jointz.sim.benches.bench_load import BenchLoad, draw_load
from jointz.sim.impedance_curves import frame_gravity, leg_of
from jointz.sim.layout import CURVE_PIECES, CURVES, Param
from jointz.sim.people import Person
from jointz.sim.plant_build import PlantBuild
from jointz.sim.presets import Preset

# What is held: 12 N*m turn it by 12 urad, a hundredth of what a goniometer on it shows.
_HELD_STIFFNESS, _HELD_DAMPING, _HELD_INERTIA = 1e6, 1400.0, 1.0
# Where the joint is, rad of flexion: far from the device's limits where it swings.
_STRAIGHT, _LOCKED, _MIDDLE, _SITTING = 0.0, 0.35, 0.9, 1.2
_FIXTURE_INERTIA = 0.005  # kg*m^2, between spring and output
# A relaxed leg: passive stiffness (N*m/rad) and damping ratio, and how people differ.
_PASSIVE_STIFFNESS, _PASSIVE_RATIO, _PASSIVE_SPREAD = 4.0, 0.08, 0.2


@dataclass(frozen=True, slots=True)
class CalibratedBody:
    """The body that the actuator moves in one condition of a calibration."""

    # beyond the place where torque is measured; on a leg, beyond the strap
    stiffness: float  # N*m/rad
    damping: float  # N*m*s/rad
    inertia: float  # kg*m^2
    gravity_nm: float  # weight times distance of a body that hangs; 0 if it is held or lies
    posture_rad: float  # angle of the joint about which it moves
    # whether strap and goniometer are on the leg, with tissue and torsion; otherwise both are rigid
    on_leg: bool


def held_body(step: str) -> CalibratedBody:
    """Return a joint that is held still, or moved by hand whatever the torque."""
    posture = {"zero": _STRAIGHT, "hinge": _MIDDLE, "torsion": _LOCKED}[step]
    return CalibratedBody(
        _HELD_STIFFNESS, _HELD_DAMPING, _HELD_INERTIA, 0.0, posture, on_leg=step != "hinge"
    )


def frame_body(preset: Preset) -> CalibratedBody:
    """Return the exoskeleton's frame, hanging alone; nothing where the preset gives it none."""
    body = preset.body
    if body is None:
        return CalibratedBody(0.0, 0.0, 0.0, 0.0, _MIDDLE, on_leg=False)
    inertia = body.frame_mass_kg * body.frame_distance_m**2
    gravity = frame_gravity(body.frame_mass_kg, body.frame_distance_m)
    return CalibratedBody(0.0, 0.0, inertia, gravity, _MIDDLE, on_leg=False)


def spring_body(preset: Preset, spring: BenchLoad) -> CalibratedBody:
    """Return a known spring on the frame, which lies so that gravity does not turn it."""
    inertia = frame_body(preset).inertia + _FIXTURE_INERTIA + spring.inertia
    return CalibratedBody(spring.stiffness, spring.damping, inertia, 0.0, _MIDDLE, on_leg=False)


def hanging_leg(person: Person, preset: Preset, weight: BenchLoad | None) -> CalibratedBody:
    """Return the relaxed leg that hangs, the thigh on a bench."""
    leg = leg_of(person)
    inertia = person.inertia if preset.body is None else leg.inertia
    gravity = leg.gravity_nm * inertia / leg.inertia
    deviations = np.clip(person.stream("hanging leg").standard_normal(2), -3.0, 3.0).tolist()
    stiffness, ratio = (
        mean * exp(_PASSIVE_SPREAD * deviation)
        for mean, deviation in zip((_PASSIVE_STIFFNESS, _PASSIVE_RATIO), deviations, strict=True)
    )
    # The leg's own: what is strapped to it hangs on the same muscles.
    damping = 2.0 * ratio * sqrt((stiffness + gravity) * inertia)
    if weight is not None:
        inertia, gravity = inertia + weight.inertia, gravity + weight.stiffness
    return CalibratedBody(stiffness, damping, inertia, gravity, _SITTING, on_leg=True)


def draw_known_load(spec: LoadSpec, person: Person, preset: Preset) -> BenchLoad:
    """Return what is really mounted: the load stated, or one drawn within its sd.

    Every person has one of their own, as after every mounting.
    """
    seed = int(person.stream("known loads").integers(2**32))
    return draw_load(spec, seed=seed, spread=preset.name != "clean")


def calibrated_plant(build: PlantBuild, body: CalibratedBody) -> PlantBuild:
    """Return the plant of walking with another joint."""
    params = build.params.copy()
    params[Param.LIMB_GRAVITY] = body.gravity_nm
    for place in (Param.SOFTENING, Param.REFLEX_GAIN, Param.VOLUNTARY_DRIVE):
        params[place] = 0.0
    if not body.on_leg:
        # The frame is the body then; the rotor alone turns with the motor.
        params[Param.EXO_INERTIA] = build.preset.actuator.rotor_inertia
        for place in (Param.STRAP_STIFFNESS, Param.EXO_GRAVITY, Param.TISSUE_RATE, Param.TORSION):
            params[place] = 0.0
    curves = np.zeros((CURVE_PIECES, 4 * CURVES))
    # The thigh is so that what hangs, hangs; on what is held gravity has no effect.
    constants = (body.stiffness, body.damping, body.inertia, body.posture_rad)
    curves[:, ::4] = constants
    return replace(build, params=params, curves=curves)
