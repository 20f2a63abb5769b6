"""Simulated people in order are neither refused nor doubted; those with a strong reflex are."""

from dataclasses import replace

import pytest

from jointz.core.codes import Doubt
from jointz.sim.direct_walk import QUICK_GRID, WALKING_PULSE, WalkPlan, walk_directly
from jointz.sim.people import draw_person
from jointz.sim.presets import ReflexSettings, preset
from jointz.sim.rig import SimulatedRig

BOTH = WALKING_PULSE.model_copy(update={"direction": "both"})
DIRECTION = Doubt.RESPONSES_DIFFER_WITH_DIRECTION.value


@pytest.fixture(scope="module")
def analyzed(analyze_walk):
    def analyzed(settings, person):
        rig = SimulatedRig(draw_person(person, seed=58), settings, grid=QUICK_GRID)
        plan = WalkPlan(per_point=50, pulse=BOTH)
        return analyze_walk(rig, walk_directly(rig, "perturbed", plan=plan), plan, rig.calibration)

    return analyzed


@pytest.mark.slow
@pytest.mark.parametrize("name", ["nominal", "hard"])
@pytest.mark.parametrize("person", range(4))
def test_people_in_order_are_not_refused_and_not_doubted(analyzed, name, person):
    result = analyzed(preset(name), person)
    statuses = {p.status for c in result.cells["bayesian"] for p in c.parameters}
    assert not [status for status in statuses if status.startswith("failed")]
    assert result.models[0].doubts == ()


@pytest.mark.slow
@pytest.mark.parametrize("person", range(3))
def test_a_reflex_as_strong_as_the_stiffness_is_told_from_both_directions(analyzed, person):
    nominal = preset("nominal")
    reflex = ReflexSettings(gain=1.0, kind="velocity", latency_s=0.03)
    strong = replace(nominal, joint=replace(nominal.joint, reflex=reflex))
    result = analyzed(strong, person)
    assert result.models[0].doubts == (DIRECTION,)
    stands = [p for c in result.cells["bayesian"] for p in c.parameters if p.available]
    assert all("directions" in p.ci_method for p in stands)
