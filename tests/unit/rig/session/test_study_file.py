"""The study that a run writes opens again, whatever its people and timing points are called."""

import csv
import io
import tomllib
from types import SimpleNamespace

import numpy as np
import pytest
from hypothesis import HealthCheck, assume, given, settings
from hypothesis import strategies as st

import jointz
from jointz.core.protocols.protocol_models import PerturbationPlan
from jointz.core.recording import build_recording
from jointz.core.study import (
    Calibrated,
    CalibrationSpec,
    TorqueModelSpec,
    name_problem,
)
from jointz.io.formats.netcdf_recording import write_recording
from jointz.io.protocols import load_protocol
from jointz.io.recordings import read_recording
from jointz.rig.devices.interface import Wearer
from jointz.rig.session.run_settings import pulses_name, recording_name
from jointz.rig.session.study_file import exclusions_csv, study_toml

WALKING = load_protocol("walking")
MOTOR = TorqueModelSpec(
    gear_ratio=9.0, torque_constant=-0.14, viscous_friction=0.12, coulomb_friction=1e-7
)
SOMEBODY = Wearer("S01")
MOTOR_CHANNELS = ("current", "motor_angle", "motor_velocity", "command", "applied_torque")
ODD_NAMES = ('Anna "Ann" O\'Neil', "S\\01", "日本", "a=b # c", "1.5")


def with_points(**points):
    """Return the walking protocol with other timing points."""
    changed = [
        condition.model_copy(
            update={
                "perturbations": PerturbationPlan(
                    timing_points=points, count_per_point=2, gap_strides=(3, 7)
                )
            }
        )
        if condition.perturbations is not None
        else condition
        for condition in WALKING.conditions[1:]
    ]
    return WALKING.model_copy(update={"conditions": tuple(changed)})


def make(folder, protocol=WALKING, people=(SOMEBODY,), calibrations=None, model=MOTOR, device=None):
    """Write a study with recordings of a few samples and open it."""
    calibrations = calibrations or {}
    time = np.arange(50) * 0.002
    for person in people:
        for condition in protocol.conditions:
            worn = () if condition.condition == "no_device" else MOTOR_CHANNELS
            name = recording_name(person.id, condition.name)
            recording = build_recording(
                time,
                {channel: 0.1 * np.sin(time) for channel in ("angle", "contact", *worn)},
                units={"applied_torque": "N*m"},
                file=name,
                contact_kind="contact",
            )
            write_recording(recording, folder / name)
            if condition.perturbations is not None:
                (folder / pulses_name(person.id, condition.name)).write_text(
                    "onset_s,duration_s,amplitude_nm,timing_point\n0.02,0.02,17,LRE\n"
                )
    known = [calibrations.get(person.id, CalibrationSpec()) for person in people]
    rigs = [SimpleNamespace(wearer=person, device=device) for person in people]
    text = study_toml(protocol, rigs, known, None if model is None else model.model_dump())
    (folder / "study.toml").write_text(text, encoding="utf-8")
    return jointz.open_study(folder)


def test_a_study_opens_with_all_its_recordings(tmp_path):
    study = make(tmp_path, people=(Wearer("S01", 72.456, 1.8049), Wearer("S02")))
    spec = study.spec
    assert (spec.joint, spec.kind, spec.positive) == ("knee", "walking", "flexion")
    assert [(p.id, p.mass_kg, p.height_m) for p in spec.participants] == [
        ("S01", 72.46, 1.805),
        ("S02", None, None),
    ]
    assert [(r.participant, r.condition) for r in spec.recordings] == [
        (person, condition.condition)
        for person in ("S01", "S02")
        for condition in WALKING.conditions
    ]
    for entry in spec.recordings:
        assert (entry.perturbations is not None) == (entry.condition == "perturbed")
        (recording,) = read_recording(study, entry)
        assert recording["time"].size == 50


def test_torque_is_computed_from_the_current(tmp_path):
    study = make(tmp_path)
    entry = next(r for r in study.spec.recordings if r.condition == "unperturbed")
    (recording,) = read_recording(study, entry)
    assert recording["current"].attrs["units"] == "A"
    assert "applied_torque" in recording
    assert "torque" not in recording  # made by the analysis, out of the model


