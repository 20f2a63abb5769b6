"""``jointz identify stride``."""

import numpy as np
import pandas as pd
import pytest

from jointz.stats import quasi_stiffness

PCT = np.arange(0.0, 101.0, 2.0)
ANGLE = 0.5 - 0.4 * np.cos(2 * np.pi * PCT / 100.0) + 0.1 * np.sin(4 * np.pi * PCT / 100.0)
TORQUE = 2.0 * (ANGLE - 0.1)


@pytest.fixture
def mean(tmp_path):
    path = tmp_path / "mean.csv"
    columns = {"pct": PCT, "knee": np.rad2deg(ANGLE), "tau": TORQUE, "share": PCT / 100.0}
    pd.DataFrame(columns).to_csv(path, index=False)
    return path


PER_MASS = ("--angle", "knee:deg", "--torque-per-mass", "tau:Nm/kg")


def values(estimates):
    return {(e["timing_point"], e["measure"]): e["value"] for e in estimates}


@pytest.mark.parametrize("phase", [("--gait-pct", "pct"), ("--gait-pct", "share:1"), ()])
def test_the_estimates_are_those_of_python_as_json_csv_and_figure(jointz, mean, tmp_path, phase):
    out, figure = tmp_path / "quasi.csv", tmp_path / "quasi.svg"
    options = ("--out", out, "--figure", figure, "--json")
    outcome = jointz("identify", "stride", mean, *PER_MASS, *phase, *options)

    assert outcome.code == 0
    found = outcome.json
    assert (found["model"], found["status"]) == ("quasi_stiffness", "ok")
    assert found["unit"] == "N*m/rad/kg"
    assert found["columns"]["angle"] == {"column": "knee", "unit": "deg"}
    expected = quasi_stiffness(ANGLE, TORQUE, gait_pct=PCT).to_dict()["estimates"]
    assert values(found["estimates"]) == pytest.approx(values(expected))
    assert set(pd.read_csv(out)["measure"]) == {"slope", "local_slope", "secant"}
    assert figure.stat().st_size > 1000


def test_torque_in_newton_metre_is_printed_with_its_unit_unless_it_is_quiet(jointz, mean):
    arguments = ("identify", "stride", mean, "--angle", "knee:deg", "--torque", "tau:Nm")
    printed, quiet = jointz(*arguments), jointz(*arguments, "--quiet")

    assert printed.code == quiet.code == 0
    assert printed.out.startswith("Quasi-stiffness, N*m/rad\n")
    assert (quiet.out, quiet.err) == ("", "")


def test_an_angle_that_does_not_move_exits_1(jointz, mean):
    pd.read_csv(mean).assign(knee=0.0).to_csv(mean, index=False)
    arguments = ("identify", "stride", mean, *PER_MASS)
    outcome, plain = jointz(*arguments, "--json"), jointz(*arguments)

    assert outcome.code == plain.code == 1
    assert outcome.json["status"] == "undecided"
    assert "No parameter could be estimated" in plain.out


@pytest.mark.parametrize(
    ("arguments", "word"),
    [
        (("--angle", "knee:deg"), "--torque-per-mass"),
        ((*PER_MASS, "--torque", "pct"), "one of them"),
        (("--angle", "knee", "--torque", "tau"), "COLUMN:deg"),
        ((*PER_MASS, "--gait-pct", "absent"), "absent"),
        ((*PER_MASS, "--gait-pct", "share"), "reaches from 0 to 1 %"),
        ((*PER_MASS, "--window-pct", 0), "window_pct"),
        ((*PER_MASS, "--out", "table.txt"), "--out"),
    ],
)
def test_what_cannot_be_used_exits_2(jointz, mean, arguments, word):
    outcome = jointz("identify", "stride", mean, *arguments)
    assert outcome.code == 2
    assert word in outcome.err


def test_a_table_of_phases_of_several_people_is_refused_and_its_names_state_units(jointz, tmp_path):
    path = tmp_path / "phase.csv"
    rows = pd.DataFrame({"phase": PCT, "knee_rad": ANGLE, "knee_moment_Nm_kg": TORQUE})
    pd.concat([rows.assign(subject=f"AB{k // 3}", step=k % 3) for k in range(6)]).to_csv(path)
    columns = ("--angle", "knee_rad", "--torque-per-mass", "knee_moment_Nm_kg")
    outcome = jointz("identify", "stride", path, *columns)
    assert (outcome.code, "the angle repeats 6 times" in outcome.err) == (2, True)

    rows.to_csv(path)
    assert jointz("identify", "stride", path, *columns, "--json").json["unit"] == "N*m/rad/kg"
    as_torque = jointz("identify", "stride", path, *columns[:2], "--torque", "knee_moment_Nm_kg")
    assert (as_torque.code, "'N*m/kg' measures torque per body mass" in as_torque.err) == (2, True)
