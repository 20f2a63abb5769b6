"""The benchmark of real legs: how it scores rows, and where it reads their truth."""

import json
import math
from pathlib import Path

import pytest
from benchmarks.real_legs import studies
from benchmarks.real_legs.__main__ import main
from benchmarks.real_legs.scores import (
    MISSING,
    Row,
    Share,
    rows_of,
    score,
)

from jointz.results.estimates import CellEstimate, ParameterEstimate

POINT = {
    "J": 0.2,
    "K_onset": 60.0,
    "B_onset": 1.0,
    "windows": {"0.1": {"K_secant": 50.0, "B_mean": 1.5}, "0.2": {"K_secant": 40.0, "B_mean": 1.4}},
}


def row(status="ok", value=None, low=None, high=None, *, truth=10.0, parameter="stiffness"):
    return Row("B", "P1", "MST", parameter, status, truth, value, low, high)


def cell(*estimates, point="MST"):
    return CellEstimate("P1", point, 20.0, estimates, 99.0, 30, 0, "rigid")


@pytest.fixture
def real_legs() -> Path:
    folder = studies.real_legs_folder()
    if not folder.is_dir():
        pytest.skip(f"recorded worlds are absent: no folder {folder.name}; set JOINTZ_DATA")
    return folder


def test_errors_and_coverage_are_over_decided_rows():
    entry = score(
        "stiffness",
        [
            row(value=11.0, low=9.0, high=13.0),
            row(value=14.0, low=12.0, high=16.0),
            row("at_bound", 8.0, 8.0, 12.0),
            row("undecided"),
            row("failed:too_few_pulses"),
        ],
    )

    assert entry.rows == 5
    assert entry.decided == Share(3, 5)
    assert entry.coverage == Share(2, 3)
    assert entry.rmse_pct == pytest.approx(math.sqrt((10.0**2 + 40.0**2 + 20.0**2) / 3))
    assert entry.bias_pct == pytest.approx(10.0)
    assert entry.far == Share(1, 3)
    assert entry.half_width_pct == pytest.approx(20.0)
    assert entry.failures == {"too_few_pulses": 1}


def test_limits_count_only_in_undecided_rows_that_have_them():
    entry = score(
        "stiffness",
        [
            row("undecided"),
            row("undecided", low=5.0, high=20.0),
            row("undecided", low=11.0, high=20.0),
            row("undecided", high=9.0),
            row(value=10.0, low=9.0, high=11.0),
        ],
    )

    assert entry.upper_limits == Share(2, 3)
    assert entry.lower_limits == Share(1, 2)
    assert entry.decided == Share(1, 5)


def test_rows_hold_the_parameters_that_have_a_truth():
    stiffness = ParameterEstimate("stiffness", 48.0, 40.0, 56.0, "ok")
    per_mass = ParameterEstimate("stiffness_per_mass", 0.7, 0.6, 0.8, "ok")
    truths = {"P1": {"MST": {"stiffness": 50.0, "damping": 2.0}}}

    (only,) = rows_of("B", [cell(stiffness, per_mass)], truths)

    assert only == Row("B", "P1", "MST", "stiffness", "ok", 50.0, 48.0, 40.0, 56.0)


def test_a_cell_without_a_parameter_of_the_others_has_a_row():
    onset = ParameterEstimate("stiffness_onset", 48.0, 40.0, 56.0, "ok")
    failed = ParameterEstimate("stiffness", None, None, None, "failed:no_pulses")
    truth = {"stiffness": 50.0, "stiffness_onset": 60.0}
    cells = [cell(onset), cell(failed, point="TST")]

    rows = rows_of("B", cells, {"P1": {"MST": truth, "TST": truth}})

    found = {(r.timing_point, r.parameter): r.status for r in rows}
    assert found["TST", "stiffness_onset"] == found["MST", "stiffness"] == MISSING
    assert score("stiffness_onset", rows[1::2]).decided == Share(1, 2)


def test_the_truth_of_a_point_is_that_of_the_window():
    assert studies.point_truth(POINT, 0.2) == {
        "stiffness": 40.0,
        "damping": 1.4,
        "inertia": 0.2,
        "stiffness_onset": 60.0,
        "damping_onset": 1.0,
    }
    with pytest.raises(ValueError, match=r"truth\.json has 0\.1, 0\.2 s; got 0\.15"):
        studies.point_truth(POINT, 0.15)


def test_the_truth_of_a_preset_includes_gravity_and_is_averaged_over_pulses(tmp_path):
    first = {"timing_point": "LRE", "stiffness": 40, "gravity_stiffness": 8}
    second = {"timing_point": "LRE", "stiffness": 50, "gravity_stiffness": 10}
    pulses = [first | {"damping": 2, "inertia": 1}, second | {"damping": 3, "inertia": 1}]
    content = {"participants": {"S01": {"perturbed": {"pulses": pulses}}}}
    (tmp_path / "ground_truth.json").write_text(json.dumps(content))

    truths = studies.simulated_truths(tmp_path)

    assert truths == {"S01": {"LRE": {"stiffness": 54.0, "damping": 2.5, "inertia": 1.0}}}


def test_recorded_worlds_are_skipped_where_their_folder_is_absent(monkeypatch, tmp_path, capsys):
    monkeypatch.setenv("JOINTZ_DATA", str(tmp_path / "data"))

    assert main([]) == 0

    captured = capsys.readouterr()
    assert captured.out == ""
    assert captured.err.count("\n") == 1
    assert "skipped" in captured.err
    assert str(tmp_path / "real_legs") in captured.err


def test_an_unknown_method_is_refused_before_anything_is_simulated(capsys):
    with pytest.raises(SystemExit, match="2"):
        main(["--method", "none", "--studies", "--simulated", "nominal"])

    assert "got none." in capsys.readouterr().err


@pytest.mark.real_data
def test_the_truth_of_study_b_is_read(real_legs):
    truths = studies.recorded_truths(real_legs, "B", 0.2)

    assert truths["P2"]["TST"] == {
        "stiffness": 69.673,
        "damping": 2.1869,
        "inertia": 0.18426,
        "stiffness_onset": 103.49,
        "damping_onset": 1.5875,
    }
