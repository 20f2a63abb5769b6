"""Estimates of single phases put together to curves over the gait cycle."""

from collections.abc import Sequence

import numpy as np

from jointz.core.codes import Failure
from jointz.identify.over_cycle.time_varying_segments import PhaseEstimate
from jointz.identify.series.joint_record import sign_warnings
from jointz.results.series.time_varying_fit import ParameterCurve, PhaseResponses

_PARAMETERS = ("stiffness", "damping", "inertia")
#: Undecided: half the interval is more than this share of the parameter's size over the cycle.
_WIDEST = 0.5


def parameter_curves(
    found: Sequence[PhaseEstimate | None], *, ci_level: float
) -> tuple[ParameterCurve, ...]:
    """Return stiffness, damping and inertia over the cycle with their intervals."""
    return tuple(_curve(found, k, name, ci_level) for k, name in enumerate(_PARAMETERS))


def _curve(
    found: Sequence[PhaseEstimate | None], k: int, name: str, ci_level: float
) -> ParameterCurve:
    tails = (0.5 * (1.0 - ci_level), 0.5 * (1.0 + ci_level))
    raw = [None if one is None else float(one.fit.values[k]) for one in found]
    ends = [None if one is None else np.quantile(one.fit.replicates[:, k], tails) for one in found]
    sizes = [abs(value) for value in raw if value is not None]
    widest = _WIDEST * float(np.median(sizes)) if sizes else 0.0
    decided = [end is not None and 0.5 * (end[1] - end[0]) <= widest for end in ends]
    failed = Failure.ILL_CONDITIONED.status
    return ParameterCurve(
        name=name,
        value=tuple(v if sure else None for v, sure in zip(raw, decided, strict=True)),
        ci_low=tuple(_end(e, 0) if sure else None for e, sure in zip(ends, decided, strict=True)),
        ci_high=tuple(_end(e, 1) if sure else None for e, sure in zip(ends, decided, strict=True)),
        status=tuple(
            failed if end is None else "ok" if sure else "undecided"
            for end, sure in zip(ends, decided, strict=True)
        ),
        raw=tuple(raw),
    )


def _end(ends: np.ndarray | None, which: int) -> float | None:
    return None if ends is None else float(ends[which])


def phase_responses(
    found: Sequence[PhaseEstimate | None], lags: np.ndarray, rate_hz: float
) -> PhaseResponses:
    """Return the impulse responses of all phases, per second instead of per step."""
    step_s = float(lags[1] - lags[0]) / rate_hz
    each = [None if one is None else one.response for one in found]
    return PhaseResponses(
        lag_s=tuple((lags / rate_hz).tolist()),
        response=tuple(tuple((r.response / step_s).tolist()) if r else () for r in each),
        sd=tuple(tuple((r.sd / step_s).tolist()) if r else () for r in each),
        n_kept=tuple(r.n_kept if r else 0 for r in each),
    )


def curve_warnings(
    curves: Sequence[ParameterCurve], *, instrument: str | None, n_excluded: int, n_used: int
) -> tuple[str, ...]:
    """Return what a reader of the curves must know."""
    notes = [
        f"{curve.name} is undecided at {len(curve.value) - curve.n_decided} of "
        f"{len(curve.value)} phases: take more strides, a longer segment or a larger perturbation"
        for curve in curves
        if curve.n_decided < len(curve.value)
    ]
    if any(0 < 2 * curve.n_decided < len(curve.value) for curve in curves):
        notes.append(
            "with most phases undecided the others passed by luck, and values read low: do not "
            "use them"
        )
    notes += _sign_notes(curves)
    if instrument == "torque":
        notes.append(
            "the measured torque is the instrument: a device that reacts to the joint biases K and "
            "J; give the commanded torque"
        )
    if instrument is None:
        notes.append(
            "least squares of torque on angle: torque inside the joint, and movement that varies "
            "between strides, bias K and J towards zero; give the command where there is one"
        )
    if n_excluded > n_used:
        notes.append(f"{n_excluded} of {n_used + n_excluded} strides were left out")
    return tuple(notes)


def _sign_notes(curves: Sequence[ParameterCurve]) -> list[str]:
    """Say so where all of K, B and J are negative over most of the cycle."""
    decided = [[value for value in curve.value if value is not None] for curve in curves]
    if not all(decided) or any(np.median(values) >= 0.0 for values in decided):
        return []
    return sign_warnings([float(np.median(values)) for values in decided])
