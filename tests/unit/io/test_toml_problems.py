"""Problems of TOML files: full paths, everything at once, each once."""

import pytest
from pydantic import ValidationError

from jointz.core.errors import ProtocolError, StudyError
from jointz.core.protocols.protocol import Protocol
from jointz.core.study import StudySpec
from jointz.io.toml_problems import all_problems, parse_toml, shape_problems

CONDITION = {"name": "a", "condition": "perturbed", "prompt": "", "duration_s": 5.0}
BENCH = {"jointz_protocol": 1, "name": "b", "title": "B", "kind": "bench", "joint": "j"}
BENCH["conditions"] = [CONDITION]


def found(raw, judge=all_problems):
    with pytest.raises(ValidationError) as caught:
        Protocol.model_validate(raw)
    return judge(caught.value, Protocol, raw)


def with_reference(**reference):
    return {**BENCH, "conditions": [{**CONDITION, "torque_nm": reference}]}


@pytest.mark.parametrize(
    ("raw", "path"),
    [
        (with_reference(kind="sine", amplitude="5", frequency_hz=1.0), "torque_nm.amplitude"),
        (with_reference(kind="sine", amplitude=5.0, frequency_h=1.0), "torque_nm.frequency_h"),
        (with_reference(kind="sines", amplitude=5.0), "torque_nm.kind"),
        (with_reference(amplitude=5.0), "torque_nm.kind"),
        ({**BENCH, "conditions": [{**CONDITION, "torque_nm": 5}]}, "torque_nm"),
        (with_reference(kind="steps", levels=[1.0, "x"], hold_s=1.0), "torque_nm.levels[2]"),
        ({**BENCH, "zzz": 1}, "zzz"),
        ({**BENCH, "safety": {"torque": 3.0}}, "safety.torque"),
        ({**BENCH, "jointz_protocol": 2}, "jointz_protocol"),
        (
            {**BENCH, "loads": [{"name": "k", "stiffness": {"value": 1.0}}]},
            "loads[1].stiffness.sd",
        ),
    ],
)
def test_a_problem_begins_with_the_key_s_full_path(raw, path):
    path = f"conditions[1].{path}" if path.startswith("torque_nm") else path
    assert any(told.startswith(f"{path}: ") for told in found(raw))


def test_a_key_that_is_nearly_right_is_suggested():
    (told,) = found({**BENCH, "safety": {"torque": 3.0}}, shape_problems)
    assert "'torque_nm'" in told


def test_shape_alone_leaves_out_what_does_not_go_together():
    raw = {**BENCH, "conditions": [CONDITION, CONDITION], "seed": "one"}

    (told,) = found(raw, shape_problems)
    assert told.startswith("seed: ")


def test_inconsistencies_are_told_beside_what_cannot_be_read():
    plan = {"count": 3, "pause_s": "1", "gap_strides": [3, 1], "orders": "x", "sham_share": 0.001}
    raw = {
        **BENCH,
        "pulse": {"amplitude_nm": 7.0, "duration_s": 0.2, "hold_s": 0.1, "direction": "both"},
        "safety": {"torque_nm": 6.0, "angle_min_rad": 1.0, "angle_max_rad": 0.0, "more": 1},
        "conditions": [{**CONDITION, "perturbations": plan}, {**CONDITION, "strides": 2}],
    }

    assert {told.split(": ")[0] for told in found(raw)} == {
        "safety.more",
        "safety.angle_min_rad",
        "pulse.duration_s",
        "pulse.amplitude_nm",
        "conditions",
        "conditions[1].perturbations.pause_s",
        "conditions[1].perturbations.orders",
        "conditions[1].perturbations.gap_strides",
        "conditions[1].perturbations.sham_share",
        "conditions[1].perturbations.count",
        "conditions[2].strides",
        "conditions[2].perturbations",
    }


def test_each_problem_is_told_once():
    raw = {**BENCH, "conditions": [CONDITION, {**CONDITION, "strides": 2}]}

    told = found(raw)

    assert len(told) == len(set(told))


@pytest.mark.parametrize(
    "broken",
    [
        {"pulse": 3},
        {"conditions": [3, 4]},
        {"conditions": {"a": 1}},
        {"rates": {"control_hz": "x"}},
        {"loads": [[]]},
    ],
)
def test_what_cannot_be_read_makes_no_other_problem(broken):
    key = next(iter(broken))
    whole = {
        **BENCH,
        "pulse": {"amplitude_nm": 7.0, "duration_s": 0.2, "hold_s": 0.2},
        "conditions": [{**CONDITION, "perturbations": {"count": 2, "pause_s": 1.0}}],
        **broken,
    }

    assert [told for told in found(whole) if not told.startswith(key)] == []


@pytest.mark.parametrize("error", [StudyError, ProtocolError])
@pytest.mark.parametrize(
    "text", [b"a = ", b"\xff\xfe", b"a = 99999999999999999999", b"a = [" * 5000]
)
def test_what_is_no_toml_is_said_to_be_none(text, error):
    with pytest.raises(error, match=r"f\.toml: 1 problem\n  - not valid"):
        parse_toml("f.toml", text, error=error)


def test_a_mark_at_the_start_of_the_file_is_no_trouble():
    assert parse_toml("f.toml", b"\xef\xbb\xbfa = 1", error=StudyError) == {"a": 1}


def test_a_problem_between_keys_of_a_study_names_them_alone():
    raw = {"jointz": 1, "joint": "knee", "kind": "bench", "coupling": "strap", "channels": {}}
    raw |= {"participants": [{"id": "S01"}], "recordings": [{"participant": "S01", "file": "a"}]}
    with pytest.raises(ValidationError) as caught:
        StudySpec.model_validate(raw)
    assert shape_problems(caught.value, StudySpec, raw) == [
        'coupling: belongs to kind "walking", and this is "bench"; remove it.'
    ]
