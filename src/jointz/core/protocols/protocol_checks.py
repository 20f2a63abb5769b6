"""Checks between the parts of a protocol, and its duration."""

from collections import defaultdict
from collections.abc import Iterable, Iterator
from itertools import chain

from jointz.core.checked_model import Problem
from jointz.core.protocols.bench_timing import onsets_in_cycle
from jointz.core.protocols.protocol_models import (
    ASSUMED_STRIDE_S,
    ConditionSpec,
    PerturbationPlan,
    ProtocolFields,
    PulseSpec,
)

#: Ticks and samples that a period of the fastest sine must hold.
_SAMPLES_A_PERIOD = 10
#: What sums of times may differ by, s.
ROUNDING_S = 1e-9


def assumed_stride_s(protocol: ProtocolFields) -> float:
    """Return the assumed duration of a stride before anybody has walked, s."""
    return ASSUMED_STRIDE_S if protocol.gait is None else protocol.gait.assumed_stride_s


def expected_duration_s(protocol: ProtocolFields, condition: ConditionSpec) -> float:
    """Return how long a condition takes with all its trials, s."""
    plan = condition.perturbations
    if protocol.kind == "walking":
        if plan is None or plan.gap_strides is None:
            return (condition.strides or 0) * assumed_stride_s(protocol)
        mean_gap = sum(plan.gap_strides) / 2.0
        return (plan.warm_up_strides + plan.total * mean_gap) * assumed_stride_s(protocol)
    return condition.trials * trial_duration_s(protocol, condition)


def trial_duration_s(protocol: ProtocolFields, condition: ConditionSpec) -> float:
    """Return the duration of one trial on a bench, s."""
    if condition.duration_s is not None:
        return condition.duration_s
    cycles = [r.cycle_s or 0.0 for r in condition.references.values() if r.runs_out]
    if condition.perturbations is not None and protocol.pulse is not None:
        cycles.append(_pulses_take_s(condition, condition.perturbations, protocol.pulse))
    return max(cycles, default=0.0)


def _pulses_take_s(condition: ConditionSpec, plan: PerturbationPlan, pulse: PulseSpec) -> float:
    """Return the time that the pulses of a bench need at most, s."""
    apart_s = (plan.pause_s or 0.0) + pulse.duration_s
    if plan.timing_points is None:
        return plan.total * apart_s
    cycle_s = max(_cycles_s(condition), default=0.0)
    if plan.order == "cyclic" and cycle_s:
        rounds = plan.total // len(plan.timing_points)
        points = list(plan.timing_points.values()) * rounds
        return onsets_in_cycle(points, cycle_s=cycle_s, apart_s=apart_s)[-1] + pulse.duration_s
    return plan.total * (apart_s + cycle_s)


def _cycles_s(condition: ConditionSpec) -> list[float]:
    return [r.cycle_s for r in condition.references.values() if r.cycle_s is not None]


# --- checks of the whole -----------------------------------------------------------------------


def _names_unique(protocol: ProtocolFields) -> Iterator[Problem]:
    yield from _repeated(
        "conditions", chain.from_iterable(c.trial_names for c in protocol.conditions)
    )


def _loads_unique(protocol: ProtocolFields) -> Iterator[Problem]:
    yield from _repeated("loads", (load.name for load in protocol.loads))


def _repeated(key: str, names: Iterable[str]) -> Iterator[Problem]:
    """Yield repeated names; names become file names, and some disks do not distinguish A and a."""
    spellings = defaultdict(list)
    for name in names:
        spellings[name.lower()].append(name)
    for same in spellings.values():
        if len(set(same)) > 1:
            message = f"names {' and '.join(map(repr, dict.fromkeys(same)))} differ in case only."
            yield Problem((key,), f"{message} Give one of them another name.")
        elif len(same) > 1:
            message = f"name '{same[0]}' is given {len(same)} times. Names must be unique."
            yield Problem((key,), message)


def _points_mean_one_place(protocol: ProtocolFields) -> Iterator[Problem]:
    first: dict[str, float] = {}
    for i, condition in enumerate(protocol.conditions):
        plan = condition.perturbations
        for name, pct in ((plan and plan.timing_points) or {}).items():
            if first.setdefault(name, pct) != pct:
                yield Problem(
                    ("conditions", i, "perturbations", "timing_points", name),
                    f"{pct:g} %, and {first[name]:g} % in an earlier condition: the study would "
                    "pool both. Give one of them another name.",
                )


def _gait_fits_kind(protocol: ProtocolFields) -> Iterator[Problem]:
    if protocol.kind == "walking" and protocol.gait is None:
        yield Problem(("gait",), "missing; walking needs it, at least its speed_m_s.")
    if protocol.kind != "walking" and protocol.gait is not None:
        yield Problem(
            ("gait",), f'a {protocol.kind} does not walk. Remove it, or set kind = "walking".'
        )


