"""Sentences of the report: summary, methods to paste, captions and caveats."""

from collections.abc import Mapping, Sequence
from typing import Any, Final

from jointz.core.analysis import NO_MEANS_ON_A_BENCH, PopulationEstimate, StudyAnalysis
from jointz.report.subjects import subjects
from jointz.report.wording import (
    SHARED,
    format_count,
    format_integer,
    format_number,
    parameter_name,
    pretty_unit,
)

_PHASE_NAMES: Final = (
    "initial contact (ICO), loading response (LRE), mid-stance (MST), terminal stance (TST), "
    "pre-swing (PSW), initial swing (ISW), mid-swing (MSW), terminal swing (TSW)"
)

_BASELINES: Final[Mapping[str, str]] = {
    "unperturbed_mean": (
        "the mean unperturbed cycle, aligned in time at heel strike, was subtracted from each "
        "response"
    ),
    "pre_pulse": "the value before each pulse was subtracted from its response",
    "matched_strides": (
        "the mean of the unperturbed strides most like the perturbed one was subtracted from each "
        "response"
    ),
    "predicted": (
        "the unperturbed motion and torque, predicted from what went before each pulse, were "
        "subtracted from its response"
    ),
}

_BOUNDED: Final = ", fitted to the average response by least squares with K, B and J not negative"
_FITS: Final = dict.fromkeys(("dissertation", "pre_pulse", "matched_strides"), _BOUNDED)

#: Method that uses whole trials, and what it does.
FULL_RECORD: Final = "full_record"
_WHOLE_TRIALS: Final = (
    "Whole trials were used: nothing was cut out and no unperturbed motion subtracted. The torque "
    "was modelled as K·angle + B·velocity + J·acceleration with a friction torque of constant size "
    "against the motion and an offset for each trial, recorded with a lag (a delay, a first-order "
    "filter or both). All were fitted together by least squares, the noise of the angle taken out "
    "of the sums of squares. Angle and torque passed the same Gaussian low-pass (standard "
    "deviation 40 Hz, or a tenth of the sampling rate where that is less), and samples where "
    "friction may have held the load were left out."
)

_VAF_CAVEAT: Final = (
    "VAF is not accuracy.",
    "The variance accounted for says how well the model follows the average response, not how "
    "close stiffness, damping and inertia are to the truth. A lag of a few milliseconds or a "
    "wrong baseline can spoil all three while VAF stays near 99 %.",
)
#: What every reader of such a report should know, in plain words.
CAVEATS: Final = (
    _VAF_CAVEAT,
    (
        "Inertia is that of joint and device together.",
        "Everything that moves with the joint is in it: limb, brace and what hangs on them, unless "
        "a calibrated device inertia was subtracted.",
    ),
    (
        "Intervals from resampled pulses see only what differs from pulse to pulse.",
        "Errors common to all pulses never show in them: a lag between sensor and joint, a shift "
        "between the unperturbed and the perturbed condition, the gain of the torque. Give them "
        "under [calibration] with their standard deviation to have them in the intervals.",
    ),
    (
        "The values belong to the displacement and the window they were measured with.",
        "Large displacements are no longer a small disturbance, reflexes may act within the "
        "window, and stiffness that changes inside it is averaged.",
    ),
)
#: The same for loads on a bench.
BENCH_CAVEATS: Final = (
    _VAF_CAVEAT,
    (
        "Inertia is that of the load and of all that moves with it.",
        "The bench's own is in it, and so are its stiffness and damping, unless a calibrated "
        "intrinsic impedance was subtracted.",
    ),
    (
        "Intervals do not know the gain of the torque.",
        "Stiffness, damping and inertia follow an error of the torque's gain one to one. Give the "
        "gain under [calibration] with its standard deviation to have it in the intervals.",
    ),
    (
        "A load is taken to be linear.",
        "Friction other than a constant one against the motion, play and stiffness that changes "
        "with the deflection are averaged into the three numbers.",
    ),
)


