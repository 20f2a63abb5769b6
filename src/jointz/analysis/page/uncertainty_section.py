"""Section of the report on uncertainty: undecided estimates, models of people, details."""

import re
from collections.abc import Mapping, Sequence
from typing import Any, Final

import numpy as np

from jointz.analysis.page.budget_figure import source_name
from jointz.analysis.page.details_tables import variance_shares
from jointz.analysis.page.strapped_uncertainty import NOTE, strapped_undecided
from jointz.core.codes import Doubt
from jointz.core.method_names import STRAPPED
from jointz.identify.rigid.steep_change import MOVED
from jointz.report.wording import (
    ABSOLUTE,
    format_number,
    format_span,
    parameter_name,
    pretty_unit,
)
from jointz.results.estimates import REACH_95, CellEstimate, ParameterEstimate, decides
from jointz.results.participant_model import ParticipantModel
from jointz.results.study_analysis import StudyAnalysis

#: Source of uncertainty -> what would reduce it.
_REMEDIES: Final[Mapping[str, str]] = {
    "noise": "more or larger pulses here, and more unperturbed strides between pulses",
    "lag": "a measured lag between angle and torque, given as angle_lag_s under [calibration]",
    "friction": "a measured torque, or a friction model measured on the bench",
    "cross_talk": "a test of how torque changes the reading of the angle while the joint is fixed",
    "inertia_model": "pulses at more timing points, or an inertia measured by other means",
    "drift": "pulses shortly before and after this point, which show how K and B change",
    "reflex": "pulses of both directions and several sizes, which separate reflexes from stiffness",
    "prior": "larger or more pulses: these add little to the prior assumptions",
    "model": "a measurement that decides between the models, most often of the lag",
    "gain": "better calibrated gains of angle and torque",
    "intrinsic": "a better measured impedance of the device",
}
#: What a source's share includes besides, if a measured lag would help.
_THROUGH_LAG: Final[Mapping[str, str]] = {"noise": ", and the uncertainty of the lag it causes"}
#: Reason and remedy if the estimator withheld a value whose error was small enough.
_WITHHELD: Final = (
    "stiffness seems to change steeply inside the window; the error itself is small",
    _REMEDIES["drift"],
)
#: A further source is named if it has at least this share of the variance.
_WORTH_NAMING: Final = 0.2
_LIKELY, _UNLIKELY = 0.9, 0.1

_NOTE: Final = (
    "Value: the unbounded value and its standard deviation, which is too large for an estimate "
    "unless stated otherwise. Why: the largest sources of its variance. What would decide it: "
    "first measurements of the instruments, each with the standard deviation that would remain if "
    "the quantity were known exactly."
)

#: Numbers of a reason or remedy, which differ between estimates of one kind.
_NUMBERS: Final = re.compile(r" \(\d+ %\)|, which would leave ± [^;]*|: ±\s[>\s\d]+%")
_Row = dict[str, Any]


def uncertainty_section(analysis: StudyAnalysis) -> _Row | None:
    """Return what the page shows of the uncertainty, None if the method says nothing of it."""
    strapped = [c for c in analysis.cells if c.method == STRAPPED and c.through_instruments]
    if strapped:
        rows = strapped_undecided(analysis)
        return {"note": NOTE, "undecided": rows, "models": [], **_details(strapped)}
    cells = [c for c in analysis.cells if c.budget]
    if not cells:
        return None
    steep = {m.label for m in analysis.models if Doubt.STEEP_CHANGE.value in m.doubts}
    return {
        "note": _NOTE,
        "undecided": [
            _undecided_row(cell, p, steep=cell.label in steep and name in MOVED)
            for cell in cells
            for name in ABSOLUTE
            if (p := cell.parameter(name)) is not None and p.status == "undecided"
        ],
        "models": [_model_row(model) for model in analysis.models],
        **_details(cells),
    }


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
            "value": _value(own),
            "why": own[0]["why"] if len(own) == 1 else why,
            "remedy": own[0]["remedy"] if len(own) == 1 else remedy,
        }
        for (parameter, why, remedy), own in kinds.items()
    ]


