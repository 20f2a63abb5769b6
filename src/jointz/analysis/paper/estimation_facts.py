"""Facts about methods and intervals of the estimates."""

from typing import Any, Final

from jointz.analysis.paper.signal_facts import lag_is_calibrated, recorded_rates, response_rates
from jointz.analysis.summary import interval_methods, mean_interval, mean_over_people_note
from jointz.core.method_names import FULL_RECORD, WITH_POSTERIOR
from jointz.report.pulse_words import window_start
from jointz.report.wording import format_exact, format_span
from jointz.results.study_analysis import StudyAnalysis

#: Methods whose bootstrap deviations are widened to Student's t.
_WIDENED: Final = ("least_squares", "instrumental_variable")
_SAME_RATE: Final = 1e-3


def method_facts(analysis: StudyAnalysis) -> dict[str, Any]:
    """Return the facts about the methods of the estimates and what they were applied to."""
    used = _used_methods(analysis)
    others = [m for m in used if m != FULL_RECORD]
    name = others[0] if others else ""
    trials = [c for c in analysis.cells if c.method == FULL_RECORD and c.nuisance]
    baselines = (c.baseline for c in analysis.cells if c.method == name and c.baseline)
    return {
        "name": name,  # of the method of pulses
        "bayesian": name in WITH_POSTERIOR,
        "posterior": not WITH_POSTERIOR.isdisjoint(used),
        "whole_trials": FULL_RECORD in used,
        "pulses": used != [FULL_RECORD],
        "baseline": next(baselines, str(analysis.settings.get("baseline") or "")),
        "window_start": window_start(analysis),
        "cases": len(trials),
        "sliding": sum(any(p.name == "coulomb_friction" for p in c.nuisance) for c in trials),
        "lag_calibrated": bool(trials) and lag_is_calibrated(analysis),
        **_sampling_facts(analysis),
    }


def interval_facts(analysis: StudyAnalysis) -> dict[str, Any]:
    """Return the facts about level and calculation of the intervals, and means."""
    settings, used = analysis.settings, set(_used_methods(analysis))
    level = format_exact(100 * settings.get("ci_level", 0.95))
    methods = interval_methods(analysis)
    resampled = used - {FULL_RECORD, *WITH_POSTERIOR} and any("bootstrap" in m for m in methods)
    return {
        "level": level,
        "methods": "; ".join(methods),
        "resamples": settings.get("resamples") if resampled else None,
        "widened": not used.isdisjoint(_WIDENED),
        "means": any(m.value is not None for m in analysis.population),
        "mean": mean_interval(analysis, level=f"{level} % "),
        "note": mean_over_people_note(analysis),
    }


def _used_methods(analysis: StudyAnalysis) -> list[str]:
    """Return the methods of the estimates; a case may have needed another than the chosen one."""
    used = list(dict.fromkeys(c.method for c in analysis.cells if c.method))
    chosen = analysis.settings.get("method")
    return used or ([str(chosen)] if chosen else [])


def _sampling_facts(analysis: StudyAnalysis) -> dict[str, Any]:
    """Return averaging and resampling before the fit, as far as the rates show."""
    used = response_rates(analysis)
    pairs = [
        (rate, used[person])
        for (person, _), rate in recorded_rates(analysis).items()
        if person in used
    ]
    blocks = [max(1, round(rate / rate_used)) for rate, rate_used in pairs]
    ratios = [rate / block / own for (rate, own), block in zip(pairs, blocks, strict=True)]
    return {
        "blocks": format_span(blocks, str) if blocks else "",
        "resampled": any(abs(ratio - 1.0) >= _SAME_RATE for ratio in ratios),
    }
