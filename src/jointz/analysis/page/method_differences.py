"""The recommended method beside the dissertation's, and in plain words why they differ."""

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Final

import numpy as np

from jointz.analysis.page.lag_effect import fit_with_lag
from jointz.core.events import row_label
from jointz.report.impedance_figures import timing_points
from jointz.report.wording import DASH, MINUS, format_count, format_number, format_vaf
from jointz.results.estimates import CellEstimate, Response
from jointz.results.study_analysis import StudyAnalysis

METHOD: Final = "recommended"
OTHER: Final = "dissertation"
_PARAMETERS: Final = ("stiffness", "damping", "inertia")
_SYMBOLS: Final = ("K", "B", "J")
#: What the dissertation's method takes where a study says nothing (4.2.3).
_CUTOFF_HZ, _WINDOW_S = 20.0, 0.1
_SAME_LAG_S: Final = 0.5e-3
_SMALL_PCT: Final = 5.0

_Row = dict[str, Any]


@dataclass(frozen=True, slots=True)
class _Pair:
    """One participant and timing point by both methods."""

    mine: CellEstimate
    other: CellEstimate
    lag_s: float
    lag_alone: tuple[float, ...]
    apart_deg: float


def differences_section(analysis: StudyAnalysis) -> _Row | None:
    """Return what the page says of both methods, None where there are not both."""
    pairs = _pairs(analysis)
    if not pairs:
        return None
    names = timing_points([p.mine for p in pairs])
    return {
        "lead": _unbroken(_lead(pairs)),
        "rows": [_row(name, [p for p in pairs if p.mine.timing_point == name]) for name in names],
        "reasons": [(head, _unbroken(text)) for head, text in _reasons(analysis, pairs)],
    }


def left_over_lag_s(analysis: StudyAnalysis, cell: CellEstimate) -> tuple[float, float] | None:
    """Return the lag found, and the part of it that the study's calibration does not take out."""
    model = next((m for m in analysis.models if m.label == cell.label), None)
    if model is None:
        return None
    return model.lag_s, model.lag_s - _calibrated_lag_s(analysis, cell)


def _calibrated_lag_s(analysis: StudyAnalysis, cell: CellEstimate) -> float:
    known = _calibration(analysis, cell)
    return _seconds(known, "angle_lag_s") - _seconds(known, "torque_lag_s")


def _calibration(analysis: StudyAnalysis, cell: CellEstimate) -> Mapping[str, Any]:
    """Return what holds in the perturbed recordings of a cell."""
    known = dict(analysis.settings.get("calibration") or {})
    study = analysis.provenance.get("study") or {}
    for person in study.get("participants") or ():
        if person.get("id") == cell.participant:
            known |= person.get("calibration") or {}
    for recording in study.get("recordings") or ():
        perturbed = recording.get("condition") in ("perturbed", None)
        whose = [recording.get(key) or "" for key in ("participant", "session", "side")]
        if perturbed and row_label(*whose) == cell.label:
            known |= recording.get("calibration") or {}
    return known


def _seconds(known: Mapping[str, Any], name: str) -> float:
    return float((known.get(name) or {}).get("value", 0.0))


def _pairs(analysis: StudyAnalysis) -> list[_Pair]:
    others = {(c.label, c.timing_point): c for c in analysis.comparison if c.method == OTHER}
    pairs = []
    for cell in analysis.cells:
        other = others.get((cell.label, cell.timing_point))
        lags = left_over_lag_s(analysis, cell)
        if cell.method != METHOD or other is None or lags is None or cell.response is None:
            continue
        alone = _lag_alone(cell, cell.response, lags[1], analysis.settings)
        late_s = _seconds(_calibration(analysis, cell), "angle_lag_s")
        apart_deg = _apart_deg(cell, other, late_s)
        pairs.append(_Pair(cell, other, lags[1], alone, apart_deg))
    return pairs


def _lag_alone(
    cell: CellEstimate, response: Response, lag_s: float, settings: Mapping[str, Any]
) -> tuple[float, ...]:
    """Return what the lag does to the other method's K, B and J, % of each."""
    known = [p.unbounded for name in _PARAMETERS if (p := cell.parameter(name)) is not None]
    values = [v for v in known if v is not None and v > 0.0]
    if len(values) < len(_PARAMETERS):
        return ()
    impedance = (values[0], values[1], values[2])
    found = fit_with_lag(
        response,
        impedance,
        lag_s=lag_s,
        cutoff_hz=settings.get("cutoff_hz") or _CUTOFF_HZ,
        window_s=settings.get("window_s") or _WINDOW_S,
    )
    return tuple(100.0 * (f / v - 1.0) for f, v in zip(found, impedance, strict=True))


