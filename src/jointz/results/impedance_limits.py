"""What no estimate of K, B and J may be, whatever its method: negative, unsettled, enormous."""

from collections.abc import Iterable, Mapping
from dataclasses import replace

import numpy as np

from jointz.core.channels import PARAMETER_UNITS
from jointz.core.codes import Failure
from jointz.results.estimates import ParameterEstimate

#: Largest stiffness (N*m/rad), damping (N*m*s/rad) and inertia (kg*m^2) of a joint or load.
LARGEST_IMPEDANCE = (4900.0, 98.0, 5.0)
_LARGEST = dict(zip(("stiffness", "damping", "inertia"), LARGEST_IMPEDANCE, strict=True))
_PARTS = ("per_mass", "onset", "gravity_corrected")
_POSITIVE = (*_LARGEST, *(f"{n}_{of}" for n in _LARGEST for of in _PARTS))


def withhold_impossible(estimates: Iterable[ParameterEstimate]) -> tuple[ParameterEstimate, ...]:
    """Return the estimates, of which none that cannot be is ``ok``.

    Stiffness, damping and inertia are positive: if the interval of one reaches zero, it is
    undecided and the interval stays, as limits; if the interval lies below, it has failed. If one
    is beyond any joint or load, all have failed, because they share the units of torque, angle and
    time.
    """
    estimates = tuple(estimates)
    beyond = beyond_limits(estimates)
    return tuple(
        _without_value(p, Failure.OUTSIDE_RANGE.status)
        if beyond and p.name in _POSITIVE and p.available
        else without_negative(p)
        for p in estimates
    )


def beyond_limits(estimates: Iterable[ParameterEstimate]) -> bool:
    """Return whether K, B or J is larger than that of any joint or load."""
    return any(
        p.value is not None and abs(p.value) > _LARGEST.get(p.name, np.inf) for p in estimates
    )


def weakest_status(estimates: Iterable[ParameterEstimate]) -> str:
    """Return the status of a fit: that of its weakest estimate."""
    statuses = {p.status for p in estimates}
    failed = sorted(s for s in statuses if s.startswith("failed:"))
    weakest = (*failed, *(s for s in ("undecided", "at_bound") if s in statuses))
    return next(iter(weakest), "ok")


def reaches_zero(estimate: ParameterEstimate) -> bool:
    """Return whether an estimate of a positive quantity is ``ok`` though it may be zero."""
    low = estimate.ci_low if estimate.ci_low is not None else estimate.value
    decided = estimate.status == "ok" and estimate.name in _POSITIVE
    return decided and low is not None and low <= 0.0


def unit_question(values: Mapping[str, float]) -> str:
    """Return the question that values of K, B and J beyond all limits raise."""
    told = ", ".join(
        f"{name} {value:.4g} {PARAMETER_UNITS[name]}"
        for name, value in values.items()
        if name in _LARGEST
    )
    return (
        f"{told}: beyond any joint or load. Is the torque in N*mm or N*cm, or the sampling rate "
        "wrong? Correct the unit of the column, or the rate."
    )


def without_negative(estimate: ParameterEstimate) -> ParameterEstimate:
    """Return an estimate, without its value if that is K, B or J and may be zero or negative.

    A value at its bound stays, at zero if a correction moved it below.
    """
    at_bound = estimate.name in _POSITIVE and estimate.status == "at_bound"
    if not (at_bound or reaches_zero(estimate)):
        return estimate
    if estimate.ci_high is not None and estimate.ci_high <= 0.0 and estimate.value != 0.0:
        return _without_value(estimate, Failure.BELOW_ZERO.status)
    if at_bound:
        ends = (estimate.value, estimate.ci_low)
        value, low = (end if end is None else max(end, 0.0) for end in ends)
        return estimate if (value, low) == ends else replace(estimate, value=value, ci_low=low)
    return replace(estimate, value=None, status="undecided", unbounded=estimate.value)


def _without_value(estimate: ParameterEstimate, status: str) -> ParameterEstimate:
    unbounded = estimate.value if estimate.unbounded is None else estimate.unbounded
    return replace(
        estimate, value=None, ci_low=None, ci_high=None, status=status, unbounded=unbounded
    )
