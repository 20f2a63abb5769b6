"""Quasi-stiffness of people who were not perturbed, for the report and a paper."""

from collections.abc import Mapping, Sequence
from typing import Any, Final

from jointz.analysis.paper.latex import MARKS
from jointz.analysis.paper.table import NO_VALUE, NOTE, Table
from jointz.core.channels import pretty_unit
from jointz.core.events import row_label
from jointz.report.subjects import subjects
from jointz.report.wording import DASH, format_integer, format_interval
from jointz.results.statistics.quasi_stiffness_fit import WINDOW_PCT, QuasiStiffnessDoubt
from jointz.results.study_analysis import StudyAnalysis

_MEASURES: Final = ("slope", "local_slope", "secant")

_Row = Mapping[str, Any]
#: Participant with session, side and timing point -> one row for each measure.
_Places = Mapping[tuple[str, str, str], Sequence[_Row]]


def quasi_stiffness_section(analysis: StudyAnalysis) -> dict[str, Any] | None:
    """Return what the page shows of quasi-stiffness, None if there is none."""
    rows = quasi_stiffness_records(analysis)
    if not rows:
        return None
    return {
        "rows": [
            {
                "participant": row_label(participant, side=side),
                "point": point,
                "n": measures[0]["n_strides"],
                "cells": [{"text": _value(row, DASH), "note": _doubts(row)} for row in measures],
            }
            for (participant, side, point), measures in _by_place(rows).items()
        ],
        "unit": rows[0]["unit"],
        "window": f"{WINDOW_PCT:g} %",
        "level": f"{100 * rows[0]['ci_level']:g} %",
        "doubts": [
            (_in_words(code), QuasiStiffnessDoubt(code).meaning) for code in _all_doubts(rows)
        ],
    }


def quasi_stiffness_table(analysis: StudyAnalysis) -> Table:
    """Return the table for a paper; without rows if there is no quasi-stiffness."""
    rows = quasi_stiffness_records(analysis)
    words = subjects(analysis)
    unit = pretty_unit(rows[0]["unit"]) if rows else ""
    level = f"{100 * rows[0]['ci_level']:g} %" if rows else ""
    measures = [f"{_in_words(m).capitalize()} ({unit})" for m in _MEASURES]
    head = (words.one.capitalize(), "Side", words.point.capitalize(), *measures, "Strides", NOTE)
    caption = (
        f"Quasi-stiffness in the mean stride of each {words.one}: value [{level} interval]. "
        "Slope: least-squares line of moment on angle over the gait phase of the timing point; "
        f"local slope: the same over {WINDOW_PCT:g} % of the gait cycle about it; secant: moment "
        "over angle. Interval: t interval of the delete-one jackknife over strides, without errors "
        f"of motion capture and inverse dynamics. These {words.many} were not perturbed: "
        "quasi-stiffness is no impedance."
    )
    codes = _all_doubts(rows)
    marks = {code: MARKS[min(k, len(MARKS) - 1)] for k, code in enumerate(codes)}
    cells = tuple(_table_row(key, own, marks) for key, own in _by_place(rows).items())
    notes = tuple(
        f"{mark}{_in_words(d)}: {QuasiStiffnessDoubt(d).meaning}." for d, mark in marks.items()
    )
    return Table(caption, head, cells, notes)


def quasi_stiffness_records(analysis: StudyAnalysis) -> list[dict[str, Any]]:
    """Return the rows of ``quasi_stiffness.csv``."""
    return list(analysis.statistics.get("quasi_stiffness") or ())


def _table_row(
    key: tuple[str, ...], measures: Sequence[_Row], marks: Mapping[str, str]
) -> tuple[str, ...]:
    texts = [
        _value(row, NO_VALUE) + "".join(dict.fromkeys(marks[d] for d in row["doubts"].split()))
        for row in measures
    ]
    note = "; ".join(
        f"{_in_words(row['measure'])}: {_doubts(row)}" for row in measures if row["doubts"]
    )
    return (*key, *texts, format_integer(measures[0]["n_strides"]), note)


def _by_place(rows: Sequence[_Row]) -> _Places:
    places: dict[tuple[str, str, str], dict[str, _Row]] = {}
    for row in rows:
        who = row_label(row["participant"], row.get("session", ""))
        places.setdefault((who, row["side"], row["timing_point"]), {})[row["measure"]] = row
    return {place: [own[measure] for measure in _MEASURES] for place, own in places.items()}


def _value(row: _Row, missing: str) -> str:
    if row["value"] is None:
        return missing
    return format_interval(row["value"], row["ci_low"], row["ci_high"])


def _all_doubts(rows: Sequence[_Row]) -> list[str]:
    return list(dict.fromkeys(code for row in rows for code in row["doubts"].split()))


def _doubts(row: _Row) -> str:
    return ", ".join(map(_in_words, row["doubts"].split()))


def _in_words(code: str) -> str:
    return code.replace("_", " ")
