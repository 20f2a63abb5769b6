"""Sentences of a methods section about estimation and intervals."""

from collections.abc import Mapping
from typing import Any, Final

import numpy as np

from jointz.analysis.paper.citations import cite
from jointz.analysis.paper.methods_calibration import lag_is_calibrated
from jointz.analysis.paper.methods_data import (
    recorded_rates,
    response_rates,
    torque_is_from_current,
)
from jointz.analysis.paper.methods_strapped import strapped_decision, strapped_sentences
from jointz.analysis.paper.methods_used import FULL_RECORD, RIGID, STRAPPED, used_methods
from jointz.analysis.summary import interval_methods, mean_interval, mean_over_people_note
from jointz.identify.prediction.unperturbed_prediction import FEWEST_STRIDES
from jointz.identify.rigid.reflex_hypothesis import LATENCIES_S
from jointz.identify.rigid.response_model import Priors
from jointz.report.pulse_words import window_start
from jointz.report.subjects import subjects
from jointz.report.wording import format_exact, format_integer, format_span, method_name
from jointz.results.study_analysis import StudyAnalysis

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
    without = {FULL_RECORD, RIGID, STRAPPED}
    resampled = used - without and any("bootstrap" in text for text in methods)
    if settings.get("resamples") and resampled:
        seed = f", seed {settings['seed']}" if settings.get("seed") is not None else ""
        sentences.append(f"Number of resamples: {settings['resamples']}{seed}.")
        if used & set(_WIDENED):
            sentences.append("Deviations of the pulses were widened to Student's t.")
    if RIGID in used:
        sentences.append(decision_sentence())
    if STRAPPED in used:
        sentences.append(strapped_decision(analysis))
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
    if method == RIGID:
        return rigid_sentences(analysis)
    if method == STRAPPED:
        fitted = strapped_sentences(analysis, float(settings.get("window_s") or 0.1))
        return [_sampling(analysis), _prediction(analysis), *fitted]
    cells = [c for c in analysis.cells if c.method == method]
    window_s = settings.get("window_s")
    window = (
        f", over {format_exact(1e3 * window_s)} ms from {window_start(analysis)}"
        if window_s
        else ""
    )
    baseline = next((c.baseline for c in cells if c.baseline), str(settings.get("baseline") or ""))
    sentences = [
        "The torque response was modelled as K·angle + B·velocity + J·acceleration "
        f"{cite('dissertation')}{window}{_fit(method, bounded=settings.get('kind') != 'bench')}."
    ]
    if method == "dissertation" and baseline == "unperturbed_mean":
        sentences.append("The mean over the bootstrap resamples is reported.")
    return [
        *sentences,
        *_filter_sentences(settings, method),
        *_baseline_sentences(analysis, baseline),
    ]


def _fit(method: str, *, bounded: bool) -> str:
    """Describe the fit; only on a bench may parameters be negative."""
    if method not in _FITS:
        return f", by the method {method}, which this version of jointz does not describe"
    bounds = "with K, B and J not negative" if bounded else "without bounds"
    return f", {_FITS[method].format(bounds=bounds, instruments=cite('instruments'))}"


def _filter_sentences(settings: Mapping[str, Any], method: str) -> list[str]:
    cutoff_hz = settings.get("cutoff_hz")
    if not cutoff_hz or method not in _FITS:  # another method need not have filtered
        return []
    cutoff = f"{format_exact(cutoff_hz)} Hz"
    return [f"Angle and torque passed the same low-pass filter ({cutoff}), {_FILTER}."]


def _baseline_sentences(analysis: StudyAnalysis, baseline: str) -> list[str]:
    if not baseline or baseline == "none":
        return []
    if baseline == "unperturbed_mean" and subjects(analysis).bench:
        start = "the beginning of the cycle" if analysis.strides else "the beginning"
        return [_UNPERTURBED_TRIAL.format(start=start)]
    return [_BASELINES.get(baseline, f"The baseline “{baseline}” was subtracted.")]


