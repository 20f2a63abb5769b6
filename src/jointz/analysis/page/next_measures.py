"""Measurements that would help the undecided values most, for the first page of a report."""

from collections import Counter
from collections.abc import Iterator, Mapping
from typing import Final

import numpy as np

from jointz.analysis.page.uncertainty_section import (
    MEASURES,
    half_widths_without,
    parts_by_source,
    relative_sds,
)
from jointz.analysis.page.withheld_values import HELD, is_held, withheld
from jointz.analysis.summary import used_coupling
from jointz.report.subjects import nobody_perturbed, shown_parameters, subjects
from jointz.report.wording import ABSOLUTE, exclusion_meaning, format_count, parameter_name
from jointz.results.estimates import decides
from jointz.results.study_analysis import PopulationEstimate, StudyAnalysis
from jointz.results.study_counts import study_counts

#: Source -> property of device, sensors or leg.
_INSTRUMENTS: Final[Mapping[str, str]] = {
    "lag": "lag of the angle",
    "friction": "friction of the actuator",
    "strap": "strap and tissue",
    "mount": "mount of the goniometer",
    "softening": "stiffness that falls with displacement",
    "reflex": "reflex",
    "gain": "gain of the torque",
}
_MOST_INSTRUMENTS: Final = 4
_SMALLEST: Final = 0.01  # share of the variance that is named
_PERTURB: Final = (
    "Record the same task with pulses: without them the impedance cannot be estimated. The section "
    "on quasi-stiffness has moment over angle, if a moment was recorded."
)
_DOUBLETS: Final = (
    f"Use doublets of two shapes and sizes, as the protocol walking_doublets does: {HELD}, however "
    "many pulses there are."
)
_MOST: Final = 2
#: A measure is named if it makes the interval narrower by this share.
_WORTH_NAMING: Final = 0.1
#: Half-width of a mean that a study is planned for, over the mean.
_TARGET: Final = 0.2
_FEWEST_PEOPLE: Final = 3  # from which a number of people can be extrapolated
_MOST_PEOPLE: Final = 500


#: Half-width of a value over the value: now, and by source if that source were known.
_Gain = tuple[float, Mapping[str, float]]


def next_measures(analysis: StudyAnalysis) -> list[str]:
    """Return up to two sentences on what would help most, and one on the number of people."""
    if nobody_perturbed(analysis):
        return [_PERTURB]
    gains = [*_gains(analysis)]
    sentences = _ranked(gains, study_counts(analysis).statuses["undecided"]) if gains else []
    if any(is_held(analysis, c, p) for c in analysis.cells for p in c.parameters):
        sentences = [_DOUBLETS]
    sentences = [*_checks(analysis), *sentences[:_MOST], *_after_failures(analysis)]
    return [*sentences, *_more_people(analysis)]


def _checks(analysis: StudyAnalysis) -> list[str]:
    """Say what to check first where the data contradict the model."""
    found = [
        withheld(analysis, cell, estimate)
        for cell in analysis.cells
        for estimate in (cell.parameter(name) for name in ABSOLUTE)
        if estimate
    ]
    return [
        f"{remedy[0].upper()}{remedy[1:]} ({format_count(count, 'undecided value')})."
        for remedy, count in Counter(own.remedy for own in found if own).most_common(_MOST)
    ]


def instrument_shares(analysis: StudyAnalysis) -> str:
    """Say how much of the variance exact knowledge of each instrument would remove, or ""."""
    gains = [*_gains(analysis, undecided_only=False)]
    names = {n for _, left in gains for n in left if n in _INSTRUMENTS}
    shares = {
        n: float(np.median([1.0 - (left.get(n, now) / now) ** 2 for now, left in gains]))
        for n in names
    }
    ordered = [n for n in sorted(shares, key=lambda n: (-shares[n], n)) if shares[n] >= _SMALLEST]
    if not ordered:
        return ""
    texts = [f"{_INSTRUMENTS[n]} {100 * shares[n]:.0f} %" for n in ordered[:_MOST_INSTRUMENTS]]
    return (
        "Share of the variance that would vanish if a property of the device, the sensors or the "
        f"leg were known exactly (median over all estimates): {', '.join(texts)}. The shares "
        "overlap and do not add up."
    )


