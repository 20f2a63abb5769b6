"""The quasi-stiffness of people whom nobody perturbed, as the report and a paper show it."""

from collections.abc import Mapping, Sequence
from typing import Any, Final

from jointz.core.events import row_label
from jointz.report.latex import MARKS
from jointz.report.subjects import subjects
from jointz.report.table import NO_VALUE, NOTE, Table
from jointz.report.wording import DASH, format_integer, format_interval, pretty_unit
from jointz.results.statistics.quasi_stiffness_fit import Doubt
from jointz.results.study_analysis import StudyAnalysis
from jointz.stats.quasi_stiffness import WINDOW_PCT

_MEASURES: Final = ("slope", "local_slope", "secant")


def quasi_stiffness_section(analysis: StudyAnalysis) -> dict[str, Any] | None:
    """Return what the page says of quasi-stiffness, None where there is none."""
    found = _rows(analysis)
    if not found:
        return None
    cells = {_place(row): row["n_strides"] for row in found}
    values = _by_measure(found)
    doubts = _doubts(found)
    return {
        "rows": [
            {
                "participant": row_label(participant, side=side),
                "point": point,
                "n": n,
                "cells": [_cell(values[participant, side, point, m]) for m in _MEASURES],
            }
            for (participant, side, point), n in cells.items()
        ],
        "unit": found[0]["unit"],
        "window": f"{WINDOW_PCT:g} %",
        "level": f"{100 * found[0]['ci_level']:g} %",
        "doubts": [(_spoken(code), Doubt(code).meaning) for code in doubts],
    }


def quasi_stiffness_table(analysis: StudyAnalysis) -> Table:
    """Return the table for a paper; without rows where there is no quasi-stiffness."""
    found = _rows(analysis)
    words = subjects(analysis)
    unit = pretty_unit(found[0]["unit"]) if found else ""
    level = f"{100 * found[0]['ci_level']:g} %" if found else ""
    measures = [f"{_spoken(m).capitalize()} ({unit})" for m in _MEASURES]
    head = (words.one.capitalize(), "Side", words.point.capitalize(), *measures, "Strides", NOTE)
    caption = (
        f"Quasi-stiffness in the mean stride of each {words.one}: value [{level} interval]. "
        "Slope: least-squares line of moment on angle over the gait phase of the timing point; "
        f"local slope: the same over {WINDOW_PCT:g} % of the gait cycle about it; secant: moment "
        "over angle. Interval: Student's t of the delete-one jackknife over strides; it holds no "
        f"error of motion capture or inverse dynamics. These {words.many} were not perturbed: it "
        "is no impedance."
    )
    values = _by_measure(found)
    marks = {d: MARKS[min(k, len(MARKS) - 1)] for k, d in enumerate(_doubts(found))}
    rows = tuple(
        _table_row(key, [values[(*key, m)] for m in _MEASURES], marks)
        for key in dict.fromkeys(key[:3] for key in values)
    )
    notes = tuple(f"{mark}{_spoken(d)}: {Doubt(d).meaning}." for d, mark in marks.items())
    return Table(caption, head, rows, notes)


def _table_row(
    key: tuple[str, ...], own: Sequence[Mapping[str, Any]], marks: Mapping[str, str]
) -> tuple[str, ...]:
    texts = []
    for row in own:
        value, ends = row["value"], (row["ci_low"], row["ci_high"])
        text = NO_VALUE if value is None else format_interval(value, *ends)
        texts.append(text + "".join(dict.fromkeys(marks[d] for d in row["doubts"].split())))
    said = [
        f"{_spoken(row['measure'])}: {', '.join(map(_spoken, row['doubts'].split()))}"
        for row in own
        if row["doubts"]
    ]
    return (*key, *texts, format_integer(own[0]["n_strides"]), "; ".join(said))


def _rows(analysis: StudyAnalysis) -> list[dict[str, Any]]:
    return list(analysis.statistics.get("quasi_stiffness") or ())


def _by_measure(found: Sequence[dict[str, Any]]) -> dict[tuple[str, ...], dict[str, Any]]:
    return {(*_place(row), row["measure"]): row for row in found}


def _place(row: Mapping[str, Any]) -> tuple[str, str, str]:
    """Return participant with session, side and timing point."""
    who = row_label(row["participant"], row.get("session", ""))
    return who, row["side"], row["timing_point"]


def _doubts(found: Sequence[Mapping[str, Any]]) -> list[str]:
    return list(dict.fromkeys(d for row in found for d in row["doubts"].split()))


def _cell(row: dict[str, Any]) -> dict[str, str]:
    said = ", ".join(map(_spoken, row["doubts"].split()))
    if row["value"] is None:
        return {"text": DASH, "note": said}
    return {"text": format_interval(row["value"], row["ci_low"], row["ci_high"]), "note": said}


def _spoken(code: str) -> str:
    return code.replace("_", " ")
