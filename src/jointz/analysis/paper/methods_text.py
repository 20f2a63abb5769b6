"""Methods section of a paper, from the settings and the data."""

from collections import Counter
from collections.abc import Mapping, Sequence
from typing import Any, Final

from jointz.analysis.page.quasi_stiffness_section import quasi_stiffness_records
from jointz.analysis.paper.citations import cite, cited
from jointz.analysis.paper.latex import to_latex
from jointz.analysis.paper.methods_bayesian import bayesian_sentences, decision_sentence
from jointz.analysis.paper.methods_calibration import lag_is_calibrated
from jointz.analysis.paper.methods_data import (
    exclusion_sentences,
    people_sentences,
    protocol_sentences,
    recorded_rates,
    response_rates,
    signal_sentences,
    torque_is_inverted,
)
from jointz.analysis.paper.methods_used import (
    FULL_RECORD,
    WITH_POSTERIOR,
    used_methods,
    used_pulses,
)
from jointz.analysis.summary import interval_methods, mean_interval, mean_over_people_note
from jointz.core.method_names import PREDICTED
from jointz.identify.over_cycle.stride_curves import NODES
from jointz.identify.prediction.unperturbed_prediction import FEWEST_STRIDES
from jointz.report.pulse_words import window_start
from jointz.report.subjects import nobody_perturbed, study_spec, subjects
from jointz.report.wording import (
    format_count,
    format_exact,
    format_integer,
    format_span,
    method_name,
    status_meaning,
)
from jointz.results.statistics.quasi_stiffness_fit import STEP_PCT, WINDOW_PCT, QuasiStiffnessDoubt
from jointz.results.study_analysis import StudyAnalysis
from jointz.results.study_counts import study_counts

SIMULATED: Final = "All recordings are simulated: no person was measured."
_HASH_DIGITS: Final = 12


def methods_paragraphs(analysis: StudyAnalysis) -> list[str]:
    """Write a methods section, one text for each paragraph, ready to paste into a paper.

    It contains only what settings and data say.
    """
    paragraphs = [
        [SIMULATED] if analysis.simulated else [],
        people_sentences(analysis) + protocol_sentences(analysis),
        signal_sentences(analysis),
        *_estimation(analysis),
        quasi_stiffness_sentences(analysis),
        [*exclusion_sentences(analysis), *_pulses_used(analysis), *_statuses(analysis)],
        _software(analysis),
    ]
    return [" ".join(sentences) for sentences in paragraphs if sentences]


def methods_text(analysis: StudyAnalysis) -> str:
    """Return the methods section and its references as plain text."""
    paragraphs = methods_paragraphs(analysis)
    if references := cited(paragraphs):
        paragraphs.append("\n".join(("References", *references)))
    return "\n\n".join(paragraphs) + "\n"


def methods_latex(analysis: StudyAnalysis) -> str:
    r"""Return the methods section and its references as LaTeX to ``\input``."""
    paragraphs = methods_paragraphs(analysis)
    texts = list(map(to_latex, paragraphs))
    if references := cited(paragraphs):
        # Ragged, as LaTeX does not break long identifiers.
        listed = [rf"\noindent {to_latex(entry)}" for entry in references]
        texts += [r"\paragraph{References}", r"{\raggedright", *listed, "}"]
    return "\n\n".join(texts) + "\n"


def _estimation(analysis: StudyAnalysis) -> list[list[str]]:
    """Return the paragraphs on estimation; none if no pulse was used."""
    if not used_pulses(analysis):
        return []
    return [[_lead(analysis), *estimation_sentences(analysis)], interval_sentences(analysis)]


def _lead(analysis: StudyAnalysis) -> str:
    settings = analysis.settings
    what = (
        "loads on a bench" if subjects(analysis).loads else f"the {settings.get('joint', 'joint')}"
    )
    version = analysis.provenance.get("jointz")
    by = f" by the method “{method_name(settings['method'])}”" if settings.get("method") else ""
    return (
        f"Mechanical impedance of {what} was estimated with jointz"
        f"{f' {version}' if version else ''} {cite('jointz')}{by}."
    )


def _pulses_used(analysis: StudyAnalysis) -> list[str]:
    if nobody_perturbed(analysis):
        return ["Nobody was perturbed: no impedance was estimated."]
    if analysis.cells and not used_pulses(analysis):
        return ["No pulse could be used: no impedance was estimated."]
    counts = study_counts(analysis)
    found = counts.used + counts.excluded + counts.aborted
    trials = used_methods(analysis) == [FULL_RECORD]
    return [
        f"Of {format_count(found, 'pulse')}, {format_integer(counts.used)} "
        f"{'are in the trials used' if trials else 'were used'}."
    ]


