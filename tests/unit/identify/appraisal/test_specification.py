"""Sets of choices: inertias taken apart, and the refusals of the recommended method in each."""

from dataclasses import dataclass, replace

import numpy as np
import pytest

from jointz.core.codes import Doubt, Failure
from jointz.core.recording import build_recording
from jointz.core.study import PerturbationsSpec
from jointz.identify.appraisal.specification import (
    Choices,
    of_inertia_model,
    specification_estimates,
)
from jointz.identify.participant import analyze_participant
from jointz.identify.preparation.sources import ParticipantSettings, RecordingInput
from jointz.identify.rigid.response_model import Hypothesis
from jointz.identify.rigid.response_posterior import JointPosterior
from jointz.identify.study_kinds import WALKING
from jointz.sim.descriptions import exoskeleton
from jointz.sim.direct_walk import QUICK_GRID, WALKING_PULSE, WalkPlan, walk_directly
from jointz.sim.people import draw_person
from jointz.sim.presets import ReflexSettings, preset
from jointz.sim.rig import SimulatedRig


@dataclass(frozen=True)
class Found:
    hypothesis: Hypothesis
    log_evidence: float


POSTERIOR = JointPosterior(
    (
        Found(Hypothesis(0.01, 0.1), np.log(6.0)),
        Found(Hypothesis(0.01, 0.02), np.log(2.0)),
        Found(Hypothesis(0.1, 0.1), np.log(1.0)),
        Found(Hypothesis(0.35, 0.1), np.log(1.0)),
    ),
    np.array([0.6, 0.2, 0.1, 0.1]),
)


def test_one_inertia_keeps_its_hypotheses_and_what_they_are_worth_to_each_other():
    one = of_inertia_model(POSTERIOR, "one")

    assert {p.hypothesis.inertia_sd for p in one.posteriors} == {0.01}
    assert one.weights == pytest.approx([0.75, 0.25])


def test_a_free_inertia_is_the_freest_there_is():
    free = of_inertia_model(POSTERIOR, "free")

    assert [p.hypothesis.inertia_sd for p in free.posteriors] == [0.35]
    assert free.weights == pytest.approx([1.0])


def test_hypotheses_that_the_data_rule_out_can_still_be_looked_at():
    ruled_out = JointPosterior(
        (Found(Hypothesis(0.01, 0.1), 0.0), Found(Hypothesis(0.35, 0.1), -2000.0)),
        np.array([1.0, 0.0]),
    )

    assert of_inertia_model(ruled_out, "free").weights == pytest.approx([1.0])


def test_an_unknown_model_of_the_inertia_is_refused():
    with pytest.raises(ValueError, match="inertia_models: expected one or more names among one"):
        Choices(inertia_models=("two",))


def walked(plan, *, points, reflex=None):
    """Return what is recorded of a simulated walk, and what is asked of it."""
    nominal = preset("nominal")
    own = (
        nominal if reflex is None else replace(nominal, joint=replace(nominal.joint, reflex=reflex))
    )
    rig = SimulatedRig(draw_person(3, seed=41), own, grid=QUICK_GRID)
    walk = walk_directly(rig, "perturbed", plan=plan)
    recording = build_recording(
        walk.time_s,
        dict(walk.channels),
        units={"contact": "1"},
        contact_kind="contact",
        condition="perturbed",
        file="walk.nc",
    )
    columns = ["onset_s", "duration_s", "amplitude_nm", "timing_point"]
    asked = ParticipantSettings(
        kind=WALKING,
        perturbations=PerturbationsSpec(timing_points=points),
        torque_model=exoskeleton(rig.build(worn=True)).torque_model,
        n_resamples=10,
        mass_kg=70.0,
    )
    return [RecordingInput(recording, rig.calibration, walk.pulses[columns])], asked


STANCE = {"LRE": 7.0, "MST": 21.5, "TST": 40.5, "PSW": 56.0}
NEAR = {"ICO": 1.0, "LRE": 7.0, "MST": 21.5, "ISW": 68.5, "TSW": 93.5}


@pytest.mark.parametrize(
    ("points", "direction", "reflex", "doubt"),
    [
        (
            STANCE,
            "both",
            ReflexSettings(gain=1.5, latency_s=0.03),
            Doubt.RESPONSES_DIFFER_WITH_DIRECTION,
        ),
        (NEAR, "positive", None, Doubt.STEEP_CHANGE),
    ],
)
def test_what_analyze_widens_and_withholds_is_widened_and_withheld_in_the_curve(
    points, direction, reflex, doubt
):
    pulse = WALKING_PULSE.model_copy(update={"direction": direction})
    plan = WalkPlan(per_point=30, timing_points=points, pulse=pulse)
    recordings, asked = walked(plan, points=points, reflex=reflex)
    alone = analyze_participant("S01", recordings, asked)
    assert doubt.value in alone.models[0].doubts
    choices = Choices(windows_s=(0.1,), cutoffs_hz=(20.0,), baselines=("predicted",))

    rows = specification_estimates("S01", recordings, asked, choices)

    own = {
        (cell.timing_point, p.name): (p.value, p.ci_low, p.ci_high, p.status)
        for cell in alone.cells["rigid"]
        for p in cell.parameters
    }
    pooled = [row for row in rows if row.inertia_model == "pooled"]
    assert len(pooled) == 3 * len(points)
    for row in pooled:
        found = (row.value, row.ci_low, row.ci_high, row.status)
        assert found == own[row.timing_point, row.parameter]


def test_unperturbed_strides_may_have_been_recorded_at_another_rate(walkers):
    walker = walkers.Walker(counts={"A": 12, "B": 12})
    idle = walkers.walk(replace(walker, sizes_nm=(1e-9,), rate_hz=250.0, seed=1))
    teacher = idle.recording.assign_attrs(condition="unperturbed", file="idle.csv")
    recordings = [walkers.walk(walker), RecordingInput(teacher, idle.calibration)]
    choices = Choices(
        windows_s=(0.1,),
        cutoffs_hz=(20.0,),
        baselines=("unperturbed_mean",),
        inertia_models=("pooled",),
    )

    rows = specification_estimates("S01", recordings, walkers.settings(walker), choices)

    mine = [row for row in rows if row.method == "rigid"]
    assert {row.timing_point for row in mine} == {"A", "B"}
    assert Failure.NO_UNPERTURBED_STRIDES.status not in {row.status for row in mine}


def test_a_model_of_the_inertia_is_judged_by_itself(monkeypatch):
    """What explains nothing is refused under it alone."""
    plan = WalkPlan(per_point=6, timing_points=STANCE)
    recordings, asked = walked(plan, points=STANCE)
    monkeypatch.setattr("jointz.identify.appraisal.specification.fit_failure", _misfit_at_first)
    choices = Choices(windows_s=(0.1,), cutoffs_hz=(20.0,), baselines=("predicted",))

    rows = specification_estimates("S01", recordings, asked, choices)

    refused = {
        (row.inertia_model, row.timing_point)
        for row in rows
        if row.status == Failure.MODEL_MISFIT.status
    }
    assert refused == {("one", "LRE"), ("free", "LRE")}


def _misfit_at_first(i, posterior, response):
    return Failure.MODEL_MISFIT if i == 0 else None
