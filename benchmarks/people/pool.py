"""One pool of people, each of whom walks twice: as usual, and with a stiffer knee."""

import json
from collections.abc import Mapping
from dataclasses import dataclass, fields, replace
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
from benchmarks.accuracy.people import cell_truth
from benchmarks.kept import Entry
from benchmarks.realistic.rows import ROWS, set_window

import jointz
from jointz.rig.session.simulate_study import simulate_study
from jointz.rig.sim.direct_walk import WalkPlan
from jointz.rig.sim.own_truth import own_truth
from jointz.rig.sim.people import Person, draw_person
from jointz.rig.sim.presets import preset

#: How much stiffer knees are in the second condition: mean, and sd of the logarithm over people.
STIFFER, _OWN_SD = 1.2, 0.08
CONDITIONS = ("usual", "stiffer")
WORLDS = ("realistic", "nominal")
_RESAMPLES = 10
#: What is drawn anew at the second visit; body and instruments stay the person's.
_ANEW = ("noise", "gait", "contact", "motion sensor noise", "gyroscope bias", "direct plan")


@dataclass(frozen=True, slots=True)
class SecondVisit(Person):
    """A person who comes again: the same body and instruments, other strides and other noise."""

    def stream(self, purpose: str, number: int = 0) -> np.random.Generator:
        """Return the random numbers of one purpose."""
        again = purpose.startswith(_ANEW)
        return Person.stream(self, f"{purpose}, again" if again else purpose, number)


def visitor(condition: str, seed: int, number: int) -> Person:
    """Return a person of the pool in a condition.

    Parameters
    ----------
    condition : str
        One of :data:`CONDITIONS`.
    seed, number : int
        Of the population; person.
    """
    person = draw_person(number, seed=seed)
    if condition == CONDITIONS[0]:
        return person
    factor = STIFFER * float(np.exp(_OWN_SD * person.stream("response").standard_normal()))
    values = {field.name: getattr(person, field.name) for field in fields(Person)}
    stiffer = {point: factor * k for point, k in person.stiffness_per_mass.items()}
    return SecondVisit(**(values | {"stiffness_per_mass": stiffer}))


def person_of_pool(world: str, condition: str, seed: int, number: int) -> Entry:
    """Let one person walk and be analysed; return estimates and truth, ready for JSON.

    Parameters
    ----------
    world : str
        ``realistic``: two doublets with three sensors; ``nominal``: the dissertation's pulse,
        a rigid strap and an unknown lag.
    condition : str
        One of :data:`CONDITIONS`.
    seed, number : int
        Of the population; person.
    """
    person, row = visitor(condition, seed, number), ROWS["c"]
    realistic = world == WORLDS[0]
    plan = row.plan if realistic else WalkPlan(per_point=50)
    settings = preset(world)
    with TemporaryDirectory(prefix="people_") as scratch:
        study = simulate_study(
            Path(scratch) / "study", preset=settings, participants=[person], plan=plan
        )
        if realistic:
            set_window(study, row.window_s)
            truth = own_truth(person, settings, plan, row.window_s)
        else:
            truth = _nominal_truth(study)
        analysis = jointz.analyze(study, resamples=_RESAMPLES, progress=False)
    return {
        "number": number,
        "mass_kg": person.mass_kg,
        "truth": truth,
        "cells": [replace(c, response=None, example=None).to_dict() for c in analysis.cells],
        "posteriors": [p.to_dict() for p in analysis.log_posteriors],
    }


def _nominal_truth(study: Path) -> Mapping[str, Mapping[str, float]]:
    (walks,) = json.loads((study / "ground_truth.json").read_text())["participants"].values()
    return cell_truth(walks["perturbed"])
