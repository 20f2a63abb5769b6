"""What stands behind the recommended estimates: undecided ones, models of people, details."""

from collections.abc import Mapping
from typing import Any, Final

import numpy as np

from jointz.analysis.page.budget_figure import source_name
from jointz.analysis.page.details_tables import variance_shares
from jointz.core.codes import Doubt
from jointz.identify.recommended.steep_change import MOVED
from jointz.report.wording import (
    DASH,
    format_estimate,
    format_number,
    parameter_name,
    pretty_unit,
)
from jointz.results.estimates import REACH_95, CellEstimate, ParameterEstimate, decides
from jointz.results.participant_model import ParticipantModel
from jointz.results.study_analysis import StudyAnalysis

#: Source of uncertainty -> what would make it smaller.
_REMEDIES: Final[Mapping[str, str]] = {
    "noise": "more or larger pulses here, and more unperturbed strides between pulses",
    "lag": "a measured lag between angle and torque, given as angle_lag_s under [calibration]",
    "friction": "a measured torque, or a friction model measured on the bench",
    "cross_talk": "a test of what torque does to the angle sensor while the joint is held",
    "inertia_model": "pulses at more timing points, or an inertia measured by other means",
    "drift": "pulses shortly before and after this point, which show how K and B change",
    "reflex": "pulses of both directions and several sizes, which tell a reflex from stiffness",
    "prior": "larger or more pulses: these say little beyond what was assumed before",
    "model": "whatever tells the models apart, most often a measured lag",
    "gain": "better calibrated gains of angle and torque",
    "intrinsic": "a better measured impedance of the device",
}
#: What a source's share holds besides, where a measured lag would help.
_THROUGH_LAG: Final[Mapping[str, str]] = {"noise": ", also through the lag that they leave open"}
#: Why and remedy where the estimator withheld what an error of this size would have decided.
_WITHHELD: Final = (
    "stiffness seems to change steeply inside the window, beside which this error is small",
    _REMEDIES["drift"],
)
_PARAMETERS: Final = ("stiffness", "damping", "inertia")
#: A second reason is named where it makes up so much of the variance.
_WORTH_NAMING: Final = 0.2
_LIKELY, _UNLIKELY = 0.9, 0.1

_Row = dict[str, Any]


def behind_section(analysis: StudyAnalysis) -> _Row | None:
    """Return what the page shows behind the estimates, None where no budget was made."""
    cells = [c for c in analysis.cells if c.budget]
    if not cells:
        return None
    firsts: set[str] = set()
    rows = []
    for cell in cells:
        rows.append(_details_row(cell) | {"first": cell.label not in firsts})
        firsts.add(cell.label)
    steep = {m.label for m in analysis.models if Doubt.STEEP_CHANGE.value in m.doubts}
    return {
        "undecided": [
            row for cell in cells for row in _undecided_rows(cell, steep=cell.label in steep)
        ],
        "models": [_model_row(model) for model in analysis.models],
        "details": rows,
        "gravity": any(c.gravity_corrected is not None for c in cells),
    }


def _undecided_rows(cell: CellEstimate, *, steep: bool) -> list[_Row]:
    estimates = (cell.parameter(name) for name in _PARAMETERS)
    return [
        _undecided_row(cell, p, steep=steep and p.name in MOVED)
        for p in estimates
        if p and p.status == "undecided"
    ]


def _undecided_row(cell: CellEstimate, estimate: ParameterEstimate, *, steep: bool) -> _Row:
    sd = float(np.linalg.norm(list(cell.budget.get(estimate.name, {}).values())))
    found = estimate.unbounded or 0.0
    like = max(abs(found), sd)
    # What would have been decided was withheld: no measurement of the instruments helps it.
    withheld = steep and decides(found, REACH_95 * sd)
    why, remedy = _WITHHELD if withheld else _reason(cell, estimate, sd, like=like)
    return {
        "participant": cell.label,
        "name": cell.timing_point,
        "parameter": parameter_name(estimate.name),
        "found": f"{format_number(estimate.unbounded, like=like)} ± {format_number(sd, like=like)}",
        "unit": pretty_unit(estimate.unit),
        "why": why,
        "remedy": remedy,
    }


def _reason(
    cell: CellEstimate, estimate: ParameterEstimate, sd: float, *, like: float
) -> tuple[str, str]:
    """Return where an error comes from, and what would make it smaller."""
    shares = variance_shares(cell, estimate.name)
    ordered = sorted(shares, key=lambda name: -shares[name])
    named = [n for k, n in enumerate(ordered) if k == 0 or shares[n] >= _WORTH_NAMING][:2]
    left = _left_by_measuring(cell, estimate, sd)
    remedies = [
        f"{_REMEDIES[n]}, which would leave ± {format_number(x, like=like)}"
        for n, x in left.items()
    ]
    # A lag that is known tells most models apart as well.
    said = {*left, "model"} if "lag" in left else left
    others = [_REMEDIES[n] for n in named if n in _REMEDIES and n not in said]
    through = _THROUGH_LAG if "lag" in left else {}
    why = "; ".join(
        f"{source_name(n)}{through.get(n, '')} ({100 * shares[n]:.0f} %)" for n in named
    )
    return why, "; then ".join(["; ".join(r) for r in (remedies, others) if r])


def _left_by_measuring(
    cell: CellEstimate, estimate: ParameterEstimate, sd: float
) -> dict[str, float]:
    """Return what is worth measuring, what helps most first, and the sd that it would leave.

    Noise is also what leaves a lag open, so the budget does not say that a measured lag would
    help more than pulses.
    """
    parts = cell.through_instruments.get(estimate.name, {})
    worth = [n for n, part in parts.items() if part > 0.0 and part**2 >= _WORTH_NAMING * sd**2]
    worth.sort(key=lambda name: -parts[name])
    return {name: float(np.sqrt(max(sd**2 - parts[name] ** 2, 0.0))) for name in worth}


def _model_row(model: ParticipantModel) -> _Row:
    lag = f"{1e3 * model.lag_s:.1f} ± {1e3 * model.lag_sd_s:.1f}"
    return {
        "participant": model.label,
        "lag": lag,
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


def _details_row(cell: CellEstimate) -> _Row:
    stiffness, corrected = cell.parameter("stiffness"), cell.gravity_corrected
    shift = cell.displacement_rad
    return {
        "participant": cell.label,
        "name": cell.timing_point,
        "onset": _one_decimal(cell.onset_gait_pct),
        "centre": _one_decimal(cell.centre_gait_pct),
        "motion": DASH if shift is None else f"{np.degrees(shift):.1f}",
        "apparent": DASH if stiffness is None else _shown(stiffness),
        "corrected": DASH if corrected is None else format_estimate(corrected),
        "unbounded": [_unbounded(cell, name) for name in _PARAMETERS],
    }


def _shown(estimate: ParameterEstimate) -> str:
    return "undecided" if estimate.status == "undecided" else format_estimate(estimate)


def _unbounded(cell: CellEstimate, name: str) -> str:
    estimate = cell.parameter(name)
    return DASH if estimate is None else format_number(estimate.unbounded)


def _one_decimal(value: float | None) -> str:
    return DASH if value is None else f"{value:.1f}"
