"""The protocol file of a plan, which ``jointz run`` takes."""

import tomllib
from collections.abc import Iterator, Mapping, Sequence
from typing import Any

from pydantic import ValidationError

from jointz.core.protocols.protocol import Protocol
from jointz.core.protocols.protocol_models import ConditionSpec
from jointz.core.protocols.pulse_models import Pulse, PulseSpec
from jointz.io.toml_problems import all_problems
from jointz.io.toml_text import written_key, written_text
from jointz.planning.predicted_responses import Design


def protocol_text(
    protocol: Protocol,
    design: Design,
    counts: Mapping[str, int],
    *,
    participants: int,
    half_width_pct: Mapping[str, Mapping[str, float]],
    displacement_rad: float | None,
    sensors: Sequence[str],
) -> str:
    """Return a protocol file with the planned pulses and what they are expected to decide."""
    raw = protocol.model_dump(exclude_none=True, exclude_defaults=True)
    raw |= {"jointz_protocol": 1, "name": f"{protocol.name}-planned"[:64], "kind": protocol.kind}
    raw |= {"participants": participants, "window_s": design.window_s}
    raw["sensors"] = list(sensors)
    # Notes of the protocol are about its own pulses and their numbers.
    raw.pop("notes", None)
    if not any(isinstance(pulse, PulseSpec) for pulse in design.pulses):
        raw.pop("pulse", None)
        raw["pulses"] = [_written_pulse(pulse) for pulse in design.pulses]
    raw["planned_half_width_pct"] = {k: dict(v) for k, v in half_width_pct.items()}
    if displacement_rad is not None:
        raw["safety"] = raw["safety"] | {"displacement_rad": displacement_rad}
    raw["conditions"] = [_condition(spec, counts) for spec in protocol.conditions]
    text = "\n".join(_lines(raw))
    return f"# Written by jointz plan from the protocol {protocol.name}.\n{text}\n"


def problems_of(text: str) -> list[str]:
    """Return what is wrong with the text of a protocol; nothing if it can be run."""
    raw = tomllib.loads(text)
    try:
        Protocol.model_validate(raw)
    except ValidationError as exc:
        return all_problems(exc, Protocol, raw)
    return []


def _written_pulse(pulse: Pulse) -> dict[str, Any]:
    """Return a pulse by its keys, name and kind first."""
    whole = pulse.model_dump()
    head = {key: whole[key] for key in ("name", "kind")}
    return head | pulse.model_dump(exclude_defaults=True)


def _condition(spec: ConditionSpec, counts: Mapping[str, int]) -> dict[str, Any]:
    """Return a condition, with its planned numbers of pulses."""
    raw = spec.model_dump(exclude_none=True, exclude_defaults=True)
    points = None if spec.perturbations is None else spec.perturbations.timing_points
    if points is None:
        return raw
    own = {name: counts[name] for name in points}
    alike = len(set(own.values())) == 1
    count = next(iter(own.values())) if alike else own
    return raw | {"perturbations": dict(raw["perturbations"]) | {"count_per_point": count}}


def _lines(table: Mapping[str, Any], path: tuple[str, ...] = ()) -> Iterator[str]:
    """Yield the lines of a table: values first, then tables and lists of tables."""
    later = []
    for key, value in table.items():
        if isinstance(value, Mapping) or _is_tables(value):
            later.append((key, value))
        else:
            yield f"{written_key(key)} = {_value(value)}"
    for key, value in later:
        name = (*path, written_key(key))
        for entry in value if _is_tables(value) else (value,):
            mark = ("[[", "]]") if _is_tables(value) else ("[", "]")
            yield f"\n{mark[0]}{'.'.join(name)}{mark[1]}"
            yield from _lines(entry, name)


def _is_tables(value: Any) -> bool:
    return isinstance(value, list | tuple) and bool(value) and isinstance(value[0], Mapping)


def _value(value: Any) -> str:
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, int | float):
        return repr(value)
    if isinstance(value, list | tuple):
        return f"[{', '.join(map(_value, value))}]"
    return written_text(str(value))