def _gains(analysis: StudyAnalysis, *, undecided_only: bool = True) -> Iterator[_Gain]:
    sds, coupling = relative_sds(analysis), used_coupling(analysis)
    for cell in analysis.cells:
        for name in ABSOLUTE:
            estimate = cell.parameter(name)
            sd = sds.get((cell.label, name, cell.timing_point), np.inf)
            if estimate is None or not estimate.unbounded or not np.isfinite(sd):
                continue
            if estimate.ci_low is None or (undecided_only and estimate.status != "undecided"):
                continue
            parts = parts_by_source(cell, name, coupling)
            yield half_widths_without(sd, estimate.unbounded, parts)


def _ranked(gains: list[_Gain], undecided: int) -> list[str]:
    """Return a sentence for each measure that helps, the most useful one first."""
    # A narrow interval may be withheld for another reason, which no measurement removes.
    wide = [left for now, left in gains if not decides(1.0, now)]
    decided = Counter(n for left in wide for n, half in left.items() if decides(1.0, half))
    narrower = {
        name: float(np.median([1.0 - left.get(name, now) / now for now, left in gains]))
        for name in {n for _, left in gains for n in left}
    }
    ordered = sorted(narrower, key=lambda n: (-decided[n], -narrower[n], n))
    worth = [n for n in ordered if decided[n] or narrower[n] >= _WORTH_NAMING]
    if not worth:
        return [
            "No single measurement would make the intervals of the undecided values much narrower."
        ]
    return [_sentence(n, decided[n], narrower[n], undecided) for n in worth]


def _sentence(name: str, decided: int, narrower: float, total: int) -> str:
    measure = MEASURES.get(name, f"measure {name.replace('_', ' ')}")
    measure = measure[0].upper() + measure[1:]
    if decided:
        return f"{measure}: this alone would make {decided} of {total} undecided values available."
    return f"{measure}: this narrows the undecided intervals by {100 * narrower:.0f} % (median)."


def _after_failures(analysis: StudyAnalysis) -> list[str]:
    """Return what to look at if estimates failed and pulses were excluded."""
    counts = study_counts(analysis)
    if not counts.failed or not counts.excluded or not analysis.pulses:
        return []
    code, count = counts.exclusions.most_common(1)[0]
    return [
        f"Check why pulses were excluded; most often ({format_count(count, 'pulse')}): "
        f"{exclusion_meaning(code)}."
    ]


def _more_people(analysis: StudyAnalysis) -> list[str]:
    """Return how many people a mean within 20 % needs, if people vary as these do."""
    means = [
        m
        for name in shown_parameters(analysis.cells)[:1]
        for m in analysis.population
        if m.parameter == name and m.status == "ok" and m.n_participants >= _FEWEST_PEOPLE
    ]
    if not means:
        return _more_than_few(analysis)
    needed = max(_people_needed(m) for m in means)
    have = max(m.n_participants for m in means)
    name = parameter_name(means[0].parameter).lower()
    target = f"a mean {name} within ±{100 * _TARGET:.0f} % at every timing point with a mean"
    if needed <= have:
        return [f"More {subjects(analysis).many} are not needed for {target}."]
    number = f"about {needed}" if needed < _MOST_PEOPLE else f"more than {_MOST_PEOPLE}"
    return [f"For {target}, plan {number} {subjects(analysis).many}, if they vary as these do."]


def _more_than_few(analysis: StudyAnalysis) -> list[str]:
    """Ask for more people where there are too few for any mean."""
    means = [m for m in analysis.population if m.n_participants > 1]
    many = subjects(analysis).many
    if not means or any(m.value is not None for m in means):
        return []
    count = max(m.n_participants for m in means)
    return [f"Measure more {many}: the {count} of this study are too few for a mean."]


def _people_needed(mean: PopulationEstimate) -> int:
    """Return the number of people at which the t interval is as narrow as the target."""
    from scipy.stats import t

    if not mean.value or mean.ci_low is None or mean.ci_high is None:
        return _FEWEST_PEOPLE
    n = mean.n_participants
    half = 0.5 * (mean.ci_high - mean.ci_low) / abs(mean.value)
    spread = half * np.sqrt(n) / t.ppf(0.975, n - 1)
    numbers = np.arange(_FEWEST_PEOPLE, _MOST_PEOPLE + 1)
    enough = t.ppf(0.975, numbers - 1) * spread / np.sqrt(numbers) <= _TARGET
    return int(numbers[np.argmax(enough)]) if enough.any() else _MOST_PEOPLE
