"""Sentences of the report: summary and captions."""

import re
from bisect import bisect_left
from collections.abc import Iterable, Iterator, Mapping, Sequence
from itertools import zip_longest
from typing import Any, Final

from jointz.core.codes import Exclusion
from jointz.core.events import StrideRecord
from jointz.core.gait_phases import ALL_POINTS
from jointz.report.subjects import subjects
from jointz.report.wording import (
    format_count,
    format_integer,
    format_number,
    method_name,
    parameter_name,
    pretty_unit,
)
from jointz.results.statistics.pooled_estimates import POOLED_METHOD
from jointz.results.study_analysis import NO_MEANS_ON_A_BENCH, PopulationEstimate, StudyAnalysis

_PHASE_NAMES: Final = (
    "initial contact (ICO), loading response (LRE), mid-stance (MST), terminal stance (TST), "
    "pre-swing (PSW), initial swing (ISW), mid-swing (MSW), terminal swing (TSW)"
)

#: A count in how an interval was made; not the digits of a word.
_NUMBER: Final = re.compile(r"(?<![\w.])(\d+)(?![\w.])")

# Said of a torque that was not fitted.
_DRIVEN: Final = "; the measured torque drives it and has no fit"


def summary_paragraph(analysis: StudyAnalysis) -> str:
    """Say in plain words who was measured, how, and what stands."""
    people = list(dict.fromkeys(c.participant for c in analysis.cells))
    if not people:
        return "The study holds nobody and nothing with pulses, so there is nothing to report."
    words = subjects(analysis)
    points = {c.timing_point for c in analysis.cells if c.timing_point != ALL_POINTS}
    used, left_out = pulse_counts(analysis)
    total = sum(len(c.parameters) for c in analysis.cells)
    joint = None if words.loads else analysis.settings.get("joint")
    who = f"{words.counted(len(people))} ({_range(people)})"
    place = _place(analysis, len(points))
    sentences = [
        f"{who}, {f'{joint}, ' if joint else ''}{place}.",
        f"{format_count(used, 'pulse was', 'pulses were')} used and "
        f"{format_integer(left_out)} left out.",
        f"{_method_lead(analysis.settings)}{analysis.n_standing} of "
        f"{format_count(total, 'estimate')} {'stands' if analysis.n_standing == 1 else 'stand'}"
        f"{_not_standing(analysis)}.",
    ]
    if words.loads and len(people) > 1:
        sentences.append(NO_MEANS_ON_A_BENCH)
    return " ".join([*sentences, *_extremes(analysis.population)])


def interval_methods(analysis: StudyAnalysis) -> list[str]:
    """Return how the intervals of the standing estimates were made."""
    every = (p for c in analysis.cells for p in c.parameters if p.stands and p.ci_method)
    return _merged(dict.fromkeys(p.ci_method for p in every))


def chosen_method(analysis: StudyAnalysis) -> str:
    """Return the method that was asked for, or that of the first estimate where nothing tells."""
    first = next((c.method for c in analysis.cells), "")
    return str(analysis.settings.get("method") or first)


def pulse_counts(analysis: StudyAnalysis) -> tuple[int, int]:
    """Return how many pulses were used and left out, each counted once."""
    if analysis.pulses:
        used = sum(not p.code for p in analysis.pulses)
        return used, len(analysis.pulses) - used
    # The row of a shared value repeats the pulses of the timing points it spans.
    own = [c for c in analysis.cells if c.timing_point != ALL_POINTS]
    return sum(c.n_used for c in own), sum(c.n_excluded for c in own)