def _statuses(analysis: StudyAnalysis) -> list[str]:
    """Say how many estimates have which status."""
    statuses = study_counts(analysis).statuses
    total = statuses.total()
    if not total or nobody_perturbed(analysis):
        return []
    others = [
        f"{format_integer(count)} {status} ({status_meaning(status)})"
        for status, count in statuses.most_common()
        if status != "ok"
    ]
    rest = f"; {'; '.join(others)}" if others else ""
    ok = format_integer(statuses["ok"])
    return [f"Of {format_count(total, 'estimate')} of K, B and J, {ok} ok{rest}."]


def _software(analysis: StudyAnalysis) -> list[str]:
    provenance, settings = analysis.provenance, analysis.settings
    packages = provenance.get("packages") or {}
    named = [f"{k} {packages[k]}" for k in ("numpy", "scipy") if packages.get(k)]
    python = [f"Python {provenance['python']}"] if provenance.get("python") else []
    own = [f"jointz {provenance['jointz']}"] if provenance.get("jointz") else []
    sentences = []
    if own:
        seed = f", seed {settings['seed']}" if settings.get("seed") is not None else ""
        sentences.append(f"Software: {', '.join([*own, *python, *named])}{seed}.")
    if digest := str(provenance.get("study_sha256", ""))[:_HASH_DIGITS]:
        sentences.append(
            f"The study file has the SHA-256 {digest}…; those of all recordings are in "
            "provenance.json."
        )
    return sentences


_CALCULATION: Final = (
    f"Each stride was resampled to {NODES} points from one heel strike to the next by linear "
    "interpolation, without a filter and without gains or lags of a calibration; the strides "
    "of a participant and side were averaged. Slope: least-squares line of moment on angle over "
    "the gait phase of the timing point, both sampled every "
    f"{STEP_PCT:g} % of the cycle; local slope: the same over {WINDOW_PCT:g} % of the cycle about "
    "the timing point; secant: moment over angle at the timing point."
)
_STATUSES: Final[Mapping[str, str]] = {
    "ok": "without doubt",
    "ill_conditioned": "with doubts",
    "undecided": "without a value",
}

_Rows = Sequence[Mapping[str, Any]]


def quasi_stiffness_sentences(analysis: StudyAnalysis) -> list[str]:
    """Describe how quasi-stiffness was calculated; nothing if there is none."""
    rows = quasi_stiffness_records(analysis)
    if not rows:
        return []
    return [
        _quasi_stiffness_lead(analysis, rows),
        _moment(analysis),
        _strides(rows),
        _CALCULATION,
        *_intervals(rows),
        _outcome(rows),
    ]


def _quasi_stiffness_lead(analysis: StudyAnalysis, rows: _Rows) -> str:
    version = analysis.provenance.get("jointz")
    people = list(dict.fromkeys(str(r["participant"]) for r in rows))
    # If nobody was perturbed, another sentence names the participants.
    names = "" if nobody_perturbed(analysis) else f" ({', '.join(people)})"
    return (
        f"Quasi-stiffness of {subjects(analysis).counted(len(people))}{names} without a device and "
        "without pulses was estimated from the mean stride with jointz"
        f"{f' {version}' if version else ''} {cite('jointz')}. It is the relation of moment and "
        "angle, and no impedance."
    )


def _moment(analysis: StudyAnalysis) -> str:
    study = study_spec(analysis)
    torque = study.channels.get("torque")
    named = f" “{torque.column}”" if torque and torque.column else ""
    if torque is None:
        sign = ""
    elif torque_is_inverted(study):
        sign = ", its sign inverted to that of the torque on the joint"
    else:
        sign = ", its sign unchanged"
    return f"The moment of the joint is the study's torque channel{named}{sign}."


def _strides(rows: _Rows) -> str:
    counts = {
        (r["participant"], r.get("session", ""), r["side"]): int(r["n_strides"]) for r in rows
    }
    sides = " and side" if any(side for *_, side in counts) else ""
    return (
        "Accepted strides without a missing sample were used, "
        f"{format_span(counts.values(), format_integer)} for each participant{sides}."
    )


def _intervals(rows: _Rows) -> list[str]:
    known = [r for r in rows if r["value"] is not None]
    with_interval = [r for r in known if r["ci_low"] is not None]
    sentences = []
    if with_interval:
        sentences.append(
            f"{100 * with_interval[0]['ci_level']:g} % intervals are t intervals of the delete-one "
            f"jackknife over strides {cite('jackknife')}, with one degree of freedom less than "
            "strides, and do not include errors of motion capture and inverse dynamics."
        )
    if len(with_interval) < len(known):
        without = format_count(len(known) - len(with_interval), "value has", "values have")
        sentences.append(f"{without} no interval because of too few strides.")
    return sentences


