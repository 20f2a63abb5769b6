"""The protocol file of a plan, which ``jointz run`` takes."""

from collections.abc import Iterator, Mapping, Sequence
from typing import Any

from jointz.core.protocols.protocol import Protocol
from jointz.core.protocols.pulse_models import Pulse, PulseSpec
from jointz.io.toml_text import written_key, written_text
from jointz.planning.predicted_responses import Design

#: Different numbers of pulses get conditions of their own, at most so many.
MOST_CONDITIONS = 3


def levelled(counts: Mapping[str, int]) -> dict[str, int]:
    """Return numbers of pulses of which at most :data:`MOST_CONDITIONS` differ, none smaller."""
    levels = sorted(set(counts.values()), reverse=True)
    while len(levels) > MOST_CONDITIONS:
        # What is raised costs least between the nearest two.
        gaps = [levels[k] - levels[k + 1] for k in range(len(levels) - 1)]
        del levels[gaps.index(min(gaps)) + 1]
    return {point: min(v for v in levels if v >= n) for point, n in counts.items()}


def protocol_text(
    protocol: Protocol,
    design: Design,
    counts: Mapping[str, int],
    *,
    participants: int,
    half_width_pct: Mapping[str, Mapping[str, float]],
    displacement_rad: float,
    notes: Sequence[str],
) -> str:
    """Return a protocol file with the planned pulses and what they are expected to decide."""
    raw = protocol.model_dump(exclude_none=True, exclude_defaults=True)
    raw |= {"jointz_protocol": 1, "name": f"{protocol.name}-planned"[:64], "kind": protocol.kind}
    raw |= {"participants": participants, "window_s": design.window_s, "notes": list(notes)}
    if not any(isinstance(pulse, PulseSpec) for pulse in design.pulses):
        raw.pop("pulse", None)
        raw["pulses"] = [_written_pulse(pulse) for pulse in design.pulses]
    raw["planned_half_width_pct"] = {k: dict(v) for k, v in half_width_pct.items()}
    if protocol.expected_joint is not None:
        raw["safety"] = dict(raw.get("safety", {})) | {"displacement_rad": displacement_rad}
    raw["conditions"] = [c for spec in protocol.conditions for c in _conditions(spec, counts)]
    text = "\n".join(_lines(raw))
    return f"# Written by jointz plan from the protocol {protocol.name}.\n{text}\n"


def _written_pulse(pulse: Pulse) -> dict[str, Any]:
    """Return a pulse by its keys, name and kind first."""
    whole = pulse.model_dump()
    head = {key: whole[key] for key in ("name", "kind")}
    return head | pulse.model_dump(exclude_defaults=True)


def _conditions(spec: Any, counts: Mapping[str, int]) -> Iterator[dict[str, Any]]:
    """Yield a condition; a perturbed one by number of pulses."""
    raw = spec.model_dump(exclude_none=True, exclude_defaults=True)
    plan = spec.perturbations
    if plan is None:
        yield raw
        return
    levels = sorted({counts[p] for p in plan.timing_points}, reverse=True)
    for number, count in enumerate(levels, start=1):
        points = {p: at for p, at in plan.timing_points.items() if counts[p] == count}
        own = dict(raw["perturbations"]) | {"timing_points": points, "count_per_point": count}
        name = spec.name if len(levels) == 1 else f"{spec.name}-{number}"
        yield raw | {"name": name, "perturbations": own}


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
