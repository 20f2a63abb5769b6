"""Section of the report that sets estimates beside published values."""

from functools import partial
from statistics import fmean, stdev
from typing import Any, Final

from jointz.analysis.classical import classical_analysis
from jointz.core.channels import axis_label
from jointz.core.gait_phases import TIMING_POINTS
from jointz.reference import chapter4
from jointz.report.subjects import subjects
from jointz.report.wording import (
    DASH,
    format_estimate,
    format_interval,
    format_number,
    format_span,
)
from jointz.results.study_analysis import StudyAnalysis

_COMPARED: Final = ("stiffness_per_mass", "damping_per_mass", "inertia")


#: A mean over people of this study, or the estimate of the only one: value, lower limit, text.
_Ours = tuple[float, float | None, str]


def published_section(analysis: StudyAnalysis) -> dict[str, Any] | None:
    """Return a table of both, None if there are no published values of this joint."""
    values = {name: _values(_as_published(analysis), name) for name in _COMPARED}
    names = [name for name in _COMPARED if values[name]]
    points = [p for p in TIMING_POINTS if any(p in values[name] for name in names)]
    if not points:
        return None
    return {
        "heads": [axis_label(name) for name in names],
        "inertia": "inertia" in names,
        "classical": classical_analysis(analysis) is not None,
        "rows": [
            {"name": p, "cells": [_cell(name, p, values[name].get(p)) for name in names]}
            for p in points
        ],
    }


def published_clause(analysis: StudyAnalysis) -> str:
    """Return a sentence that compares the stiffness with the published means, or ""."""
    ours = _values(_as_published(analysis), "stiffness_per_mass")
    ratios = {
        point: value / _published("stiffness_per_mass", point)[0]
        for point, (value, low, _) in ours.items()
        if low is not None and low > 0.0  # one that may be zero has no ratio
    }
    if not ratios:
        return ""
    span = format_span(ratios.values(), partial(format_number, digits=2))
    kind = "Classical stiffness" if classical_analysis(analysis) else "Stiffness"
    return (
        f"{kind} per body mass is {span} times the mean of the dissertation's ten participants "
        f"({', '.join(ratios)})."
    )


def _as_published(analysis: StudyAnalysis) -> StudyAnalysis:
    """Return the values that can be compared: the published ones are classical."""
    return classical_analysis(analysis) or analysis


def _values(analysis: StudyAnalysis, name: str) -> dict[str, _Ours]:
    """Return the values of this study by timing point of the published tables."""
    if subjects(analysis).bench or analysis.settings.get("joint") != "knee":
        return {}
    means = [m for m in analysis.population if m.parameter == name and m.n_participants > 1]
    if means:
        return {
            m.timing_point: (m.value, m.ci_low, format_interval(m.value, m.ci_low, m.ci_high))
            for m in means
            if m.value is not None and m.timing_point in TIMING_POINTS
        }
    if len({c.label for c in analysis.cells}) != 1:
        return {}
    return {
        c.timing_point: (p.value, p.ci_low, format_estimate(p))
        for c in analysis.cells
        if c.timing_point in TIMING_POINTS
        and (p := c.parameter(name)) is not None
        and p.status == "ok"
        and p.value is not None
    }


def _published(name: str, point: str) -> tuple[float, float]:
    """Return mean and standard deviation over the dissertation's participants."""
    row = chapter4.TABLES[name][point]
    values = [row[subject].value for subject in chapter4.SUBJECTS]
    return fmean(values), stdev(values)


def _cell(name: str, point: str, ours: _Ours | None) -> dict[str, str]:
    mean, sd = _published(name, point)
    return {
        "ours": DASH if ours is None else ours[2],
        "published": f"{format_number(mean)} ± {format_number(sd, like=mean)}",
    }
