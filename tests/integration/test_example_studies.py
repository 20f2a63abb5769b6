"""Real recordings: the examples of the repository and the command of the issue."""

import json
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

EXAMPLES = Path(__file__).parents[2] / "examples"

pytestmark = pytest.mark.real_data


@pytest.fixture
def analyze_example(jointz, real_data, monkeypatch, tmp_path):
    monkeypatch.setenv("JOINTZ_DATA", str(real_data))

    def call(name):
        out = tmp_path / "results"
        more = ("--resamples", 100, "--json", "--tables")
        return jointz("analyze", EXAMPLES / name, "--out", out, *more), out

    return call


def test_pulses_on_a_moving_ankle_rise_in_stiffness_with_dorsiflexion(analyze_example):
    outcome, out = analyze_example("ankle_pulses")

    assert outcome.code == 0
    table = pd.read_csv(out / "estimates.csv")
    assert set(table["status"]) == {"ok"}
    stiffness = table.query("parameter == 'stiffness'")
    assert stiffness["n_used"].sum() >= 300
    values = stiffness["value"].to_numpy()
    assert len(values) == 5
    assert np.all(np.diff(values) > 0)
    assert 15 < values[0] < 20
    assert 85 < values[-1] < 100
    inertia = table.query("parameter == 'inertia'")["value"]
    assert inertia.between(0.015, 0.019).all()
    assert stiffness["vaf_pct"].median() > 96


def test_treadmill_walking_gives_strides_and_quasi_stiffness_but_no_impedance(
    analyze_example, real_data
):
    outcome, out = analyze_example("treadmill_strides")

    assert outcome.code == 1
    (summary,) = json.loads((out / "statistics.json").read_text())["strides"]
    assert (summary["n_accepted"], summary["n_rejected"], summary["n_gaps"]) == (42, 0, 15)
    assert summary["mean_s"] == pytest.approx(1.34, abs=0.005)
    assert summary["longest_gap_s"] == pytest.approx(0.137, abs=0.001)
    strides = pd.read_csv(out / "strides.csv")
    last = strides.iloc[-1]
    strikes = np.append(strides["start_s"], last["start_s"] + last["duration_s"])
    events = pd.read_csv(real_data / "moore2015_walk" / "UnpertPre__event.csv")
    np.testing.assert_allclose(strikes, events["rhs"].dropna(), rtol=0, atol=0.020)
    assert set(pd.read_csv(out / "estimates.csv")["status"]) == {"failed:no_perturbed_recording"}
    # A knee that is loaded bends under an extension moment: the slope of mid-stance is positive,
    # here 2.6 N*m/rad/kg, where Winter's mean curve has 3.8.
    quasi = pd.read_csv(out / "quasi_stiffness.csv").set_index(["timing_point", "measure"])
    assert set(quasi["n_strides"]) == {42}
    assert quasi.loc[("MST", "slope"), "value"] == pytest.approx(203, abs=5)
    assert quasi.loc[("TST", "slope"), "doubts"] == "angle_turns"
