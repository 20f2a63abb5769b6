"""Rows of realistic people: shapes of pulse and sensors, and what analysis makes of one person."""

from collections.abc import Mapping
from itertools import product
from pathlib import Path
from tempfile import TemporaryDirectory
from types import MappingProxyType

from benchmarks.kept import Entry
from benchmarks.realistic.rows import (
    PARAMETERS,
    ROWS,
    RealisticRow,
    preset_of,
    set_window,
)

import jointz
from jointz.core.protocols.pulse_models import TrapezoidPulse
from jointz.rig.session.simulate_study import simulate_study
from jointz.rig.sim.direct_walk import WalkPlan
from jointz.rig.sim.own_truth import own_truth
from jointz.rig.sim.people import Person, draw_person
from jointz.rig.sim.presets import Preset

_RESAMPLES = 10
WINDOW_S = 0.15
_SHORT = TrapezoidPulse(
    name="short", kind="trapezoid", amplitudes_nm=(10.0, 17.0), hold_s=0.06, direction="both"
)
#: Name -> pulses: the dissertation's, two doublets of two sizes, short pulses of two sizes.
SHAPES: Mapping[str, WalkPlan] = MappingProxyType(
    {
        "hold": ROWS["a"].plan,
        "doublets": ROWS["c"].plan,
        "short": WalkPlan(per_point=50, pulses=(_SHORT,)),
    }
)
PLANNED: Mapping[str, RealisticRow] = MappingProxyType(
    {
        f"{shape}-{sensors}": RealisticRow(
            f"{shape}-{sensors}", f"{shape}, {sensors}", plan, WINDOW_S, sensors == "three"
        )
        for (shape, plan), sensors in product(SHAPES.items(), ("goniometer", "three"))
    }
)


def obtained(name: str, seed: int, number: int) -> Entry:
    """Let one person walk and be analysed; return statuses, sds of logarithms and truth.

    Parameters
    ----------
    name : str
        Row of :data:`PLANNED`.
    seed, number : int
        Of the population; person, the same in all rows.
    """
    row, person = PLANNED[name], draw_person(number, seed=seed)
    return obtained_of(person, preset_of(row), row.plan, row.window_s) | {"number": number}


def obtained_of(person: Person, settings: Preset, plan: WalkPlan, window_s: float) -> Entry:
    """Let a person walk a plan; return what analysis says beside the truth."""
    truth = own_truth(person, settings, plan, window_s)
    with TemporaryDirectory(prefix="planned_") as scratch:
        study = simulate_study(
            Path(scratch) / "study", preset=settings, participants=[person], plan=plan
        )
        set_window(study, window_s)
        analysis = jointz.analyze(study, method="strapped", resamples=_RESAMPLES, progress=False)
    posteriors = analysis.log_posteriors
    cells = []
    for cell in analysis.cells:
        for parameter in PARAMETERS:
            found = cell.parameter(parameter)
            cells.append({
                "timing_point": cell.timing_point,
                "parameter": parameter,
                "truth": truth[cell.timing_point][parameter],
                "status": "failed" if found is None else found.status,
                "value": None if found is None else found.value,
                "low": None if found is None else found.ci_low,
                "high": None if found is None else found.ci_high,
                "unbounded": None if found is None else found.unbounded,
                "displacement_deg": truth[cell.timing_point]["displacement_deg"],
            })  # fmt: skip
    return {
        "mass_kg": person.mass_kg,
        "height_m": person.height_m,
        "cells": cells,
        "posteriors": [p.to_dict() for p in posteriors],
    }
