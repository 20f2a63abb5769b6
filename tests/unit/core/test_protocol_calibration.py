"""What belongs to the protocol of a calibration's step, and what does not."""

from typing import get_args

import pytest
from pydantic import ValidationError

from jointz.core.protocols.protocol import Protocol
from jointz.core.protocols.protocol_calibration_checks import STEP_RULES
from jointz.core.protocols.protocol_models import CalibrationStep
from jointz.io.protocols import load_protocol
from jointz.io.toml_problems import all_problems

PULSE = {"amplitude_nm": 5.0, "duration_s": 0.1, "hold_s": 0.1, "direction": "both"}
PULSES = {"count": 4, "pause_s": 2.0}
WEIGHT = {
    "name": "weighted",
    "inertia": {"value": 0.18, "sd": 0.004},
    "stiffness": {"value": 5.9, "sd": 0.06},
}


def condition(name, **changes):
    return {"name": name, "condition": "unperturbed", "prompt": "?", "duration_s": 9.0} | changes


def pulses(name, **changes):
    return condition(name, condition="perturbed", perturbations=PULSES) | changes


def step(name, conditions, **changes):
    made = {
        "jointz_protocol": 1,
        "name": "c",
        "title": "T",
        "kind": "calibration",
        "calibration": name,
        "joint": "knee",
        "conditions": conditions,
    }
    return {key: value for key, value in (made | changes).items() if value is not None}


def problems(raw):
    with pytest.raises(ValidationError) as caught:
        Protocol.model_validate(raw)
    return all_problems(caught.value, Protocol, raw)


def leg(conditions=None, **changes):
    made = {"pulse": PULSE, "loads": [WEIGHT]}
    return step("leg", conditions or [pulses("bare"), pulses("weighted")], **(made | changes))


ZERO = [condition("straight")]
SINE = {"kind": "sine", "amplitude": 10.0, "frequency_hz": 0.1}

WRONG = [
    (step(None, ZERO), "calibration"),
    (step("lag", ZERO), "calibration"),
    (step("zero", ZERO, kind="bench"), "calibration"),
    (step("zero", ZERO, gait={"speed_m_s": 1.2}), "gait"),
    (step("zero", ZERO, bench="series-elastic"), "bench"),
    (step("zero", [*ZERO, condition("again")]), "conditions[2].name"),
    (leg(conditions=[pulses("bare")]), "conditions"),
    (step("zero", [condition("straight", condition="no_device")]), "conditions[1].condition"),
    (step("zero", [condition("straight", trials=2)]), "conditions[1].trials"),
    (step("zero", [condition("straight", session="one")]), "conditions[1].session"),
    (step("footswitch", [condition("walking", strides=60)]), "conditions[1].strides"),
    (step("hinge", [condition("swing", torque_nm=SINE)]), "conditions[1].torque_nm"),
    (
        step("torsion", [pulses("locked", torque_nm=SINE)], pulse=PULSE),
        "conditions[1].perturbations",
    ),
    (step("torsion", [condition("locked")]), "conditions[1].torque_nm"),
    (step("frame", [condition("pulses")]), "conditions[1].perturbations"),
    (leg(pulse=PULSE | {"direction": "positive"}), "pulse.direction"),
    (leg(loads=[]), "loads"),
    (leg(loads=[{"name": "weighted", "inertia": {"value": 0.2, "sd": 0.0}}]), "loads[1].stiffness"),
    (
        step(
            "spring",
            [condition("spring", condition="perturbed", torque_nm=SINE)],
            loads=[{"name": "spring", "stiffness": {"value": 0.0, "sd": 1.0}}],
        ),
        "loads[1].stiffness",
    ),
    (leg(loads=[WEIGHT, {"name": "bare"}]), "loads[2].name"),
    (step("zero", ZERO, loads=[{"name": "straight"}]), "loads[1].name"),
    (
        leg(loads=[{"name": "weighted", "locked": True} | {"stiffness": WEIGHT["stiffness"]}]),
        "loads[1].locked",
    ),
]


@pytest.mark.parametrize(("raw", "place"), WRONG, ids=[place for _, place in WRONG])
def test_what_does_not_belong_to_a_step_is_refused_at_its_key(raw, place):
    assert [told for told in problems(raw) if told.startswith(f"{place}: ")], problems(raw)


def test_every_step_has_rules_and_a_built_in_protocol():
    assert tuple(STEP_RULES) == get_args(CalibrationStep)
    for name in STEP_RULES:
        protocol = load_protocol(f"calibration-{name}")
        assert (protocol.kind, protocol.calibration) == ("calibration", name)
        assert protocol.participants == protocol.cases == 10
        assert not protocol.cases_are_loads
        assert {load.name for load in protocol.loads} <= {c.name for c in protocol.conditions}
    made, bench = Protocol.model_validate(leg(participants=3)), load_protocol("sea-mass-spring")
    assert (made.cases, len(made.loads)) == (3, 1)
    assert (bench.cases, bench.cases_are_loads) == (len(bench.loads), True)
