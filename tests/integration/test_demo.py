"""The demo: from nothing to a report, and only its own folder replaced."""

import json
import re

import pandas as pd
import pytest

import jointz as jointz_package
from jointz.core.errors import DataError
from jointz.demo import demo_study
from jointz.demo.demo_study import truth_table
from jointz.io.protocols import load_protocol


def demo(jointz, out, *more):
    return jointz("demo", "--quick", "--out", out, *more)


def few_strides(name):
    whole = load_protocol(name)
    few = [c if c.perturbations else c.model_copy(update={"strides": 25}) for c in whole.conditions]
    return whole.model_copy(update={"conditions": tuple(few)})


@pytest.mark.parametrize("people", [1, pytest.param(2, marks=pytest.mark.slow)])
def test_the_demo_writes_study_results_truth_and_report(
    jointz, tmp_path, one_core, monkeypatch, people
):
    if people == 1:  # shorter than --quick, which the slow test runs as it is
        monkeypatch.setattr(demo_study, "_QUICK", (1, 8, (3, 3)))
        monkeypatch.setattr(demo_study, "load_protocol", few_strides)
    made = tmp_path / "demo"
    with one_core():
        outcome = demo(jointz, made, "--json")

    assert outcome.code == 0
    found = outcome.json
    assert found["report"] == str(made / "results" / "report.html")
    assert found["n_standing"] >= 0.6 * people * 6 * 5
    for name in ("results", "dissertation-results"):
        page = (made / name / "report.html").read_text()
        assert "<svg" in page
        assert "http://" not in page.replace("http://www.w3.org", "").replace("http://purl.org", "")
        assert "one torque held, goniometer</td><td>Stiffness</td>" in page
    held = " ".join((made / "dissertation-results" / "report.html").read_text().split())
    assert "Most frequent reason" in held
    assert "K and B are not identifiable from pulses that hold one torque" in held
    assert "Use doublets of two shapes and sizes" in held
    assert_doublets_decide_what_a_held_torque_does_not(found["accuracy"], people)
    assert_same_people_walked_both(made)
    assert_truth_is_of_what_is_estimated(made)


def assert_doublets_decide_what_a_held_torque_does_not(accuracy, people):
    rows = {(row["protocol"], row["parameter"]): row for row in accuracy}
    assert len(rows) == 2 * 3
    for name in ("stiffness", "damping"):
        doublets, held = rows["walking_doublets", name], rows["walking", name]
        assert doublets["n_cells"] == held["n_cells"] == people * 6
        assert doublets["n_decided"] >= 0.6 * people * 6
        assert doublets["coverage"] >= 0.7
        assert held["n_decided"] <= 1
        if not held["n_decided"]:
            assert held["rms_error_pct"] is held["coverage"] is None
    assert rows["walking", "inertia"]["n_decided"] >= 0.6 * people * 6


def assert_same_people_walked_both(made):
    truths = [
        json.loads((made / name / "ground_truth.json").read_text())
        for name in ("study", "dissertation-study")
    ]
    assert {t["preset"] for t in truths} == {"realistic"}
    doublets, held = (
        {name: c["perturbed"] for name, c in t["participants"].items()} for t in truths
    )
    for name, walk in doublets.items():
        assert walk["person"] == held[name]["person"]
        assert len(walk["pulses"]) == len(held[name]["pulses"]) == 6 * 8
    methods = {json.loads((made / name / "provenance.json").read_text())["settings"]["method"]
               for name in ("results", "dissertation-results")}  # fmt: skip
    assert methods == {"bayesian"}


def assert_truth_is_of_what_is_estimated(made):
    truth = pd.read_csv(made / "truth.csv")
    assert set(truth["protocol"]) == {"walking_doublets", "walking"}
    written = json.loads((made / "study" / "ground_truth.json").read_text())
    stiffness = truth.query("protocol == 'walking_doublets' and parameter == 'stiffness'")
    for row in stiffness.itertuples():
        means = written["participants"][row.participant]["perturbed"]["timing_points"]
        own = means[row.timing_point]
        muscles = own["stiffness_window_mean"]
        beside = own["gravity_stiffness"] + own["inertial_stiffness"]
        # Less than that of small motion: the joint softens along the bone's motion.
        assert 0.9 * muscles < row.truth - beside < 1.05 * muscles
    damping = truth.query("protocol == 'walking_doublets' and parameter == 'damping'")
    for row in damping.itertuples():  # of the muscles, without inertia_rate
        means = written["participants"][row.participant]["perturbed"]["timing_points"]
        assert row.truth == pytest.approx(means[row.timing_point]["damping_window_mean"])
    analysis = jointz_package.load(made / "results")
    with pytest.raises(DataError, match="plan"):
        truth_table(analysis, made / "study")


@pytest.mark.slow
def test_the_demo_replaces_its_own_folder(jointz, tmp_path):
    demo(jointz, tmp_path / "demo")
    assert (tmp_path / "demo" / ".jointz-demo").is_file()
    stale = tmp_path / "demo" / "results" / "report.html"
    stale.write_text("x")
    outcome = demo(jointz, tmp_path / "demo")

    assert outcome.code == 0
    assert "Report: " in outcome.out
    assert re.search(
        r"with one held torque \d+ of 24 K and B are available, .* \d+ of 24", outcome.out
    )
    assert len(stale.read_text()) > 1000
    assert [p.name for p in tmp_path.iterdir()] == ["demo"]


def test_the_demo_refuses_a_folder_it_did_not_make(jointz, tmp_path):
    mine = tmp_path / "mine"
    mine.mkdir()
    (mine / "thesis.doc").write_text("years of work")
    outcome = demo(jointz, mine, "--json")

    assert outcome.code == 2
    assert outcome.json["error"] == "OutputError"
    assert [p.name for p in mine.iterdir()] == ["thesis.doc"]
    assert [p.name for p in tmp_path.iterdir()] == ["mine"]
