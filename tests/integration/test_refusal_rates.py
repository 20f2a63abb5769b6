"""Simulated people in order are neither refused nor doubted; those with a strong reflex are."""

from dataclasses import replace

import pytest

from jointz.core.codes import Doubt
from jointz.core.recording import build_recording
from jointz.core.study import PerturbationsSpec
from jointz.identify.participant import ParticipantResult, analyze_participant
from jointz.identify.preparation.sources import ParticipantSettings, RecordingInput
from jointz.identify.study_kinds import WALKING
from jointz.sim.descriptions import exoskeleton
from jointz.sim.direct_walk import QUICK_GRID, WALKING_PULSE, WalkPlan, walk_directly
from jointz.sim.people import draw_person
from jointz.sim.presets import Preset, ReflexSettings, preset
from jointz.sim.rig import SimulatedRig

BOTH = WALKING_PULSE.model_copy(update={"direction": "both"})
DIRECTION = Doubt.RESPONSES_DIFFER_WITH_DIRECTION.value


def analyzed(settings: Preset, person: int) -> ParticipantResult:
    rig = SimulatedRig(draw_person(person, seed=58), settings, grid=QUICK_GRID)
    plan = WalkPlan(per_point=50, pulse=BOTH)
    walked = walk_directly(rig, "perturbed", plan=plan)
    recording = build_recording(
        walked.time_s,
        dict(walked.channels),
        units={"contact": "1"},
        contact_kind="contact",
        condition="perturbed",
        file="walk.nc",
    )
    asked = ParticipantSettings(
        kind=WALKING,
        perturbations=PerturbationsSpec(timing_points=dict(plan.timing_points)),
        torque_model=exoskeleton(rig.build(worn=True)).torque_model,
        n_resamples=10,
        mass_kg=rig.person.mass_kg,
    )
    columns = ["onset_s", "duration_s", "amplitude_nm", "timing_point"]
    given = RecordingInput(recording, rig.calibration, walked.pulses[columns])
    return analyze_participant("S01", [given], asked)


@pytest.mark.slow
@pytest.mark.parametrize("name", ["nominal", "hard"])
@pytest.mark.parametrize("person", range(4))
def test_people_in_order_are_not_refused_and_not_doubted(name, person):
    result = analyzed(preset(name), person)
    statuses = {p.status for c in result.cells["recommended"] for p in c.parameters}
    assert not [status for status in statuses if status.startswith("failed")]
    assert result.models[0].doubts == ()


@pytest.mark.slow
@pytest.mark.parametrize("person", range(3))
def test_a_reflex_as_strong_as_the_stiffness_is_told_from_both_directions(person):
    nominal = preset("nominal")
    reflex = ReflexSettings(gain=1.0, kind="velocity", latency_s=0.03)
    strong = replace(nominal, joint=replace(nominal.joint, reflex=reflex))
    result = analyzed(strong, person)
    assert result.models[0].doubts == (DIRECTION,)
    stands = [p for c in result.cells["recommended"] for p in c.parameters if p.available]
    assert all("directions" in p.ci_method for p in stands)
