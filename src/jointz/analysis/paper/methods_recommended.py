"""What a methods section says of the recommended method in walking."""

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
from jointz.report.wording import format_exact, format_integer
from jointz.results.study_analysis import StudyAnalysis

_PREDICTED: Final = (
    "What each pulse would have met without it was predicted from the half second before its "
    "onset and the stride times by ridge regression {ridge}, learned at virtual onsets in the "
    "unperturbed strides of the same recording, or, where it has fewer than {fewest}, of the "
    "unperturbed recordings too{strides}, and subtracted."
)
_FITTED: Final = (
    "The average angle of each timing point{window} was fitted as that of a joint with stiffness, "
    "damping and inertia {model} that the torque drives, seen through a sensor with a delay and a "
    "first-order lag or behind tissue that resonates. All timing points of a participant were "
    "fitted together, weighted with the covariance of what the prediction misses at virtual onsets."
)
_HYPOTHESES: Final = (
    "Hypotheses were that such tissue resonates or not; that inertia is one for all timing points "
    "or differs; that stiffness and damping hardly change inside the window or, with four timing "
    "points or more, change as the curve through them does; and that the muscles answer with a "
    "reflex {latencies} ms after the stretch {reflex} or not. Each counts by its evidence "
    "(Laplace's approximation) {evidence}."
)
_DECIDED: Final = (
    "No value is given (undecided) where its interval reaches further above it than half of it; "
    "where zero is in the interval and the upper limit is no small one, or comes by more than a "
    "quarter of its variance from the priors of K, B and J; and for K and B where K seems to "
    "change steeply inside the window. Where zero is in the interval and the upper limit is small, "
    "only that limit is given {unified}."
)
_SAME_RATE: Final = 1e-3


def recommended_sentences(analysis: StudyAnalysis) -> list[str]:
    """Say how the recommended method predicted and fitted."""
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
    """Say when the recommended method gives no value, or a limit only."""
    return _DECIDED.format(unified=cite("unified"))


def _sampling(analysis: StudyAnalysis) -> str:
    """Say what became of the samples before the fit, as far as the rates tell."""
    wanted = response_rates(analysis)
    pairs = [
        (rate, wanted[person])
        for (person, _), rate in recorded_rates(analysis).items()
        if person in wanted
    ]
    if not pairs:
        return "Angle and torque were used without a filter."
    blocks = sorted({max(1, round(rate / own)) for rate, own in pairs})
    moved = any(
        abs(rate / max(1, round(rate / own)) / own - 1.0) >= _SAME_RATE for rate, own in pairs
    )
    brought = ", brought to one rate by straight lines between samples" if moved else ""
    if blocks == [1]:
        return f"Angle and torque were used as sampled{brought}, without a filter."
    several = f" to {blocks[-1]}" if len(blocks) > 1 else ""
    return (
        f"Angle and torque were averaged over {blocks[0]}{several} samples each{brought}, and not "
        "filtered otherwise."
    )


def _window(analysis: StudyAnalysis) -> str:
    window_s = analysis.settings.get("window_s")
    if not window_s:
        return ""
    return f", over {format_exact(1e3 * window_s)} ms from the commanded onset and the lag,"


def _learned_from(analysis: StudyAnalysis) -> str:
    """Say from how many strides the prediction was learned."""
    counts = [m.n_strides for m in analysis.models]
    if not counts:
        return ""
    several = f" to {format_integer(max(counts))}" if max(counts) > min(counts) else ""
    return f" ({format_integer(min(counts))}{several} a participant)"


def _priors(analysis: StudyAnalysis) -> str:
    """Say what was taken for likely before the data."""
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
    friction = [f"true over stated friction {_pair(p.friction_gain)}"]
    unknown = [
        f"lag of the angle {_pair(p.lag_s, 1e3)} ms",
        *(friction if torque_is_from_current(analysis) else ()),
        f"angle shown per torque {_pair(p.cross_talk)} rad/(N·m)",
        f"a resonance {resonance[0]} Hz within a factor of {resonance[1]}",
    ]
    return (
        f"Priors, normal, mean ± SD: {'; '.join(always)}. Where nothing was calibrated: "
        f"{'; '.join(unknown)}."
    )


def _pair(prior: tuple[float, float], factor: float = 1.0) -> str:
    return " ± ".join(format_exact(factor * x) for x in prior)