def _value(rows: Sequence[Mapping[str, str]]) -> str:
    return f"{rows[0]['value']} {rows[0]['unit']}" if len(rows) == 1 else f"{len(rows)} values"


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


def _undecided_row(cell: CellEstimate, estimate: ParameterEstimate, *, steep: bool) -> _Row:
    sd = float(np.linalg.norm(list(cell.budget.get(estimate.name, {}).values())))
    value = estimate.unbounded or 0.0
    like = max(abs(value), sd)
    # A value that was withheld though it was precise enough: no measurement of instruments helps.
    withheld = steep and decides(value, REACH_95 * sd)
    why, remedy = _WITHHELD if withheld else _reason(cell, estimate, sd, like=like)
    return {
        "participant": cell.label,
        "name": cell.timing_point,
        "parameter": parameter_name(estimate.name),
        "value": f"{format_number(estimate.unbounded, like=like)} ± {format_number(sd, like=like)}",
        "unit": pretty_unit(estimate.unit),
        "why": why,
        "remedy": remedy,
    }


def _reason(
    cell: CellEstimate, estimate: ParameterEstimate, sd: float, *, like: float
) -> tuple[str, str]:
    """Return the sources of an error, and what would reduce it."""
    shares = variance_shares(cell, estimate.name)
    ordered = sorted(shares, key=lambda name: -shares[name])
    named = [n for k, n in enumerate(ordered) if k == 0 or shares[n] >= _WORTH_NAMING][:2]
    remaining = _remaining_sd(cell, estimate, sd)
    measurements = [
        f"{_REMEDIES[n]}, which would leave ± {format_number(x, like=like)}"
        for n, x in remaining.items()
    ]
    # A known lag decides between most models as well.
    covered = {*remaining, "model"} if "lag" in remaining else remaining
    others = [_REMEDIES[n] for n in named if n in _REMEDIES and n not in covered]
    through = _THROUGH_LAG if "lag" in remaining else {}
    why = "; ".join(
        f"{source_name(n)}{through.get(n, '')} ({100 * shares[n]:.0f} %)" for n in named
    )
    return why, "; then ".join(["; ".join(r) for r in (measurements, others) if r])


def _remaining_sd(cell: CellEstimate, estimate: ParameterEstimate, sd: float) -> dict[str, float]:
    """Return the sd that each worthwhile measurement would leave, the most useful one first.

    Noise also causes the uncertainty of the lag, so the budget alone does not show that a measured
    lag would help more than pulses.
    """
    parts = cell.through_instruments.get(estimate.name, {})
    worth = [n for n, part in parts.items() if part > 0.0 and part**2 >= _WORTH_NAMING * sd**2]
    worth.sort(key=lambda name: -parts[name])
    return {name: float(np.sqrt(max(sd**2 - parts[name] ** 2, 0.0))) for name in worth}


def _model_row(model: ParticipantModel) -> _Row:
    return {
        "participant": model.label,
        "lag": f"{1e3 * model.lag_s:.1f} ± {1e3 * model.lag_sd_s:.1f}",
        "resonance": likely(model.resonance_probability),
        "inertia": likely(model.constant_inertia_probability),
        "curve": likely(model.curve_probability),
        "friction": f"{model.friction_gain:.2f} ± {model.friction_gain_sd:.2f}",
        "strides": model.n_strides,
    }


def likely(probability: float) -> str:
    """Write a probability in a word and in %."""
    word = (
        "likely" if probability >= _LIKELY else "unlikely" if probability <= _UNLIKELY else "open"
    )
    pct = 100.0 * probability
    number = "< 1" if pct < 1.0 else "> 99" if pct > 99.0 else f"{pct:.0f}"
    return f"{word} ({number} %)"