def _outcome(rows: _Rows) -> str:
    statuses = Counter(r["status"] for r in rows)
    doubts = Counter(d for r in rows for d in r["doubts"].split())
    parts = [
        f"{format_integer(statuses[status])} {words}"
        for status, words in _STATUSES.items()
        if statuses[status]
    ]
    why = "; ".join(
        f"{QuasiStiffnessDoubt(d).meaning}, {format_integer(n)}" for d, n in doubts.most_common()
    )
    return (
        f"Of {format_count(len(rows), 'slope and secant', 'slopes and secants')}, "
        f"{', '.join(parts)}{f' ({why})' if why else ''}."
    )


#: The dissertation's text says no more than "Butterworth".
_FILTER: Final = "a fourth-order Butterworth filter run forward and backward"
_BASELINES: Final[Mapping[str, str]] = {
    "unperturbed_mean": (
        "The mean unperturbed cycle, aligned in time at heel strike, was subtracted from each "
        "response."
    ),
    "pre_pulse": "The level before each pulse was subtracted from its response.",
    "matched_strides": (
        "The mean of the unperturbed strides most similar to the perturbed one was subtracted from "
        "each response."
    ),
}
#: Bench recordings may have no cycles; a recording then replaces the strides.
_UNPERTURBED_TRIAL: Final = (
    "The unperturbed recording most similar in session, side and trial, or the mean of several "
    "such recordings, was subtracted from each response at the same time since {start}."
)

_BY_LEAST_SQUARES: Final = "fitted to the average response by least squares {bounds}"
_FITS: Final[Mapping[str, str]] = {
    **dict.fromkeys(("dissertation", "pre_pulse", "matched_strides", "pilot"), _BY_LEAST_SQUARES),
    "least_squares": "fitted to the average response by least squares without bounds",
    "instrumental_variable": (
        "fitted to the average response with the commanded torque as instrument {instruments}, "
        "{bounds}"
    ),
}
#: Methods whose bootstrap deviations are widened to Student's t.
_WIDENED: Final = ("least_squares", "instrumental_variable")

_WHOLE_TRIALS: Final = (
    "Whole trials were used, without windows and without a baseline. The torque was modelled as "
    "K·angle + B·velocity + J·acceleration {model} with {friction}an offset for each trial, and "
    "recorded with {lag}. All parameters were estimated together by least squares, with the noise "
    "of the angle removed from the sums of squares {scores}. Angle and torque passed the same "
    "Gaussian low-pass filter (standard deviation 40 Hz, or a tenth of the sampling rate if that "
    "is less){sticking}."
)
_STICKING: Final = ", and samples in which friction may have stopped the motion were excluded"


def estimation_sentences(analysis: StudyAnalysis) -> list[str]:
    """Describe how responses were calculated and fitted."""
    used = used_methods(analysis)
    others = [m for m in used if m != FULL_RECORD]
    sentences = []
    if FULL_RECORD in used:
        sentences.append(_whole_trials(analysis))
        if others:
            sentences.append(
                f"Other cases were estimated by the method “{method_name(others[0])}”."
            )
    if used != [FULL_RECORD]:
        sentences += _response_sentences(analysis, others[0] if others else "")
    return sentences


def interval_sentences(analysis: StudyAnalysis) -> list[str]:
    """Describe level and calculation of the intervals, and means over participants."""
    settings, used = analysis.settings, set(used_methods(analysis))
    level = f"{format_exact(100 * settings.get('ci_level', 0.95))} %"
    methods = interval_methods(analysis)
    words = subjects(analysis)
    sentences = []
    if methods:
        text = "; ".join(methods)
        cited = [k for k in ("bootstrap", "sandwich", "jackknife") if k in text]
        sentences.append(
            f"{level} intervals of each {words.one}: {' '.join([text, *map(cite, cited)])}."
        )
    without = {FULL_RECORD, *WITH_POSTERIOR}
    resampled = used - without and any("bootstrap" in text for text in methods)
    if settings.get("resamples") and resampled:
        seed = f", seed {settings['seed']}" if settings.get("seed") is not None else ""
        sentences.append(f"Number of resamples: {settings['resamples']}{seed}.")
        if used & set(_WIDENED):
            sentences.append("Deviations of the pulses were widened to Student's t.")
    if used & WITH_POSTERIOR:
        sentences.append(decision_sentence(analysis))
    if any(m.value is not None for m in analysis.population):
        sentences.append(
            f"Means over {words.many} have {mean_interval(analysis, level=f'{level} ')}. "
            f"{mean_over_people_note(analysis)}"
        )
    return sentences


