"""The models behind study.toml: what they take, what they refuse, and what stands over what."""

import pytest
from pydantic import ValidationError

from jointz.core.channels import OPPOSITE_DIRECTION
from jointz.core.study import (
    CalibrationSpec,
    ChannelSpec,
    ParticipantSpec,
    PerturbationsSpec,
    RecordingSpec,
    StudySpec,
)

MINIMAL = {
    "jointz": 1,
    "joint": "knee",
    "kind": "walking",
    "channels": {"angle": {"column": "a"}},
    "participants": [{"id": "S01"}],
    "recordings": [{"participant": "S01", "file": "a.csv"}],
}
ENTRY = MINIMAL["recordings"][0]

# --- words ---------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("condition", "names"),
    [
        ("unperturbed", ("unperturbed", "NPC", "E-NPC", "ENP")),
        ("perturbed", ("perturbed", "APC", "E-APC", "EWP")),
        ("no_device", ("no_device", "NWC")),
    ],
)
def test_conditions_have_the_names_of_the_dissertation_in_any_case(condition, names):
    for name in names:
        for written in (name, name.lower(), name.title(), f"  {name}\t"):
            assert RecordingSpec(**ENTRY, condition=written).condition == condition


def test_every_direction_has_an_opposite_and_is_taken():
    for direction, opposite in OPPOSITE_DIRECTION.items():
        assert OPPOSITE_DIRECTION[opposite] == direction != opposite
        assert ChannelSpec(column="a", positive=direction).positive == direction


@pytest.mark.parametrize(("value", "name"), [(7, "7"), ("S01", "S01")])
def test_a_whole_number_is_a_name(value, name):
    assert ParticipantSpec(id=value).id == name
    assert RecordingSpec(participant=value, file="a", session=value).session == name


def test_a_column_is_a_name_or_a_number():
    for column in ("a", 0, ""):
        assert ChannelSpec(column=column).column == column


def test_the_first_timing_point_may_stand_at_the_heel_strike():
    points = {"LRE": 0, "TSW": 99.9}
    assert PerturbationsSpec(timing_points=points).timing_points == points


LIMB_PARTS = {"limb_mass_kg": 72.4, "limb_centre_m": 0.26}


@pytest.mark.parametrize(
    "given", [{"limb_mass_kg": 0.3}, {"limb_centre_m": 0.3}, LIMB_PARTS | {"mass_kg": 72.4}]
)
def test_a_limb_has_mass_and_centre_and_is_lighter_than_its_person(given):
    with pytest.raises(ValidationError, match="limb_mass_kg"):
        ParticipantSpec(id="S01", **given)
    assert ParticipantSpec(id="S01", **LIMB_PARTS).limb_mass_kg == 72.4


# --- calibration ---------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("entries", "place"),
    [
        ({"torque_gain": 0.0}, "torque_gain"),
        ({"angle_gain": -1.0}, "angle_gain"),
        ({"tissue_hz": 0.0}, "tissue_hz"),
        ({"contact_threshold_v": 2.0}, "contact_release_v"),
        ({"contact_release_v": 2.0}, "contact_threshold_v"),
        ({"contact_threshold_v": 1.0, "contact_release_v": 1.0}, "contact_threshold_v"),
    ],
)
def test_a_calibration_that_cannot_be_is_refused(entries, place):
    with pytest.raises(ValidationError, match=f"{place}: "):
        calibration(**entries)


def calibration(**values: float) -> CalibrationSpec:
    return CalibrationSpec.model_validate({k: {"value": v, "sd": 0.1} for k, v in values.items()})


def test_a_calibration_is_overridden_entry_by_entry():
    own = calibration(torque_gain=1.1, angle_lag_s=0.01)

    over = own.overridden_by(calibration(angle_lag_s=0.02, intrinsic_damping=0.3))

    assert over == calibration(torque_gain=1.1, angle_lag_s=0.02, intrinsic_damping=0.3)
    assert own == calibration(torque_gain=1.1, angle_lag_s=0.01)
    assert own.overridden_by(None) is own
    assert own.overridden_by(CalibrationSpec()) == own
    levels = calibration(contact_threshold_v=2.1, contact_release_v=1.2)
    assert (levels.contact_levels_v, own.contact_levels_v) == ((1.2, 2.1), None)


@pytest.mark.parametrize("person", [True, False])
@pytest.mark.parametrize("recording", [True, False])
def test_the_recording_stands_over_the_person_and_the_person_over_the_study(person, recording):
    def table(value: float) -> dict:
        return {"calibration": {"torque_gain": {"value": value, "sd": 0.0}}}

    spec = StudySpec.model_validate(
        MINIMAL
        | table(1.0)
        | {"participants": [{"id": "S01"} | (table(2.0) if person else {}), {"id": "S02"}]}
        | {"recordings": [MINIMAL["recordings"][0] | (table(3.0) if recording else {})]}
    )

    expected = 3.0 if recording else 2.0 if person else 1.0
    assert spec.calibration_of(spec.recordings[0]).torque_gain.value == expected
