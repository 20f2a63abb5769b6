"""Why estimates of the method ``strapped`` are undecided, and what would decide them."""

from collections.abc import Iterator, Mapping, Sequence
from typing import Any, Final

import numpy as np

from jointz.core.codes import Doubt
from jointz.identify.strapped.decisions import with_model_error
from jointz.report.wording import ABSOLUTE, format_number, parameter_name, pretty_unit
from jointz.results.estimates import (
    CellEstimate,
    ParameterEstimate,
    decides,
    relative_half_width,
)
from jointz.results.log_posterior import LogPosterior
from jointz.results.study_analysis import StudyAnalysis

NOTE: Final = (
    "Value: the median of the posterior, and half of its 95 % interval in % of it; it is no "
    "estimate. What would decide it: measurements, each with the half-interval that would remain "
    "if the quantity were known exactly and nothing else changed; they come from the posterior, "
    "and do not add up. Half-intervals of more than 50 % are undecided."
)
#: Source of :mod:`jointz.identify.strapped.information` -> measurement in words.
_MEASUREMENTS: Final[Mapping[str, str]] = {
    "pulses": "twice as many pulses",
    "strap": "resonance and damping of strap and tissue, and the inertia of the device",
    "lag": "lag of the angle (angle_lag_s under [calibration])",
    "softening": "how stiffness falls with displacement, from pulses of several sizes",
    "reflex": "strength and latency of the reflex, from pulses of both directions",
    "friction": "friction that the torque does not include",
    "gain": "gain of the torque",
    "inertia": "inertia of leg and device, measured by other means",
}
#: A measurement is named if it makes the interval narrower by this share.
_WORTH_NAMING: Final = 0.1
_MOST_NAMED: Final = 3
_NOTHING_ALONE: Final = "no single measurement"
_NO_INTERVAL: Final = "the posterior has no interval that means anything"

_Row = dict[str, Any]


def strapped_undecided(analysis: StudyAnalysis) -> list[_Row]:
    """Return a row for each undecided K, B and J."""
    sds = {key: sd for posterior in analysis.log_posteriors for key, sd in log_sds(posterior)}
    doubts = {posterior.label: _doubts(posterior) for posterior in analysis.log_posteriors}
    return [
        _row(cell, estimate, sds, doubts.get(cell.label, ""))
        for cell in analysis.cells
        for name in ABSOLUTE
        if (estimate := cell.parameter(name)) is not None and estimate.status == "undecided"
    ]


_Key = tuple[str, str, str]


def log_sds(posterior: LogPosterior) -> Iterator[tuple[_Key, float]]:
    """Yield participant, parameter and timing point with the relative sd; endless at zero."""
    places = zip(posterior.parameters, posterior.timing_points, strict=True)
    for (name, point), sd, share in zip(places, posterior.sd, posterior.shares, strict=True):
        own = with_model_error(name, float(sd)) / share if share > 0.0 else np.inf
        whole = np.hypot(own, posterior.gain_sd)
        yield (posterior.label, name, point), float(whole)


def _row(
    cell: CellEstimate,
    estimate: ParameterEstimate,
    sds: Mapping[_Key, float],
    doubts: str,
) -> _Row:
    sd = sds.get((cell.label, estimate.name, cell.timing_point))
    others = [x for (who, name, _), x in sds.items() if (who, name) == (cell.label, estimate.name)]
    withheld = estimate.ci_low is None
    reach = "" if sd is None else f", ±\N{NO-BREAK SPACE}{_pct(relative_half_width(sd))}"
    return {
        "participant": cell.label,
        "name": cell.timing_point,
        "parameter": parameter_name(estimate.name),
        "value": format_number(estimate.unbounded),
        "unit": f"{pretty_unit(estimate.unit)}{reach}",
        "why": (doubts or _NO_INTERVAL) if withheld else _too_wide(sd, others),
        "remedy": "checking what the reason names" if withheld else _remedy(cell, estimate, sd),
    }


def _doubts(posterior: LogPosterior) -> str:
    """Say what speaks against a person's model, and which parameters do."""
    meanings = [Doubt(code).meaning for code in posterior.doubts]
    return "; ".join([*meanings, *map(str, posterior.unlikely)])


def _too_wide(sd: float | None, others: Sequence[float]) -> str:
    if sd is None or not decides(1.0, relative_half_width(sd)):
        return "half of the interval exceeds 50 % of the value"
    usual = relative_half_width(float(np.median(others)))
    return (
        "half of the interval is within 50 %, but the median over the participant's timing points "
        f"is ±\N{NO-BREAK SPACE}{_pct(usual)}: one narrow interval among wide ones may be "
        "so by chance"
    )


def _remedy(cell: CellEstimate, estimate: ParameterEstimate, sd: float | None) -> str:
    """Name the measurements that would make the interval narrower, the best one first."""
    parts = cell.through_instruments.get(estimate.name, {})
    if sd is None or not np.isfinite(sd) or not estimate.unbounded:
        return _NOTHING_ALONE
    now = relative_half_width(sd)
    left = {
        source: relative_half_width(
            float(np.sqrt(max(sd**2 - (part / estimate.unbounded) ** 2, 0.0)))
        )
        for source, part in parts.items()
    }
    ordered = sorted(left, key=left.__getitem__)
    named = [
        f"{_MEASUREMENTS[n]}: ±\N{NO-BREAK SPACE}{_pct(left[n])}" for n in ordered[:_MOST_NAMED]
    ]
    worth = sum(x <= (1.0 - _WORTH_NAMING) * now for x in left.values())
    if worth or not named:
        return "; ".join(named[:worth]) or _NOTHING_ALONE
    return f"{_NOTHING_ALONE} by more than a tenth; most by {named[0]}"


def _pct(share: float) -> str:
    return (
        f"{100.0 * share:.0f}\N{NO-BREAK SPACE}%"
        if share < 10.0
        else ">\N{NO-BREAK SPACE}1000\N{NO-BREAK SPACE}%"
    )
