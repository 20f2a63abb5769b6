"""``jointz calibrate``: table, JSON, files, exit status."""

import numpy as np
import pandas as pd
import pytest

STUDY = """
jointz = 1
joint = "knee"
kind = "bench"
sample_rate_hz = 200.0
[channels.angle]
column = "angle"
unit = "rad"
[[participants]]
id = "S01"
[[participants]]
id = "S02"
[[recordings]]
participant = "S01"
condition = "unperturbed"
session = "straight"
file = "S01.csv"
[[recordings]]
participant = "S02"
condition = "unperturbed"
session = "straight"
file = "S02.csv"
"""
ZEROS = {"S01": 0.2, "S02": -0.05}


@pytest.fixture
def study(tmp_path):
    """S01 stands still; S02 walks about."""
    rng = np.random.default_rng(0)
    folder = tmp_path / "zero"
    folder.mkdir()
    (folder / "study.toml").write_text(STUDY)
    time = np.arange(4000) / 200.0
    for person, motion in (("S01", 0.0), ("S02", 0.5)):
        angle = ZEROS[person] + motion * np.sin(8.0 * time) + 1e-3 * rng.standard_normal(time.size)
        pd.DataFrame({"angle": angle}).to_csv(folder / f"{person}.csv", index=False)
    return folder


def test_a_table_says_who_has_which_value_and_why_not(jointz, study):
    outcome = jointz("calibrate", "zero", study)

    assert outcome.code == 0
    lines = [line.split("\t") for line in outcome.out.splitlines()]
    header = ["participant", "entry", "value", "sd", "unit", "status", "reason"]
    assert lines[1] == header
    rows = {line[0]: dict(zip(header, line, strict=True)) for line in lines[2:4]}
    assert float(rows["S01"]["value"]) == pytest.approx(0.2, abs=1e-3)
    assert (rows["S01"]["unit"], rows["S01"]["status"]) == ("rad", "ok")
    assert (rows["S02"]["value"], rows["S02"]["status"]) == ("-", "failed:not_still")


def test_json_holds_everything_but_the_samples_of_the_figure(jointz, study, tmp_path):
    out, figure = tmp_path / "c.toml", tmp_path / "zero.svg"
    outcome = jointz("calibrate", "zero", study, "--json", "--out", out, "--figure", figure)

    made = outcome.json
    assert (outcome.code, made["status"], made["step"]) == (0, "ok", "zero")
    assert made["written"] == [str(out)]
    entry = made["fits"]["S01"]["entries"][0]
    assert (entry["name"], entry["status"]) == ("angle_zero_rad", "ok")
    assert "series" not in made["fits"]["S01"]
    assert "S01. Calibration: zero" in figure.read_text()
    assert '"S02"' not in out.read_text()


def test_quiet_prints_nothing_and_no_entry_is_exit_status_1(jointz, study):
    outcome = jointz("calibrate", "zero", study, "--quiet")
    assert (outcome.code, outcome.out) == (0, "")
    (study / "S01.csv").write_bytes((study / "S02.csv").read_bytes())
    outcome = jointz("calibrate", "zero", study, "--json")
    assert (outcome.code, outcome.json["status"]) == (1, "nothing_stands")


@pytest.mark.parametrize(
    ("arguments", "place"),
    [
        (("knee", "STUDY"), "knee"),
        (("hinge", "STUDY"), "swing"),
        (("zero", "STUDY", "--figure", "zero.doc"), "zero.doc"),
        (("zero", "nowhere"), "study.toml"),
        (("zero", "STUDY", "--into", "nowhere"), "study.toml"),
    ],
)
def test_bad_input_is_told_and_exit_status_2(jointz, study, arguments, place):
    outcome = jointz("calibrate", *[study if a == "STUDY" else a for a in arguments])
    assert outcome.code == 2
    assert place in outcome.err
