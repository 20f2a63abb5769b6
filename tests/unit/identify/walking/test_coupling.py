"""What a coupling supposes, and the method of the rigid one."""

import json

import numpy as np
import pytest

import jointz
from jointz.core.priors import LogPrior, PriorsSpec, Spread
from jointz.identify.walking.coupling import RIGID, STRAP
from jointz.rig.session.simulate_study import simulate_study
from jointz.rig.sim.direct_walk import WalkPlan
from jointz.tasks.task_store import TaskStore


def test_what_a_study_states_replaces_what_a_coupling_supposes():
    stated = PriorsSpec(device_share=LogPrior(median=0.2, log_sd=0.1))

    assert RIGID.spec(stated).device_share == stated.device_share
    assert RIGID.spec(stated).strap_hz == RIGID.priors.strap_hz
    assert STRAP.spec(stated) == stated


def test_a_stated_inertia_of_a_point_is_not_supposed_otherwise():
    stated = PriorsSpec(inertia_of_point=Spread(sd=0.1))
    supposed = RIGID.hypotheses_of(RIGID.spec(stated), several_sensors=False, phases=6)

    assert {h.inertia_sd for h in supposed} == {None}
    assert len(supposed) == len(RIGID.hypotheses) / 2


def test_no_curve_goes_through_three_timing_points():
    def follows(coupling, phases):
        spec = coupling.spec(PriorsSpec())
        return any(
            h.follows_cycle
            for h in coupling.hypotheses_of(spec, several_sensors=False, phases=phases)
        )

    assert follows(RIGID, 4)
    assert not follows(RIGID, 3)
    assert follows(STRAP, 3)


@pytest.fixture(scope="module")
def walked(tmp_path_factory):
    folder = tmp_path_factory.mktemp("rigid") / "study"
    return simulate_study(folder, preset="nominal", participants=1, plan=WalkPlan(per_point=25))


def test_a_held_torque_shows_the_impedance_of_a_rigid_coupling(walked):
    truth = json.loads((walked / "ground_truth.json").read_text())["participants"]["S01"]
    analysis = jointz.analyze(walked, method="rigid", resamples=10, progress=False)

    given = {"stiffness": 0, "damping": 0, "inertia": 0}
    for cell in analysis.cells:
        true = truth["perturbed"]["timing_points"][cell.timing_point]
        for name in given:
            found = cell.parameter(name)
            if found.value is not None:
                given[name] += 1
                low, high = np.array(found.ci) / true[name]
                assert low < 1.0 < high
    assert all(n >= 4 for n in given.values())
    assert {cell.method for cell in analysis.cells} == {"bayesian"}
    assert analysis.settings["coupling"] == "rigid"


def test_finished_people_of_one_coupling_are_not_taken_for_the_other(walked, tmp_path):
    store = TaskStore(tmp_path)
    both = [
        jointz.analyze(walked, method=name, resamples=10, store=store, progress=False)
        for name in ("rigid", "strapped", "rigid")
    ]
    means = [analysis.log_posteriors[0].mean.tolist() for analysis in both]
    assert means[0] == means[2] != means[1]


def test_an_encoder_that_agrees_contradicts_nothing_with_rigid_coupling(tmp_path):
    study = simulate_study(
        tmp_path / "study",
        preset="nominal",
        plan=WalkPlan(per_point=12),
        sensors=("goniometer", "encoder"),
        seed=3,
    )
    (posterior,) = jointz.analyze(study, resamples=10, progress=False).log_posteriors
    assert posterior.doubts == ()
