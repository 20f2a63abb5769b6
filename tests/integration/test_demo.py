"""The demo: from nothing to a report, and only its own folder replaced."""

import json
import re

import numpy as np
import pandas as pd
import pytest


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    return tmp_path_factory.mktemp("demo")


def demo(jointz, out, *more):
    return jointz("demo", "--quick", "--out", out, *more)


def test_the_demo_writes_study_results_truth_and_report(jointz, folder, one_core):
    with one_core():
        outcome = demo(jointz, folder / "demo", "--json")

    assert outcome.code == 0
    found = outcome.json
    assert found["report"] == str(folder / "demo" / "results" / "report.html")
    assert 0.75 * 2 * 6 * 5 <= found["n_standing"] <= 2 * 6 * 5
    page = (folder / "demo" / "results" / "report.html").read_text()
    assert "<svg" in page
    assert "http://" not in page.replace("http://www.w3.org", "").replace("http://purl.org", "")
    truth = pd.read_csv(folder / "demo" / "truth.csv")
    assert 0.75 * 2 * 6 * 3 <= len(truth) <= 2 * 6 * 3
    assert {row["parameter"] for row in found["accuracy"]} == {"stiffness", "damping", "inertia"}
    written = json.loads((folder / "demo" / "study" / "ground_truth.json").read_text())
    people = {name: c["perturbed"] for name, c in written["participants"].items()}
    assert all(0.004 <= p["instruments"]["angle_lag_s"] <= 0.012 for p in people.values())
    person = people["S01"]["person"]
    expected = person["stiffness_per_mass"]["LRE"] * person["mass_kg"]
    rows = truth.query("participant == 'S01' and timing_point == 'LRE'").set_index("parameter")
    assert rows.loc["stiffness", "truth"] == pytest.approx(expected, rel=0.01)
    inertias = truth.query("parameter == 'inertia'")
    own = [people[name]["person"]["inertia"] for name in inertias["participant"]]
    assert len(own) > 2
    np.testing.assert_allclose(inertias["truth"], own, rtol=1e-6)


@pytest.mark.slow
def test_the_demo_replaces_its_own_folder(jointz, folder):
    demo(jointz, folder / "demo")
    assert (folder / "demo" / ".jointz-demo").is_file()
    stale = folder / "demo" / "results" / "report.html"
    stale.write_text("x")
    outcome = demo(jointz, folder / "demo")

    assert outcome.code == 0
    assert "Report: " in outcome.out
    assert re.search(r"Mean VAF 99\.\d\d %", outcome.out)  # never as 100 what is less
    assert len(stale.read_text()) > 1000
    assert [p.name for p in folder.iterdir()] == ["demo"]


def test_the_demo_refuses_a_folder_it_did_not_make(jointz, tmp_path):
    mine = tmp_path / "mine"
    mine.mkdir()
    (mine / "thesis.doc").write_text("years of work")
    outcome = demo(jointz, mine, "--json")

    assert outcome.code == 2
    assert outcome.json["error"] == "OutputError"
    assert [p.name for p in mine.iterdir()] == ["thesis.doc"]
    assert [p.name for p in tmp_path.iterdir()] == ["mine"]
