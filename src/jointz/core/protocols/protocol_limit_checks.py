"""Checks of a protocol against its own limits and against what can be run at all."""

from collections.abc import Iterator

from jointz.core.checked_model import Problem
from jointz.core.limits import DUTY_WINDOW_S
from jointz.core.protocols.expected_displacement import LONGEST_PULSE_S, largest_displacement_rad
from jointz.core.protocols.protocol_checks import (
    ROUNDING_S,
    assumed_stride_s,
    expected_duration_s,
    longest_pulse_s,
    placed_pulses,
    trial_duration_s,
)
from jointz.core.protocols.protocol_models import PerturbationPlan, ProtocolFields
from jointz.core.protocols.pulse_models import name_of, variants_of

_LONGEST_S = 86_400.0
#: Of a trial on a bench: all of it is laid out before it begins.
_MOST_TICKS = 10_000_000


# --- checks of the whole -----------------------------------------------------------------------


def _pulse_within_torque(protocol: ProtocolFields) -> Iterator[Problem]:
    limit = protocol.safety.torque_nm
    for place, pulse in placed_pulses(protocol):
        largest_nm = max(pulse.sizes_nm)
        if limit is not None and largest_nm > limit:
            yield Problem(
                (*place, pulse.size_key),
                f"{largest_nm:g} N*m is above safety.torque_nm = {limit:g} N*m: it would be cut. "
                "Lower it, or raise the limit.",
            )


def _pulse_within_torque_rate(protocol: ProtocolFields) -> Iterator[Problem]:
    limit = protocol.safety.torque_rate_nm_s
    if limit is None:
        return
    for place, pulse in placed_pulses(protocol):
        steepest: dict[str, tuple[float, float, float]] = {}
        for key, share, ramp_s in pulse.changes:
            change_nm = share * max(pulse.sizes_nm)
            takes_s = ramp_s or 1.0 / protocol.rates.control_hz
            change = change_nm / takes_s, change_nm, takes_s
            steepest[key] = max(change, steepest.get(key, change))
        for key, (rate_nm_s, change_nm, takes_s) in steepest.items():
            if rate_nm_s > limit * (1.0 + 1e-9):
                most_nm = max(pulse.sizes_nm) * limit / rate_nm_s
                ramp = key in ("ramp_up_s", "ramp_down_s")
                remedy = f"{change_nm / limit:.3g} s" if ramp else f"{most_nm:.3g} N*m"
                yield Problem(
                    (*place, key),
                    f"{change_nm:g} N*m in {takes_s:g} s is steeper than "
                    f"safety.torque_rate_nm_s = {limit:g} N*m/s. Give at "
                    f"{'least' if ramp else 'most'} {remedy}, or raise the limit.",
                )


def _pulse_within_duty(protocol: ProtocolFields) -> Iterator[Problem]:
    duty, pulse_s = protocol.safety.pulse_duty, longest_pulse_s(protocol)
    if duty is None:
        return
    longest_s = duty * DUTY_WINDOW_S
    if pulse_s > longest_s + ROUNDING_S:
        which = "the longest pulse," if protocol.pulse is None else "pulse.duration_s ="
        yield Problem(
            ("safety", "pulse_duty"),
            f"{duty:g} of {DUTY_WINDOW_S:g} s is {longest_s:g} s, less than {which} "
            f"{pulse_s:g} s: no pulse would come to its end. Give at least "
            f"{pulse_s / DUTY_WINDOW_S:.3g}, or shorten the pulse.",
        )


def _displacement_expected(protocol: ProtocolFields) -> Iterator[Problem]:
    limit, joint = protocol.safety.displacement_rad, protocol.expected_joint
    if protocol.kind == "control":
        return
    if limit is None:
        if joint is not None:
            message = "safety.displacement_rad is missing, for which it is. Give both or none."
            yield Problem(("expected_joint",), message)
        return
    if joint is None:
        if protocol.kind != "walking" or not protocol.shapes:
            return  # a device may have a limit that concerns none of its pulses
        yield Problem(
            ("expected_joint",),
            "missing; safety.displacement_rad needs it: [expected_joint] with the stiffness "
            "(N*m/rad), damping (N*m*s/rad) and inertia (kg*m^2) of the leg with the device.",
        )
        return
    for place, pulse in placed_pulses(protocol):
        # Not its length: parts may disagree with it, which is a problem of its own.
        lasts_s = sum(abs(part_s) for _, part_s in pulse.timed_parts)
        if lasts_s > LONGEST_PULSE_S:
            longest_key = max(pulse.timed_parts, key=lambda part: part[1])[0]
            yield Problem(
                (*place, longest_key),
                f"the pulse lasts {lasts_s:g} s; safety.displacement_rad is for pulses of at most "
                f"{LONGEST_PULSE_S:g} s. Shorten it.",
            )
            continue
        moved_rad = max(pulse.sizes_nm) * largest_displacement_rad(pulse, joint)
        if moved_rad > limit:
            yield Problem(
                (*place, pulse.size_key),
                f"{max(pulse.sizes_nm):g} N*m move the expected joint by {moved_rad:.3g} rad, "
                f"beyond safety.displacement_rad = {limit:g} rad. Give at most "
                f"{max(pulse.sizes_nm) * limit / moved_rad:.3g} N*m, or shorten the pulse.",
            )


