"""``jointz inspect`` at the command line."""

import os
import shlex
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from jointz.inspection.inspection_result import Inspection
from jointz.io.study_reader import open_study

from .answers import answered


@pytest.fixture
def recording(tmp_path: Path) -> Path:
    s = np.arange(1000) / 200.0
    columns = {"time": s, "knee angle (deg)": 30 * np.sin(2 * np.pi * s)}
    columns |= {"torque (Nm)": np.cos(2 * np.pi * s), "command (Nm)": 17.0 * (s % 2 > 1.9)}
    columns["footswitch"] = (s % 1 < 0.6).astype(int)
    pd.DataFrame(columns).to_csv(tmp_path / "S01.csv", index=False)
    return tmp_path / "S01.csv"


def test_it_prints_what_is_there_and_a_study(recording, jointz):
    outcome = jointz("inspect", recording)
    result = jointz("inspect", recording, "--json").json

    assert outcome.code == 0
    assert "[channels.angle]" in outcome.out
    assert (result.pop("status"), result.pop("written")) == ("ok", None)
    again = Inspection.from_dict(result)
    assert again.channel("angle").column == "knee angle (deg)"
    assert again.obstacles == ()


def test_the_study_is_written_once_and_opens(recording, jointz, tmp_path):
    folder = tmp_path / "mine"
    folder.mkdir()

    assert jointz("inspect", recording, "--toml", folder, "--quiet").out == ""
    again = jointz("inspect", recording, "--toml", folder)

    assert again.code == 2
    assert jointz("inspect", recording, "--toml", folder, "--overwrite").code == 0
    draft = folder / "study.toml"
    draft.write_text(answered(draft.read_text()))
    (entry,) = open_study(folder).spec.recordings
    assert entry.file == "../S01.csv"


@pytest.mark.parametrize(
    "options",
    [("--toml", "S01.csv"), ("--toml", "S02.csv"), ("--toml", "S01.toml"), ("--figure", "S01.png")],
)
def test_a_recording_is_never_replaced(options, recording, jointz, monkeypatch):
    monkeypatch.chdir(recording.parent)
    for name in ("S02.csv", "S01.toml", "S01.png"):
        file = Path(name)
        file.unlink(missing_ok=True)
        file.hardlink_to(recording)
    before = recording.read_bytes()

    outcome = jointz("inspect", recording, *options, "--overwrite")

    assert outcome.code == 2
    assert recording.read_bytes() == before


def test_a_figure_that_exists_is_kept(recording, jointz, tmp_path):
    figure = tmp_path / "old.png"
    figure.write_bytes(b"mine")

    assert jointz("inspect", recording, "--figure", figure).code == 2
    assert figure.read_bytes() == b"mine"

    assert jointz("inspect", recording, "--figure", figure, "--overwrite").code == 0
    assert figure.read_bytes().startswith(b"\x89PNG")


@pytest.mark.parametrize("signs", [("--delimiter", ",", "--decimal", ","), ("--delimiter", ";;")])
def test_signs_that_are_none_are_bad_input(signs, recording, jointz):
    outcome = jointz("inspect", recording, *signs)

    assert outcome.code == 2
    assert "delimiter" in outcome.err


def test_a_file_whose_name_is_not_utf8_is_looked_at(recording, jointz, tmp_path):
    odd = tmp_path / os.fsdecode(b"S\xff.csv")
    try:
        recording.rename(odd)
    except OSError:
        pytest.skip("this system has no such names")

    found = jointz("inspect", odd, "--toml", tmp_path, "--json").json

    assert "not UTF-8" in found["obstacles"][0]
    assert (tmp_path / "study.toml").read_text(encoding="utf-8") == found["toml"]


def test_the_largest_numbers_there_are_are_shown(jointz, tmp_path):
    values = [1.7e308, -1.7e308] * 100
    frame = pd.DataFrame({"time": np.arange(200) / 100, "knee angle": values, "torque": 1.7e308})
    frame.to_csv(tmp_path / "a.csv", index=False)

    found = jointz("inspect", tmp_path / "a.csv", "--json", "--figure", tmp_path / "a.svg").json

    assert found["channels"][1]["high"] == 1.7e308
    assert jointz("inspect", tmp_path / "a.csv").code == 0


def test_a_layout_can_be_given(jointz, tmp_path):
    (tmp_path / "a.txt").write_text("1|2,5\n2|3,5\n3|4,5\n")

    layout = ("--delimiter", "|", "--decimal", ",", "--no-header", "--skip-rows", "0")
    found = jointz("inspect", tmp_path / "a.txt", *layout, "--json").json

    assert [c["high"] for c in found["channels"]] == [3.0, 4.5]


def test_the_commands_that_it_advises_take_the_file_as_it_is(jointz, tmp_path, monkeypatch):
    rng = np.random.default_rng(1)
    angle = 0.02 * np.convolve(rng.standard_normal(4000), np.hanning(15), "same")
    velocity = np.gradient(angle) * 500.0
    torque = 50 * angle + velocity + 0.02 * np.gradient(velocity) * 500.0
    columns = {"t": np.arange(4000) / 500.0, "angle (rad)": angle, "torque (Nm)": torque}
    body = pd.DataFrame(columns).to_csv(index=False, sep=";", decimal=",")
    (tmp_path / "a file.csv").write_text("two lines\nof prose\n" + body)
    monkeypatch.chdir(tmp_path)

    advice, _ = jointz("inspect", "a file.csv", "--json").json["advice"]

    words = shlex.split(advice.removeprefix("Taken as it is by: jointz "))
    found = jointz(*words, "--json").json
    assert found["parameters"]["stiffness"]["value"] == pytest.approx(50.0, rel=0.05)
