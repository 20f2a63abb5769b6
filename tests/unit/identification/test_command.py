"""``jointz identify joint``: numbers, echo, figure, failures."""

import errno
import os

import numpy as np
import pandas as pd
import pytest


@pytest.fixture
def file(tmp_path, knee_table):
    path = tmp_path / "r.csv"
    columns = {"t": knee_table["t"], "knee": np.rad2deg(knee_table["angle"])}
    pd.DataFrame(columns | {"tau": -knee_table["torque"]}).to_csv(path, index=False)
    return path


ARGUMENTS = ("--angle", "knee:deg", "--torque", "tau", "--input", "angle")
FLIPPED = ("--torque-acts-on", "device")


def test_json_holds_parameters_with_units_and_intervals_and_echoes_columns(jointz, file):
    outcome = jointz("identify", "joint", file, *ARGUMENTS, *FLIPPED, "--time", "t", "--json")

    assert outcome.code == 0
    found = outcome.json
    assert found["model"] == "kbj"
    for name, truth, unit in (
        ("stiffness", 80.0, "N*m/rad"),
        ("damping", 1.2, "N*m*s/rad"),
        ("inertia", 0.02, "kg*m^2"),
    ):
        parameter = found["parameters"][name]
        assert parameter["value"] == pytest.approx(truth, rel=1e-3)
        assert parameter["unit"] == unit
        low, high = parameter["ci"]
        assert low <= parameter["value"] <= high
    assert found["vaf_pct"] > 99.9
    assert found["columns"]["angle"] == {"column": "knee", "unit": "deg"}
    assert found["columns"]["torque"] == {"column": "tau", "unit": "N*m"}


def test_a_sample_that_no_sensor_gives_is_bad_input_with_row_and_column(jointz, file):
    table = pd.read_csv(file).astype({"tau": object})
    table.loc[100, "tau"] = "-1e308"
    table.to_csv(file, index=False)

    outcome = jointz("identify", "joint", file, *ARGUMENTS, "--time", "t")

    assert outcome.code == 2
    assert "r.csv, row 102, column 'tau'" in outcome.err


@pytest.mark.parametrize(("model", "suffix"), [("irf", "png"), ("frf", "svg")])
def test_every_model_gives_the_second_order_joint_and_a_figure(
    jointz, file, tmp_path, model, suffix
):
    figure = tmp_path / f"fit.{suffix}"
    options = ("--time", "t", "--model", model, "--figure", figure, "--json")
    outcome = jointz("identify", "joint", file, *ARGUMENTS, *FLIPPED, *options)

    assert outcome.code == 0
    assert outcome.json["model"] == model
    assert outcome.json["parameters"]["stiffness"]["value"] == pytest.approx(80.0, rel=0.02)
    assert {"vaf_pct", "status"} <= set(outcome.json)
    assert figure.stat().st_size > 1000


def test_a_record_without_an_answer_exits_1_with_the_code(jointz, file):
    pd.read_csv(file).assign(knee=1.0).to_csv(file, index=False)
    arguments = ("identify", "joint", file, *ARGUMENTS, "--time", "t")

    outcome = jointz(*arguments, "--json")
    assert outcome.code == 1
    assert outcome.json["status"].startswith("failed:")
    plain = jointz(*arguments)
    assert (plain.code, plain.out) == (1, "")
    assert plain.err.startswith("jointz: ")


@pytest.mark.parametrize(
    ("arguments", "word"),
    [
        (("--angle", "knee:furlong_x", "--torque", "tau", "--time", "t"), "furlong_x"),
        (("--angle", "knee", "--torque", "tau"), "--rate"),
    ],
)
def test_what_cannot_be_read_exits_2(jointz, file, arguments, word):
    outcome = jointz("identify", "joint", file, *arguments, "--json")
    assert outcome.code == 2
    assert word in outcome.json["message"]


def test_a_table_without_header_and_with_decimal_commas_is_read(jointz, file):
    text = pd.read_csv(file).to_csv(index=False, header=False, sep=";", decimal=",")
    file.write_text("recorded in the lab\n" + text)
    options = ("--time", "1", "--angle", "2:deg", "--torque", "3", "--input", "angle")
    layout = ("--delimiter", ";", "--decimal", ",", "--no-header", "--skip-rows", "1")
    outcome = jointz("identify", "joint", file, *options, *layout, *FLIPPED, "--json")
    assert outcome.code == 0
    assert outcome.json["parameters"]["stiffness"]["value"] == pytest.approx(80.0, rel=0.02)


@pytest.mark.parametrize("name", ["figure.txt", "no/such/figure.svg"])
def test_a_figure_that_cannot_be_written_is_refused_before_the_work(jointz, tmp_path, name):
    options = (*ARGUMENTS, "--time", "t", "--figure", tmp_path / name)
    outcome = jointz("identify", "joint", tmp_path / "absent.csv", *options)
    assert outcome.code == 2
    assert "--figure" in outcome.err


def test_a_figure_that_the_system_refuses_leaves_the_old_one(jointz, file, tmp_path, monkeypatch):
    def refused(_canvas, target, **_):
        target.write_text("half")
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    (tmp_path / "fit.svg").write_text("old")
    monkeypatch.setattr("matplotlib.figure.Figure.savefig", refused)
    before = sorted(p.name for p in tmp_path.iterdir())
    options = (*ARGUMENTS, *FLIPPED, "--time", "t", "--figure", tmp_path / "fit.svg", "--json")
    outcome = jointz("identify", "joint", file, *options)

    assert outcome.code == 1
    assert "fit.svg" in outcome.json["message"]
    assert sorted(p.name for p in tmp_path.iterdir()) == before
    assert (tmp_path / "fit.svg").read_text() == "old"
