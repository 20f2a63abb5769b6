"""What belongs to the protocol of a calibration's step, and what does not."""

from typing import get_args

import pytest
from pydantic import ValidationError

from jointz.core.protocols.protocol import CalibrationStep, Protocol
from jointz.core.protocols.protocol_calibration_checks import STEP_RULES
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

WRONG = {
    "no step": (step(None, ZERO), "calibration: missing; expected the step, one of zero,"),
    "no such step": (step("lag", ZERO), "calibration: expected 'zero', 'footswitch',"),
    "a step of a bench": (
        step("zero", ZERO, kind="bench"),
        'calibration: bench has no step. Remove it, or set kind = "calibration".',
    ),
    "a walk": (step("zero", ZERO, gait={"speed_m_s": 1.2}), "gait: a calibration does not walk."),
    "a bench": (step("zero", ZERO, bench="series-elastic"), "bench: calibration needs none."),
    "another name": (
        step("zero", [*ZERO, condition("again")]),
        "conditions[2].name: expected 'straight', by which the analysis tells what was done; got "
        "'again'.",
    ),
    "one too few": (
        leg(conditions=[pulses("bare")]),
        "conditions: 'leg' has the conditions 'bare' and 'weighted'; missing: 'weighted'.",
    ),
    "without device": (
        step("zero", [condition("straight", condition="no_device")]),
        'conditions[1].condition: expected "unperturbed" or "perturbed"',
    ),
    "several trials": (
        step("zero", [condition("straight", trials=2)]),
        "conditions[1].trials: a calibration has no use for it",
    ),
    "a session": (
        step("zero", [condition("straight", session="one")]),
        "conditions[1].session: a calibration has no use for it",
    ),
    "strides": (
        step("footswitch", [condition("walking", strides=60)]),
        "conditions[1].strides: belongs to kind = 'walking', and this is 'calibration'.",
    ),
    "torque where there is none": (
        step("hinge", [condition("swing", torque_nm=SINE)]),
        "conditions[1].torque_nm: 'hinge' has none. Remove it.",
    ),
    "pulses where there are none": (
        step("torsion", [pulses("locked", torque_nm=SINE)], pulse=PULSE),
        "conditions[1].perturbations: 'torsion' has none. Remove it.",
    ),
    "no torque": (
        step("torsion", [condition("locked")]),
        "conditions[1].torque_nm: missing; 'torsion' needs it.",
    ),
    "no pulses": (
        step("frame", [condition("pulses")]),
        "conditions[1].perturbations: missing; 'frame' needs it.",
    ),
    "pulses of one sign": (
        leg(pulse=PULSE | {"direction": "positive"}),
        'pulse.direction: expected "both": pulses of one sign cannot tell friction from torque; '
        'got "positive".',
    ),
    "no known load": (leg(loads=[]), "loads: missing: 'weighted', the known load of that"),
    "half a known load": (
        leg(loads=[{"name": "weighted", "inertia": {"value": 0.2, "sd": 0.0}}]),
        "loads[1].stiffness: missing; the step compares with it. Give value and sd.",
    ),
    "a load of nothing": (
        step(
            "spring",
            [condition("spring", condition="perturbed", torque_nm=SINE)],
            loads=[{"name": "spring", "stiffness": {"value": 0.0, "sd": 1.0}}],
        ),
        "loads[1].stiffness: missing; the step compares with it.",
    ),
    "a load of another name": (
        leg(loads=[WEIGHT, {"name": "bare"}]),
        "loads[2].name: 'leg' has a known load in 'weighted'; got 'bare'.",
    ),
    "a load where there is none": (
        step("zero", ZERO, loads=[{"name": "straight"}]),
        "loads[1].name: 'zero' has a known load in none; got 'straight'.",
    ),
    "a locked load": (
        leg(loads=[{"name": "weighted", "locked": True} | {"stiffness": WEIGHT["stiffness"]}]),
        "loads[1].locked: a known load moves.",
    ),
}


@pytest.mark.parametrize("what", WRONG)
def test_it_is_told_what_is_wrong_and_what_to_do(what):
    raw, expected = WRONG[what]
    assert [told for told in problems(raw) if told.startswith(expected)], problems(raw)


def test_every_step_has_rules_and_a_built_in_protocol():
    assert tuple(STEP_RULES) == get_args(CalibrationStep)
    for name in STEP_RULES:
        protocol = load_protocol(f"calibration-{name}")
        assert (protocol.kind, protocol.calibration) == ("calibration", name)
        assert protocol.participants == protocol.cases == 10
        assert not protocol.cases_are_loads
        assert {load.name for load in protocol.loads} <= {c.name for c in protocol.conditions}


def test_participants_and_loads_stand_beside_each_other():
    made = Protocol.model_validate(leg(participants=3))
    assert (made.cases, len(made.loads)) == (3, 1)


def test_a_bench_counts_its_loads():
    bench = load_protocol("sea-mass-spring")
    assert (bench.cases, bench.cases_are_loads) == (len(bench.loads), True)