def _samples_young_enough(protocol: ProtocolFields) -> Iterator[Problem]:
    limit_s, period_s = protocol.safety.sensor_age_s, 1.0 / protocol.rates.sample_hz
    if limit_s is not None and limit_s < period_s - ROUNDING_S:
        yield Problem(
            ("safety", "sensor_age_s"),
            f"expected at least one period of rates.sample_hz ({period_s:g} s), got {limit_s:g} s: "
            "the gate would trip at once. Raise it, or the rate.",
        )


PROTOCOL_LIMIT_CHECKS = (
    _pulse_within_torque,
    _pulse_within_torque_rate,
    _pulse_within_duty,
    _displacement_expected,
    _samples_young_enough,
)


# --- checks of one condition -------------------------------------------------------------------


def _count_within_limit(protocol: ProtocolFields, i: int) -> Iterator[Problem]:
    condition, limit = protocol.conditions[i], protocol.safety.pulse_count
    if condition.perturbations is None or limit is None:
        return
    planned = condition.trials * condition.perturbations.total
    if planned > limit:
        yield Problem(
            ("conditions", i, "perturbations"),
            f"{planned} pulses are more than safety.pulse_count = {limit}. Plan fewer, or raise "
            "the limit.",
        )


def _pulses_within_duty(protocol: ProtocolFields, i: int) -> Iterator[Problem]:
    plan, duty = protocol.conditions[i].perturbations, protocol.safety.pulse_duty
    if plan is None or not protocol.shapes or duty is None:
        return
    if longest_pulse_s(protocol) > duty * DUTY_WINDOW_S:
        return  # a problem of the limit already
    pulse_s = _mean_pulse_s(protocol)
    apart_s = _mean_apart_s(protocol, plan, pulse_s)
    if pulse_s > duty * apart_s * (1.0 + 1e-9) > 0.0:
        yield Problem(
            ("conditions", i, "perturbations"),
            f"a pulse of {pulse_s:.4g} s about every {apart_s:.3g} s is "
            f"{pulse_s / apart_s:.3g} of the time; safety.pulse_duty = {duty:g} would "
            "break pulses off. Put them further apart, shorten them, or raise the limit.",
        )


def _mean_pulse_s(protocol: ProtocolFields) -> float:
    """Return the mean duration of a pulse, s."""
    lengths_s = {name_of(pulse): pulse.length_s for pulse in protocol.shapes}
    variants = variants_of(protocol.shapes)
    return sum(lengths_s[variant.shape] for variant in variants) / len(variants)


def _mean_apart_s(protocol: ProtocolFields, plan: PerturbationPlan, pulse_s: float) -> float:
    """Return the mean time from onset to onset, s; 0 if the plan does not state it."""
    if plan.gap_strides is not None:
        return sum(plan.gap_strides) / 2.0 * assumed_stride_s(protocol)
    return plan.pause_s + pulse_s if plan.pause_s is not None else 0.0


def _torque_within_limit(protocol: ProtocolFields, i: int) -> Iterator[Problem]:
    condition, limit = protocol.conditions[i], protocol.safety.torque_nm
    if condition.torque_nm is None or limit is None:
        return
    pulse_nm = protocol.pulse.amplitude_nm if condition.perturbations and protocol.pulse else 0.0
    largest_nm = max(map(abs, condition.torque_nm.bounds)) + pulse_nm
    if largest_nm > limit:
        yield Problem(
            ("conditions", i, "torque_nm"),
            f"reaches {largest_nm:g} N*m{' with the pulse' if pulse_nm else ''}, above "
            f"safety.torque_nm = {limit:g} N*m. Lower it, or raise the limit.",
        )


def _position_within_limits(protocol: ProtocolFields, i: int) -> Iterator[Problem]:
    position, safety = protocol.conditions[i].position_rad, protocol.safety
    if position is None:
        return
    lowest, highest = position.bounds
    for key, over in (
        ("angle_min_rad", safety.angle_min_rad is not None and lowest < safety.angle_min_rad),
        ("angle_max_rad", safety.angle_max_rad is not None and highest > safety.angle_max_rad),
    ):
        if over:
            yield Problem(
                ("conditions", i, "position_rad"),
                f"goes from {lowest:.4g} to {highest:.4g} rad, beyond safety.{key} = "
                f"{getattr(safety, key):g} rad. Lower it, or widen the limit.",
            )


def _over_in_a_day(protocol: ProtocolFields, i: int) -> Iterator[Problem]:
    takes_s = expected_duration_s(protocol, protocol.conditions[i])
    if takes_s > _LONGEST_S:
        yield Problem(
            ("conditions", i),
            f"would take {takes_s / 3600.0:.3g} h; expected at most {_LONGEST_S / 3600.0:g} h. "
            "Do less in one condition.",
        )


def _trial_can_be_laid_out(protocol: ProtocolFields, i: int) -> Iterator[Problem]:
    if protocol.by_gait:
        return
    rate_hz = protocol.rates.control_hz
    trial_s = trial_duration_s(protocol, protocol.conditions[i])
    if trial_s * rate_hz > _MOST_TICKS:
        yield Problem(
            ("conditions", i),
            f"a trial of {trial_s:g} s has more than {_MOST_TICKS} periods of control_hz = "
            f"{rate_hz:g} Hz. Give at most {_MOST_TICKS / rate_hz:g} s a trial, and more trials.",
        )


CONDITION_LIMIT_CHECKS = (
    _count_within_limit,
    _pulses_within_duty,
    _torque_within_limit,
    _position_within_limits,
    _over_in_a_day,
    _trial_can_be_laid_out,
)