def test_a_footswitch_in_walking_is_a_contact_unless_it_gives_volts():
    def contact(kind):
        devices = {"contact": {"kind": kind}}
        rig = SimpleNamespace(wearer=SOMEBODY, device=None)
        text = study_toml(WALKING, [rig], [CalibrationSpec()], None, devices=devices)
        return tomllib.loads(text)["channels"]["contact"]

    assert contact("contact") == {"column": "contact", "kind": "contact"}
    assert contact("voltage") == {"column": "contact", "kind": "voltage", "unit": "V"}


def test_calibrations_come_back_with_their_sd(tmp_path):
    mine = CalibrationSpec(
        torque_gain=Calibrated(value=1.0, sd=0.02), angle_lag_s=Calibrated(value=6.5e-05, sd=5e-7)
    )
    study = make(tmp_path, people=(Wearer("S01"), Wearer("S02")), calibrations={"S01": mine})
    assert study.spec.participants[0].calibration == mine
    assert study.spec.participants[1].calibration is None


@pytest.mark.parametrize("name", ODD_NAMES)
def test_people_may_have_any_name_that_files_can_have(tmp_path, name):
    study = make(tmp_path, people=(Wearer(name, 70.0),))
    assert study.spec.participants[0].id == name
    assert {entry.participant for entry in study.spec.recordings} == {name}
    (recording, *_) = read_recording(study, study.spec.recordings[0])
    assert recording.attrs["participant"] == name


@settings(
    max_examples=20, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture]
)
@given(
    name=st.text(st.characters(exclude_categories=["C", "Z"]), min_size=1, max_size=12),
    pct=st.floats(0.0, 99.9),
)
def test_text_and_numbers_survive_the_file(tmp_path, name, pct):
    assume(name == name.strip() and name.isprintable() and not name_problem(name))
    study = make(tmp_path, with_points(**{name: pct}))
    ((found, value),) = study.spec.perturbations.timing_points.items()
    assert found == name
    assert value == pct


def test_without_the_device_no_torque_is_asked_for(tmp_path):
    alone = WALKING.model_copy(
        update={
            "conditions": tuple(c for c in WALKING.conditions if c.condition == "no_device"),
            "pulse": None,
        }
    )
    study = make(tmp_path, alone, model=None)
    assert study.spec.torque_model is None
    assert study.spec.perturbations.timing_points is None
    (recording,) = read_recording(study, study.spec.recordings[0])
    assert set(recording.data_vars) >= {"angle", "contact"}


def test_two_conditions_of_one_kind_are_told_apart(tmp_path):
    _, unperturbed, perturbed = WALKING.conditions
    twice = [perturbed.model_copy(update={"name": name}) for name in ("before", "after")]
    protocol = WALKING.model_copy(update={"conditions": (*twice, unperturbed)})
    study = make(tmp_path, protocol)
    assert [(r.condition, r.session) for r in study.spec.recordings] == [
        ("perturbed", "before"),
        ("perturbed", "after"),
        ("unperturbed", None),
    ]


def test_pulses_that_were_broken_off_are_left_out_by_the_study(tmp_path):
    name = 'Anna, "Ann"'
    file = recording_name(name, "perturbed")
    text = exclusions_csv(
        [{"participant": name, "recording": file, "onset_s": 1234.567891234}], "2026-01-02T03:04:05"
    )
    (row,) = csv.DictReader(io.StringIO(text))
    assert (row["participant"], row["recording"]) == (name, file)
    assert float(row["onset_s"]) == pytest.approx(1234.567891234, abs=1e-5)
    (tmp_path / "exclusions.csv").write_text(text, encoding="utf-8")
    (found,) = make(tmp_path, people=(Wearer(name),)).user_exclusions
    assert (found.participant, found.recording) == (name, file)
    assert found.onset_s == pytest.approx(1234.567891234, abs=1e-5)
    assert found.code == "aborted"
