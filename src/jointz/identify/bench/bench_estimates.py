"""Checks and estimates that the stiffness fits of a bench share."""

from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from jointz.core.errors import DataError, EstimationError
from jointz.identify.bench.bench_records import FEWEST_SAMPLES
from jointz.results.bench.bench_fits import estimate
from jointz.results.estimates import ParameterEstimate

_CONSTANT = 1e-9
NEGATIVE_STIFFNESS = "the stiffness is negative: turn the sign of torque or angle"


def is_constant(values: np.ndarray) -> bool:
    """Tell whether a channel stands still but for rounding."""
    return bool(np.ptp(values) <= _CONSTANT * np.abs(values).max())


def check_excited(where: str, channels: Mapping[str, np.ndarray]) -> None:
    """Refuse a bench record that is too short, or in which angle or torque stands still."""
    n = channels["angle"].size
    if n < FEWEST_SAMPLES:
        raise DataError(f"{where}: expected at least {FEWEST_SAMPLES} samples, got {n}.")
    for name in ("angle", "torque"):
        if is_constant(channels[name]):
            raise EstimationError(
                f"constant_{name}",
                f"{where}: the {name} is {channels[name][0]:.6g} throughout; expected one that "
                "changes. Look for a dead sensor, or load the bench more.",
            )


def bench_estimates(
    values: Mapping[str, float], half_width: np.ndarray, *, ci_level: float, ci_method: str
) -> tuple[ParameterEstimate, ...]:
    """Return estimates with intervals; an undecided one keeps its value as ``unbounded``."""
    common = {"ci_level": ci_level, "ci_method": ci_method}
    estimates = [
        estimate(name, float(value), float(half), t_factor=1.0, common=common)
        for (name, value), half in zip(values.items(), half_width, strict=True)
    ]
    return tuple(
        p if p.available else replace(p, unbounded=float(values[p.name])) for p in estimates
    )