def _apart_deg(mine: CellEstimate, other: CellEstimate, late_s: float) -> float:
    """Return how far apart the two average angles are at most; mine is late by a known lag."""
    a, b = mine.response, other.response
    if a is None or b is None:
        return float("nan")
    at = a.time_s - late_s  # the other method shifted it out
    both = (at >= b.time_s[0]) & (at <= b.time_s[-1])
    apart = np.abs(a.angle[both] - np.interp(at[both], b.time_s, b.angle))
    return float(np.degrees(apart.max())) if apart.size else float("nan")


def _differences(pairs: Iterable[_Pair], name: str) -> np.ndarray:
    """Return the other method's estimates over ours, less one, %, where both stand."""
    found = []
    for pair in pairs:
        a, b = pair.mine.parameter(name), pair.other.parameter(name)
        if a is None or b is None or not (a.stands and b.stands) or not a.value:
            continue
        found.append(100.0 * ((b.value or 0.0) / a.value - 1.0))
    return np.array(found)


def _row(name: str, pairs: Sequence[_Pair]) -> _Row:
    cells = []
    for k, parameter in enumerate(_PARAMETERS):
        alone = [p.lag_alone[k] for p in pairs if p.lag_alone]
        found = _differences(pairs, parameter)
        cells.append({"whole": _percent(found), "lag": _percent(alone)})
    bound = [
        symbol
        for symbol, parameter in zip(_SYMBOLS, _PARAMETERS, strict=True)
        for p in pairs
        if (e := p.other.parameter(parameter)) is not None and e.status == "at_bound"
    ]
    return {
        "name": name,
        "cells": cells,
        "apart": _degrees([p.apart_deg for p in pairs]),
        "motion": _degrees([np.degrees(p.mine.displacement_rad or np.nan) for p in pairs]),
        "verdict": _verdict(pairs),
        "bound": ", ".join(f"{bound.count(s)} {s}" for s in dict.fromkeys(bound)) or DASH,
        "n": len(pairs),
    }


def _verdict(pairs: Sequence[_Pair]) -> str:
    """Say what sets the stiffnesses apart: the lag, the rest, or both against each other."""
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
        return "lag and baseline, against each other"
    return "lag and baseline"


def _percent(values: Sequence[float] | np.ndarray) -> str:
    finite = np.asarray(values, dtype=float)
    finite = finite[np.isfinite(finite)]
    if not finite.size:
        return DASH
    rounded = round(float(np.median(finite)))
    return f"{rounded:+d} %".replace("-", MINUS) if rounded else "0 %"


def _degrees(values: Sequence[float]) -> str:
    finite = np.asarray(values, dtype=float)
    finite = finite[np.isfinite(finite)]
    return f"{float(np.median(finite)):.1f}" if finite.size else DASH


def _lead(pairs: Sequence[_Pair]) -> str:
    sizes = []
    for symbol, name in zip(_SYMBOLS, _PARAMETERS, strict=True):
        found = _differences(pairs, name)
        if found.size:
            sizes.append(f"{np.sqrt(np.mean(found**2)):.0f} % in {symbol}")
    text = (
        "Both had the same recordings; each leaves out the pulses that it cannot use. From the "
        f"recommended estimates the {OTHER}'s method differs"
    )
    return f"{text} by {_listed(sizes)} (root mean square)." if sizes else f"{text}."


def _reasons(analysis: StudyAnalysis, pairs: Sequence[_Pair]) -> list[tuple[str, str]]:
    return [
        ("VAF is not accuracy.", _vaf_reason(pairs)),
        ("Lag.", _lag_reason(analysis, pairs)),
        ("Baseline.", _baseline_reason(analysis, pairs)),
        ("Bounds.", _bounds_reason(pairs)),
        ("Inertia.", _inertia_reason(pairs)),
        ("Intervals.", _interval_reason(pairs)),
    ]


def _vaf_reason(pairs: Sequence[_Pair]) -> str:
    mine, other = (
        [v for c in cells if (v := c.vaf_pct) is not None]
        for cells in ([p.mine for p in pairs], [p.other for p in pairs])
    )
    if not mine or not other:
        return "How well a curve is followed does not say how right its parameters are."
    return (
        f"Both follow the responses closely (mean VAF of the {OTHER}'s torque "
        f"{format_vaf(float(np.mean(other)))} %, of the recommended angle "
        f"{format_vaf(float(np.mean(mine)))} %), so VAF cannot say which of them is right. Wrong "
        "stiffness, damping and inertia make up for a wrong lag or baseline."
    )


