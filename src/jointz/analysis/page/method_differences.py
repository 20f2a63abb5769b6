"""Section of the report on the methods bayesian and dissertation: why they differ."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Final

import numpy as np

from jointz.analysis.summary import used_coupling
from jointz.core.events import row_label
from jointz.core.grouping import by_key
from jointz.core.method_names import DISSERTATION
from jointz.identify.preparation.calibration import value_of
from jointz.kernels.filtering import lowpass_zero_phase
from jointz.report.subjects import study_spec, timing_points
from jointz.report.wording import (
    ABSOLUTE,
    DASH,
    MINUS,
    SYMBOLS,
    format_number,
    format_span,
    joined,
)
from jointz.results.estimates import CellEstimate, Response
from jointz.results.study_analysis import StudyAnalysis

#: Defaults of the dissertation's method (4.2.3).
_CUTOFF_HZ, _WINDOW_S = 20.0, 0.1
_SAME_LAG_S: Final = 0.5e-3
_SAME_LAG_MS: Final = 0.1
_SMALL_PCT: Final = 5.0

_Row = dict[str, Any]


@dataclass(frozen=True, slots=True)
class _Pair:
    """One participant and timing point by both methods."""

    bayesian: CellEstimate
    other: CellEstimate
    lag_s: float  # lag of the angle behind the torque that the calibration does not remove
    # effect of ``lag_s`` on the other method's K, B and J, %; empty if one of ours is not above 0
    lag_alone: tuple[float, ...]
    apart_deg: float  # largest distance between the average angles of the two methods


def differences_section(analysis: StudyAnalysis) -> _Row | None:
    """Return what the page shows of both methods, None unless there are estimates of both."""
    pairs = _pairs(analysis)
    if not pairs:
        return None
    names = timing_points([p.bayesian for p in pairs])
    return {
        "lead": _lead(pairs),
        "rows": [
            _row(name, [p for p in pairs if p.bayesian.timing_point == name]) for name in names
        ],
        "reasons": _reasons(analysis, pairs),
    }


def _estimated_lag_s(cell: CellEstimate) -> float | None:
    """Return the estimated lag of the angle behind the torque, calibrated part included."""
    return next((p.value for p in cell.nuisance if p.name == "angle_lag"), None)


def _calibrated_lag_s(analysis: StudyAnalysis, cell: CellEstimate) -> float:
    """Return the calibrated lag of the angle; the torque is corrected for its own lag."""
    study = study_spec(analysis)
    known = [
        study.calibration_of(r)
        for r in study.recordings
        if r.condition in ("perturbed", None)
        and row_label(r.participant, r.session or "", r.side or "") == cell.label
    ]
    return value_of(known[-1].angle_lag_s, 0.0) if known else 0.0


def _pairs(analysis: StudyAnalysis) -> list[_Pair]:
    if used_coupling(analysis).is_strap:
        return []  # strap and softening set the methods apart as well
    others = {(c.label, c.timing_point): c for c in analysis.comparison if c.method == DISSERTATION}
    pairs = []
    for cell in analysis.cells:
        other = others.get((cell.label, cell.timing_point))
        lag_s = _estimated_lag_s(cell)
        if other is None or lag_s is None or cell.response is None:
            continue
        if not any(p.available for p in other.parameters):
            continue  # nothing to compare with
        calibrated_lag_s = _calibrated_lag_s(analysis, cell)
        alone = _lag_alone(cell, cell.response, lag_s - calibrated_lag_s, analysis.settings)
        apart_deg = _apart_deg(cell, other, calibrated_lag_s)
        pairs.append(_Pair(cell, other, lag_s - calibrated_lag_s, alone, apart_deg))
    return pairs


def _lag_alone(
    cell: CellEstimate, response: Response, lag_s: float, settings: Mapping[str, Any]
) -> tuple[float, ...]:
    """Return the effect of the lag on the other method's K, B and J, % of each."""
    estimates = [p for name in ABSOLUTE if (p := cell.parameter(name)) is not None]
    values = [p.unbounded for p in estimates if p.unbounded is not None and p.unbounded > 0.0]
    if len(values) < len(ABSOLUTE):
        return ()
    stiffness, damping, inertia = values
    biased = fit_with_lag(
        response,
        (stiffness, damping, inertia),
        lag_s=lag_s,
        cutoff_hz=settings.get("cutoff_hz") or _CUTOFF_HZ,
        window_s=settings.get("window_s") or _WINDOW_S,
    )
    return tuple(100.0 * (b / v - 1.0) for b, v in zip(biased, values, strict=True))


