"""Printed summary of an analysis: one table, the notes that matter most, the report's place."""

from collections.abc import Sequence
from math import inf
from pathlib import Path
from statistics import median

from jointz.analysis.summary import counted_people
from jointz.report.subjects import subjects
from jointz.report.wording import ABSOLUTE, SYMBOLS, format_span, joined, onset_note
from jointz.results.estimates import CellEstimate, ParameterEstimate
from jointz.results.study_analysis import PopulationEstimate, StudyAnalysis
from jointz.results.study_counts import study_counts
from jointz.terminal.output import emit, emit_table

#: More are in the report.
_MOST_NOTES = 5
_LEFT_TO_FILES = ("_per_mass", "_onset")


def print_analysis(analysis: StudyAnalysis, report: Path) -> None:
    """Print an analysis for people."""
    for warning in analysis.statistics.get("warnings", []):
        emit(f"WARNING: {warning}")
    # Means of which none is decided say less than everybody's own values.
    if any(p.n_participants > 1 and p.value is not None for p in analysis.population):
        _print_means(analysis)
    else:
        _print_cells(analysis)
    emit(_counts(analysis).rstrip())
    _print_notes(analysis)
    emit(_availability(analysis))
    if planned := _planned(analysis):
        emit(planned)
    emit(f"Report: {report}")


def _print_means(analysis: StudyAnalysis) -> None:
    means = [p for p in analysis.population if _is_shown(p.parameter)]
    points = dict.fromkeys(p.timing_point for p in means)
    people = format_span([p.n_participants for p in means if p.value is not None], str)
    rows = {(p.timing_point, p.parameter): _written(p) for p in means}
    names = {p.parameter: p.unit for p in means}
    emit_table(
        [[point, *(rows.get((point, name), "-") for name in names)] for point in points],
        ["timing point", *(f"{name} {unit}" for name, unit in names.items())],
        title=f"Means over {people} people [95 % interval]",
    )


def _print_cells(analysis: StudyAnalysis) -> None:
    words = subjects(analysis)
    names = {
        p.name: p.unit for cell in analysis.cells for p in cell.parameters if _is_shown(p.name)
    }
    emit_table(
        [_cell_row(cell, list(names)) for cell in analysis.cells],
        [f"{words.one}, {words.point}", *(f"{name} {unit}" for name, unit in names.items())],
        title="Estimates [95 % interval]",
    )


def _cell_row(cell: CellEstimate, names: Sequence[str]) -> list[str]:
    found = [cell.parameter(name) for name in names]
    texts = ["-" if p is None else _written(p) for p in found]
    if len(set(texts)) == 1:  # one status of the whole cell is told once
        texts[1:] = [""] * (len(texts) - 1)
    return [f"{cell.label} {cell.timing_point}", *texts]


def _written(row: ParameterEstimate | PopulationEstimate) -> str:
    """Write value and interval; what is no plain value says its status."""
    if row.value is None or row.ci_low is None or row.ci_high is None:
        return row.status
    text = f"{row.value:.3g} [{row.ci_low:.3g}, {row.ci_high:.3g}]"
    return text if row.status == "ok" else f"{text} {row.status}"


def _is_shown(parameter: str) -> bool:
    return not parameter.endswith(_LEFT_TO_FILES)


def _counts(analysis: StudyAnalysis) -> str:
    """Count participants, cells and pulses, and name the methods."""
    methods = dict.fromkeys(c.method for c in analysis.cells)
    return (
        f"{counted_people(analysis)}, {len(analysis.cells)} cells, method "
        f"{' and '.join(methods) or '-'}; pulses: {study_counts(analysis).pulses_text}. "
        f"{analysis.changes_text}"
    )


def _print_notes(analysis: StudyAnalysis) -> None:
    notes = list(analysis.statistics.get("notes", []))
    if note := onset_note(p.name for c in analysis.cells for p in c.parameters):
        notes.append(note)
    for note in notes[:_MOST_NOTES]:
        emit(f"note: {note}")
    left = len(notes) - _MOST_NOTES
    if left > 0:
        emit(f"note: {left} more in the report.")


def _planned(analysis: StudyAnalysis) -> str:
    """Set the medians of the half-widths that a plan expected and that were reached beside."""
    parts = []
    for name, letter in zip(ABSOLUTE, SYMBOLS, strict=True):
        rows = [
            row
            for row in analysis.statistics.get("planned_half_widths", [])
            if row["parameter"] == name
        ]
        if rows:
            reached = median(r["reached_pct"] or inf for r in rows)
            text = "undecided" if reached == inf else f"{reached:.0f} %"
            parts.append(f"{letter} {median(r['planned_pct'] for r in rows):.0f} %, {text}")
    return f"Half-widths planned and reached, medians: {'; '.join(parts)}." if parts else ""


def _availability(analysis: StudyAnalysis) -> str:
    """Say how many estimates are available and why the others are not; the exit status in words."""
    counts = study_counts(analysis)
    why = joined([f"{n} {status}" for status, n in counts.missing.most_common()])
    if not analysis.n_standing:
        finding = f" ({why}): a finding about the data" if why else ""
        return f"No estimate is available{finding}, exit status 1."
    available = (
        f"{counts.available} of {counts.statuses.total()} values of K, B and J are available"
    )
    return f"{available}{f'; {why}' if why else ''}."
