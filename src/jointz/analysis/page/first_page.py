"""First page of the report: what was done, the values, what they mean, what to do next."""

from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from functools import partial
from typing import Any, Final

import numpy as np

from jointz.analysis.classical import cells_of_both, classical_analysis, classical_note
from jointz.analysis.page.next_measures import next_measures
from jointz.analysis.page.published_values import published_clause
from jointz.analysis.page.value_tables import (
    Row,
    cells_by_person,
    mean_rows,
    mean_text,
    people_means,
    short_status,
)
from jointz.analysis.page.withheld_values import HELD, is_held, withheld
from jointz.analysis.paper.citations import CITATIONS
from jointz.analysis.summary import SIMULATED, chosen_method, name_range, stiffness_extremes
from jointz.core.codes import Failure
from jointz.core.gait_phases import ALL_POINTS
from jointz.core.method_names import COUPLING_OF
from jointz.report.subjects import (
    calibrations,
    shown_parameters,
    study_spec,
    subjects,
)
from jointz.report.wording import (
    ABSOLUTE,
    AT_ONSET,
    DASH,
    PER_MASS,
    format_count,
    format_estimate,
    format_span,
    joined,
    parameter_name,
    point_name,
    status_meaning,
)
from jointz.results.estimates import CellEstimate, ParameterEstimate
from jointz.results.fit import SYMBOLS
from jointz.results.study_analysis import PopulationEstimate, StudyAnalysis
from jointz.results.study_counts import study_counts

#: More rows than these would push the rest of the first page off it.
_MOST_ROWS: Final = 12
_MOST_WARNINGS: Final = 2
#: So few missing values are named.
_MOST_NAMED: Final = 4
_COUPLINGS: Final = {
    "strap": "strapped to the leg",
    "rigid": "coupled rigidly to the bone",
}


def first_page(analysis: StudyAnalysis) -> Row:
    """Return what the first page shows besides title and figure."""
    warnings = [str(text) for text in analysis.statistics.get("warnings", ())]
    return {
        "study": _study(analysis),
        "planned": analysis.run.n_planned if analysis.run else 0,
        "counts": study_counts(analysis),
        "reasons": bool(analysis.pulses),  # without them, only the number of excluded is known
        "sizes": _sizes(analysis),
        "device": _device(analysis),
        "method": chosen_method(analysis),
        "simulated": SIMULATED if analysis.simulated else "",
        "warnings": [_first_sentence(text) for text in warnings[:_MOST_WARNINGS]],
        "more_warnings": max(0, len(warnings) - _MOST_WARNINGS),
        "table": _table(analysis),
        "said": _said(analysis),
        "meaning": _meaning(analysis),
        "next": next_measures(analysis),
        "cite": _citation(analysis),
    }


def _first_sentence(text: str) -> str:
    head, dot, rest = text.partition(". ")
    return f"{head}." if dot and rest else text


def _citation(analysis: StudyAnalysis) -> str:
    version = str(analysis.provenance.get("jointz") or "as in provenance.json")
    return CITATIONS["jointz"].full.replace("version as in the text", f"version {version}")


# --- what was done -------------------------------------------------------------------------------


def _study(analysis: StudyAnalysis) -> str:
    """Name participants, joint and timing points; "" for a study without participants."""
    people = list(dict.fromkeys(c.participant for c in analysis.cells))
    if not people:
        return ""
    words = subjects(analysis)
    points = {c.timing_point for c in analysis.cells if c.timing_point != ALL_POINTS}
    joint = None if words.loads else analysis.settings.get("joint")
    parts = [
        f"{words.counted(len(people))} ({name_range(people)})",
        str(joint) if joint else "",
        "walking" if not words.bench else "",
        format_count(len(points), words.point, words.points),
        _masses(analysis, people),
        _stride_times(analysis),
    ]
    return ", ".join(p for p in parts if p)


def _masses(analysis: StudyAnalysis, people: Sequence[str]) -> str:
    entries = study_spec(analysis).participants
    masses = [e.mass_kg for e in entries if e.id in people and e.mass_kg]
    if not masses or subjects(analysis).loads:
        return ""
    missing = len(people) - len(masses)
    some = f" ({missing} without)" if missing > 0 else ""
    doubtful = any(
        p.status == Failure.MASS_UNLIKELY.status for c in analysis.cells for p in c.parameters
    )
    doubt = " (doubtful: see the notes)" if doubtful else ""
    return f"body mass {format_span(masses, '{:.0f}'.format)} kg{some}{doubt}"


