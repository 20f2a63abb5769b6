"""The models behind study.toml: what they take, what they refuse, and what stands over what."""

import itertools
import math

import pytest
from pydantic import ValidationError

from jointz.core.channels import OPPOSITE_DIRECTION
from jointz.core.study import (
    Calibrated,
    CalibrationSpec,
    ChannelSpec,
    DeviceSpec,
    FilesSpec,
    GroupSpec,
    ParticipantSpec,
    PerturbationsSpec,
    RecordingSpec,
    StudySpec,
    TorqueModelSpec,
)

MINIMAL = {
    "jointz": 1,
    "joint": "knee",
    "kind": "walking",
    "channels": {"angle": {"column": "a"}},
    "participants": [{"id": "S01"}],
    "recordings": [{"participant": "S01", "file": "a.csv"}],
}


def refused(model, **values) -> str:
    """Give values to a model, expect one problem, and return key and message."""
    with pytest.raises(ValidationError) as caught:
        model.model_validate(values)
    (error,) = caught.value.errors()
    return f"{'.'.join(map(str, error['loc']))}: {error['msg']}"


# --- the whole -----------------------------------------------------------------------------------


def test_a_minimal_study_has_the_defaults_of_the_format():
    spec = StudySpec.model_validate(MINIMAL)

    assert (spec.positive, spec.torque_acts_on, spec.sample_rate_hz) == ("flexion", "joint", None)
    assert spec.perturbations.window_s == 0.1
    assert spec.perturbations.cutoff_hz == 20.0
    assert (spec.perturbations.source, spec.perturbations.baseline) == (None, None)
    assert spec.files.model_dump() == {
        "delimiter": None,
        "decimal": ".",
        "skip_rows": 0,
        "header": True,
    }
    assert spec.calibration == CalibrationSpec()
    assert spec.torque_model is None
    assert spec.device is None


@pytest.mark.parametrize("key", MINIMAL)
def test_every_key_of_a_minimal_study_is_required(key):
    without = {k: v for k, v in MINIMAL.items() if k != key}

    assert refused(StudySpec, **without) == f"{key}: Field required"


@pytest.mark.parametrize("key", ["participants", "recordings"])
def test_a_study_has_somebody_and_something(key):
    assert refused(StudySpec, **(MINIMAL | {key: []})).startswith(f"{key}: Tuple should have at")


@pytest.mark.parametrize(
    "model",
    [
        StudySpec,
        ChannelSpec,
        Calibrated,
        CalibrationSpec,
        TorqueModelSpec,
        ParticipantSpec,
        RecordingSpec,
        GroupSpec,
        PerturbationsSpec,
        FilesSpec,
    ],
)
def test_unknown_keys_are_refused_at_every_level(model):
    with pytest.raises(ValidationError) as caught:
        model.model_validate({"colour": "red"})

    assert ("colour",) in [
        e["loc"] for e in caught.value.errors() if e["type"] == "extra_forbidden"
    ]


def test_a_study_cannot_be_changed():
    spec = StudySpec.model_validate(MINIMAL)

    with pytest.raises(ValidationError, match="frozen"):
        spec.joint = "ankle"


PERSON, DEVICE = {"id": "S01"}, {"mass_kg": 1.0, "centre_m": 0.18}
LIMB = PERSON | {"limb_mass_kg": 4.4, "limb_centre_m": 0.26}
GEAR = {"gear_ratio": 6.0, "torque_constant": 0.1}
WRONG = [
    *((StudySpec, MINIMAL, "jointz", version) for version in (2, 0, True, 1.0, "1")),
    *((StudySpec, MINIMAL, "joint", joint) for joint in ("", 3)),
    (StudySpec, MINIMAL, "kind", "running"),
    (StudySpec, MINIMAL, "torque_acts_on", "Joint"),
    *((StudySpec, MINIMAL, "sample_rate_hz", rate) for rate in (0, "1000", math.inf, True)),
    *((ParticipantSpec, PERSON, "id", name) for name in ("", True, 1.5, None, ["S01"])),
    *((ParticipantSpec, PERSON, "mass_kg", mass) for mass in (0, "72", math.nan)),
    *((ParticipantSpec, PERSON, "height_m", height) for height in (-1.0, 174.0)),
    (ParticipantSpec, PERSON, "group", ""),
    (ParticipantSpec, LIMB, "limb_centre_m", 26.0),
    *((DeviceSpec, DEVICE, "mass_kg", mass) for mass in (0.0, "1", None)),
    *((DeviceSpec, DEVICE, "centre_m", centre) for centre in (-0.1, 18.0, None)),
    (DeviceSpec, DEVICE, "inertia", 0.03),
    (FilesSpec, {}, "delimiter", ""),
    (FilesSpec, {}, "decimal", ";"),
    *((FilesSpec, {}, "skip_rows", rows) for rows in (-1, 1.0)),
    (FilesSpec, {}, "header", 0),
    *((PerturbationsSpec, {}, "window_s", window) for window in (0.0009, 10.1)),
    (PerturbationsSpec, {}, "cutoff_hz", 0),
    (PerturbationsSpec, {}, "source", "pulses"),
    (PerturbationsSpec, {}, "baseline", "mean"),
    (PerturbationsSpec, {}, "timing_points", {"LRE": math.nan}),
    (ChannelSpec, {"column": "a"}, "positive", 1),
    *((TorqueModelSpec, GEAR, "gear_ratio", ratio) for ratio in (0, -3.0)),
]


