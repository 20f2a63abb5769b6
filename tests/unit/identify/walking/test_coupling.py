"""What a coupling supposes, and the method of the rigid one."""

import json

import numpy as np
import pytest

import jointz
from jointz.core.priors import LogPrior, PriorsSpec
from jointz.identify.walking.coupling import RIGID, STRAP
from jointz.session.simulate_study import simulate_study
from jointz.sim.direct_walk import WalkPlan


def test_what_a_study_states_replaces_what_a_coupling_supposes():
    stated = PriorsSpec(device_share=LogPrior(median=0.2, log_sd=0.1))

    assert RIGID.spec(stated).device_share == stated.device_share
    assert RIGID.spec(stated).strap_hz == RIGID.priors.strap_hz
    assert STRAP.spec(stated) == stated


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
