"""Counts and sentences about an analysis that terminal, page and paper share."""

import re
from collections.abc import Iterable, Iterator, Sequence
from itertools import zip_longest
from typing import Final

from jointz.core.channels import pretty_unit
from jointz.core.grouping import by_key
from jointz.identify.walking.coupling import COUPLINGS, Coupling
from jointz.report.subjects import subjects
from jointz.report.wording import format_count, format_number, parameter_name
from jointz.results.study_analysis import PopulationEstimate, StudyAnalysis
from jointz.results.study_counts import study_counts
from jointz.stats.people_likelihoods import PeopleResults

#: A count in the description of an interval; not the digits of a word.
_NUMBER: Final = re.compile(r"(?<![\w.])(\d+)(?![\w.])")
_MOST_NAMES: Final = 3

SIMULATED: Final = "All recordings are simulated: no person was measured."


def name_range(names: Sequence[str]) -> str:
    """Name up to three participants, else the first and the last."""
    return ", ".join(names) if len(names) <= _MOST_NAMES else f"{names[0]} to {names[-1]}"


def stiffness_extremes(population: Sequence[PopulationEstimate]) -> list[str]:
    """Name the timing points of largest and smallest mean stiffness."""
    for parameter in ("stiffness_per_mass", "stiffness"):
        means = [m for m in population if m.parameter == parameter and m.n_participants > 1]
        rows = [(m.value, m) for m in means if m.value is not None]
        undecided = ", ".join(m.timing_point for m in means if m.status == "undecided")
        mean = f"Mean {parameter_name(parameter).lower()}"
        if len(rows) > 1:
            (low, first), (high, last) = (pick(rows, key=lambda r: r[0]) for pick in (min, max))
            beside = f"; it is undecided at {undecided}" if undecided else ""
            return [
                f"{mean} ranges from {format_number(low)} ({first.timing_point}) to "
                f"{format_number(high)} {pretty_unit(last.unit)} ({last.timing_point}){beside}."
            ]
        if undecided:
            return [f"{mean} is undecided at {undecided}."]
    return []


def has_onsets(analysis: StudyAnalysis) -> bool:
    """Return whether pulses have a place on the gait cycle."""
    return any(c.onset_gait_pct is not None for c in analysis.cells)


def chosen_method(analysis: StudyAnalysis) -> str:
    """Return the method of the settings, else that of the first estimate."""
    first = next((c.method for c in analysis.cells), "")
    return str(analysis.settings.get("method") or first)


def used_coupling(analysis: StudyAnalysis) -> Coupling:
    """Return what was assumed of the coupling of device and leg."""
    return COUPLINGS[analysis.coupling]


def counted_people(analysis: StudyAnalysis) -> str:
    """Return the number of participants in words."""
    return subjects(analysis).counted(study_counts(analysis).people)


def counted_people_and_pulses(analysis: StudyAnalysis) -> str:
    """Return the number of participants and of pulses used, in words."""
    return f"{counted_people(analysis)}, {format_count(study_counts(analysis).used, 'pulse')}"


def fitted_signals(analysis: StudyAnalysis) -> str:
    """Return the signal that the chosen method fitted: ``angle``, ``torque`` or both."""
    responses = [c.response for c in analysis.cells if c.response is not None]
    names = ("torque" if r.fitted_angle is None else "angle" for r in responses)
    return " or ".join(dict.fromkeys(names)) or "torque"


# --- intervals and means -------------------------------------------------------------------------


def interval_methods(analysis: StudyAnalysis) -> list[str]:
    """Return how the intervals of the available estimates were calculated."""
    estimates = (p for c in analysis.cells for p in c.parameters if p.available and p.ci_method)
    return _merged(dict.fromkeys(p.ci_method for p in estimates))


def means_of_people_together(analysis: StudyAnalysis) -> bool:
    """Return whether means over participants are from the model of people together."""
    results = PeopleResults(analysis.log_posteriors, analysis.cells)
    return bool(analysis.population) and results.have_errors


def mean_interval(analysis: StudyAnalysis, *, level: str = "") -> str:
    """Name the interval of the means over participants."""
    if means_of_people_together(analysis):
        return (
            f"the {level}interval of a model of all participants together, in which each counts by "
            "the uncertainty of the estimates"
        )
    return f"a {level}t interval over participants"


def mean_over_people_note(analysis: StudyAnalysis) -> str:
    """Explain mean, SD and n over participants."""
    if not means_of_people_together(analysis):
        return "SD: of the participants' estimates. n: participants with an estimate."
    return (
        "Mean and SD are from one model of all participants, in which each counts by what the data "
        "say, without the participant's priors; body mass is a covariate. The model has one "
        "relative SD between participants for all timing points; the sample SD is that of the "
        "available estimates, with their errors. "
        "The interval includes errors of calibration and method that all participants share. "
        "n: participants who count, undecided ones included."
    )


def _merged(texts: Iterable[str]) -> list[str]:
    """Join texts that differ in numbers only: over 48 pulses, over 50 -> over 48 to 50."""
    split = (_NUMBER.split(text) for text in texts)
    kinds = by_key((tuple(parts[::2]), parts[1::2]) for parts in split)
    return ["".join(_interleaved(words, numbers)) for words, numbers in kinds.items()]


def _interleaved(words: Sequence[str], numbers: Sequence[Sequence[str]]) -> Iterator[str]:
    columns = [sorted(set(column), key=float) for column in zip(*numbers, strict=True)]
    spans = [own[0] if len(own) == 1 else f"{own[0]} to {own[-1]}" for own in columns]
    for word, span in zip_longest(words, spans, fillvalue=""):
        yield word + span