def _stride_times(analysis: StudyAnalysis) -> str:
    rows: Iterable[Mapping[str, Any]] = analysis.statistics.get("strides", ())
    means = [row["mean_s"] for row in rows if row.get("mean_s")]
    return f"stride time {format_span(means, '{:.2f}'.format)} s" if means else ""


def _sizes(analysis: StudyAnalysis) -> Row | None:
    """Return how large pulses and responses are, None if that is not known."""
    used = [abs(p.amplitude) for p in analysis.pulses if not p.code and p.amplitude]
    motions = [float(np.degrees(c.displacement_rad)) for c in analysis.cells if c.displacement_rad]
    if not used or not motions or study_spec(analysis).perturbations.source == "angle":
        return None
    return {"torques": format_span(used, "{:.3g}".format), "motion": f"{max(motions):.1f}"}


def _device(analysis: StudyAnalysis) -> Row | None:
    """Return the coupling of the device, as it was used and as the study states it."""
    if subjects(analysis).bench or not analysis.provenance.get("study"):
        return None
    stated, by_method = study_spec(analysis).coupling, COUPLING_OF.get(chosen_method(analysis))
    used = analysis.settings.get("coupling") or by_method or stated or "strap"
    return {
        "used": _COUPLINGS.get(used, used),
        "stated": _COUPLINGS[stated] if stated else "",
        "as_stated": stated == used,
    }


# --- table ---------------------------------------------------------------------------------------


def _table(analysis: StudyAnalysis) -> Row | None:
    """Return means over people, or estimates if no mean is available.

    Where a value is not available, the classical one stands beside it.
    """
    classical = classical_analysis(analysis)
    parameters = _table_parameters(analysis, classical)
    if not shown_parameters(cells_of_both(analysis, classical)):
        return None
    means = [m for m in people_means(analysis) if m.parameter in parameters]
    several = len({c.label for c in analysis.cells}) > 1
    level = f"{100 * analysis.settings.get('ci_level', 0.95):g} % interval"
    beside = people_means(classical)
    known = [m for m in means if m.value is not None]
    if not shown_parameters(analysis.cells):  # nobody has a value of his own
        known = [m for m in beside if m.value is not None and m.parameter in parameters]
    if known:
        numbers = format_span([m.n_participants for m in known], str)
        of_classical = {(m.timing_point, m.parameter): m for m in beside}
        write = partial(_mean, of_classical)
        rows = mean_rows(analysis.cells, means, parameters, write)
        note = f"Mean over {numbers} {subjects(analysis).many} [{level}]."
    else:
        others = {(c.label, c.timing_point): c for c in classical.cells} if classical else {}
        rows = [
            _cell_row(cell, others.get((cell.label, cell.timing_point)), parameters)
            for cells in cells_by_person(analysis.cells).values()
            for cell in cells
        ]
        note = f"Estimate [{level}]."
    return {
        "heads": parameters,
        "rows": rows[:_MOST_ROWS],
        "several": several and not known,
        "more": max(0, len(rows) - _MOST_ROWS),
        "note": note,
        "classical": classical_note(classical)
        if classical and any(c["classical"] for row in rows for c in row["cells"])
        else "",
    }


def _table_parameters(analysis: StudyAnalysis, classical: StudyAnalysis | None = None) -> list[str]:
    """Return K, B and J as the figure has them; those without any value too."""
    shown = shown_parameters(cells_of_both(analysis, classical))
    present = {p.name for c in analysis.cells for p in c.parameters}
    pairs = (*zip(PER_MASS, ABSOLUTE, strict=False), ABSOLUTE[2:])
    first = (next((n for n in (*shown, *names) if n in names), "") for names in pairs)
    return [
        name if name in present else names[-1]
        for name, names in zip(first, pairs, strict=True)
        if not present.isdisjoint(names)
    ]


def _cell_row(cell: CellEstimate, classical: CellEstimate | None, parameters: Sequence[str]) -> Row:
    cells = [
        _estimate(cell.parameter(name), classical.parameter(name) if classical else None)
        for name in parameters
    ]
    return {"who": cell.label, "name": point_name(cell.timing_point), "cells": cells}


def _mean(
    classical: Mapping[tuple[str, str], PopulationEstimate], mean: PopulationEstimate | None
) -> Row:
    if mean is None:
        return {"text": "", "classical": ""}
    beside = None if mean.value is not None else classical.get((mean.timing_point, mean.parameter))
    known = beside is not None and beside.value is not None
    return {"text": mean_text(mean), "classical": mean_text(beside) if beside and known else ""}