@pytest.mark.parametrize(("model", "valid", "key", "value"), WRONG)
def test_a_wrong_value_is_refused_at_its_key(model, valid, key, value):
    assert model.model_validate(valid)
    assert refused(model, **(valid | {key: value})).startswith(key)


# --- words ---------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("name", "condition"),
    [
        ("unperturbed", "unperturbed"),
        ("perturbed", "perturbed"),
        ("no_device", "no_device"),
        ("NPC", "unperturbed"),
        ("E-NPC", "unperturbed"),
        ("ENP", "unperturbed"),
        ("APC", "perturbed"),
        ("E-APC", "perturbed"),
        ("EWP", "perturbed"),
        ("NWC", "no_device"),
    ],
)
def test_conditions_have_the_names_of_the_dissertation_in_any_case(name, condition):
    for written in (name, name.lower(), name.upper(), name.title(), f"  {name}\t"):
        entry = RecordingSpec(participant="S01", file="a.csv", condition=written)
        assert entry.condition == condition


@pytest.mark.parametrize("value", ["EPN", "", 1, True, ["perturbed"]])
def test_an_unknown_condition_is_refused(value):
    told = refused(RecordingSpec, participant="S01", file="a.csv", condition=value)

    assert told == "condition: Input should be 'unperturbed', 'perturbed' or 'no_device'"


@pytest.mark.parametrize("direction", sorted(OPPOSITE_DIRECTION))
def test_every_direction_has_an_opposite_and_is_taken(direction):
    assert OPPOSITE_DIRECTION[OPPOSITE_DIRECTION[direction]] == direction
    assert OPPOSITE_DIRECTION[direction] != direction
    assert ChannelSpec(column="a", positive=direction).positive == direction


def test_an_unknown_direction_is_refused_with_those_known():
    told = refused(StudySpec, **(MINIMAL | {"positive": "Flexion"}))

    assert told == (
        "positive: Value error, expected one of abduction, adduction, dorsiflexion, eversion, "
        "extension, external_rotation, flexion, internal_rotation, inversion, plantarflexion, "
        "pronation, radial_deviation, supination, ulnar_deviation; got 'Flexion'"
    )


@pytest.mark.parametrize(("value", "name"), [(7, "7"), ("S01", "S01")])
def test_a_whole_number_is_a_name(value, name):
    assert ParticipantSpec(id=value).id == name
    assert RecordingSpec(participant=value, file="a", session=value).session == name


@pytest.mark.parametrize("value", [True, 1.0, None, ["a"]])
def test_a_column_is_a_name_or_a_number(value):
    told = refused(ChannelSpec, column=value)

    assert told == "column: Value error, expected the name or the number of a column"


@pytest.mark.parametrize("column", ["a", 0, 3, ""])
def test_a_column_by_name_or_number_is_kept(column):
    assert ChannelSpec(column=column).column == column


@pytest.mark.parametrize(
    ("given", "missing"),
    [("limb_mass_kg", "limb_centre_m"), ("limb_centre_m", "limb_mass_kg")],
)
def test_mass_and_centre_of_a_limb_go_together(given, missing):
    told = refused(ParticipantSpec, id="S01", **{given: 0.3})

    assert told.endswith(f"{missing}: missing; limb_mass_kg and limb_centre_m go together")


def test_a_limb_is_lighter_than_its_person():
    limb = {"limb_mass_kg": 72.4, "limb_centre_m": 0.26}

    assert "72.4 kg is not less than mass_kg" in refused(
        ParticipantSpec, id="S01", mass_kg=72.4, **limb
    )
    assert ParticipantSpec(id="S01", **limb).limb_mass_kg == 72.4


def test_a_limb_and_a_device_that_were_weighed_are_kept():
    person = ParticipantSpec(id="S01", mass_kg=72.4, limb_mass_kg=4.4, limb_centre_m=0.26)
    study = StudySpec.model_validate(MINIMAL | {"device": {"mass_kg": 1.0, "centre_m": 0.18}})

    assert (person.limb_mass_kg, person.limb_centre_m) == (4.4, 0.26)
    assert study.device == DeviceSpec(mass_kg=1.0, centre_m=0.18)


# --- perturbations -------------------------------------------------------------------------------


