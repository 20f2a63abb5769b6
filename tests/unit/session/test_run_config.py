"""``jointz run`` and ``jointz console`` with a device file."""

import io
import json
import sys
from contextlib import nullcontext

import pytest

from jointz.console.command import _arguments
from jointz.core.clock import VirtualClock
from jointz.core.errors import DataError, DeviceFileError, StudyError
from jointz.io.protocols import protocol_text
from jointz.session.command import Device, Preset
from jointz.sim.rig import simulated_rig

pytestmark = pytest.mark.alone

DEVICES = """
[actuator]
driver = "dephy"
port = "/dev/ttyACM0"
firmware = "12.0.0"
side = "left"
torque_model = { gear_ratio = 9, torque_constant = 0.14 }
[actuator.limits]
torque_nm = 20
torque_rate_nm_s = 1e5
current_a = 18
angle_min_rad = -0.2
angle_max_rad = 1.8
velocity_rad_s = 12
temperature_c = 100
sensor_age_s = 0.02
pulse_count = 400
pulse_duty = 0.3
consecutive_overruns = 5
fade_s = 0.05
[angle]
driver = "lsl"
stream = "Goniometer"
sample_rate_hz = 500
[contact]
driver = "lsl"
stream = "Footswitch"
sample_rate_hz = 500
kind = "contact"
"""


@pytest.fixture
def config(tmp_path):
    path = tmp_path / "device.toml"
    path.write_text(DEVICES)
    return path


@pytest.fixture
def protocol(tmp_path):
    """Walking, short, with one pulse a point."""
    path = tmp_path / "short.toml"
    text = protocol_text("walking").replace("strides = 60", "strides = 5")
    text = text.replace("count_per_point = 50", "count_per_point = 1")
    path.write_text(text.replace("gap_strides = [3, 7]", "gap_strides = [2, 2]"))
    return path


@pytest.fixture
def laboratory(monkeypatch):
    """Simulated devices are opened where real ones are named, and time flies."""

    def open_devices(file, *, clock, before=None):
        del before
        rig = simulated_rig(0, seed=2)
        return rig.open("lab", worn=file.actuator is not None, segment=0, clock=clock)

    monkeypatch.setattr("jointz.session.rigs.hardware_rig.open_devices", open_devices)
    for home in ("run", "participant_run"):
        monkeypatch.setattr(f"jointz.session.{home}.RealClock", VirtualClock)
    monkeypatch.setattr("jointz.experiment.session.undisturbed", nullcontext)


def test_an_experiment_on_the_devices_of_a_file_ends_as_a_study(
    jointz, laboratory, monkeypatch, config, protocol, tmp_path
):
    monkeypatch.setattr(sys, "stdin", io.StringIO("\n\n\n"))
    out = tmp_path / "study"
    done = jointz("run", protocol, "--config", config, "--out", out, "--participants", 1, "--json")
    told = json.loads(done.out)
    assert (done.code, told["status"], told["pulses_completed"]) == (0, "ok", 6)
    assert "Put the exoskeleton on." in done.err
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
    assert "Stopped." in done.err
    assert [folder.name for folder in (out / "sessions").iterdir()] == ["S01"]


@pytest.mark.parametrize(
    ("options", "told"),
    [
        (("--device", "sim"), "exclude each other"),
        (("--preset", "hard"), "preset: 'hard' is of simulated devices"),
        (("--clock", "fast"), "clock: real devices keep real time"),
        (("--workers", "2"), "workers: expected 1 with a device file, got 2"),
    ],
)
def test_options_of_a_simulation_are_refused(jointz, config, tmp_path, options, told):
    done = jointz("run", "walking", "--config", config, "--out", tmp_path / "s", *options)
    assert done.code == 2
    assert told in done.err
    assert not (tmp_path / "s").exists()


def test_the_console_hands_the_file_to_the_run(config, tmp_path):
    made = _arguments("walking", tmp_path, None, None, config=config, participants=2, seed=None)
    assert made[made.index("--config") + 1] == str(config)
    assert not {"--device", "--preset"} & set(made)
    assert made[made.index("--clock") + 1] == "real"


def test_the_console_without_a_file_runs_the_simulation(tmp_path):
    made = _arguments(
        "walking", tmp_path, Device.sim, Preset.hard, config=None, participants=None, seed=3
    )
    assert made[made.index("--device") + 1] == "sim"
    assert made[made.index("--preset") + 1] == "hard"


def test_the_console_hands_a_calibration_to_the_run(tmp_path):
    file = tmp_path / "calibration.toml"
    file.write_text("[calibration]\nangle_lag_s = { value = 0.02, sd = 0.001 }\n")
    about = {"config": None, "participants": None, "seed": None, "calibration": file}
    made = _arguments("walking", tmp_path, None, None, **about)
    assert made[made.index("--calibration") + 1] == str(file)
    file.write_text("[calibration]\nangle_lag_s = 1\n")
    with pytest.raises(StudyError, match="angle_lag_s"):
        _arguments("walking", tmp_path, None, None, **about)


def test_the_console_tells_what_is_wrong_before_its_page_is_served(config, tmp_path):
    with pytest.raises(DataError, match="exclude each other"):
        _arguments(
            "walking", tmp_path, Device.sim, None, config=config, participants=None, seed=None
        )
    config.write_text(DEVICES[: DEVICES.index("[angle]")])
    with pytest.raises(DeviceFileError, match="angle: missing"):
        _arguments("walking", tmp_path, None, None, config=config, participants=None, seed=None)
