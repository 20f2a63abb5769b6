"""Checks between the parts of a protocol, and its duration."""

from collections.abc import Iterable, Iterator
from itertools import chain

from jointz.core.checked_model import Problem
from jointz.core.grouping import by_key
from jointz.core.protocols.bench_timing import onsets_in_cycle
from jointz.core.protocols.protocol_models import (
    ASSUMED_STRIDE_S,
    ConditionSpec,
    PerturbationPlan,
    ProtocolFields,
)
from jointz.core.protocols.pulse_models import Pulse, variants_of
from jointz.core.study import MOST_ADDED

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
    if protocol.by_gait:
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
    if condition.perturbations is not None and protocol.shapes:
        longest_s = longest_pulse_s(protocol)
        cycles.append(_pulses_take_s(condition, condition.perturbations, longest_s))
    return max(cycles, default=0.0)


def longest_pulse_s(protocol: ProtocolFields) -> float:
    """Return the duration of the longest pulse, s; 0 without pulses."""
    return max((pulse.length_s for pulse in protocol.shapes), default=0.0)


def placed_pulses(protocol: ProtocolFields) -> Iterator[tuple[tuple[str | int, ...], Pulse]]:
    """Yield every pulse with the path of its table."""
    if protocol.pulse is not None:
        yield ("pulse",), protocol.pulse
        return
    for i, pulse in enumerate(protocol.pulses):
        yield ("pulses", i), pulse


def _pulses_take_s(condition: ConditionSpec, plan: PerturbationPlan, pulse_s: float) -> float:
    """Return the time that the pulses of a bench need at most, s."""
    apart_s = (plan.pause_s or 0.0) + pulse_s
    if plan.timing_points is None:
        return plan.total * apart_s
    cycle_s = max((r.cycle_s or 0.0 for r in condition.references.values()), default=0.0)
    if plan.order == "cyclic" and cycle_s:
        rounds = plan.total // len(plan.timing_points)
        points = list(plan.timing_points.values()) * rounds
        return onsets_in_cycle(points, cycle_s=cycle_s, apart_s=apart_s)[-1] + pulse_s
    return plan.total * (apart_s + cycle_s)


# --- checks of the whole -----------------------------------------------------------------------


def _names_unique(protocol: ProtocolFields) -> Iterator[Problem]:
    yield from _repeated(
        "conditions", chain.from_iterable(c.trial_names for c in protocol.conditions)
    )


def _loads_unique(protocol: ProtocolFields) -> Iterator[Problem]:
    yield from _repeated("loads", (load.name for load in protocol.loads))


def _repeated(key: str, names: Iterable[str]) -> Iterator[Problem]:
    """Yield repeated names; names become file names, and some disks do not distinguish A and a."""
    for same in by_key((name.lower(), name) for name in names).values():
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
    if protocol.by_gait and protocol.gait is None:
        message = f"missing; {protocol.kind} needs it, at least its speed_m_s."
        yield Problem(("gait",), message)
    if not protocol.by_gait and protocol.gait is not None:
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
    if protocol.kind == "control":
        yield Problem(("loads",), "a controller's conditions have no loads. Remove them.")
    elif protocol.kind == "bench" and _is_set(protocol, "participants"):
        yield Problem(("participants",), "the loads stand for participants. Remove it.")
    named = {condition.load for condition in protocol.conditions}
    for i, load in enumerate(protocol.loads):
        if protocol.kind != "walking" and load.mass_kg is not None:
            message = "belongs to kind = 'walking', where it hangs on the shank. Give inertia."
            yield Problem(("loads", i, "mass_kg"), message)
        elif protocol.kind == "walking" and load.name not in named:
            message = f"no condition has load = '{load.name}'. Remove it, or name it there."
            yield Problem(("loads",), message)
        elif protocol.kind == "walking" and (load.locked or load.damping or not load.properties):
            yield Problem(
                ("loads", i),
                "expected what is added in walking: mass_kg and distance_m, inertia or stiffness, "
                "above 0. Add one of them, and remove damping and locked.",
            )
        for name, most in MOST_ADDED.items() if protocol.kind == "walking" else ():
            entry = load.properties.get(name)
            if entry is not None and entry.value > most:
                message = f"expected at most {most:g} in SI units, got {entry.value:g}."
                yield Problem(("loads", i), f"{name}: {message}")


