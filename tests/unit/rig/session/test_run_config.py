"""``jointz run`` and ``jointz console`` with a device file."""

import io
import json
import sys

import pytest

from jointz.core.errors import DataError, DeviceFileError, StudyError
from jointz.io.protocols import protocol_text
from jointz.rig.console.command import _arguments
from jointz.rig.session.command import RigOptions

from .laboratory import ACTUATOR, ANGLE, CONTACT


@pytest.fixture
def config(tmp_path):
    path = tmp_path / "device.toml"
    path.write_text(ACTUATOR + ANGLE + CONTACT)
    return path


@pytest.fixture
def protocol(tmp_path):
    """Walking, short, with one pulse a point."""
    path = tmp_path / "short.toml"
    text = protocol_text("walking").replace("strides = 60", "strides = 5")
    text = text.replace("count_per_point = 50", "count_per_point = 1")
    path.write_text(text.replace("gap_strides = [3, 7]", "gap_strides = [2, 2]"))
    return path


def test_an_experiment_on_the_devices_of_a_file_ends_as_a_study(
    jointz, laboratory, monkeypatch, config, protocol, tmp_path
):
    monkeypatch.setattr(sys, "stdin", io.StringIO("\n\n\n"))
    out = tmp_path / "study"
    done = jointz("run", protocol, "--config", config, "--out", out, "--participants", 1, "--json")
    told = json.loads(done.out)
    assert (done.code, told["status"], told["pulses_completed"]) == (0, "ok", 6)
    assert {path.name for path in out.glob("S01_*.nc")} == {
        "S01_no_device.nc",
        "S01_unperturbed.nc",
        "S01_perturbed.nc",
    }
    assert (out / "study.toml").is_file()


def test_who_does_not_answer_the_prompt_stops_the_run_and_can_go_on(
    jointz, laboratory, monkeypatch, config, protocol, tmp_path
):
    out = tmp_path / "study"
    arguments = ("run", protocol, "--config", config, "--out", out, "--participants", 1)
    monkeypatch.setattr(sys, "stdin", io.StringIO("\n"))
    assert jointz(*arguments).code == 130
    monkeypatch.setattr(sys, "stdin", io.StringIO("\n\n"))
    assert jointz(*arguments, "--resume").code == 0


def test_who_does_not_answer_for_one_simulated_person_is_not_asked_for_the_next(
    jointz, laboratory, monkeypatch, protocol, tmp_path
):
    out = tmp_path / "study"
    monkeypatch.setattr(sys, "stdin", io.StringIO("\n"))
    done = jointz("run", protocol, "--clock", "real", "--out", out, "--participants", 2)
    assert done.code == 130
    assert [folder.name for folder in (out / "sessions").iterdir()] == ["S01"]


def test_the_console_hands_the_file_or_the_simulation_to_the_run(config, tmp_path):
    about = {"participants": 2, "seed": None, "live": True, "calibration": None}
    real = _arguments("walking", tmp_path, RigOptions(config=config), **about)
    assert real[real.index("--config") + 1] == str(config)
    assert not {"--device", "--preset"} & set(real)
    assert real[real.index("--clock") + 1] == "real"
    made = _arguments("walking", tmp_path, RigOptions("sim", preset="hard"), **about)
    assert made[made.index("--device") + 1] == "sim"
    assert made[made.index("--preset") + 1] == "hard"


def test_the_console_hands_a_calibration_to_the_run(tmp_path):
    file = tmp_path / "calibration.toml"
    file.write_text("[calibration]\nangle_lag_s = { value = 0.02, sd = 0.001 }\n")
    about = {"participants": None, "seed": None, "live": True, "calibration": file}
    made = _arguments("walking", tmp_path, RigOptions(), **about)
    assert made[made.index("--calibration") + 1] == str(file)
    file.write_text("[calibration]\nangle_lag_s = 1\n")
    with pytest.raises(StudyError, match="angle_lag_s"):
        _arguments("walking", tmp_path, RigOptions(), **about)


def test_the_console_tells_what_is_wrong_before_its_page_is_served(config, tmp_path):
    about = {"participants": None, "seed": None, "live": True, "calibration": None}
    with pytest.raises(DataError, match="config"):
        _arguments("walking", tmp_path, RigOptions("sim", config), **about)
    config.write_text(ACTUATOR + CONTACT)
    with pytest.raises(DeviceFileError, match="angle"):
        _arguments("walking", tmp_path, RigOptions(config=config), **about)