def _apart_deg(bayesian: CellEstimate, other: CellEstimate, calibrated_lag_s: float) -> float:
    """Return the largest distance between the average angles, without the calibrated lag."""
    a, b = bayesian.response, other.response
    if a is None or b is None:
        return float("nan")
    at = a.time_s - calibrated_lag_s  # the other method has removed this lag
    both = (at >= b.time_s[0]) & (at <= b.time_s[-1])
    apart = np.abs(a.angle[both] - np.interp(at[both], b.time_s, b.angle))
    return float(np.degrees(apart.max())) if apart.size else float("nan")


def _differences(pairs: Iterable[_Pair], name: str) -> np.ndarray:
    """Return the differences of the other method, % of ours, where both are available."""
    differences = []
    for pair in pairs:
        a, b = pair.bayesian.parameter(name), pair.other.parameter(name)
        if a is None or b is None or not (a.available and b.available) or not a.value:
            continue
        differences.append(100.0 * ((b.value or 0.0) / a.value - 1.0))
    return np.array(differences)


def _row(name: str, pairs: Sequence[_Pair]) -> _Row:
    cells = [
        {
            "whole": _percent(_differences(pairs, parameter)),
            "lag": _percent([p.lag_alone[k] for p in pairs if p.lag_alone]),
        }
        for k, parameter in enumerate(ABSOLUTE)
    ]
    bound = [
        symbol
        for symbol, parameter in zip(SYMBOLS, ABSOLUTE, strict=True)
        for p in pairs
        if (e := p.other.parameter(parameter)) is not None and e.status == "at_bound"
    ]
    return {
        "name": name,
        "cells": cells,
        "apart": _degrees([p.apart_deg for p in pairs]),
        "motion": _degrees([np.degrees(p.bayesian.displacement_rad or np.nan) for p in pairs]),
        "verdict": _verdict(pairs),
        "bound": ", ".join(f"{bound.count(s)} {s}" for s in dict.fromkeys(bound)) or DASH,
        "n": len(pairs),
    }


def _verdict(pairs: Sequence[_Pair]) -> str:
    """Name the cause of the difference in stiffness: the lag, the rest, or both."""
    whole = _differences(pairs, "stiffness")
    alone = [pair.lag_alone[0] for pair in pairs if pair.lag_alone]
    if not whole.size or not alone:
        return DASH
    lag = float(np.median(alone))
    rest = 100.0 * ((100.0 + float(np.median(whole))) / (100.0 + lag) - 1.0)
    if max(abs(lag), abs(rest)) < _SMALL_PCT:
        return "little"
    if abs(rest) < 0.5 * abs(lag):
        return "mostly the lag"
    if abs(lag) < 0.5 * abs(rest):
        return "mostly the baseline"
    if lag * rest < 0.0:
        return "lag and baseline, with opposite effects"
    return "lag and baseline"


def _percent(values: Sequence[float] | np.ndarray) -> str:
    median = _median(values)
    if median is None:
        return DASH
    return f"{round(median):+d} %".replace("-", MINUS) if round(median) else "0 %"


def _degrees(values: Sequence[float]) -> str:
    median = _median(values)
    return DASH if median is None else f"{median:.1f}"


def _median(values: Sequence[float] | np.ndarray) -> float | None:
    finite = np.asarray(values, dtype=float)
    finite = finite[np.isfinite(finite)]
    return float(np.median(finite)) if finite.size else None


def _lead(pairs: Sequence[_Pair]) -> str:
    sizes = []
    for symbol, name in zip(SYMBOLS, ABSOLUTE, strict=True):
        percent = _differences(pairs, name)
        if percent.size:
            sizes.append(f"{np.sqrt(np.mean(percent**2)):.0f}\N{NO-BREAK SPACE}% in {symbol}")
    text = (
        "Both methods analysed the same recordings; each excludes the pulses that it cannot use. "
        "The dissertation's method differs from the method bayesian"
    )
    return f"{text} by {joined(sizes)} (root mean square)." if sizes else f"{text}."