def _one_load_a_session(protocol: ProtocolFields) -> Iterator[Problem]:
    first: dict[str, str | None] = {}
    for i, condition in enumerate(protocol.conditions):
        if protocol.kind != "walking" or condition.session is None:
            continue
        load = first.setdefault(condition.session, condition.load)
        if load != condition.load:
            earlier = "none" if load is None else f"'{load}'"
            yield Problem(
                ("conditions", i, "load"),
                f"expected {earlier}, as in the earlier conditions of session "
                f"'{condition.session}', which share a baseline. Give it another session.",
            )


def _pulse_is_used(protocol: ProtocolFields) -> Iterator[Problem]:
    if protocol.kind == "control":
        return
    if protocol.shapes and all(c.perturbations is None for c in protocol.conditions):
        key = "pulses" if protocol.pulse is None else "pulse"
        yield Problem(
            (key,), "no condition has perturbations. Remove it, or give them where it belongs."
        )


def _pulse_suits_rate(protocol: ProtocolFields) -> Iterator[Problem]:
    period_s = 1.0 / protocol.rates.control_hz
    for place, pulse in placed_pulses(protocol):
        shortest_s: dict[str, float] = {}
        for key, part_s in pulse.timed_parts:
            if part_s > 0.0:
                shortest_s[key] = min(part_s, shortest_s.get(key, part_s))
        for key, part_s in shortest_s.items():
            if part_s < period_s - ROUNDING_S:
                yield Problem(
                    (*place, key),
                    f"expected 0 or at least one period of control_hz ({period_s:g} s), got "
                    f"{part_s:g} s. Raise it, or the rate.",
                )


def _window_fits_kind(protocol: ProtocolFields) -> Iterator[Problem]:
    if protocol.window_s is not None and not protocol.by_gait:
        yield Problem(("window_s",), f"a {protocol.kind} is analysed without it. Remove it.")


def _pulses_given_once(protocol: ProtocolFields) -> Iterator[Problem]:
    if protocol.pulse is not None and protocol.pulses:
        message = "[pulse] is given too. Remove one of the two: [pulse] is the only one."
        yield Problem(("pulses",), message)
    if protocol.pulses and not protocol.by_gait:
        message = f"a {protocol.kind} has one pulse. Give [pulse] instead."
        yield Problem(("pulses",), message)
    yield from _repeated("pulses", (pulse.name for pulse in protocol.pulses))


def _control_has_no_pulses(protocol: ProtocolFields) -> Iterator[Problem]:
    if protocol.kind != "control":
        return
    of_pulses = {
        ("pulse",): protocol.pulse,
        ("pulses",): protocol.pulses or None,
        ("window_s",): protocol.window_s,
        ("expected_joint",): protocol.expected_joint,
        ("safety", "displacement_rad"): protocol.safety.displacement_rad,
    }
    for key, value in of_pulses.items():
        if value is not None:
            message = "belongs to pulses, and 'control' has none. Remove it."
            yield Problem(key, message)


def _wishes_are_for_points(protocol: ProtocolFields) -> Iterator[Problem]:
    known = set(protocol.timing_points)
    for parameter, own in (protocol.planned_half_width_pct or {}).items():
        for name in sorted(set(own) - known):
            message = f"is no timing point; expected one of {', '.join(sorted(known))}."
            yield Problem(("planned_half_width_pct", parameter, name), message)


def _live_can_decide(protocol: ProtocolFields) -> Iterator[Problem]:
    live = protocol.live
    if live is None:
        return
    if protocol.kind != "walking":
        yield Problem(("live",), f"estimates in walking, and this is a {protocol.kind}. Remove it.")
        return
    if live.planned_half_width_pct is not None and protocol.planned_half_width_pct:
        message = "the protocol has a table of that name, too. Remove one of the two."
        yield Problem(("live", "planned_half_width_pct"), message)
    if not live.decides:
        return
    plans = [c.perturbations for c in protocol.conditions if c.perturbations is not None]
    if len(plans) != 1:
        message = f"expected one condition with perturbations, found {len(plans)}."
        yield Problem(("live", "may"), f'{message} Set may = "show".')
        return
    if not protocol.wishes:
        message = "missing; it says which half-widths are narrow enough, % of the value."
        yield Problem(("live", "planned_half_width_pct"), message)
    few = [point for point, count in plans[0].counts.items() if count < live.fewest_pulses]
    if few:
        message = f"expected at most count_per_point, which {', '.join(few)} does not have."
        yield Problem(("live", "fewest_pulses"), f"{message} Give them more pulses.")
    if "steer" in live.may and plans[0].order in ("sequential", "cyclic"):
        message = f'order = "{plans[0].order}" fixes where pulses come. Set order = "balanced".'
        yield Problem(("live", "may"), message)