def _bench_fits_kind(protocol: ProtocolFields) -> Iterator[Problem]:
    if protocol.kind != "bench" and protocol.bench is not None:
        message = f'{protocol.kind} needs none. Remove it, or set kind = "bench".'
        yield Problem(("bench",), message)


def _loads_fit_kind(protocol: ProtocolFields) -> Iterator[Problem]:
    if not protocol.loads:
        return
    if protocol.kind == "walking":
        yield Problem(("loads",), 'only a bench has loads. Remove them, or set kind = "bench".')
    elif protocol.kind == "bench" and _is_set(protocol, "participants"):
        yield Problem(("participants",), "the loads stand for participants. Remove it.")


def _pulse_is_used(protocol: ProtocolFields) -> Iterator[Problem]:
    if protocol.pulse is not None and all(c.perturbations is None for c in protocol.conditions):
        yield Problem(
            ("pulse",), "no condition has perturbations. Remove it, or give them where it belongs."
        )


def _pulse_suits_rate(protocol: ProtocolFields) -> Iterator[Problem]:
    if protocol.pulse is None:
        return
    period_s = 1.0 / protocol.rates.control_hz
    for key in ("ramp_up_s", "hold_s", "ramp_down_s"):
        part: float = getattr(protocol.pulse, key)
        if 0 < part < period_s - ROUNDING_S:
            yield Problem(
                ("pulse", key),
                f"expected 0 or at least one period of control_hz ({period_s:g} s), got "
                f"{part:g} s. Raise it, or the rate.",
            )


PROTOCOL_CHECKS = (
    _names_unique,
    _loads_unique,
    _points_mean_one_place,
    _gait_fits_kind,
    _bench_fits_kind,
    _loads_fit_kind,
    _pulse_is_used,
    _pulse_suits_rate,
)


# --- checks of one condition -------------------------------------------------------------------

#: Keys of conditions and of their perturbations that belong to the other kind.
_FOREIGN = {
    "walking": (
        ("duration_s", "trials", "torque_nm", "position_rad", "velocity_rad_s"),
        ("count", "pause_s"),
    ),
    "bench": (("strides",), ("gap_strides", "warm_up_strides")),
    "calibration": (("strides",), ("gap_strides", "warm_up_strides")),
}
_OTHER = {"walking": "bench", "bench": "walking", "calibration": "walking"}


def _keys_fit_kind(protocol: ProtocolFields, i: int) -> Iterator[Problem]:
    condition, plan = protocol.conditions[i], protocol.conditions[i].perturbations
    of_condition, of_plan = _FOREIGN[protocol.kind]
    foreign: list[tuple[str, ...]] = [(key,) for key in of_condition if _is_set(condition, key)]
    foreign += [
        ("perturbations", key) for key in of_plan if plan is not None and _is_set(plan, key)
    ]
    for keys in foreign:
        yield Problem(
            ("conditions", i, *keys),
            f"belongs to kind = {_OTHER[protocol.kind]!r}, and this is {protocol.kind!r}. "
            "Remove it.",
        )


def _is_set(model: "ConditionSpec | PerturbationPlan | ProtocolFields", key: str) -> bool:
    """Whether a key differs from its default: a dump, which writes defaults, stays valid."""
    return bool(getattr(model, key) != type(model).model_fields[key].default)


def _says_how_long(protocol: ProtocolFields, i: int) -> Iterator[Problem]:
    condition, place = protocol.conditions[i], ("conditions", i)
    if protocol.kind == "walking":
        if condition.strides is None and condition.perturbations is None:
            yield Problem((*place, "strides"), "missing; without perturbations it says how long.")
        if condition.strides is not None and condition.perturbations is not None:
            message = "the perturbations say how long. Remove it."
            yield Problem((*place, "strides"), message)
        return
    finite = any(reference.runs_out for reference in condition.references.values())
    if condition.duration_s is None and condition.perturbations is None and not finite:
        yield Problem(
            (*place, "duration_s"),
            "missing; only perturbations, chirps and steps say themselves how long they take.",
        )


def _perturbed_is_perturbed(protocol: ProtocolFields, i: int) -> Iterator[Problem]:
    condition, place = protocol.conditions[i], ("conditions", i)
    if condition.condition != "perturbed" or condition.perturbations is not None:
        return
    if protocol.kind == "walking":
        yield Problem((*place, "perturbations"), "missing; a perturbed condition needs them.")
    elif not condition.references:
        yield Problem(
            (*place, "perturbations"),
            "missing; a perturbed condition needs them, or a reference (torque_nm, position_rad, "
            "velocity_rad_s).",
        )