def _reasons(analysis: StudyAnalysis, pairs: Sequence[_Pair]) -> _Row:
    """Return the facts about lag, baseline, inertia and intervals."""
    lags = [1e3 * (_estimated_lag_s(p.bayesian) or 0.0) for p in pairs]
    alike = max(lags) - min(lags) < _SAME_LAG_MS
    apart = [p.apart_deg for p in pairs if np.isfinite(p.apart_deg)]
    bayesian, other = [p.bayesian for p in pairs], [p.other for p in pairs]
    inertias = [_inertia_spread(cells) for cells in (other, bayesian)]
    return {
        "lag": f"{min(lags):.1f}" if alike else format_span(lags, "{:.1f}".format),
        "same_lag": max(abs(p.lag_s) for p in pairs) < _SAME_LAG_S,
        "calibrated": any(abs(_calibrated_lag_s(analysis, cell)) > 0.0 for cell in bayesian),
        "apart": (max(apart), np.median(apart)) if apart else None,
        "inertias": None if None in inertias else inertias,
        "widths": [
            f"{symbol} {_half_width(bayesian, name)} and {_half_width(other, name)}"
            for symbol, name in zip(SYMBOLS, ABSOLUTE, strict=True)
        ],
    }


def _inertia_spread(cells: Sequence[CellEstimate]) -> str | None:
    """Return the largest over the smallest inertia of a participant, the median over them."""
    known = ((cell.label, cell.inertia) for cell in cells)
    inertias = by_key((label, j.value) for label, j in known if j and j.available and j.value)
    ratios = [max(v) / min(v) for v in inertias.values() if len(v) > 1]
    return format_number(float(np.median(ratios))) if ratios else None


def _half_width(cells: Iterable[CellEstimate], name: str) -> str:
    widths = [
        50.0 * ((p.ci_high or 0.0) - (p.ci_low or 0.0)) / p.value
        for cell in cells
        if (p := cell.parameter(name)) is not None and p.status == "ok" and p.value
    ]
    return f"{np.median(widths):.0f}\N{NO-BREAK SPACE}%" if widths else DASH


# The low-pass needs a few periods of its cut-off; the pulse continues after the window.
_MARGIN_S = 0.3
_STEP_S = 1e-3


def fit_with_lag(
    response: Response,
    impedance: tuple[float, float, float],
    *,
    lag_s: float,
    cutoff_hz: float,
    window_s: float,
) -> tuple[float, float, float]:
    """Return the K, B, J that a regression gives if the angle is late and nothing else is wrong.

    The joint is linear and at rest, the lag a pure delay, and there is no noise; torque is
    regressed on angle, velocity and acceleration (4.2). After the low-pass of 20 Hz a sensor with a
    time constant differs little from a delay.
    """
    from scipy.optimize import nnls
    from scipy.signal import lsim

    stiffness, damping, inertia = impedance
    end_s = float(response.time_s[-1])
    time = np.arange(-_MARGIN_S, end_s + _MARGIN_S, _STEP_S)
    torque = np.interp(time, response.time_s, response.torque, left=0.0)
    _, angle, _ = lsim(([1.0], [inertia, damping, stiffness]), torque, time - time[0])
    seen = np.interp(time - lag_s, time, angle, left=0.0)
    smooth_angle, smooth_torque = (
        lowpass_zero_phase(x, cutoff_hz=cutoff_hz, rate_hz=1.0 / _STEP_S) for x in (seen, torque)
    )
    velocity = np.gradient(smooth_angle, _STEP_S)
    motion = np.column_stack([smooth_angle, velocity, np.gradient(velocity, _STEP_S)])
    inside = (time >= -0.5 * _STEP_S) & (time <= window_s + 0.5 * _STEP_S)
    scale = np.abs(motion[inside]).max(axis=0)
    scaled, _ = nnls(motion[inside] / scale, smooth_torque[inside])
    k, b, j = scaled / scale
    return float(k), float(b), float(j)
