"""Checks and estimates that the stiffness fits of a bench share."""

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from jointz.core.errors import DataError, EstimationError
from jointz.core.events import PulseEstimate
from jointz.identify.bench.bench_records import FEWEST_SAMPLES
from jointz.identify.preparation.assignment import Candidate
from jointz.identify.preparation.conditioning import TORQUE
from jointz.identify.preparation.sources import Source
from jointz.kernels.bounded_lsq import least_squares, normal_equations
from jointz.results.bench.bench_fits import estimate
from jointz.results.estimates import ParameterEstimate

_CONSTANT = 1e-9
NEGATIVE_STIFFNESS = "the stiffness is negative: turn the sign of torque or angle"


def is_constant(values: np.ndarray) -> bool:
    """Return whether a channel is constant up to rounding."""
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


#: The slope of a reference is that over so long before the onset: no pulse is in it.
_SLOPE_S = 0.02


def pulse_estimates(
    participant: str,
    candidates: Sequence[Candidate],
    responses: np.ndarray,
    sources: Sequence[Source],
) -> tuple[PulseEstimate, ...]:
    """Fit torque = K*angle + B*velocity + J*acceleration to every response by itself."""
    gram, moment, power = normal_equations(responses)
    values = least_squares(gram, moment)
    fitted = np.einsum("pk,pkt->pt", values, responses[:, :TORQUE])
    error = ((fitted - responses[:, TORQUE]) ** 2).sum(axis=1)
    vaf_pct = 100.0 * (1.0 - error / power)
    return tuple(
        PulseEstimate(
            participant=participant,
            timing_point=candidate.record.timing_point,
            recording=candidate.record.recording,
            trial=str(sources[candidate.source].input.recording.attrs["trial"]),
            onset_s=candidate.pulse.onset_s,
            sign=int(candidate.pulse.sign),
            direction=_direction(candidate, sources[candidate.source]),
            stiffness=float(row[0]),
            damping=float(row[1]),
            inertia=float(row[2]),
            vaf_pct=float(vaf),
        )
        for candidate, row, vaf in zip(candidates, values, vaf_pct, strict=True)
        if np.isfinite(row).all()
    )


def _direction(candidate: Candidate, source: Source) -> str:
    """Return whether a pulse moves with the reference or against it, "" if unknown."""
    recording = source.input.recording
    if "reference" not in recording:
        return ""
    onset = candidate.pulse.onset_s
    at = np.searchsorted(recording["time"].to_numpy(), [onset - _SLOPE_S, onset])
    before, now = recording["reference"].to_numpy()[at.clip(0, recording.sizes["time"] - 1)]
    slope = candidate.pulse.sign * (now - before)
    if not np.isfinite(slope) or slope == 0.0:
        return ""
    return "with" if slope > 0.0 else "against"
