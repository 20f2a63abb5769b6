"""One participant of a row: recordings as a study would hold them, and the truth beside them."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from benchmarks.accuracy.rows import Row

from jointz.core.gait_phases import TIMING_POINTS
from jointz.core.study import Calibrated, CalibrationSpec, PerturbationsSpec
from jointz.identify.preparation.sources import ParticipantSettings, RecordingInput
from jointz.identify.study_kinds import WALKING
from jointz.rig.devices.interface import Stretch
from jointz.rig.sim.descriptions import exoskeleton
from jointz.rig.sim.direct_walk import QUICK_GRID, WALKING_PULSE, Walk, WalkPlan, walk_directly
from jointz.rig.sim.own_truth import cell_truth as cell_truth
from jointz.rig.sim.people import Person, draw_person
from jointz.rig.sim.rig import SimulatedRig


@dataclass(frozen=True, slots=True)
class Priors:
    """Log-normal distributions that K, B and J of a rig are drawn from.

    Parameters
    ----------
    stiffness, damping, inertia : tuple of float
        Median (SI) and standard deviation of the logarithm.
    """

    stiffness: tuple[float, float] = (50.0, 0.8)
    damping: tuple[float, float] = (2.5, 0.6)
    inertia: tuple[float, float] = (0.08, 0.6)


#: Over what calibration is tested. The method's own priors are wider still, down to zero and
#: below: 17 N*m would swing such a leg around.
PRIORS = Priors()

#: As the walking protocol has them: strides walked without pulses, bootstrap resamples.
UNPERTURBED_STRIDES = 60
RESAMPLES = 1000


@dataclass(frozen=True, slots=True)
class Simulated:
    """A participant who walked.

    Parameters
    ----------
    rig : SimulatedRig
        Who in what.
    walk, level : Walk
        With pulses and without.
    recordings : tuple of RecordingInput
        What the study holds: perturbed and unperturbed.
    truth : mapping
        As the simulation writes it, of the perturbed walk.
    """

    rig: SimulatedRig
    walk: Walk
    level: Walk
    recordings: tuple[RecordingInput, ...]
    truth: dict[str, Any]


def rig_of(row: Row, number: int, seed: int) -> SimulatedRig:
    """Build the rig of a row's participant; the person is the same in every row.

    Parameters
    ----------
    row : Row
        Which row.
    number, seed : int
        Participant, and seed of the population.
    """
    person = draw_person(number, seed=seed)
    if row.from_priors:
        person = _from_priors(person, PRIORS)
    return SimulatedRig(_with_stiffness(person, row), row.preset, grid=QUICK_GRID)


def simulate(row: Row, number: int, seed: int) -> Simulated:
    """Let one participant of a row walk with and without pulses.

    Parameters
    ----------
    row : Row
        Which row.
    number, seed : int
        Participant, and seed of the population.
    """
    rig = rig_of(row, number, seed)
    walk = walk_directly(rig, "perturbed", plan=WalkPlan(per_point=row.per_point))
    level = walk_directly(
        rig, "unperturbed", plan=WalkPlan(per_point=0, warm_up_strides=UNPERTURBED_STRIDES)
    )
    truth = rig.truth(
        "perturbed",
        worn=True,
        stretches=[Stretch(0, 0.0, walk.end_s)],
        pulses=walk.pulses,
        shapes={"": WALKING_PULSE},
    )
    return as_known(Simulated(rig, walk, level, (), truth), row)


def walk_key(row: Row) -> str:
    """Return what tells whether two rows are walked alike: they differ in what is known.

    Parameters
    ----------
    row : Row
        Which row.
    """
    return repr((row.preset, row.per_point, sorted(row.stiffness.items()), row.from_priors))


def as_known(simulated: Simulated, row: Row) -> Simulated:
    """Return a walk as the study of another row of the same walks holds it.

    Parameters
    ----------
    simulated : Simulated
        Who walked.
    row : Row
        For what is known.
    """
    known = _calibration(simulated.rig, row)
    who = simulated.rig.person.id
    level, walk = (
        given.recording(condition, participant=who, file=f"{who}_{condition}.nc")
        for given, condition in ((simulated.level, "unperturbed"), (simulated.walk, "perturbed"))
    )
    recordings = (
        RecordingInput(level, known),
        RecordingInput(walk, known, simulated.walk.pulse_table),
    )
    return replace(simulated, recordings=recordings)


def settings_of(row: Row, rig: SimulatedRig, methods: Sequence[str]) -> ParticipantSettings:
    """Return what an analysis of the row's study would be asked for.

    Parameters
    ----------
    row : Row
        Which row.
    rig : SimulatedRig
        Its participant.
    methods : sequence of str
        Names of methods.
    """
    return ParticipantSettings(
        kind=WALKING,
        perturbations=PerturbationsSpec(timing_points=dict(TIMING_POINTS), source="table"),
        torque_model=exoskeleton(rig.build(worn=True)).torque_model,
        methods=tuple(methods),
        n_resamples=RESAMPLES,
        mass_kg=rig.person.mass_kg,
        coupling="rigid" if row.preset.body is None else "strap",
    )


def _from_priors(person: Person, priors: Priors) -> Person:
    rng = person.stream("benchmark: priors")

    def drawn(prior: tuple[float, float], scale: float = 1.0) -> float:
        return float(scale * prior[0] * np.exp(prior[1] * rng.standard_normal()))

    per_kg = 1.0 / person.mass_kg
    return replace(
        person,
        stiffness_per_mass={p: drawn(priors.stiffness, per_kg) for p in TIMING_POINTS},
        damping_per_mass={p: drawn(priors.damping, per_kg) for p in TIMING_POINTS},
        inertia=drawn(priors.inertia),
    )


def _with_stiffness(person: Person, row: Row) -> Person:
    own = {point: value / person.mass_kg for point, value in row.stiffness.items()}
    return replace(person, stiffness_per_mass={**person.stiffness_per_mass, **own})


def _calibration(rig: SimulatedRig, row: Row) -> CalibrationSpec:
    """Return what the lab knows: gains and frame as always, the lag as the row says."""
    if row.lag_sd_s is None:
        return rig.calibration
    error = float(rig.person.stream("benchmark: knowledge of the lag").standard_normal())
    true_s = rig.build(worn=True).instruments.angle_lag_s
    lag = Calibrated(value=true_s + row.lag_sd_s * error, sd=row.lag_sd_s)
    return rig.calibration.overridden_by(CalibrationSpec(angle_lag_s=lag))
