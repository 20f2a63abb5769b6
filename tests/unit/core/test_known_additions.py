"""Known additions to a walking joint: in a protocol and in a study."""

import copy
import tomllib
from math import hypot
from pathlib import Path

import pytest
from pydantic import ValidationError

from jointz.core.protocols.protocol import Protocol
from jointz.core.protocols.protocol_models import LoadSpec
from jointz.core.study import StudySpec

EXAMPLE = Path(__file__).parents[3] / "examples" / "known_addition" / "walking_known_addition.toml"
CONTENT = tomllib.loads(EXAMPLE.read_text(encoding="utf-8"))
MASS, DISTANCE = {"value": 2.0, "sd": 0.02}, {"value": 0.25, "sd": 0.005}
STIFFNESS = {"value": 30.0, "sd": 0.6}


def problems(content, model=Protocol):
    """Return place -> message of what is wrong."""
    with pytest.raises(ValidationError) as caught:
        model.model_validate(content)
    return {".".join(map(str, error["loc"])): error["msg"] for error in caught.value.errors()}


def changed(*places):
    """Return the example with other values; None takes a key out."""
    content = copy.deepcopy(CONTENT)
    for *path, key, value in places:
        part = content
        for step in path:
            part = part[step]
        if value is None:
            del part[key]
        else:
            part[key] = value
    return content


def test_a_weight_adds_mass_times_distance_squared_and_its_gravity():
    load = LoadSpec(name="cuff", mass_kg=MASS, distance_m=DISTANCE)

    assert load.added_inertia.value == pytest.approx(0.125)
    assert load.added_inertia.sd == pytest.approx(0.125 * hypot(0.01, 2 * 0.02))
    assert load.gravity_nm.value == pytest.approx(2.0 * 9.81 * 0.25)
    assert load.gravity_nm.sd == pytest.approx(4.905 * hypot(0.01, 0.02))
    assert set(load.properties) == {"inertia", "gravity_nm"}


def test_a_stated_inertia_has_no_gravity():
    load = LoadSpec(name="disc", inertia={"value": 0.1, "sd": 0.001})

    assert load.added_inertia == load.inertia
    assert load.gravity_nm.value == load.gravity_nm.sd == 0.0
    assert set(load.properties) == {"inertia"}


def test_the_example_says_which_condition_has_which_load():
    loads = Protocol.model_validate(CONTENT).condition_loads

    assert {name: load.name for name, load in loads.items()} == {
        "unperturbed_2": "cuff", "perturbed_2": "cuff", "perturbed_3": "cuff",
        "unperturbed_band": "band", "perturbed_band": "band",
    }  # fmt: skip


@pytest.mark.parametrize(
    ("places", "place", "message"),
    [
        ([("conditions", 5, "load", "brick")], "conditions.5.load", "expected one of cuff, band"),
        ([("conditions", 3, "load", None)], "conditions.3.load", "expected 'cuff', as in"),
        ([("conditions", 1, "load", "cuff")], "conditions.1.load", "expected none, as in"),
        ([("loads", 0, "distance_m", None)], "loads.0.distance_m", "missing; mass_kg and"),
        ([("loads", 0, "inertia", MASS)], "loads.0.inertia", "Remove one of the two"),
        ([("loads", 0, "mass_kg", {"value": -2.0, "sd": 0.0})], "loads.0.mass_kg.value", "0 to 20"),
        ([("loads", 1, "stiffness", None)], "loads.1", "Add one of them"),
        ([("loads", 1, "locked", True)], "loads.1", "remove damping and locked"),
        ([("loads", 1, "damping", STIFFNESS)], "loads.1", "remove damping and locked"),
        ([("conditions", k, "load", "cuff") for k in (5, 6)], "loads", "no condition has load"),
    ],
)  # fmt: skip
def test_a_problem_of_an_addition_names_place_and_remedy(places, place, message):
    assert message in problems(changed(*places))[place]


def test_no_device_may_be_worn_with_a_load():
    no_device = {"name": "bare", "condition": "no_device", "session": "with", "load": "cuff"}
    condition = {**no_device, "prompt": "", "strides": 20}

    protocol = Protocol.model_validate(
        {**CONTENT, "conditions": [*CONTENT["conditions"], condition]}
    )
    assert protocol.condition_loads["bare"].name == "cuff"


@pytest.mark.parametrize("kind", ["bench", "calibration"])
def test_only_walking_has_conditions_with_a_load(kind):
    content = {
        "jointz_protocol": 1, "name": "a", "title": "A", "kind": kind, "joint": "knee",
        "loads": [{"name": "cuff", "mass_kg": MASS, "distance_m": DISTANCE}],
        "conditions": [{
            "name": "a", "condition": "unperturbed", "prompt": "", "duration_s": 5.0,
            "load": "cuff",
        }],
    }  # fmt: skip
    found = problems(content)
    assert "belongs to kind = 'walking'" in found["conditions.0.load"]
    assert "belongs to kind = 'walking'" in found["loads.0.mass_kg"]


def study(*additions):
    return {
        "jointz": 1, "joint": "knee", "kind": "walking",
        "channels": {"time": {"column": "t", "unit": "s"}},
        "participants": [{"id": "S01"}],
        "recordings": [
            {"participant": "S01", "file": f"{name}.nc", "session": name}
            for name in ("without", "with")
        ],
        "additions": list(additions),
    }  # fmt: skip


def test_a_study_states_the_addition_of_a_session():
    (addition,) = StudySpec.model_validate(
        study({"session": "with", "stiffness": STIFFNESS})
    ).additions

    assert addition.session == "with"
    assert (addition.stiffness.value, addition.inertia, addition.gravity_nm) == (30.0, None, None)


@pytest.mark.parametrize(
    ("additions", "message"),
    [
        ([{"session": "with"}], "above 0"),
        ([{"session": "with", "stiffness": {"value": -1.0, "sd": 0.0}}], "above 0"),
        ([{"session": "later", "stiffness": STIFFNESS}], "no recording has session 'later'"),
        ([{"session": "with", "stiffness": STIFFNESS}] * 2, "'with' is given twice"),
        (
            [{"session": "with", "damping": STIFFNESS}],
            "damping: not for kind 'walking'",
        ),
    ],
)
def test_a_study_refuses_additions_that_it_cannot_use(additions, message):
    assert message in " ".join(problems(study(*additions), StudySpec).values())
