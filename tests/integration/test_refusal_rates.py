"""Simulated people in order are neither refused nor doubted."""

import pytest

from jointz.rig.sim.direct_walk import QUICK_GRID, WALKING_PULSE, WalkPlan, walk_directly
from jointz.rig.sim.people import draw_person
from jointz.rig.sim.presets import preset
from jointz.rig.sim.rig import SimulatedRig

BOTH = WALKING_PULSE.model_copy(update={"direction": "both"})


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
    assert result.log_posteriors[0].doubts == ()