_PREDICTED: Final = (
    "The unperturbed motion of each pulse was predicted from the half second before its onset and "
    "the stride times by ridge regression {ridge} and subtracted. The regression was trained at "
    "virtual onsets in the unperturbed strides of the same recording, and, if it had fewer than "
    "{fewest}, of the unperturbed recordings too{strides}."
)
_FITTED: Final = (
    "The average angle of each timing point{window} was modelled as that of a joint with "
    "stiffness, damping and inertia {model}, driven by the torque and observed by a sensor with a "
    "delay and a first-order lag or through resonating soft tissue. All timing points of a "
    "participant were fitted together, weighted with the covariance of the prediction errors at "
    "virtual onsets."
)
_HYPOTHESES: Final = (
    "Alternative hypotheses were that such tissue resonates or not; that inertia is one for all "
    "timing points or differs; that stiffness and damping hardly change inside the window or, with "
    "four timing points or more, change as the curve through them does; and that the muscles "
    "respond with a reflex {latencies} ms after the stretch {reflex} or not. Each hypothesis is "
    "weighted by its evidence (Laplace's approximation) {evidence}."
)
_DECIDED: Final = (
    "A parameter is undecided, without a value, if the upper end of its interval exceeds it by "
    "more than half; if zero is in the interval and the upper limit is too large to be informative "
    "or owes more than a quarter of its variance to the priors of K, B and J; and, for K and B, if "
    "K seems to change steeply inside the window. If zero is in the interval and the upper limit "
    "is small, only this limit is given {unified}."
)
_SAME_RATE: Final = 1e-3


def rigid_sentences(analysis: StudyAnalysis) -> list[str]:
    """Describe prediction, model and priors of the method ``rigid``."""
    latencies = " or ".join(format_exact(1e3 * s) for s in LATENCIES_S)
    return [
        _sampling(analysis),
        _prediction(analysis),
        _FITTED.format(window=_window(analysis), model=cite("dissertation")),
        _HYPOTHESES.format(latencies=latencies, reflex=cite("reflex"), evidence=cite("evidence")),
        _priors(analysis),
    ]


def _prediction(analysis: StudyAnalysis) -> str:
    """Describe the prediction of the unperturbed motion."""
    strides = _learned_from(analysis)
    return _PREDICTED.format(ridge=cite("ridge"), fewest=FEWEST_STRIDES, strides=strides)


def decision_sentence() -> str:
    """Describe when the method ``rigid`` gives no value, or only a limit."""
    return _DECIDED.format(unified=cite("unified"))


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


def _window(analysis: StudyAnalysis) -> str:
    window_s = analysis.settings.get("window_s")
    if not window_s:
        return ""
    return f", over {format_exact(1e3 * window_s)} ms after the commanded onset and the lag,"


def _learned_from(analysis: StudyAnalysis) -> str:
    """Return the number of strides that the prediction was trained on."""
    counts = [m.n_strides for m in analysis.models]
    return f" ({format_span(counts, format_integer)} for each participant)" if counts else ""


def _priors(analysis: StudyAnalysis) -> str:
    """Describe the priors."""
    p = Priors()
    inertia, resonance = (
        (format_exact(float(np.exp(mean))), f"{np.exp(sd):.1f}")
        for mean, sd in (p.log_inertia, p.log_resonance)
    )
    always = [
        f"K {_pair(p.stiffness)} N·m/rad",
        f"B {_pair(p.damping)} N·m·s/rad",
        f"J {inertia[0]} kg·m² within a factor of {inertia[1]}",
        f"pure delay in the lag of the angle {_pair(p.delay_s, 1e3)} ms",
        f"damping of a resonance {_pair(p.resonance_damping)}",
    ]
    friction = [f"actual over stated friction {_pair(p.friction_gain)}"]
    unknown = [
        f"lag of the angle {_pair(p.lag_s, 1e3)} ms",
        *(friction if torque_is_from_current(analysis) else ()),
        f"change of the angle reading per torque {_pair(p.cross_talk)} rad/(N·m)",
        f"a resonance {resonance[0]} Hz within a factor of {resonance[1]}",
    ]
    return (
        f"Priors, normal, mean ± SD: {'; '.join(always)}. Without a calibration also: "
        f"{'; '.join(unknown)}."
    )


def _pair(prior: tuple[float, float], factor: float = 1.0) -> str:
    return " ± ".join(format_exact(factor * x) for x in prior)
