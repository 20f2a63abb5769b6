"""A study that was walked directly: as a run's, with a truth, of any preset and any people."""

import json
from dataclasses import replace

import numpy as np
import pytest

import jointz
from jointz.core.errors import DataError
from jointz.demo.demo_study import truth_table
from jointz.io.recordings import read_pulse_table, read_recording
from jointz.rig.session.simulate_study import simulate_study
from jointz.rig.sim.direct_walk import WalkPlan, walk_directly
from jointz.rig.sim.people import draw_person
from jointz.rig.sim.presets import preset
from jointz.rig.sim.rig import SimulatedRig

FEW = WalkPlan(per_point=1)


@pytest.fixture(scope="module")
def study(tmp_path_factory):
    out = tmp_path_factory.mktemp("simulated") / "study"
    return simulate_study(out, plan=FEW, unperturbed_strides=20, lag_sd_s=0.001, seed=3)


def test_the_folder_opens_as_a_study_of_both_walks(study):
    opened = jointz.open_study(study)

    assert [r.condition for r in opened.spec.recordings] == ["unperturbed", "perturbed"]
    assert opened.spec.perturbations.timing_points == dict(FEW.timing_points)
    truth = json.loads((study / "ground_truth.json").read_text())
    points = truth["participants"]["S01"]["perturbed"]["timing_points"]
    assert set(points) == set(FEW.timing_points)
    assert points["LRE"]["stiffness"] > 20.0


def test_recordings_are_what_the_rig_walked(study):
    opened = jointz.open_study(study)
    entry = opened.spec.recordings[1]
    (recording,) = read_recording(opened, entry)
    from jointz.rig.sim.direct_walk import QUICK_GRID

    rig = SimulatedRig(draw_person(0, seed=3), preset("nominal"), grid=QUICK_GRID)
    walk = walk_directly(rig, "perturbed", plan=FEW)

    for channel in ("angle", "joint_moment"):
        np.testing.assert_array_equal(recording[channel], walk.channels[channel])
    assert recording["joint_moment"].attrs["units"] == "N*m"
    np.testing.assert_allclose(
        read_pulse_table(opened, entry)["onset_s"], walk.pulses["onset_s"], atol=1e-6
    )


def test_the_lag_is_known_as_well_as_was_asked(study):
    lag = jointz.open_study(study).spec.participants[0].calibration.angle_lag_s
    rig = SimulatedRig(draw_person(0, seed=3), preset("nominal"))
    true_s = rig.build(worn=True).instruments.angle_lag_s

    assert lag.sd == 0.001
    assert 0.0 < abs(lag.value - true_s) < 0.005


def test_without_errors_the_estimates_are_the_truth(tmp_path):
    study = simulate_study(
        tmp_path / "study", preset="clean", plan=WalkPlan(per_point=3), unperturbed_strides=25
    )

    table = truth_table(jointz.analyze(study, method="dissertation", resamples=2), study)

    assert len(table) >= 12
    assert table["error_pct"].abs().median() < 5.0


def test_people_and_settings_of_ones_own_are_taken(tmp_path):
    people = [draw_person(n, seed=9) for n in (4, 7)]
    mine = replace(preset("anthropometric"), name="mine")

    study = simulate_study(
        tmp_path / "study", preset=mine, participants=people, plan=FEW, unperturbed_strides=15
    )

    spec = jointz.open_study(study).spec
    assert [p.id for p in spec.participants] == ["S05", "S08"]
    assert spec.device.mass_kg == mine.body.frame_mass_kg
    assert json.loads((study / "ground_truth.json").read_text())["preset"] == "mine"


@pytest.mark.parametrize(
    ("options", "told"),
    [
        ({"participants": 0}, "1 to 1000 participants, got 0"),
        ({"participants": [draw_person(0, seed=1)] * 2}, "different numbers, got S01, S01"),
        ({"unperturbed_strides": 0}, "one unperturbed stride or more"),
        ({"lag_sd_s": -1.0}, "lag_sd_s above 0"),
        ({"preset": "best"}, "expected one of clean"),
    ],
)
def test_what_makes_no_sense_is_refused_and_nothing_written(options, told, tmp_path):
    with pytest.raises(DataError, match=told):
        simulate_study(tmp_path / "study", **options)
    assert list(tmp_path.iterdir()) == []