def _estimate(estimate: ParameterEstimate | None, classical: ParameterEstimate | None) -> Row:
    if estimate is None:
        return {"text": "", "classical": ""}
    text, beside = format_estimate(estimate), ""
    if text == DASH:
        text = short_status(estimate.status)
        beside = format_estimate(classical) if classical and classical.available else ""
    return {"text": text, "classical": beside}


# --- what can and what cannot be said ------------------------------------------------------------


def _said(analysis: StudyAnalysis) -> list[str]:
    estimates = [(c, p) for c in analysis.cells for p in c.parameters if p.name in ABSOLUTE]
    if not estimates:
        return []
    sentences = [_decided(analysis, estimates), _means(analysis), published_clause(analysis)]
    return [s for s in sentences if s]


def _decided(
    analysis: StudyAnalysis, estimates: Sequence[tuple[CellEstimate, ParameterEstimate]]
) -> str:
    counts = study_counts(analysis)
    kinds = {
        "as an upper limit only": counts.statuses["at_bound"],
        "undecided": counts.statuses["undecided"],
        "failed": counts.failed,
    }
    parts = ", ".join(f"{count} {words}" for words, count in kinds.items() if count)
    missing = [
        f"{SYMBOLS[p.name]} of {c.label} at {point_name(c.timing_point)}"
        for c, p in estimates
        if not p.available
    ]
    named = f" Missing: {', '.join(missing)}." if 0 < len(missing) <= _MOST_NAMED else ""
    verb = "is" if counts.available == 1 else "are"
    reason = _reason(analysis, estimates)
    return (
        f"{counts.available} of {counts.statuses.total()} values of K, B and J {verb} available"
        f"{f' ({parts})' if parts else ''}.{named}{f' {reason}' if reason else ''}"
    )


def _reason(
    analysis: StudyAnalysis, estimates: Sequence[tuple[CellEstimate, ParameterEstimate]]
) -> str:
    """Name the most frequent reason why values are missing; of one person with its numbers."""
    missing = [(cell, *_why_missing(analysis, cell, p)) for cell, p in estimates if not p.available]
    if not missing:
        return ""
    kind, count = Counter(kind for _, kind, _ in missing).most_common(1)[0]
    details = {(cell.label, detail) for cell, own, detail in missing if own == kind}
    label, detail = details.pop()
    text = kind if details or detail == kind else f"{label}: {detail}"
    return f"Most frequent reason ({count} of {study_counts(analysis).missing.total()}): {text}."


def _why_missing(
    analysis: StudyAnalysis, cell: CellEstimate, estimate: ParameterEstimate
) -> tuple[str, str]:
    """Return why a value is missing, by kind and in detail."""
    kind = "the interval is too wide"
    if estimate.status.startswith("failed"):
        kind = status_meaning(estimate.status)
    elif found := withheld(analysis, cell, estimate):
        return found.kind, found.reason
    elif is_held(analysis, cell, estimate):
        kind = HELD
    return kind, kind


def _means(analysis: StudyAnalysis) -> str:
    """Say at how many timing points each mean can be estimated."""
    means = study_counts(analysis).means if people_means(analysis) else {}
    counts = {n: means[n] for n in _table_parameters(analysis) if n in means}
    many = subjects(analysis).many
    if not counts:
        return ""
    if not any(decided for decided, _ in counts.values()):
        return f"No mean over {many} can be estimated."
    shown = [m for m in analysis.population if m.parameter in counts]
    extremes = " ".join(["", *stiffness_extremes(shown)])
    if all(decided == total for decided, total in counts.values()):
        return f"All means over {many} can be estimated.{extremes}"
    texts = [f"{parameter_name(n).lower()} {a} of {b}" for n, (a, b) in counts.items()]
    return f"Means over {many} available: {joined(texts)} timing points.{extremes}"


def _meaning(analysis: StudyAnalysis) -> Row | None:
    """Return which displacement, and which moment, K belongs to."""
    estimates = [p for c in analysis.cells for p in c.parameters]
    if subjects(analysis).loads or not any(p.available for p in estimates if p.name == "stiffness"):
        return None
    shifts = [np.degrees(c.displacement_rad) for c in analysis.cells if c.displacement_rad]
    return {
        "at_onset": any(p.name in AT_ONSET for p in estimates),
        "size": f" of up to {max(shifts):.1f}°" if shifts else "",
        # an inertia of the device was subtracted somewhere
        "device_known": any(c.intrinsic_inertia for c in calibrations(analysis)),
    }
