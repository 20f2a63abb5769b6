"""Inertia and weight of shank and foot about the knee, from body mass and height."""

from dataclasses import dataclass, replace

from jointz.core.priors import LogPrior, PriorsSpec
from jointz.core.study import ParticipantSpec
from jointz.reference.body_segments import leg_beyond

#: A free hip lets the thigh move along: apparent over rigid inertia, seen 0.3 to 1.
_FREE_HIP = 0.65
_DEVICE = 0.02  # kg*m^2
#: Cosine of a usual angle of the shank from the vertical.
_USUAL_POSTURE = 0.93


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
    leg = leg_beyond("knee", mass, height)
    ratio, per_mass = priors.inertia_over_body, priors.stiffness_per_mass
    stiffness = LogPrior(median=per_mass.median * mass, log_sd=per_mass.log_sd)
    if not of_body:
        return replace(unknown, stiffness=stiffness)
    inertia = ratio.median * (_FREE_HIP * leg.inertia + _DEVICE)
    return replace(
        unknown,
        inertia=LogPrior(median=inertia, log_sd=ratio.log_sd),
        stiffness=stiffness,
        gravity_stiffness=_USUAL_POSTURE * leg.moment_nm,
        known=True,
    )
