"""An experiment on the devices that a file names; simulated ones are opened in their place."""

import json
import sys
import tomllib
from dataclasses import replace

import numpy as np
import pytest

import jointz
from jointz.core.errors import DataError, DeviceError, DeviceFileError, ProtocolError
from jointz.io.formats.netcdf_recording import read_recording
from jointz.io.protocols import load_protocol
from jointz.rig.devices.interface import Lifecycle
from jointz.rig.session.rigs.hardware_rig import HardwareRig, read_hardware

from .laboratory import ACTUATOR, ANGLE, CONTACT

REST = """
[calibration]
angle_lag_s = { value = 0.0065, sd = 0.0005 }
[device]
mass_kg = 1.2
centre_m = 0.18
[[participants]]
id = "P07"
mass_kg = 71.5
height_m = 1.78
[[participants]]
id = "P09"
"""
WHOLE = ACTUATOR + ANGLE + CONTACT + REST


class Operator:
    """Keeps what it is told, and leaves at the prompt of a number."""

    def __init__(self, leaves_at=None):
        self.leaves_at, self.told = leaves_at, []

    def prompt(self, text):
        if len(self.told) == self.leaves_at:
            raise KeyboardInterrupt
        self.told.append(text)


class Volts:
    """A footswitch that gives 0 V off the ground and 3 V on it."""

    def __init__(self, switch):
        self._switch = switch

    def __getattr__(self, name):
        return getattr(self._switch, name)

    def describe(self):
        return replace(self._switch.describe(), kind="voltage", unit="V")

    def read(self):
        return [one._replace(value=3.0 * one.value) for one in self._switch.read()]


@pytest.fixture
def file(tmp_path):
    def write(text=WHOLE):
        path = tmp_path / "device.toml"
        path.write_text(text)
        return path

    return write


def walking(*, strides=6, conditions=3):
    """The walking protocol with few strides and one pulse."""
    whole = load_protocol("walking")
    pulses = whole.conditions[2].perturbations.model_copy(
        update={"count_per_point": 1, "timing_points": {"MST": 21.5}, "warm_up_strides": 4}
    )
    still, unperturbed, perturbed = whole.conditions
    changed = (
        still.model_copy(update={"strides": strides}),
        unperturbed.model_copy(update={"strides": strides}),
        perturbed.model_copy(update={"perturbations": pulses}),
    )
    return whole.model_copy(update={"conditions": changed[:conditions]})


def test_an_experiment_runs_on_the_devices_of_a_file(laboratory, file, tmp_path):
    operator, protocol = Operator(), walking()
    made = jointz.run(
        protocol, config=file(), participants=1, out=tmp_path / "s", operator=operator
    )

    seen, *trials = laboratory.opened
    assert seen.actuator is not None
    assert [one.actuator is not None for one in trials] == [False, True, True]  # who wears it
    assert operator.told == [one.prompt for one in protocol.conditions]
    assert made.report.to_frame()["completed"].sum() == 1
    study = tomllib.loads((made.study / "study.toml").read_text())
    assert study["participants"] == [
        {
            "id": "P07",
            "mass_kg": 71.5,
            "height_m": 1.78,
            "calibration": {"angle_lag_s": {"value": 0.0065, "sd": 0.0005}},
        }
    ]
    assert study["device"] == {"mass_kg": 1.2, "centre_m": 0.18}
    assert jointz.open_study(made.study) is not None
    assert not (made.study / "ground_truth.json").exists()
    run = json.loads((made.study / "run.json").read_text())
    assert (run["device"], run["clock"], run["participants"]) == ("hardware", "real", 1)
    notes = json.loads((made.study / "sessions/P07/session.json").read_text())["rig"]
    assert notes["simulated"] is False
    assert notes["drivers"] == {"actuator": "dephy", "angle": "lsl", "contact": "ads1115"}
    assert set(notes["libraries"]) == {"flexsea", "pylsl", "smbus2"}
    assert "tried on hardware" in notes["untried"]


def test_a_footswitch_that_gives_volts_is_recorded_as_that(laboratory, file, tmp_path):
    laboratory.switch = Volts
    levels = (
        "contact_threshold_v = { value = 2.0, sd = 0.1 }\n"
        "contact_release_v = { value = 1.0, sd = 0.1 }\n"
    )
    text = WHOLE.replace('kind = "contact"', 'kind = "voltage"')
    made = jointz.run(
        walking(),
        config=file(text.replace("[calibration]\n", f"[calibration]\n{levels}")),
        participants=1,
        out=tmp_path / "s",
        operator=Operator(),
    )
    assert made.report.to_frame()["completed"].sum() == 1
    study = tomllib.loads((made.study / "study.toml").read_text())
    assert study["channels"]["contact"] == {"column": "contact", "kind": "voltage", "unit": "V"}
    for entry in jointz.open_study(made.study).spec.recordings:
        recording = read_recording(made.study / entry.file)
        assert recording.attrs["contact_kind"] == "voltage"
        assert recording["contact"].attrs["units"] == "V"
        assert np.nanmax(recording["contact"].to_numpy()) == 3.0


def test_devices_answer_and_are_let_go_before_anybody_is_prompted(laboratory, file, tmp_path):
    with pytest.raises(KeyboardInterrupt):
        jointz.run(walking(), config=file(), out=tmp_path / "s", operator=Operator(leaves_at=0))
    (seen,) = laboratory.opened
    assert {device.state for device in seen.all()} == {Lifecycle.FINALISED}


