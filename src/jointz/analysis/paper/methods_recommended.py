"""Sentences of a methods section about the recommended method in walking."""

from typing import Final

import numpy as np

from jointz.analysis.paper.citations import cite
from jointz.analysis.paper.methods_data import (
    recorded_rates,
    response_rates,
    torque_is_from_current,
)
from jointz.identify.recommended.reflex_hypothesis import LATENCIES_S
from jointz.identify.recommended.response_model import Priors
from jointz.identify.recommended.unperturbed_prediction import FEWEST_STRIDES
from jointz.report.wording import format_exact, format_integer, format_span
from jointz.results.study_analysis import StudyAnalysis

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


def recommended_sentences(analysis: StudyAnalysis) -> list[str]:
    """Describe prediction, model and priors of the recommended method."""
    latencies = " or ".join(format_exact(1e3 * s) for s in LATENCIES_S)
    return [
        _sampling(analysis),
        _PREDICTED.format(
            ridge=cite("ridge"), fewest=FEWEST_STRIDES, strides=_learned_from(analysis)
        ),
        _FITTED.format(window=_window(analysis), model=cite("dissertation")),
        _HYPOTHESES.format(latencies=latencies, reflex=cite("reflex"), evidence=cite("evidence")),
        _priors(analysis),
    ]


def decision_sentence() -> str:
    """Describe when the recommended method gives no value, or only a limit."""
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
