"""What a methods section says of estimation and intervals."""

from collections.abc import Mapping
from typing import Any, Final

from jointz.core.analysis import StudyAnalysis
from jointz.report.citations import cite
from jointz.report.prose import interval_methods, mean_interval
from jointz.report.subjects import subjects
from jointz.report.wording import method_name

#: Method that explains all timing points of a walker together.
RECOMMENDED: Final = "recommended"
#: Method that uses whole trials, and what it does.
FULL_RECORD: Final = "full_record"
#: What the dissertation took where its text says no more than "Butterworth".
_FILTER: Final = "a fourth-order Butterworth filter run forward and backward"

_BASELINES: Final[Mapping[str, str]] = {
    "unperturbed_mean": (
        "The mean unperturbed cycle, aligned in time at heel strike, was subtracted from each "
        "response."
    ),
    "pre_pulse": "The level before each pulse was subtracted from its response.",
    "matched_strides": (
        "The mean of the unperturbed strides most like the perturbed one was subtracted from each "
        "response."
    ),
    "predicted": (
        "The unperturbed motion and torque, predicted from what went before each pulse, were "
        "subtracted from its response."
    ),
}

_BOUNDED: Final = "fitted to the average response by least squares with K, B and J not negative"
_FITS: Final[Mapping[str, str]] = {
    **dict.fromkeys(("dissertation", "pre_pulse", "matched_strides", "pilot"), _BOUNDED),
    "least_squares": "fitted to the average response by least squares without bounds",
    "instrumental_variable": (
        "fitted to the average response with the commanded torque as instrument, K, B and J not "
        "negative"
    ),
    "output_error": "its angle simulated from the measured torque and fitted to the average angle",
    "errors_in_variables": (
        "fitted to the average response with errors of both signals and a lag between them"
    ),
    "weak_form": (
        "fitted to the average response in its weak form, which takes no derivatives, K, B and J "
        "not negative"
    ),
}
_AS_SAMPLED: Final = ("output_error", "errors_in_variables", "weak_form")

_WHOLE_TRIALS: Final = (
    "Whole trials were used: nothing was cut out and no unperturbed motion subtracted. The torque "
    "was modelled as K·angle + B·velocity + J·acceleration {model} with a friction torque of "
    "constant size against the motion and an offset for each trial, recorded with a lag (a delay, "
    "a first-order filter or both). All were fitted together by least squares, the noise of the "
    "angle taken out of the sums of squares {scores}. Angle and torque passed the same Gaussian "
    "low-pass (standard deviation 40 Hz, or a tenth of the sampling rate where that is less), and "
    "samples where friction may have held it still were left out."
)

_PREDICTED: Final = (
    "Angle and torque were used as sampled, without a filter. What each pulse would have met "
    "without it was predicted from the half second before its onset and the stride times by ridge "
    "regression {ridge}, learned at virtual onsets in the unperturbed strides of the same "
    "recording{strides}, and subtracted. The average angle of each timing point{window} was fitted "
    "as that of a joint with stiffness, damping and inertia {model} that the torque drives, seen "
    "through a sensor with a delay and a first-order lag or behind tissue that resonates. All "
    "timing points of a participant were fitted together, weighted with the covariance of what the "
    "prediction misses at virtual onsets; stiffness and damping may change inside the window and "
    "inertia may differ between timing points. Models were weighted by their evidence (Laplace's "
    "approximation) {evidence}."
)
_DECIDED: Final = (
    "No value is given (undecided) where its interval reaches further than half the value. Where "
    "zero is in the interval and the upper limit is small, only that limit is given {unified}."
)


def estimation_sentences(analysis: StudyAnalysis) -> list[str]:
    """Say how responses were made and fitted.

    Parameters
    ----------
    analysis : StudyAnalysis
        The analysis.
    """
    used = used_methods(analysis)
    others = [m for m in used if m != FULL_RECORD]
    sentences = []
    if FULL_RECORD in used:
        sentences.append(
            _WHOLE_TRIALS.format(model=cite("dissertation"), scores=cite("corrected_scores"))
        )
        if others:
            sentences.append(
                f"Other cases were estimated by the method “{method_name(others[0])}”."
            )
    if used != [FULL_RECORD]:
        sentences += _response_sentences(analysis, others[0] if others else "")
    return sentences