def test_a_library_that_is_missing_is_told_before_anybody_is_prompted(monkeypatch, file, tmp_path):
    monkeypatch.setitem(sys.modules, "flexsea.device", None)
    operator = Operator()
    with pytest.raises(DeviceError, match=r"jointz\[dephy\]"):
        jointz.run(walking(), config=file(), out=tmp_path / "s", operator=operator)
    assert operator.told == []
    assert not (tmp_path / "s").exists()


def test_the_limits_of_the_file_hold_against_the_protocol(file, tmp_path):
    low = WHOLE.replace("torque_nm = 20", "torque_nm = 12")
    with pytest.raises(ProtocolError, match="walking"):
        jointz.run(walking(), config=file(low), out=tmp_path / "s", operator=Operator())
    assert not (tmp_path / "s").exists()


def test_everybody_keeps_the_calibration_of_the_day(laboratory, file, tmp_path):
    protocol, out = walking(conditions=2), tmp_path / "s"
    with pytest.raises(KeyboardInterrupt):
        jointz.run(protocol, config=file(), out=out, operator=Operator(leaves_at=2))
    later = WHOLE.replace("value = 0.0065", "value = 0.0031")
    jointz.run(protocol, config=file(later), out=out, operator=Operator(), resume=True)
    study = tomllib.loads((out / "study.toml").read_text())
    lags = [one["calibration"]["angle_lag_s"]["value"] for one in study["participants"]]
    assert lags == [0.0065, 0.0031]


def test_a_study_has_one_torque_model(laboratory, file, tmp_path):
    protocol, out = walking(conditions=2), tmp_path / "s"
    with pytest.raises(KeyboardInterrupt):
        jointz.run(protocol, config=file(), out=out, operator=Operator(leaves_at=2))
    report = out / "sessions" / "P07" / "report.json"
    before = json.loads(report.read_text())
    before["torque_model"]["torque_constant"] *= 1.01
    report.write_text(json.dumps(before))
    with pytest.raises(DataError, match=r"P07.*torque_model"):
        jointz.run(protocol, config=file(), out=out, operator=Operator(), resume=True)


@pytest.mark.parametrize(
    ("protocol", "text", "place"),
    [
        ("walking", ANGLE + CONTACT, "actuator"),
        ("walking", ACTUATOR + CONTACT, "angle"),
        ("walking", ACTUATOR + ANGLE, "contact"),
        ("walking", WHOLE.replace('kind = "contact"', ""), "contact.kind"),
        ("walking", WHOLE.replace("P09", "P07"), "participants[2].id"),
        ("calibration-footswitch", WHOLE, "contact.kind"),
    ],
)
def test_what_a_protocol_needs_is_told_at_its_place(file, protocol, text, place):
    with pytest.raises(DeviceFileError, match=r"device\.toml") as raised:
        read_hardware(file(text), load_protocol(protocol))
    assert [problem.split(":")[0] for problem in raised.value.problems] == [place]


@pytest.mark.parametrize(
    ("protocol", "text", "participants", "told"),
    [
        ("walking", WHOLE, 3, "participants"),
        ("walking", WHOLE.replace("P09", "P/10"), None, "P/10"),
        ("sea-intrinsic", WHOLE, None, "far side"),
    ],
)
def test_what_cannot_be_measured_is_told_before_the_first(file, protocol, text, participants, told):
    with pytest.raises((DataError, DeviceFileError), match=told):
        read_hardware(file(text), load_protocol(protocol), participants=participants)


@pytest.mark.parametrize(
    ("text", "asked", "ids"),
    [
        (WHOLE, None, ["P07", "P09"]),
        (WHOLE, 1, ["P07"]),
        (ACTUATOR + ANGLE + CONTACT, 2, ["S01", "S02"]),
        (ACTUATOR + ANGLE + CONTACT, None, [f"S{k:02d}" for k in range(1, 11)]),
    ],
)
def test_participants_are_those_of_the_file_or_numbered(file, text, asked, ids):
    hardware = read_hardware(file(text), load_protocol("walking"), participants=asked)
    rigs = [HardwareRig(hardware, number) for number in range(len(hardware.wearers))]
    assert [rig.wearer.id for rig in rigs] == ids


@pytest.mark.parametrize(
    ("protocol", "sections"),
    [
        ("walking", ["actuator", "angle", "contact"]),
        ("qdd-static", ["actuator", "angle"]),
        ("calibration-leg", ["actuator", "angle"]),
        ("calibration-spring", ["actuator"]),
    ],
)
def test_sensors_that_are_on_nothing_are_left_alone(file, protocol, sections):
    hardware = read_hardware(file(), load_protocol(protocol), participants=None)
    assert list(hardware.file.sections()) == sections


def test_a_footswitch_is_calibrated_by_its_voltage(file):
    volts = WHOLE.replace('kind = "contact"', 'kind = "voltage"')
    hardware = read_hardware(file(volts), load_protocol("calibration-footswitch"))
    assert list(hardware.file.sections()) == ["actuator", "contact"]


@pytest.mark.parametrize(
    ("given", "told"),
    [
        ({"device": "sim"}, "config"),
        ({"preset": "hard"}, "preset"),
        ({"clock": "fast"}, "clock"),
        ({"workers": 2}, "workers"),
        ({"operator": None}, "operator"),
    ],
)
def test_what_only_a_simulation_has_is_refused(file, tmp_path, given, told):
    options = {"operator": Operator(), **given}
    with pytest.raises(DataError, match=told):
        jointz.run(walking(), config=file(), out=tmp_path / "s", **options)
    assert not (tmp_path / "s").exists()


def test_sensors_that_a_protocol_is_planned_with_are_needed(file):
    planned = load_protocol("walking").model_copy(update={"sensors": ("goniometer", "encoder")})

    with pytest.raises(DeviceFileError, match="joint_encoder: missing; the protocol is planned"):
        read_hardware(file(), planned)
