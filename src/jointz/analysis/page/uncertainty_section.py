"""Section of the report on uncertainty: undecided estimates, and what would help."""

import re
from collections.abc import Mapping, Sequence
from typing import Any, Final

import numpy as np

from jointz.analysis.summary import used_coupling
from jointz.core.channels import pretty_unit
from jointz.core.codes import Doubt
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
from jointz.results.log_posterior import LogPosterior
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
#: Doubt that names no parameter -> what to do about it.
_REMEDIES: Final[Mapping[str, str]] = {
    Doubt.HELD_TORQUE: "use doublets of two shapes and sizes, or short pulses of several sizes",
    Doubt.SENSORS_CONTRADICT: "check the sensor that the note names",
    Doubt.STEEP_CHANGE: "move this timing point away from the change, or report its neighbours",
    Doubt.RESPONSES_UNLIKE_SIZE: "check the torque that the motor gave; leave out larger pulses",
    Doubt.RESPONSES_MISFIT: "look at the responses of this timing point: jointz explore",
}
#: A measurement is named if it makes the interval narrower by this share.
_WORTH_NAMING: Final = 0.1
_MOST_NAMED: Final = 3
_NOTHING_ALONE: Final = "no single measurement would be enough"
_CHECK: Final = "check what the reason names"
_HARDLY: Final = "no single measurement helps by more than a tenth; the best"
#: Why K and B are undecided after such pulses, however many there are.
HELD: Final = "K and B are not identifiable from pulses that hold one torque"
#: Doubts with which values or their limits are available.
_AGAINST_NONE: Final = frozenset({Doubt.HELD_TORQUE.value, Doubt.SENSORS_CONTRADICT.value})
_NO_INTERVAL: Final = "the interval is too wide for any limit"
#: Numbers of a reason or remedy, which differ between estimates of one kind.
_NUMBERS: Final = re.compile(r": ±\s[>\s\d]+%")
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
    kinds: dict[tuple[str, ...], list[Mapping[str, str]]] = {}
    for row in rows:
        kinds.setdefault((row["parameter"], _main(row["why"]), _main(row["remedy"])), []).append(
            row
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


def _main(text: str) -> str:
    """Return the first reason or remedy of a text without its numbers."""
    return _NUMBERS.sub("", text.partition("; ")[0])


def _where(rows: Sequence[Mapping[str, str]]) -> str:
    points: dict[str, list[str]] = {}
    for row in rows:
        points.setdefault(row["participant"], []).append(row["name"])
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
    posteriors = {posterior.label: posterior for posterior in analysis.log_posteriors}
    return [
        _row(cell, estimate, sds, posteriors.get(cell.label), parts_by_source(cell, name, coupling))
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
    cell: CellEstimate,
    estimate: ParameterEstimate,
    sds: Mapping[_Key, float],
    posterior: LogPosterior | None,
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
    if posterior and is_withheld(estimate, posterior):
        return {**row, "why": _contradictions(posterior), "remedy": remedies(posterior)}
    if posterior and Doubt.HELD_TORQUE.value in posterior.doubts and estimate.name != "inertia":
        return {**row, "why": HELD, "remedy": _REMEDIES[Doubt.HELD_TORQUE]}
    others = [x for (who, name, _), x in sds.items() if (who, name) == (cell.label, estimate.name)]
    why = _too_wide(estimate, sd, others)
    return {**row, "why": why, "remedy": _remedy(estimate, sd, parts)}


def is_withheld(estimate: ParameterEstimate, posterior: LogPosterior) -> bool:
    """Return whether a doubt about the person's model withholds an estimate and its limits."""
    undecided = estimate.status == "undecided" and estimate.ci_low is None
    return undecided and not _AGAINST_NONE.issuperset(posterior.doubts)


def main_contradiction(posterior: LogPosterior) -> tuple[str, str]:
    """Return the parameter that is farthest off, or else the first doubt, and what to check."""
    if posterior.unlikely:
        # Errors of any sensor may look like a reflex, too.
        farthest = max(
            posterior.unlikely, key=lambda found: (not found.name.startswith("reflex"), found.sds)
        )
        return str(farthest), farthest.remedy
    doubt = next(Doubt(code) for code in posterior.doubts if code not in _AGAINST_NONE)
    meaning = doubt.meaning.partition(";")[0].partition(":")[0]
    return meaning, _REMEDIES.get(doubt, _CHECK)


def _contradictions(posterior: LogPosterior) -> str:
    """Say what speaks against a person's model, and which parameters do."""
    meanings = [Doubt(code).meaning for code in posterior.doubts]
    return "; ".join([*meanings, *map(str, posterior.unlikely)])


def remedies(posterior: LogPosterior) -> str:
    """Say what to check about the parameters and responses that contradict the model."""
    of_doubts = [_REMEDIES[doubt] for doubt in posterior.doubts if doubt in _REMEDIES]
    named = dict.fromkeys([*(found.remedy for found in posterior.unlikely), *of_doubts])
    return "; ".join(named) or _CHECK


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