def captions(analysis: StudyAnalysis) -> dict[str, str]:
    """Return what each figure shows, how its intervals were made, and n."""
    words = subjects(analysis)
    people = words.counted(len({c.participant for c in analysis.cells}))
    used, _ = pulse_counts(analysis)
    pulses = format_count(used, "pulse")
    unmeasured = sum(p.target_pct is not None and p.measured_pct is None for p in analysis.pulses)
    made = "; ".join(interval_methods(analysis)) or "as stated by the method"
    walking = any(c.onset_gait_pct is not None for c in analysis.cells)
    fitted = fitted_signals(analysis)
    axis = (
        "The participants of a timing point are spread sideways, in the order of the table, about "
        f"the mean measured onset. Bands are the phases of the gait cycle: {_PHASE_NAMES}."
        if walking
        else f"{words.points.capitalize()} stand in the order of the study."
    )
    return {
        "impedance_over_gait": (
            f"Impedance {'over the gait cycle' if walking else f'at each {words.point}'}. Points "
            f"with bars: estimates of each {words.one} with their intervals ({made})."
            f"{_other_marks(analysis)} {axis}{_not_drawn(analysis)} n: {people}"
            f", {pulses}."
        ),
        "responses": (
            "Average responses to the pulses, baseline removed: angle (left) and torque (right), "
            f"with the {fitted} of the fitted model dashed"
            f"{_DRIVEN if fitted == 'angle' else ''}. Panels of a row share their axes. Grey "
            "numbers: pulses averaged (n) and variance accounted for (VAF, beside the signal that "
            "was fitted); VAF says how well the curve is followed, not how accurate the estimates "
            f"are. n: {people}, {pulses}; no intervals are drawn."
        ),
        "methods": (
            "The chosen method beside the others on the same recordings; each leaves out the "
            f"pulses that it cannot use. Points: means over the {words.many} whose estimate "
            f"stands; bars: Student's interval over {words.many}, or the {words.one}'s own "
            "interval where there is one only. An estimate at its bound counts with the value of "
            f"the bound.{_plain_means(analysis)} n: {people}."
        ),
        "budget": (
            "Error budget: share of each source in the variance of the estimates, mean over "
            f"{words.many}, undecided estimates included. Above the bars: standard deviation, % of "
            "the estimate (median). Strides that differ: what the prediction of the unperturbed "
            "motion misses, also through what that leaves open of the lag, made smaller by more "
            "pulses or a measured lag; prior knowledge: what the data leave to "
            f"assumptions made before. n: {people}."
        ),
        "onset_accuracy": (
            "Measured minus planned onset of every pulse, in % of the gait cycle: "
            "histogram (left) and single pulses (right) of each timing point, with their mean "
            "(line), standard deviation (SD) and number. The measured onset is the time since the "
            "heel strike over the duration of the same stride. "
            f"Not drawn: {format_count(unmeasured, 'pulse')} outside accepted strides."
        ),
        "strides": (
            "Stride times in each recording (line) and histogram of the accepted strides with "
            f"mean ± SD.{_stride_marks(analysis)} "
            f"n: {format_count(len(analysis.strides), 'stride')}."
        ),
        "truth": (
            "Estimates against the truth of the simulation. Filled: the interval holds the truth; "
            "open: it does not. Line: equality."
        ),
    }


def strides_with_pulse(analysis: StudyAnalysis) -> set[tuple[str, str, float]]:
    """Return the strides in which a pulse begins, or that were left out for holding one."""
    onsets: dict[tuple[str, str], list[float]] = {}
    for pulse in sorted(analysis.pulses, key=lambda pulse: pulse.onset_s):
        onsets.setdefault((pulse.participant, pulse.recording), []).append(pulse.onset_s)
    return {
        (s.participant, s.recording, s.start_s)
        for s in analysis.strides
        if s.code == Exclusion.PULSE_IN_STRIDE.value
        or _begins_inside(onsets.get((s.participant, s.recording), ()), s)
    }


def _begins_inside(onsets_s: Sequence[float], stride: StrideRecord) -> bool:
    following = bisect_left(onsets_s, stride.start_s)
    end_s = stride.start_s + stride.duration_s
    return following < len(onsets_s) and onsets_s[following] < end_s


def _stride_marks(analysis: StudyAnalysis) -> str:
    """Explain the marks that are there."""
    text = ""
    if any(s.code not in ("", Exclusion.PULSE_IN_STRIDE.value) for s in analysis.strides):
        text += " Marks: strides left out, by code; those beyond the axis stand at its edge."
    if strides_with_pulse(analysis):
        text += " Grey strokes: strides that hold a pulse; they are not used as unperturbed."
    return text


def _plain_means(analysis: StudyAnalysis) -> str:
    if not any(m.method == POOLED_METHOD for m in analysis.population):
        return ""
    return (
        " So all methods have means of one kind. Those of the other figures and tables, in which "
        "each estimate counts by its own uncertainty, undecided ones too, differ from them."
    )


def _not_drawn(analysis: StudyAnalysis) -> str:
    """Say of which quantities no estimate stands: they have no panel."""
    estimates = [p for c in analysis.cells for p in c.parameters]
    missing = {p.name for p in estimates} - {p.name for p in estimates if p.stands}
    wanted = ("stiffness", "damping", "inertia")
    names = [parameter_name(n).lower() for n in wanted if n in missing]
    if not names:
        return ""
    return f" Not drawn: {' and '.join(names)}: no estimate stands."


