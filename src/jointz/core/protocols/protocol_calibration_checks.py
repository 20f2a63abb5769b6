"""Checks of the protocol of a calibration: its step, and the conditions and loads of that step."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from typing import Literal

from jointz.core.checked_model import Problem
from jointz.core.protocols.protocol_models import LoadSpec, ProtocolFields


@dataclass(frozen=True, slots=True)
class StepRules:
    """Conditions, torque and loads of a calibration step."""

    conditions: tuple[str, ...]  # required names of conditions, each used once
    # actuator torque: none, pulses of both signs, or a reference
    torque: Literal["none", "pulses", "torque_nm"]
    # condition -> required keys of its known load
    loads: Mapping[str, tuple[str, ...]] = field(default_factory=dict)


#: Step -> what it is made of.
STEP_RULES: Mapping[str, StepRules] = {
    "zero": StepRules(("straight",), "none"),
    "footswitch": StepRules(("walking",), "none"),
    "hinge": StepRules(("swing",), "none"),
    "frame": StepRules(("pulses",), "pulses"),
    "leg": StepRules(("bare", "weighted"), "pulses", {"weighted": ("inertia", "stiffness")}),
    "torsion": StepRules(("locked",), "torque_nm"),
    "spring": StepRules(("spring",), "torque_nm", {"spring": ("stiffness",)}),
}

#: Keys of a condition that no calibration has a use for, and what they are by default.
_WITHOUT_USE = {"session": None, "trials": 1, "position_rad": None, "velocity_rad_s": None}


def _step_fits_kind(protocol: ProtocolFields) -> Iterator[Problem]:
    if protocol.kind == "calibration" and protocol.calibration is None:
        steps = ", ".join(STEP_RULES)
        yield Problem(("calibration",), f"missing; expected the step, one of {steps}.")
    if protocol.kind != "calibration" and protocol.calibration is not None:
        message = f'{protocol.kind} has no step. Remove it, or set kind = "calibration".'
        yield Problem(("calibration",), message)


def _conditions_are_those_of_the_step(protocol: ProtocolFields) -> Iterator[Problem]:
    rules = _rules(protocol)
    if rules is None:
        return
    names = [condition.name for condition in protocol.conditions]
    missing = [name for name in rules.conditions if name not in names]
    if missing:
        message = f"'{protocol.calibration}' has the conditions {_listed(rules.conditions)}; "
        yield Problem(("conditions",), f"{message}missing: {_listed(missing)}.")
    for i, name in enumerate(names):
        if name not in rules.conditions:
            yield Problem(
                ("conditions", i, "name"),
                f"expected {_listed(rules.conditions)}, by which the analysis tells what was "
                f"done; got '{name}'.",
            )


def _loads_are_those_of_the_step(protocol: ProtocolFields) -> Iterator[Problem]:
    rules = _rules(protocol)
    if rules is None:
        return
    loads: dict[str, LoadSpec] = {load.name: load for load in protocol.loads}
    for name, keys in rules.loads.items():
        if name not in loads:
            yield Problem(("loads",), f"missing: '{name}', the known load of that condition.")
            continue
        at = list(loads).index(name)
        for key in keys:
            entry = getattr(loads[name], key)
            if entry is None or entry.value == 0.0:
                message = "missing; the step compares with it. Give value and sd."
                yield Problem(("loads", at, key), message)
    for i, load in enumerate(protocol.loads):
        if load.name not in rules.loads:
            known = _listed(tuple(rules.loads)) if rules.loads else "none"
            message = f"'{protocol.calibration}' has a known load in {known}; got '{load.name}'."
            yield Problem(("loads", i, "name"), message)
        if load.locked:
            yield Problem(("loads", i, "locked"), "a known load moves. Remove it.")


def _nothing_foreign(protocol: ProtocolFields, i: int) -> Iterator[Problem]:
    if protocol.kind != "calibration":
        return
    condition = protocol.conditions[i]
    for key, default in _WITHOUT_USE.items():
        if getattr(condition, key) != default:
            message = "a calibration has no use for it: a condition is one recording. Remove it."
            yield Problem(("conditions", i, key), message)
    if not condition.worn:
        message = 'expected "unperturbed" or "perturbed": the actuator\'s encoder is recorded too.'
        yield Problem(("conditions", i, "condition"), message)


def _torque_is_that_of_the_step(protocol: ProtocolFields, i: int) -> Iterator[Problem]:
    rules = _rules(protocol)
    if rules is None:
        return
    condition = protocol.conditions[i]
    drives = {
        "pulses": ("perturbations", condition.perturbations is not None),
        "torque_nm": ("torque_nm", condition.torque_nm is not None),
    }
    for what, (key, there) in drives.items():
        if there and what != rules.torque:
            message = f"'{protocol.calibration}' has none. Remove it."
            yield Problem(("conditions", i, key), message)
        if not there and what == rules.torque:
            yield Problem(("conditions", i, key), f"missing; '{protocol.calibration}' needs it.")


def _pulses_go_both_ways(protocol: ProtocolFields) -> Iterator[Problem]:
    rules, pulse = _rules(protocol), protocol.pulse
    if rules is None or pulse is None or rules.torque != "pulses":
        return
    if pulse.direction != "both":
        yield Problem(
            ("pulse", "direction"),
            'expected "both": pulses of one sign cannot tell friction from torque; got '
            f'"{pulse.direction}".',
        )


def _rules(protocol: ProtocolFields) -> StepRules | None:
    if protocol.kind != "calibration" or protocol.calibration is None:
        return None
    return STEP_RULES[protocol.calibration]


def _listed(names: tuple[str, ...] | list[str]) -> str:
    return " and ".join(f"'{name}'" for name in names)


PROTOCOL_CALIBRATION_CHECKS = (
    _step_fits_kind,
    _conditions_are_those_of_the_step,
    _loads_are_those_of_the_step,
    _pulses_go_both_ways,
)
CONDITION_CALIBRATION_CHECKS = (_nothing_foreign, _torque_is_that_of_the_step)