def _whole_trials(analysis: StudyAnalysis) -> str:
    cells = [c for c in analysis.cells if c.method == FULL_RECORD and c.nuisance]
    sliding = sum(any(p.name == "coulomb_friction" for p in c.nuisance) for c in cells)
    some = "" if sliding == len(cells) else f" (in {sliding} of {len(cells)} cases)"
    friction = f"a constant friction torque against the motion{some} and " if sliding else ""
    lag = "a lag (a delay, a first-order filter or both)"
    if cells and lag_is_calibrated(analysis):
        lag = "a delay with the calibration as prior"
    return _WHOLE_TRIALS.format(
        model=cite("dissertation"),
        scores=cite("corrected_scores"),
        friction=friction,
        lag=lag,
        sticking=_STICKING if sliding else "",
    )


def _response_sentences(analysis: StudyAnalysis, method: str) -> list[str]:
    """Describe window, model, filter and baseline of the responses to pulses."""
    settings = analysis.settings
    if method in WITH_POSTERIOR:
        fitted = bayesian_sentences(analysis, float(settings.get("window_s") or 0.1))
        return [_sampling(analysis), _PREDICTED, *fitted]
    cells = [c for c in analysis.cells if c.method == method]
    baseline = next((c.baseline for c in cells if c.baseline), str(settings.get("baseline") or ""))
    if method not in _FITS:
        name = method_name(method)
        return [
            f"This version of jointz does not describe the method “{name}”.",
            *_baseline_sentences(analysis, baseline),
        ]
    window_s = settings.get("window_s")
    window = (
        f", over {format_exact(1e3 * window_s)} ms from {window_start(analysis)}"
        if window_s
        else ""
    )
    sentences = [
        "The torque response was modelled as K·angle + B·velocity + J·acceleration "
        f"{cite('dissertation')}{window}{_fit(method, bounded=settings.get('kind') != 'bench')}."
    ]
    if method == "dissertation" and baseline == "unperturbed_mean":
        sentences.append("The mean over the bootstrap resamples is reported.")
    return [
        *sentences,
        *_filter_sentences(settings),
        *_baseline_sentences(analysis, baseline),
    ]


def _fit(method: str, *, bounded: bool) -> str:
    """Describe the fit; only on a bench may parameters be negative."""
    bounds = "with K, B and J not negative" if bounded else "without bounds"
    return f", {_FITS[method].format(bounds=bounds, instruments=cite('instruments'))}"


def _filter_sentences(settings: Mapping[str, Any]) -> list[str]:
    cutoff_hz = settings.get("cutoff_hz")
    if not cutoff_hz:
        return []
    cutoff = f"{format_exact(cutoff_hz)} Hz"
    return [f"Angle and torque passed the same low-pass filter ({cutoff}), {_FILTER}."]


def _baseline_sentences(analysis: StudyAnalysis, baseline: str) -> list[str]:
    if not baseline or baseline == "none":
        return []
    if baseline == PREDICTED:
        return [_PREDICTED]
    if baseline == "unperturbed_mean" and subjects(analysis).bench:
        start = "the beginning of the cycle" if analysis.strides else "the beginning"
        return [_UNPERTURBED_TRIAL.format(start=start)]
    return [_BASELINES.get(baseline, f"The baseline “{baseline}” was subtracted.")]


_PREDICTED: Final = (
    "The unperturbed motion of each pulse was predicted from the half second before its onset and "
    f"the stride times by ridge regression {cite('ridge')} and subtracted. The regression was "
    "trained at virtual onsets in the unperturbed strides of the same recording, and, if it had "
    f"fewer than {FEWEST_STRIDES}, of the unperturbed recordings too."
)
_SAME_RATE: Final = 1e-3


def _sampling(analysis: StudyAnalysis) -> str:
    """Describe averaging and resampling before the fit, as far as the rates show."""
    used = response_rates(analysis)
    pairs = [
        (rate, used[person])
        for (person, _), rate in recorded_rates(analysis).items()
        if person in used
    ]
    if not pairs:
        return "Angle and torque were used without a filter."
    blocks = sorted({max(1, round(rate / rate_used)) for rate, rate_used in pairs})
    moved = any(
        abs(rate / max(1, round(rate / rate_used)) / rate_used - 1.0) >= _SAME_RATE
        for rate, rate_used in pairs
    )
    resampled = ", resampled to one rate by linear interpolation" if moved else ""
    if blocks == [1]:
        return f"Angle and torque were used as sampled{resampled}, without a filter."
    return (
        f"Angle and torque were averaged over {format_span(blocks, str)} samples each{resampled}, "
        "and not filtered otherwise."
    )