PROTOCOL_CHECKS = (
    _wishes_are_for_points,
    _live_can_decide,
    _names_unique,
    _loads_unique,
    _points_mean_one_place,
    _gait_fits_kind,
    _bench_fits_kind,
    _loads_fit_kind,
    _one_load_a_session,
    _pulse_is_used,
    _pulse_suits_rate,
    _pulses_given_once,
    _window_fits_kind,
    _control_has_no_pulses,
)


# --- checks of one condition -------------------------------------------------------------------

#: Keys of conditions and of their perturbations that belong to the other kind.
_FOREIGN = {
    "walking": (
        ("duration_s", "trials", "position_rad", "velocity_rad_s"),
        ("count", "pause_s"),
    ),
    "bench": (("strides",), ("gap_strides", "warm_up_strides")),
    "calibration": (("strides",), ("gap_strides", "warm_up_strides")),
    "control": (("duration_s", "trials", "torque_nm", "position_rad", "velocity_rad_s"), ()),
}
_OTHER = {"walking": "bench", "bench": "walking", "calibration": "walking", "control": "bench"}


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
    if protocol.kind == "control":
        if condition.strides is None:
            yield Problem((*place, "strides"), "missing; it says how long the controller runs.")
        return
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
    if protocol.kind == "control":
        return  # a problem of the condition already
    if protocol.kind == "walking":
        if condition.torque_nm is None:
            yield Problem(
                (*place, "perturbations"),
                "missing; a perturbed condition needs them, or a random torque (torque_nm).",
            )
    elif not condition.references:
        yield Problem(
            (*place, "perturbations"),
            "missing; a perturbed condition needs them, or a reference (torque_nm, position_rad, "
            "velocity_rad_s).",
        )


#: Of a random torque.
_SLOWEST_NOISE_HZ = 0.5


def _random_torque_in_walking(protocol: ProtocolFields, i: int) -> Iterator[Problem]:
    condition, place = protocol.conditions[i], ("conditions", i, "torque_nm")
    if protocol.kind != "walking" or condition.torque_nm is None:
        return
    if condition.torque_nm.kind != "noise":
        yield Problem(
            place,
            f'expected kind = "noise" in walking, got "{condition.torque_nm.kind}": only a random '
            "torque is independent of the stride.",
        )
    elif condition.torque_nm.cutoff_hz < _SLOWEST_NOISE_HZ:
        yield Problem(
            (*place, "cutoff_hz"),
            f"expected at least {_SLOWEST_NOISE_HZ:g} Hz, got {condition.torque_nm.cutoff_hz:g}: "
            "slower torque is a load, and its filter takes too long to settle.",
        )
    if protocol.safety.displacement_rad is not None and condition.perturbations is None:
        yield Problem(
            ("safety", "displacement_rad"),
            "is watched after pulses only, and a random torque has none. Remove it.",
        )
    if condition.condition != "perturbed":
        yield Problem(
            place,
            f'condition is "{condition.condition}". Remove it, or set condition = "perturbed".',
        )
    if condition.perturbations is not None:
        message = "perturbations are given too: pulses or a random torque. Remove one of the two."
        yield Problem(place, message)


def _perturbations_have_pulse(protocol: ProtocolFields, i: int) -> Iterator[Problem]:
    if protocol.kind == "control":
        return
    if protocol.conditions[i].perturbations is not None and not protocol.shapes:
        several = ", or several [[pulses]]" if protocol.kind == "walking" else ""
        message = f"missing; conditions[{i + 1}].perturbations need it{several}."
        yield Problem(("pulse",), message)


def _plan_is_whole(protocol: ProtocolFields, i: int) -> Iterator[Problem]:
    plan, place = protocol.conditions[i].perturbations, ("conditions", i, "perturbations")
    if plan is None or protocol.kind == "control":
        return
    if protocol.kind == "walking":
        needed: tuple[str, ...] = ("timing_points", "gap_strides")
    else:
        needed = () if plan.timing_points is not None else ("count", "pause_s")
    if protocol.kind != "walking" and isinstance(plan.count_per_point, dict):
        message = "one number for all timing points on a bench; numbers of each are for walking."
        yield Problem((*place, "count_per_point"), message)
    for key in needed:
        stated = plan.count_per_point is not None and key in ("timing_points", "count", "pause_s")
        if getattr(plan, key) is None and not stated:  # the plan itself misses the timing points
            yield Problem((*place, key), f"missing; on a {protocol.kind} it says when pulses fire.")


