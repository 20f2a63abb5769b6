"""Section of the report on uncertainty: undecided estimates, and what would help."""

import re
from collections.abc import Mapping, Sequence
from typing import Any, Final

import numpy as np

from jointz.analysis.page.withheld_values import (
    DOUBLETS,
    HELD,
    is_held,
    withheld,
)
from jointz.analysis.summary import used_coupling
from jointz.core.channels import pretty_unit
from jointz.core.grouping import by_key
from jointz.core.method_names import WITH_POSTERIOR
from jointz.identify.walking.coupling import Coupling
from jointz.identify.walking.decisions import with_model_error
from jointz.report.wording import ABSOLUTE, format_number, format_span, parameter_name
from jointz.results.estimates import (
    CellEstimate,
    ParameterEstimate,
    decides,
    relative_half_width,
)
from jointz.results.study_analysis import StudyAnalysis

#: Source of :mod:`jointz.identify.walking.information` -> what to do about it.
MEASURES: Final[Mapping[str, str]] = {
    "pulses": "record twice as many pulses",
    "strap": "measure resonance and damping of strap and tissue, and the inertia of the device",
    "mount": "measure resonance and damping of the goniometer on its mount",
    "lag": "measure the lag of the angle behind the torque (angle_lag_s under [calibration])",
    "softening": "apply pulses of several sizes, which show how stiffness falls with displacement",
    "reflex": "apply pulses of both directions, which show the strength of the reflex",
    "friction": "measure the torque, or the friction of the actuator on the bench",
    "gain": "calibrate the gain of the torque",
    "inertia": "measure the inertia of leg and device by other means",
}
#: A measurement is named if it makes the interval narrower by this share.
_WORTH_NAMING: Final = 0.1
_MOST_NAMED: Final = 3
_NOTHING_ALONE: Final = "no single measurement would be enough"
_HARDLY: Final = "no single measurement helps by more than a tenth; the best"
_NO_INTERVAL: Final = "the interval is too wide for any limit"
#: Numbers of a reason or remedy, which differ between estimates of one kind.
_NUMBERS: Final = re.compile(r": ±\s[>\s\d]+%")
#: Between two reasons or remedies, not inside brackets.
_BETWEEN: Final = re.compile(r"; (?![^(]*\))")
_Row = dict[str, Any]
_Key = tuple[str, str, str]  # participant, parameter, timing point


def uncertainty_section(analysis: StudyAnalysis) -> _Row | None:
    """Return what the page shows of the uncertainty, None if the method says nothing of it."""
    cells = [c for c in analysis.cells if c.method in WITH_POSTERIOR and c.through_instruments]
    if not cells:
        return None
    return {"undecided": _undecided(analysis), **_details(cells)}


def grouped(rows: Sequence[Mapping[str, str]]) -> list[_Row]:
    """Join rows of one parameter, main reason and main remedy, and say where they occur."""
    kinds = by_key(
        ((row["parameter"], main_part(row["why"]), main_part(row["remedy"])), row) for row in rows
    )
    return [
        {
            "where": _where(own),
            "parameter": parameter,
            "value": f"{own[0]['value']} {own[0]['unit']}"
            if len(own) == 1
            else f"{len(own)} values",
            "why": own[0]["why"] if len(own) == 1 else why,
            "remedy": own[0]["remedy"] if len(own) == 1 else remedy,
        }
        for (parameter, why, remedy), own in kinds.items()
    ]


def main_part(text: str) -> str:
    """Return the first reason or remedy of a text without its numbers."""
    return _NUMBERS.sub("", _BETWEEN.split(text)[0])


def _where(rows: Sequence[Mapping[str, str]]) -> str:
    points = by_key((row["participant"], row["name"]) for row in rows)
    return "; ".join(f"{who} {', '.join(own)}" for who, own in points.items())


def _details(cells: Sequence[CellEstimate]) -> _Row:
    """Return ranges over the cells: centre of the window after the onset, and motion."""
    motions = [np.degrees(d) for c in cells if (d := c.displacement_rad) is not None]
    apart = [
        c.centre_gait_pct - c.onset_gait_pct
        for c in cells
        if c.centre_gait_pct is not None and c.onset_gait_pct is not None
    ]
    return {
        "centre": format_span(apart, "{:.1f}".format) if apart else "",
        "motion": format_span(motions, "{:.1f}".format) if motions else "",
        "gravity": any(c.gravity_corrected is not None for c in cells),
    }