def interval_sentences(analysis: StudyAnalysis) -> list[str]:
    """Say how intervals were made, at which level, and what is no value.

    Parameters
    ----------
    analysis : StudyAnalysis
        The analysis.
    """
    settings, used = analysis.settings, set(used_methods(analysis))
    level = f"{100 * settings.get('ci_level', 0.95):g} %"
    made = interval_methods(analysis)
    one = subjects(analysis).one
    sentences = [f"{level} intervals of each {one}: {'; '.join(made)}{_basis(made)}."]
    if not made:
        sentences = []
    if settings.get("resamples") and used - {FULL_RECORD, RECOMMENDED}:
        sentences.append(f"Number of resamples: {settings['resamples']}{_seed(settings)}.")
    if RECOMMENDED in used:
        sentences.append(_DECIDED.format(unified=cite("unified")))
    if any(m.value is not None for m in analysis.population):
        sentences.append(
            f"Means over participants carry {mean_interval(analysis, level=f'{level} ')}."
        )
    return sentences


def used_methods(analysis: StudyAnalysis) -> list[str]:
    """Return the methods that the estimates were made by: a case may have needed another.

    Parameters
    ----------
    analysis : StudyAnalysis
        The analysis.
    """
    own = list(dict.fromkeys(c.method for c in analysis.cells if c.method))
    chosen = analysis.settings.get("method")
    return own or ([str(chosen)] if chosen else [])


def _response_sentences(analysis: StudyAnalysis, method: str) -> list[str]:
    """Say how responses to pulses were cut, filtered and fitted."""
    settings = analysis.settings
    if method == RECOMMENDED:
        cites = {key: cite(key) for key in ("ridge", "evidence")}
        window = f"{_window(settings)}," if settings.get("window_s") else ""
        model, strides = cite("dissertation"), _learned_from(analysis)
        return [_PREDICTED.format(window=window, strides=strides, model=model, **cites)]
    fit = f", {_FITS[method]}" if method in _FITS else ""
    sentences = [
        "The torque response was modelled as K·angle + B·velocity + J·acceleration "
        f"{cite('dissertation')}{_window(settings)}{fit}."
    ]
    return [*sentences, *_filter_sentences(settings, method), *_baseline_sentences(settings)]


def _filter_sentences(settings: Mapping[str, Any], method: str) -> list[str]:
    cutoff_hz = settings.get("cutoff_hz")
    if not cutoff_hz:
        return []
    if method in _AS_SAMPLED:
        return [
            "Angle and torque were fitted as sampled; the variance accounted for is that of the "
            f"response after a low-pass filter ({cutoff_hz:g} Hz)."
        ]
    return [f"Angle and torque passed the same low-pass filter ({cutoff_hz:g} Hz), {_FILTER}."]


def _baseline_sentences(settings: Mapping[str, Any]) -> list[str]:
    baseline = settings.get("baseline")
    if not baseline or baseline == "none":
        return []
    return [_BASELINES.get(baseline, f"The baseline “{baseline}” was subtracted.")]


def _window(settings: Mapping[str, Any]) -> str:
    window_s = settings.get("window_s")
    return f", over {1000 * window_s:g} ms from the commanded onset" if window_s else ""


def _learned_from(analysis: StudyAnalysis) -> str:
    """Say from how many strides the prediction was learned."""
    counts = [m.n_strides for m in analysis.models]
    if not counts:
        return ""
    several = f" to {max(counts)}" if max(counts) > min(counts) else ""
    return f" ({min(counts)}{several} a participant)"


def _basis(made: list[str]) -> str:
    """Return the citation of how intervals were made."""
    text = " ".join(made)
    keys = [k for k, word in (("bootstrap", "bootstrap"), ("sandwich", "sandwich")) if word in text]
    return "".join(f" {cite(key)}" for key in keys)


def _seed(settings: Mapping[str, Any]) -> str:
    return f", seed {settings['seed']}" if settings.get("seed") is not None else ""