def summary_paragraph(analysis: StudyAnalysis) -> str:
    """Say in plain words who was measured, how, and what stands.

    Parameters
    ----------
    analysis : StudyAnalysis
        The analysis.
    """
    people = list(dict.fromkeys(c.participant for c in analysis.cells))
    if not people:
        return "The study holds nobody and nothing with pulses, so there is nothing to report."
    words = subjects(analysis)
    points = {c.timing_point for c in analysis.cells if c.timing_point != SHARED}
    used, left_out = pulse_counts(analysis)
    total = sum(len(c.parameters) for c in analysis.cells)
    joint = None if words.bench else analysis.settings.get("joint")
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
    if words.bench and len(people) > 1:
        sentences.append(NO_MEANS_ON_A_BENCH)
    return " ".join([*sentences, *_extremes(analysis.population)])


def methods_paragraph(analysis: StudyAnalysis) -> str:
    """Write a methods section from the settings, ready to paste into a paper.

    Only what the settings say is written; what they do not hold is left out.

    Parameters
    ----------
    analysis : StudyAnalysis
        The analysis.
    """
    settings = analysis.settings
    version = analysis.provenance.get("jointz")
    what = (
        "loads on a bench" if subjects(analysis).bench else f"the {settings.get('joint', 'joint')}"
    )
    sentences = [
        f"Mechanical impedance of {what} was estimated with jointz"
        f"{f' {version}' if version else ''}{_method_in_brackets(settings)}."
    ]
    used_methods = _used_methods(analysis)
    if FULL_RECORD in used_methods:
        sentences.append(_WHOLE_TRIALS)
    if used_methods != [FULL_RECORD]:
        others = [m for m in used_methods if m != FULL_RECORD]
        if FULL_RECORD in used_methods:
            sentences.append(f"Other cases were estimated by the method {_quoted(others[0])}.")
        sentences += _response_sentences(settings, others[0] if others else None)
    if settings.get("positive"):
        sentences.append(f"Angle and torque are positive in {settings['positive']}.")
    sentences += _interval_sentences(analysis)
    used, left_out = pulse_counts(analysis)
    unit = "were used" if used_methods != [FULL_RECORD] else "lie in the trials used"
    sentences.append(f"Of {format_count(used + left_out, 'pulse')}, {format_integer(used)} {unit}.")
    return " ".join(sentences)


def _used_methods(analysis: StudyAnalysis) -> list[str]:
    """Return the methods that the estimates were made by: a case may have needed another."""
    own = list(dict.fromkeys(c.method for c in analysis.cells if c.method))
    chosen = analysis.settings.get("method")
    return own or ([str(chosen)] if chosen else [])


def _response_sentences(settings: Mapping[str, Any], method: str | None) -> list[str]:
    """Say how responses to pulses were cut, filtered and fitted."""
    sentences = [
        "The torque response was modelled as K·angle + B·velocity + J·acceleration"
        f"{_window(settings)}{_FITS.get(str(method), '')}."
    ]
    if settings.get("cutoff_hz"):
        sentences.append(
            f"Angle and torque passed the same low-pass filter ({settings['cutoff_hz']:g} Hz)."
        )
    baseline = settings.get("baseline")
    if baseline and baseline != "none":
        text = _BASELINES.get(baseline, f"the baseline {_quoted(baseline)} was subtracted")
        sentences.append(f"{text[0].upper()}{text[1:]}.")
    return sentences


def interval_methods(analysis: StudyAnalysis) -> list[str]:
    """Return how the intervals of the standing estimates were made.

    Parameters
    ----------
    analysis : StudyAnalysis
        The analysis.
    """
    every = (p for c in analysis.cells for p in c.parameters if p.stands and p.ci_method)
    return list(dict.fromkeys(p.ci_method for p in every))


def pulse_counts(analysis: StudyAnalysis) -> tuple[int, int]:
    """Return how many pulses were used and left out, each counted once.

    Parameters
    ----------
    analysis : StudyAnalysis
        The analysis.
    """
    # The row of a shared value repeats the pulses of the timing points it spans.
    own = [c for c in analysis.cells if c.timing_point != SHARED]
    return sum(c.n_used for c in own), sum(c.n_excluded for c in own)