def _undecided(analysis: StudyAnalysis) -> list[_Row]:
    """Return a row for each undecided K, B and J."""
    sds, coupling = relative_sds(analysis), used_coupling(analysis)
    return [
        _row(analysis, cell, estimate, sds, parts_by_source(cell, name, coupling))
        for cell in analysis.cells
        for name in ABSOLUTE
        if (estimate := cell.parameter(name)) is not None and estimate.status == "undecided"
    ]


def relative_sds(analysis: StudyAnalysis) -> dict[_Key, float]:
    """Return relative sds by participant, parameter and timing point; endless at zero."""
    error, sds = used_coupling(analysis).error, {}
    for posterior in analysis.log_posteriors:
        places = zip(posterior.parameters, posterior.timing_points, strict=True)
        for (name, point), sd, share in zip(places, posterior.sd, posterior.shares, strict=True):
            own = with_model_error(name, float(sd), error) / share if share > 0.0 else np.inf
            sds[posterior.label, name, point] = float(np.hypot(own, posterior.gain_sd))
    return sds


def parts_by_source(cell: CellEstimate, name: str, coupling: Coupling) -> dict[str, float]:
    """Return the part of an error that each source causes; a rigid coupling has no strap."""
    strap = "strap" if coupling.is_strap else "mount"
    parts = cell.through_instruments.get(name, {})
    return {strap if source == "strap" else source: part for source, part in parts.items()}


def _row(
    analysis: StudyAnalysis,
    cell: CellEstimate,
    estimate: ParameterEstimate,
    sds: Mapping[_Key, float],
    parts: Mapping[str, float],
) -> _Row:
    sd = sds.get((cell.label, estimate.name, cell.timing_point))
    row = {
        "participant": cell.label,
        "name": cell.timing_point,
        "parameter": parameter_name(estimate.name),
        "value": format_number(estimate.unbounded),
        "unit": pretty_unit(estimate.unit),
    }
    if sd is not None:
        row["unit"] += f", ±\N{NO-BREAK SPACE}{_pct(relative_half_width(sd))}"
    if found := withheld(analysis, cell, estimate):
        return {**row, "why": found.contradictions, "remedy": found.remedies}
    if is_held(analysis, cell, estimate):
        return {**row, "why": HELD, "remedy": DOUBLETS}
    others = [x for (who, name, _), x in sds.items() if (who, name) == (cell.label, estimate.name)]
    why = _too_wide(estimate, sd, others)
    return {**row, "why": why, "remedy": _remedy(estimate, sd, parts)}


def _too_wide(estimate: ParameterEstimate, sd: float | None, others: Sequence[float]) -> str:
    if estimate.ci_low is None:
        return _NO_INTERVAL
    if sd is None or not decides(1.0, relative_half_width(sd)):
        return "half of the interval exceeds 50 % of the value"
    usual = relative_half_width(float(np.median(others)))
    return (
        "half of the interval is within 50 %, but the median over the participant's timing points "
        f"is ±\N{NO-BREAK SPACE}{_pct(usual)}: one narrow interval among wide ones may be "
        "so by chance"
    )


def _remedy(estimate: ParameterEstimate, sd: float | None, parts: Mapping[str, float]) -> str:
    """Name the measurements that would make the interval narrower, the best one first."""
    if sd is None or not np.isfinite(sd) or not estimate.unbounded:
        return _NOTHING_ALONE
    now, left = half_widths_without(sd, estimate.unbounded, parts)
    ordered = sorted(left, key=left.__getitem__)
    named = [f"{MEASURES[n]}: ±\N{NO-BREAK SPACE}{_pct(left[n])}" for n in ordered[:_MOST_NAMED]]
    worth = sum(x <= (1.0 - _WORTH_NAMING) * now for x in left.values())
    if worth or not named:
        return "; ".join(named[:worth]) or _NOTHING_ALONE
    return f"{_HARDLY}: {named[0]}"


def half_widths_without(
    sd: float, value: float, parts: Mapping[str, float]
) -> tuple[float, dict[str, float]]:
    """Return the half-width over the value now, and by source if that source were known."""
    left = {n: np.sqrt(max(sd**2 - (part / value) ** 2, 0.0)) for n, part in parts.items()}
    return relative_half_width(sd), {n: relative_half_width(own) for n, own in left.items()}


def _pct(share: float) -> str:
    return (
        f"{100.0 * share:.0f}\N{NO-BREAK SPACE}%"
        if share < 10.0
        else ">\N{NO-BREAK SPACE}1000\N{NO-BREAK SPACE}%"
    )