@pytest.mark.parametrize("pct", [0, 0.0, 7, 99.9])
def test_timing_points_lie_in_the_cycle(pct):
    assert PerturbationsSpec(timing_points={"LRE": pct}).timing_points == {"LRE": pct}


@pytest.mark.parametrize("pct", [-0.1, 100, 140.0])
def test_a_timing_point_outside_the_cycle_is_refused(pct):
    assert refused(PerturbationsSpec, timing_points={"LRE": 7.0, "MST": pct}).endswith(
        f"timing_points.MST: expected 0 <= % of cycle < 100, got {float(pct)}"
    )


def test_no_timing_point_has_the_name_of_all_of_them():
    told = "timing_points.all: means all of them; expected another name"
    assert refused(PerturbationsSpec, timing_points={"LRE": 7.0, "all": 56.0}).endswith(told)


@pytest.mark.parametrize("edges", [(0.0, 0.0), (1.0, 0.0), (0.0, 2.0, 1.0)])
def test_edges_of_groups_increase(edges):
    assert refused(GroupSpec, channel="x", edges=list(edges)) == (
        f": Value error, edges must increase, got {list(edges)}"
    )


@pytest.mark.parametrize("edges", [[1.0], [], 1.0, ["0", "1"], [0.0, math.inf]])
def test_edges_of_groups_are_two_numbers_or_more(edges):
    with pytest.raises(ValidationError) as caught:
        GroupSpec.model_validate({"channel": "x", "edges": edges})

    assert {error["loc"][0] for error in caught.value.errors()} == {"edges"}


# --- calibration ---------------------------------------------------------------------------------


@pytest.mark.parametrize("name", ["torque_gain", "angle_gain"])
@pytest.mark.parametrize("value", [0.0, -1.0])
def test_a_gain_must_be_positive(name, value):
    told = refused(CalibrationSpec, **{name: {"value": value, "sd": 0.0}})

    assert told == f": Value error, {name}: measured over true must be positive, got {value}"


@pytest.mark.parametrize(
    ("entries", "told"),
    [
        ({"tissue_hz": 0.0}, "tissue_hz: must be positive, got 0.0"),
        (
            {"contact_threshold_v": 2.0},
            "contact_release_v: missing; contact_threshold_v and contact_release_v go together",
        ),
        (
            {"contact_release_v": 2.0},
            "contact_threshold_v: missing; contact_threshold_v and contact_release_v go together",
        ),
        (
            {"contact_threshold_v": 1.0, "contact_release_v": 1.0},
            "contact_threshold_v: 1.0 V must lie above contact_release_v, 1.0 V; a switch that is "
            "low on the ground must be turned in the file",
        ),
    ],
)
def test_levels_of_a_footswitch_are_two_and_a_tissue_resonates(entries, told):
    given = {name: {"value": value, "sd": 0.0} for name, value in entries.items()}

    assert refused(CalibrationSpec, **given) == f": Value error, {told}"


def test_the_levels_of_a_footswitch_are_lower_and_upper():
    given = calibration(contact_threshold_v=2.1, contact_release_v=1.2)

    assert given.contact_levels_v == (1.2, 2.1)
    assert calibration(angle_gain=1.1).contact_levels_v is None


def test_a_lag_may_be_negative_and_its_sd_may_not():
    entry = CalibrationSpec(angle_lag_s={"value": -0.01, "sd": 0.0}).angle_lag_s

    assert (entry.value, entry.sd) == (-0.01, 0.0)
    assert refused(Calibrated, value=1.0, sd=-0.1).startswith("sd: ")
    assert refused(Calibrated, value=1.0) == "sd: Field required"


def calibration(**values: float) -> CalibrationSpec:
    return CalibrationSpec.model_validate({k: {"value": v, "sd": 0.1} for k, v in values.items()})


def test_a_calibration_is_overridden_entry_by_entry():
    own = calibration(torque_gain=1.1, angle_lag_s=0.01)

    over = own.overridden_by(calibration(angle_lag_s=0.02, intrinsic_damping=0.3))

    assert over == calibration(torque_gain=1.1, angle_lag_s=0.02, intrinsic_damping=0.3)
    assert own == calibration(torque_gain=1.1, angle_lag_s=0.01)
    assert own.overridden_by(None) is own
    assert own.overridden_by(CalibrationSpec()) == own


@pytest.mark.parametrize(("person", "recording"), list(itertools.product([True, False], repeat=2)))
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


def test_a_torque_model_needs_gear_and_constant_and_has_no_friction_by_default():
    model = TorqueModelSpec(gear_ratio=6, torque_constant=0.1)

    rest = model.model_dump(exclude={"gear_ratio", "torque_constant"})
    assert set(rest.values()) == {0.0}
    assert refused(TorqueModelSpec, gear_ratio=6.0) == "torque_constant: Field required"


# --- an opened study -----------------------------------------------------------------------------
