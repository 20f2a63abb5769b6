"""Curves over the gait cycle from estimates at single phases."""

from collections.abc import Sequence

import numpy as np

from jointz.core.codes import Failure
from jointz.identify.over_cycle.time_varying_segments import PhaseEstimate
from jointz.identify.preparation.cell_data import PARAMETERS
from jointz.identify.series.joint_record import sign_warnings
from jointz.results.series.time_varying_fit import ParameterCurve, PhaseResponses

#: Undecided: half the interval is more than this share of the parameter's size over the cycle.
_WIDEST = 0.5


def parameter_curves(
    estimates: Sequence[PhaseEstimate | None], *, ci_level: float
) -> tuple[ParameterCurve, ...]:
    """Return stiffness, damping and inertia over the cycle with their intervals."""
    return tuple(_curve(estimates, k, name, ci_level) for k, name in enumerate(PARAMETERS))


def _curve(
    estimates: Sequence[PhaseEstimate | None], k: int, name: str, ci_level: float
) -> ParameterCurve:
    tails = (0.5 * (1.0 - ci_level), 0.5 * (1.0 + ci_level))
    raw = [None if e is None else float(e.fit.values[k]) for e in estimates]
    ends = [None if e is None else np.quantile(e.fit.replicates[:, k], tails) for e in estimates]
    sizes = [abs(value) for value in raw if value is not None]
    widest = _WIDEST * float(np.median(sizes)) if sizes else 0.0
    rows: list[tuple[float | None, float | None, float | None, str]] = []
    for value, end in zip(raw, ends, strict=True):
        if end is None:
            rows.append((None, None, None, Failure.ILL_CONDITIONED.status))
        elif 0.5 * (end[1] - end[0]) <= widest:
            rows.append((value, float(end[0]), float(end[1]), "ok"))
        else:
            rows.append((None, None, None, "undecided"))
    values, lows, highs, statuses = zip(*rows, strict=True)
    return ParameterCurve(
        name=name, value=values, ci_low=lows, ci_high=highs, status=statuses, raw=tuple(raw)
    )


def phase_responses(
    estimates: Sequence[PhaseEstimate | None], lags: np.ndarray, rate_hz: float
) -> PhaseResponses:
    """Return the impulse responses of all phases, per second instead of per step."""
    step_s = float(lags[1] - lags[0]) / rate_hz
    each = [None if e is None else e.response for e in estimates]
    return PhaseResponses(
        lag_s=tuple((lags / rate_hz).tolist()),
        response=tuple(tuple((r.response / step_s).tolist()) if r else () for r in each),
        sd=tuple(tuple((r.sd / step_s).tolist()) if r else () for r in each),
        n_kept=tuple(r.n_kept if r else 0 for r in each),
    )


def curve_warnings(
    curves: Sequence[ParameterCurve], *, instrument: str | None, n_excluded: int, n_used: int
) -> tuple[str, ...]:
    """Return warnings for readers of the curves."""
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
    """Return a warning if all of K, B and J are negative over most of the cycle."""
    decided = [[value for value in curve.value if value is not None] for curve in curves]
    if not all(decided) or any(np.median(values) >= 0.0 for values in decided):
        return []
    return sign_warnings([float(np.median(values)) for values in decided])
