"""Doubts that withhold a value: which, the parameters that contradict the model, the remedy."""

import re
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Final

from jointz.core.codes import Doubt
from jointz.results.estimates import CellEstimate, ParameterEstimate
from jointz.results.log_posterior import LogPosterior
from jointz.results.study_analysis import StudyAnalysis

#: Why K and B are undecided after such pulses, however many there are.
HELD: Final = "K and B are not identifiable from pulses that hold one torque"
DOUBLETS: Final = "use doublets of two shapes and sizes, or short pulses of several sizes"
_BODY: Final = "check mass_kg, height_m, the unit of the torque, and that a strap holds the device"
_LOOK: Final = "look at the responses: jointz explore"
#: Doubt -> what to do about it where no parameter is named.
_REMEDIES: Final[Mapping[str, str]] = {
    Doubt.HELD_TORQUE: DOUBLETS,
    Doubt.SENSORS_CONTRADICT: "check the sensor that the note names",
    Doubt.STEEP_CHANGE: "move this timing point away from the change, or report its neighbours",
    Doubt.RESPONSES_UNLIKE_SIZE: "check the torque that the motor gave; leave out larger pulses",
    Doubt.LAG_UNLIKELY: "measure the lag anew (jointz calibrate)",
    Doubt.INSTRUMENTS_UNLIKELY: "check sensors, strap and the coupling in study.toml",
    Doubt.INERTIA_UNLIKE_BODY: _BODY,
    Doubt.INERTIA_UNLIKE_AT_POINT: _BODY,
}
#: Doubts with which values or their limits are available.
_HARMLESS: Final = frozenset({Doubt.HELD_TORQUE.value, Doubt.SENSORS_CONTRADICT.value})
_BRACKETS: Final = re.compile(r" \([^)]*\)")


@dataclass(frozen=True, slots=True)
class Withheld:
    """Why a value is withheld, and what to check."""

    kind: str  # the first doubt in a few words
    reason: str  # the parameter that is farthest off, with its numbers; else the doubt
    remedy: str  # what to check about it
    contradictions: str  # all doubts and parameters
    remedies: str  # what to check about all


def withheld(
    analysis: StudyAnalysis, cell: CellEstimate, estimate: ParameterEstimate
) -> Withheld | None:
    """Return why an undecided value has no limits, None if no doubt withholds it."""
    posterior = _posterior(analysis, cell)
    if posterior is None or estimate.status != "undecided" or estimate.ci_low is not None:
        return None
    doubts = _harmful(posterior)
    if not doubts or not _is_doubted(posterior, cell, estimate):
        return None
    kind = _BRACKETS.sub("", doubts[0].meaning).partition(";")[0].partition(":")[0]
    everything = _contradictions(posterior), remedies(posterior)
    if not posterior.unlikely:
        return Withheld(kind, kind, _REMEDIES.get(doubts[0], _LOOK), *everything)
    # Errors of any sensor may look like a reflex, too.
    farthest = max(
        posterior.unlikely, key=lambda found: (not found.name.startswith("reflex"), found.sds)
    )
    return Withheld(kind, str(farthest), farthest.remedy, *everything)


def is_held(analysis: StudyAnalysis, cell: CellEstimate, estimate: ParameterEstimate) -> bool:
    """Return whether K or B is undecided because the pulses hold one torque."""
    posterior = _posterior(analysis, cell)
    if posterior is None or Doubt.HELD_TORQUE.value not in posterior.doubts:
        return False
    undecided = estimate.status == "undecided" and estimate.name != "inertia"
    return undecided and _is_doubted(posterior, cell, estimate)


def _contradictions(posterior: LogPosterior) -> str:
    """Say what speaks against a person's model, and which parameters do."""
    meanings = [doubt.meaning for doubt in _harmful(posterior)]
    return "; ".join([*meanings, *map(str, posterior.unlikely)])


def remedies(posterior: LogPosterior) -> str:
    """Say what to check or to do, first about the doubts that withhold values."""
    of_doubts = [_REMEDIES.get(doubt, _LOOK) for doubt in _harmful(posterior)]
    if posterior.unlikely:  # these say it more exactly
        of_doubts = [found.remedy for found in posterior.unlikely]
    return "; ".join(
        dict.fromkeys(of_doubts or [_REMEDIES[Doubt(code)] for code in posterior.doubts])
    )


def _posterior(analysis: StudyAnalysis, cell: CellEstimate) -> LogPosterior | None:
    return next((p for p in analysis.log_posteriors if p.label == cell.label), None)


def _harmful(posterior: LogPosterior) -> list[Doubt]:
    return [Doubt(code) for code in posterior.doubts if code not in _HARMLESS]


def _is_doubted(posterior: LogPosterior, cell: CellEstimate, estimate: ParameterEstimate) -> bool:
    """Return whether a doubt is about this value; results of earlier versions do not say."""
    places = zip(posterior.parameters, posterior.timing_points, posterior.doubted, strict=False)
    value = estimate.name, cell.timing_point
    return next((doubt for *place, doubt in places if tuple(place) == value), True)
