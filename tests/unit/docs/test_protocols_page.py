"""The page of the protocol file: every key, every default, examples that hold."""

import re
import tomllib
from pathlib import Path
from typing import get_args

import pytest
from pydantic import BaseModel

from jointz.core.protocols.protocol import Protocol
from jointz.io.protocols import builtin_protocols

PAGE = (Path(__file__).parents[3] / "docs" / "protocols.md").read_text(encoding="utf-8")
EXAMPLES = re.findall(r"^```toml protocol\n(.*?)^```", PAGE, re.DOTALL | re.MULTILINE)
#: Model -> heading of its section; terms and sweeps stand in the rows of their references.
SECTIONS = {
    "Protocol": "Top level",
    "RatesSpec": "rates",
    "LiveSpec": "live",
    "GaitSpec": "gait",
    "PulseSpec": "pulse",
    "ExpectedJoint": "expected_joint",
    "LimitsOverride": "safety",
    "LoadSpec": "loads",
    "ConditionSpec": "conditions",
    "PerturbationPlan": "perturbations",
    "ControllerSpec": "controller",
}


def models(annotation: object) -> set[type[BaseModel]]:
    inside = {m for part in get_args(annotation) for m in models(part)}
    if isinstance(annotation, type) and issubclass(annotation, BaseModel):
        fields = annotation.model_fields.values()
        return {annotation, *(m for f in fields for m in models(f.annotation))}
    return inside


MODELS = {model.__name__: model for model in models(Protocol)}
KINDS = {
    get_args(m.model_fields["kind"].annotation)[0]: m
    for m in MODELS.values()
    if "kind" in m.model_fields and m is not Protocol
}
PULSES = {kind: m for kind, m in KINDS.items() if "amplitudes_nm" in m.model_fields}
REFERENCES = {kind: m for kind, m in KINDS.items() if kind not in PULSES}


def rows(heading: str) -> dict[str, str]:
    """Return key -> its row, of the section under a heading."""
    section = PAGE.split(f"\n## {heading}\n", 1)[1].split("\n## ", 1)[0]
    found = {}
    for line in section.splitlines():
        cells = line.split("|")
        if line.startswith("| `"):
            found |= dict.fromkeys(re.findall(r"`(\w+)`", cells[1]), line)
    return found


@pytest.mark.parametrize("name", SECTIONS)
def test_every_key_has_a_row_with_its_default_and_no_row_is_left_over(name):
    described, fields = rows(SECTIONS[name]), MODELS[name].model_fields
    assert set(described) == set(fields), "describe them in docs/protocols.md"
    for key, field in fields.items():
        default, row = field.default, described[key].split("|")[2]
        if field.is_required():
            assert "required" in row
        elif isinstance(default, str) and default:
            assert f'`"{default}"`' in row
        elif isinstance(default, float | int) and not isinstance(default, bool):
            assert f"`{default:g}`" in row or f"`{default}`" in row


def test_every_reference_has_a_row_with_its_keys():
    described = rows("References")

    assert set(described) - {"kind"} == set(REFERENCES), "describe it in docs/protocols.md"
    for kind, model in REFERENCES.items():
        keys = {m.__name__: m.model_fields for m in models(model)}
        for key in {key for fields in keys.values() for key in fields} - {"kind"}:
            assert f"`{key}`" in described[kind]


def test_every_kind_of_pulse_has_a_row_with_its_keys():
    described = rows("pulses")

    assert set(described) == set(PULSES), "describe it in docs/protocols.md"
    for kind, model in PULSES.items():
        for key in set(model.model_fields) - {"kind", "name", "amplitudes_nm", "direction"}:
            assert f"`{key}`" in described[kind]


def test_the_example_is_a_protocol_and_every_built_in_one_is_described():
    (example,) = EXAMPLES

    assert Protocol.model_validate(tomllib.loads(example)).kind == "walking"
    assert [name for name in builtin_protocols() if f"`{name}`" not in PAGE] == []