def _perturbations_have_pulse(protocol: ProtocolFields, i: int) -> Iterator[Problem]:
    if protocol.conditions[i].perturbations is not None and protocol.pulse is None:
        yield Problem(("pulse",), f"missing; conditions[{i + 1}].perturbations need it.")


def _plan_is_whole(protocol: ProtocolFields, i: int) -> Iterator[Problem]:
    plan, place = protocol.conditions[i].perturbations, ("conditions", i, "perturbations")
    if plan is None:
        return
    if protocol.kind == "walking":
        needed: tuple[str, ...] = ("timing_points", "gap_strides")
    else:
        needed = () if plan.timing_points is not None else ("count", "pause_s")
    for key in needed:
        stated = plan.count_per_point is not None and key in ("timing_points", "count", "pause_s")
        if getattr(plan, key) is None and not stated:  # the plan itself misses the timing points
            yield Problem((*place, key), f"missing; on a {protocol.kind} it says when pulses fire.")


def _directions_balanced(protocol: ProtocolFields, i: int) -> Iterator[Problem]:
    plan = protocol.conditions[i].perturbations
    if plan is None or protocol.pulse is None or protocol.pulse.direction != "both":
        return
    for key in ("count_per_point", "count"):
        count = getattr(plan, key)
        if count is not None and count % 2:
            yield Problem(
                ("conditions", i, "perturbations", key),
                f'expected an even number, as many of either direction (pulse.direction = "both"); '
                f"got {count}.",
            )


def _pulses_apart(protocol: ProtocolFields, i: int) -> Iterator[Problem]:
    plan, pulse, gait = protocol.conditions[i].perturbations, protocol.pulse, protocol.gait
    if plan is None or pulse is None or gait is None:
        return
    if plan.gap_strides is None or not plan.timing_points:
        return
    fewest, points = plan.gap_strides[0], plan.timing_points
    first, last = min(points, key=points.__getitem__), max(points, key=points.__getitem__)
    strides = fewest - (points[last] - points[first]) / 100.0
    apart_s = strides * gait.shortest_stride_s
    if fewest >= 1 and pulse.duration_s > apart_s + ROUNDING_S:
        yield Problem(
            ("conditions", i, "perturbations", "gap_strides"),
            f"with a gap of {fewest} a pulse at {last} may begin {apart_s:.3g} s before the next "
            f"at {first}, when strides last {gait.shortest_stride_s:.3g} s, the least accepted; "
            f"pulse.duration_s is {pulse.duration_s:g} s. Raise the gap.",
        )


def _points_have_a_cycle(protocol: ProtocolFields, i: int) -> Iterator[Problem]:
    condition, plan = protocol.conditions[i], protocol.conditions[i].perturbations
    if protocol.kind == "walking" or plan is None or plan.timing_points is None:
        return
    cyclic = [name for name, r in condition.references.items() if r.cycle_s is not None]
    if len(cyclic) != 1:
        yield Problem(
            ("conditions", i, "perturbations", "timing_points"),
            "expected one reference with a cycle that they are a part of, got "
            f"{' and '.join(cyclic) or 'none'}. On a bench without one give count and pause_s.",
        )


def _pulses_fit_duration(protocol: ProtocolFields, i: int) -> Iterator[Problem]:
    condition, pulse = protocol.conditions[i], protocol.pulse
    plan, duration_s = condition.perturbations, condition.duration_s
    if protocol.kind == "walking" or plan is None or pulse is None or duration_s is None:
        return
    needed_s = _pulses_take_s(condition, plan, pulse)
    if needed_s > duration_s * (1.0 + 1e-9):
        yield Problem(
            ("conditions", i, "duration_s"),
            f"{plan.total} pulses take at least {needed_s:g} s, got {duration_s:g} s. Raise it, "
            "or plan fewer.",
        )


def _rates_suffice(protocol: ProtocolFields, i: int) -> Iterator[Problem]:
    for name, reference in protocol.conditions[i].references.items():
        needed_hz = _SAMPLES_A_PERIOD * reference.fastest_hz
        for key in ("control_hz", "sample_hz"):
            rate_hz: float = getattr(protocol.rates, key)
            if rate_hz < needed_hz:
                yield Problem(
                    ("conditions", i, name),
                    f"holds {reference.fastest_hz:g} Hz, for which rates.{key} = {rate_hz:g} Hz is "
                    f"too low. Give at least {needed_hz:g} Hz ({_SAMPLES_A_PERIOD} a period).",
                )


CONDITION_CHECKS = (
    _keys_fit_kind,
    _says_how_long,
    _perturbed_is_perturbed,
    _perturbations_have_pulse,
    _plan_is_whole,
    _directions_balanced,
    _pulses_apart,
    _points_have_a_cycle,
    _pulses_fit_duration,
    _rates_suffice,
)