def fitted_signals(analysis: StudyAnalysis) -> str:
    """Return which signal the chosen method fitted: ``angle``, ``torque`` or both."""
    held = [c.response for c in analysis.cells if c.response is not None]
    names = ("torque" if r.fitted_angle is None else "angle" for r in held)
    return " or ".join(dict.fromkeys(names)) or "torque"


def _other_marks(analysis: StudyAnalysis) -> str:
    text = ""
    if any(m.n_participants > 1 for m in analysis.population):
        text += f" Diamonds: means over participants with {mean_interval(analysis)}."
    if any(p.status == "at_bound" for c in analysis.cells for p in c.parameters):
        text += (
            " Open triangles: estimates at their bound, hanging from the upper limit of a "
            "one-sided interval."
        )
    return text


def _range(people: Sequence[str]) -> str:
    if len(people) <= 3:
        return ", ".join(people)
    return f"{people[0]} to {people[-1]}"


def _place(analysis: StudyAnalysis, count: int) -> str:
    if any(c.onset_gait_pct is not None for c in analysis.cells):
        return f"{format_count(count, 'timing point')} of the gait cycle"
    words = subjects(analysis)
    return format_count(count, words.point, words.points)


def _not_standing(analysis: StudyAnalysis) -> str:
    statuses = [p.status for c in analysis.cells for p in c.parameters]
    bound = statuses.count("at_bound")
    undecided = statuses.count("undecided")
    failed = sum(s.startswith("failed") for s in statuses)
    parts = [f"{bound} of these as an upper limit only"] if bound else []
    parts += [f"{undecided} undecided"] if undecided else []
    parts += [f"{failed} failed"] if failed else []
    return f" ({', '.join(parts)})" if parts else ""


def _extremes(population: Sequence[PopulationEstimate]) -> list[str]:
    """Name the timing points of largest and smallest mean stiffness."""
    for name in ("stiffness_per_mass", "stiffness"):
        own = [m for m in population if m.parameter == name and m.n_participants > 1]
        rows = [(m.value, m) for m in own if m.value is not None]
        undecided = ", ".join(m.timing_point for m in own if m.status == "undecided")
        beside = f"; it is undecided at {undecided}" if undecided else ""
        if len(rows) > 1:
            low, high = min(rows, key=lambda r: r[0]), max(rows, key=lambda r: r[0])
            return [
                f"Mean {parameter_name(name).lower()} ranges from "
                f"{format_number(low[0])} ({low[1].timing_point}) to {format_number(high[0])} "
                f"{pretty_unit(high[1].unit)} ({high[1].timing_point}){beside}."
            ]
        if undecided:
            return [f"Mean {parameter_name(name).lower()} is undecided at {undecided}."]
    return []


def mean_interval(analysis: StudyAnalysis, *, level: str = "") -> str:
    """Say what interval the means over participants have."""
    if any(m.method == POOLED_METHOD for m in analysis.population):
        return (
            f"the {level}interval of a normal model of people in which each estimate counts by its "
            "own uncertainty"
        )
    return f"Student's {level}interval over participants"


def mean_over_people_note(analysis: StudyAnalysis) -> str:
    """Say what mean, SD and n over participants are, where they are not the plain ones."""
    if not any(m.method == POOLED_METHOD for m in analysis.population):
        return "n: those whose estimate stands."
    return (
        "Mean and SD are from a random-effects model in which each estimate counts by its standard "
        "error, without the priors of K, B and J; of J, where all values are positive, the "
        "geometric mean, and the SD of the logarithm times that mean. n: participants with an "
        "estimate, undecided ones included."
    )


def _merged(texts: Iterable[str]) -> list[str]:
    """Join texts that differ in numbers only: over 48 pulses, over 50 -> over 48 to 50."""
    kinds: dict[tuple[str, ...], list[list[str]]] = {}
    for text in texts:
        parts = _NUMBER.split(text)
        kinds.setdefault(tuple(parts[::2]), []).append(parts[1::2])
    return ["".join(_woven(words, found)) for words, found in kinds.items()]


def _woven(words: Sequence[str], found: Sequence[Sequence[str]]) -> Iterator[str]:
    spans = [sorted(set(column), key=float) for column in zip(*found, strict=True)]
    numbers = [own[0] if len(own) == 1 else f"{own[0]} to {own[-1]}" for own in spans]
    for word, number in zip_longest(words, numbers, fillvalue=""):
        yield word + number


def _method_lead(settings: Mapping[str, Any]) -> str:
    method = settings.get("method")
    return f"With the method {_quoted(method_name(method))}, " if method else ""


def _quoted(name: Any) -> str:
    return f"“{name}”"