def _lag_reason(analysis: StudyAnalysis, pairs: Sequence[_Pair]) -> str:
    labels = {p.mine.label for p in pairs}
    found = [m.lag_s for m in analysis.models if m.label in labels]
    told = f"The angle was found to be {_range_ms(found)} behind the torque."
    left = [p.lag_s for p in pairs]
    if max(map(abs, left)) < _SAME_LAG_S:
        return (
            f"{told} That is what [calibration] says, and both methods take it out; the lag does "
            "not set them apart here."
        )
    calibrated = any(abs(_calibrated_lag_s(analysis, p.mine)) > 0.0 for p in pairs)
    taken = (
        "takes out the lag under [calibration] and leaves the rest"
        if calibrated
        else "takes them for simultaneous, as no lag stands under [calibration]"
    )
    return (
        f"{told} The {OTHER}'s method {taken}; a late angle passes for more or less of all three. "
        "The recommended method finds the lag from the responses and carries what is left open "
        "into the intervals. The columns “lag alone” say what this lag would do to the "
        f"{OTHER}'s fit of the same joint if nothing else were wrong."
    )


def _range_ms(values: Sequence[float]) -> str:
    low, high = 1e3 * min(values), 1e3 * max(values)
    same = high - low < 0.1
    return f"{low:.1f} ms" if same else f"{low:.1f} to {high:.1f} ms"


def _baseline_reason(analysis: StudyAnalysis, pairs: Sequence[_Pair]) -> str:
    apart = [p.apart_deg for p in pairs if np.isfinite(p.apart_deg)]
    strides = [m.n_strides for m in analysis.models]
    learned = f" ({min(strides)} strides at least)" if strides else ""
    told = (
        f"The {OTHER}'s method subtracts the mean unperturbed stride of another recording, with "
        "its own posture and pace; what differs passes for response. The recommended method "
        "predicts each pulse's unperturbed motion from the half second before it, learned from "
        f"unperturbed strides of the same recording{learned}."
    )
    if not apart:
        return told
    return (
        f"{told} The two average angles, the low-passed one beside the one as sampled, lie up to "
        f"{max(apart):.1f}° apart (median {np.median(apart):.1f}°)."
    )


def _bounds_reason(pairs: Sequence[_Pair]) -> str:
    estimates = [p.other.parameter(name) for p in pairs for name in _PARAMETERS]
    at_zero = sum(e is not None and e.status == "at_bound" for e in estimates)
    stand = f"{format_count(at_zero, 'estimate')} {'stands' if at_zero == 1 else 'stand'} there"
    made_up = f"{stand}, and the other two must make up for it" if at_zero else "none stands there"
    return (
        f"The {OTHER}'s method allows no value below zero ({made_up}). The recommended method fits "
        "without bounds, states the unbounded value, and gives an upper limit where zero cannot "
        "be excluded. Gravity and body weight can make an apparent stiffness negative."
    )


def _inertia_reason(pairs: Sequence[_Pair]) -> str:
    mine, other = (_inertia_spread(pairs, get) for get in (lambda p: p.mine, lambda p: p.other))
    told = (
        f"The {OTHER}'s method fits an inertia at each timing point by itself. The recommended "
        "method lets a participant's timing points share one as far as the responses allow, and "
        "tests that."
    )
    if mine is None or other is None:
        return told
    return (
        f"{told} Largest over smallest inertia of a participant: {other} by the {OTHER}'s method, "
        f"{mine} by the recommended one (median)."
    )


def _inertia_spread(pairs: Sequence[_Pair], get: Callable[[_Pair], CellEstimate]) -> str | None:
    held: dict[str, list[float]] = {}
    for cell in map(get, pairs):
        estimate = cell.parameter("inertia")
        if estimate is not None and estimate.stands and estimate.value:
            held.setdefault(cell.label, []).append(estimate.value)
    ratios = [max(v) / min(v) for v in held.values() if len(v) > 1]
    return format_number(float(np.median(ratios))) if ratios else None


def _interval_reason(pairs: Sequence[_Pair]) -> str:
    mine, other = [p.mine for p in pairs], [p.other for p in pairs]
    widths = [
        f"{symbol} {_half_width(mine, name)} and {_half_width(other, name)}"
        for symbol, name in zip(_SYMBOLS, _PARAMETERS, strict=True)
    ]
    return (
        f"Those of the {OTHER}'s method know only how pulses differ from one another; a lag or a "
        "baseline that all pulses share never shows in them. Those of the recommended method hold "
        "what the lag, the prediction, the calibration and the model leave open. Median half "
        f"width, recommended and {OTHER}: {_listed(widths)}."
    )


def _half_width(cells: Iterable[CellEstimate], name: str) -> str:
    found = []
    for cell in cells:
        p = cell.parameter(name)
        if p is not None and p.status == "ok" and p.value:
            found.append(50.0 * ((p.ci_high or 0.0) - (p.ci_low or 0.0)) / p.value)
    return f"{float(np.median(found)):.0f} %" if found else DASH


def _unbroken(text: str) -> str:
    """Keep numbers and % together at the end of a line."""
    return text.replace(" %", "\N{NO-BREAK SPACE}%")


def _listed(texts: Sequence[str]) -> str:
    return " and ".join([", ".join(texts[:-1]), texts[-1]] if len(texts) > 1 else texts)
