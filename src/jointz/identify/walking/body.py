"""Inertia and weight of shank and foot about the knee, from body mass and height."""

from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from jointz.core.priors import LogPrior, PriorsSpec
from jointz.core.study import ParticipantSpec

_GRAVITY = 9.81  # m/s^2
#: A free hip lets the thigh move along: apparent over rigid inertia, seen 0.3 to 1.
_FREE_HIP = 0.65
_DEVICE = 0.02  # kg*m^2
#: Height of the ankle above the centre line of the foot, m.
_ANKLE_M = 0.04
#: Cosine of a usual angle of the shank from the vertical.
_USUAL_POSTURE = 0.93


class _Proportions(NamedTuple):
    """Shares of body mass and segment length; lengths as shares of height."""

    shank_mass: float
    shank_centre: float
    shank_gyration: float
    shank_length: float
    foot_mass: float
    foot_centre: float
    foot_gyration: float
    foot_length: float


# P. de Leva, "Adjustments to Zatsiorsky-Seluyanov's segment inertia parameters", J Biomech 29,
# 1223 (1996), table 4: men (1.741 m) and women (1.735 m).
_DE_LEVA = (
    _Proportions(0.0433, 0.4459, 0.249, 0.4340 / 1.741, 0.0137, 0.4415, 0.245, 0.2581 / 1.741),
    _Proportions(0.0481, 0.4416, 0.267, 0.4323 / 1.735, 0.0129, 0.4014, 0.279, 0.2283 / 1.735),
)


@dataclass(frozen=True, slots=True)
class Body:
    """Priors of a person's leg from body mass and height."""

    inertia: LogPrior  # kg*m^2: leg and device about the joint
    stiffness: LogPrior  # N*m/rad: mean stiffness of the person
    gravity_stiffness: float  # N*m/rad: part of K by gravity, which does not soften; 0 if not known
    inertia_of_point_sd: float  # sd of log inertia of a timing point about that of the person
    known: bool  # whether the inertia follows from mass and height


def body_of(
    person: ParticipantSpec | None, joint: str, priors: PriorsSpec, *, of_body: bool = True
) -> Body:
    """Return the priors of a person's inertia and stiffness.

    Unless the inertia is ``of_body``, it is that of an unknown body.
    """
    unknown = Body(
        inertia=priors.inertia_unknown_body,
        stiffness=priors.stiffness_unknown_body,
        gravity_stiffness=0.0,
        inertia_of_point_sd=priors.inertia_of_point.sd,
        known=False,
    )
    mass = None if person is None else person.mass_kg
    height = None if person is None else person.height_m
    if mass is None or height is None or "knee" not in joint.lower():
        return unknown
    inertia, moment = shank_and_foot(mass, height)
    ratio, per_mass = priors.inertia_over_body, priors.stiffness_per_mass
    stiffness = LogPrior(median=per_mass.median * mass, log_sd=per_mass.log_sd)
    if not of_body:
        return replace(unknown, stiffness=stiffness)
    return Body(
        inertia=LogPrior(
            median=ratio.median * (_FREE_HIP * inertia + _DEVICE), log_sd=ratio.log_sd
        ),
        stiffness=stiffness,
        gravity_stiffness=_USUAL_POSTURE * moment,
        inertia_of_point_sd=priors.inertia_of_point.sd,
        known=True,
    )


def shank_and_foot(mass_kg: float, height_m: float) -> tuple[float, float]:
    """Return inertia (kg*m^2) and weight times distance (N*m) about the knee, mean of the sexes."""
    inertias, moments = [], []
    for p in _DE_LEVA:
        shank, foot = p.shank_length * height_m, p.foot_length * height_m
        below = shank + _ANKLE_M
        inertias.append(
            p.shank_mass * mass_kg * shank**2 * (p.shank_centre**2 + p.shank_gyration**2)
            + p.foot_mass
            * mass_kg
            * (below**2 + ((p.foot_centre - 0.25) * foot) ** 2 + (p.foot_gyration * foot) ** 2)
        )
        moments.append(
            _GRAVITY * mass_kg * (p.shank_mass * p.shank_centre * shank + p.foot_mass * below)
        )
    return float(np.mean(inertias)), float(np.mean(moments))