def _variants_balanced(protocol: ProtocolFields, i: int) -> Iterator[Problem]:
    plan = protocol.conditions[i].perturbations
    variants = len(variants_of(protocol.shapes))
    if plan is None or variants < 2:
        return
    key = "count" if plan.count_per_point is None else "count_per_point"
    each = isinstance(plan.count_per_point, dict)
    for name, count in plan.counts.items():
        if not count % variants:
            continue
        of_pulses = f"a multiple of {variants}, as many of each shape, amplitude and direction"
        both = 'an even number, as many of either direction (pulse.direction = "both")'
        yield Problem(
            ("conditions", i, "perturbations", key, *((name,) if each else ())),
            f"expected {both if protocol.pulse is not None else of_pulses}; got {count}.",
        )
        if not each:
            return


def _pulses_apart(protocol: ProtocolFields, i: int) -> Iterator[Problem]:
    plan, gait = protocol.conditions[i].perturbations, protocol.gait
    longest_s = longest_pulse_s(protocol)
    if plan is None or gait is None:
        return
    if plan.gap_strides is None or not plan.timing_points:
        return
    fewest, points = plan.gap_strides[0], plan.timing_points
    first, last = min(points, key=points.__getitem__), max(points, key=points.__getitem__)
    strides = fewest - (points[last] - points[first]) / 100.0
    apart_s = strides * gait.shortest_stride_s
    if fewest >= 1 and longest_s > apart_s + ROUNDING_S:
        yield Problem(
            ("conditions", i, "perturbations", "gap_strides"),
            f"with a gap of {fewest} a pulse at {last} may begin {apart_s:.3g} s before the next "
            f"at {first}, when strides last {gait.shortest_stride_s:.3g} s, the least accepted; "
            f"{'a pulse lasts' if protocol.pulse is None else 'pulse.duration_s is'} "
            f"{longest_s:g} s. Raise the gap.",
        )


def _points_have_a_cycle(protocol: ProtocolFields, i: int) -> Iterator[Problem]:
    condition, plan = protocol.conditions[i], protocol.conditions[i].perturbations
    if protocol.by_gait or plan is None or plan.timing_points is None:
        return
    cyclic = [name for name, r in condition.references.items() if r.cycle_s is not None]
    if len(cyclic) != 1:
        yield Problem(
            ("conditions", i, "perturbations", "timing_points"),
            "expected one reference with a cycle that they are a part of, got "
            f"{' and '.join(cyclic) or 'none'}. On a bench without one give count and pause_s.",
        )


def _pulses_fit_duration(protocol: ProtocolFields, i: int) -> Iterator[Problem]:
    condition = protocol.conditions[i]
    plan, duration_s = condition.perturbations, condition.duration_s
    if protocol.by_gait or plan is None or not protocol.shapes or duration_s is None:
        return
    needed_s = _pulses_take_s(condition, plan, longest_pulse_s(protocol))
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


def _load_is_known(protocol: ProtocolFields, i: int) -> Iterator[Problem]:
    name, place = protocol.conditions[i].load, ("conditions", i, "load")
    names = [load.name for load in protocol.loads]
    if name is None:
        return
    if protocol.kind != "walking":
        message = f"belongs to kind = 'walking', and this is {protocol.kind!r}. Remove it."
        yield Problem(place, message)
    elif name not in names:
        known = f"one of {', '.join(names)}" if names else "a name in [[loads]], which is missing"
        yield Problem(place, f"expected {known}; got '{name}'. Add it to [[loads]].")


def _controller_fits_kind(protocol: ProtocolFields, i: int) -> Iterator[Problem]:
    condition, place = protocol.conditions[i], ("conditions", i)
    if protocol.kind != "control":
        if condition.controller is not None:
            message = f"belongs to kind = 'control', and this is {protocol.kind!r}. Remove it."
            yield Problem((*place, "controller"), message)
        return
    if condition.controller is None:
        yield Problem((*place, "controller"), "missing; it commands the torque. Give its name.")
    if condition.condition != "unperturbed":
        yield Problem(
            (*place, "condition"),
            'expected "unperturbed": the device is worn and no pulses come; got '
            f'"{condition.condition}".',
        )
    if condition.perturbations is not None:
        message = "belongs to kind = 'walking', and this is 'control'. Remove it."
        yield Problem((*place, "perturbations"), message)


CONDITION_CHECKS = (
    _keys_fit_kind,
    _says_how_long,
    _perturbed_is_perturbed,
    _random_torque_in_walking,
    _perturbations_have_pulse,
    _plan_is_whole,
    _variants_balanced,
    _pulses_apart,
    _points_have_a_cycle,
    _pulses_fit_duration,
    _rates_suffice,
    _load_is_known,
    _controller_fits_kind,
)