def captions(analysis: StudyAnalysis) -> dict[str, str]:
    """Return what each figure shows, how its intervals were made, and n.

    Parameters
    ----------
    analysis : StudyAnalysis
        The analysis.
    """
    words = subjects(analysis)
    people = words.counted(len({c.participant for c in analysis.cells}))
    used, _ = pulse_counts(analysis)
    pulses = format_count(used, "pulse")
    made = "; ".join(interval_methods(analysis)) or "as stated by the method"
    walking = any(c.onset_gait_pct is not None for c in analysis.cells)
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
            f"{_other_marks(analysis)} {axis} n: {people}"
            f", {pulses}."
        ),
        "responses": (
            "Average responses to the pulses, baseline removed: angle (left) and torque (right), "
            "with the torque of the fitted model dashed. Panels of a row share their axes. Grey "
            "numbers: pulses averaged (n, left) and variance accounted for (VAF, right); VAF says "
            f"how well the curve is followed, not how accurate the estimates are. n: {people}, "
            f"{pulses}; no intervals are drawn."
        ),
        "methods": (
            "The chosen method beside the others on the same pulses. Points: means over the "
            f"{words.many} whose estimate stands; bars: Student's interval over {words.many}, or "
            f"the {words.one}'s own interval where there is one only. An estimate at its bound "
            f"counts with the value of the bound. n: {people}."
        ),
        "onset_accuracy": (
            "Measured onset of every pulse relative to its target, in % of the gait cycle: "
            "histogram (left) and single pulses (right) of each timing point, with their mean "
            "(line), standard deviation (SD) and number. Pulses without a measured phase are not "
            "drawn."
        ),
        "strides": (
            "Stride times in each recording (line) and histogram of the accepted strides with "
            "mean ± SD. Marks: strides left out, by code; those beyond the axis stand at its edge. "
            "Grey strokes: strides that hold a pulse, and are therefore not used as unperturbed. "
            f"n: {format_count(len(analysis.strides), 'stride')}."
        ),
        "truth": (
            "Estimates against the truth of the simulation. Filled: the interval holds the truth; "
            "open: it does not. Line: equality."
        ),
    }


def _other_marks(analysis: StudyAnalysis) -> str:
    text = ""
    if any(m.n_participants > 1 for m in analysis.population):
        text += " Diamonds: means over participants with Student's interval over participants."
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
        own = (m for m in population if m.parameter == name and m.n_participants > 1)
        rows = [(m.value, m) for m in own if m.value is not None]
        if len(rows) > 1:
            low, high = min(rows, key=lambda r: r[0]), max(rows, key=lambda r: r[0])
            return [
                f"Mean {parameter_name(name).lower()} ranges from "
                f"{format_number(low[0])} ({low[1].timing_point}) to {format_number(high[0])} "
                f"{pretty_unit(high[1].unit)} ({high[1].timing_point})."
            ]
    return []


def _window(settings: Mapping[str, Any]) -> str:
    window_s = settings.get("window_s")
    return f", over {1000 * window_s:g} ms from the commanded onset" if window_s else ""


def _interval_sentences(analysis: StudyAnalysis) -> list[str]:
    settings = analysis.settings
    level = f"{100 * settings.get('ci_level', 0.95):g} %"
    made = interval_methods(analysis)
    one = subjects(analysis).one
    sentences = [f"{level} intervals of each {one}: {'; '.join(made)}."] if made else []
    if settings.get("resamples") and _used_methods(analysis) != [FULL_RECORD]:
        seed = f", seed {settings['seed']}" if settings.get("seed") is not None else ""
        sentences.append(f"Number of resamples: {settings['resamples']}{seed}.")
    if any(m.value is not None for m in analysis.population):
        sentences.append(
            f"Means over participants carry Student's {level} interval over participants."
        )
    return sentences


def _method_lead(settings: Mapping[str, Any]) -> str:
    return f"With the method {_quoted(settings['method'])}, " if settings.get("method") else ""


def _method_in_brackets(settings: Mapping[str, Any]) -> str:
    return f" (method {_quoted(settings['method'])})" if settings.get("method") else ""


def _quoted(name: Any) -> str:
    return f"“{name}”"
