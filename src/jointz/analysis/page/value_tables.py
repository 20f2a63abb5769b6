"""Rows of the report's tables of estimates and means."""

from collections.abc import Callable, Iterable, Sequence
from typing import Any

from jointz.core.gait_phases import ALL_POINTS
from jointz.core.grouping import by_key
from jointz.report.subjects import timing_points
from jointz.report.wording import format_interval, point_name
from jointz.results.estimates import CellEstimate
from jointz.results.study_analysis import PopulationEstimate, StudyAnalysis

Row = dict[str, Any]


def point_order(cells: Sequence[CellEstimate]) -> list[str]:
    """Return the timing points in the order of the cycle, values shared by all points last."""
    return [*timing_points(cells), ALL_POINTS]


def cells_by_person(cells: Sequence[CellEstimate]) -> dict[str, list[CellEstimate]]:
    """Return each person's cells in the order of the cycle."""
    order = {name: k for k, name in enumerate(point_order(cells))}
    people = by_key((c.label, c) for c in sorted(cells, key=lambda c: order[c.timing_point]))
    return {label: people[label] for label in dict.fromkeys(c.label for c in cells)}


def people_means(analysis: StudyAnalysis | None) -> list[PopulationEstimate]:
    """Return means over several people, those without a value too."""
    several = analysis and len({c.participant for c in analysis.cells}) > 1
    return list(analysis.population) if analysis and several else []


def mean_rows(
    cells: Sequence[CellEstimate],
    means: Iterable[PopulationEstimate],
    parameters: Sequence[str],
    write: Callable[[PopulationEstimate | None], Row],
) -> list[Row]:
    """Return one row for each timing point that has a mean of a parameter."""
    by_place = {(m.timing_point, m.parameter): m for m in means}
    return [
        {"name": point_name(name), "cells": [write(by_place.get((name, p))) for p in parameters]}
        for name in point_order(cells)
        if any((name, p) in by_place for p in parameters)
    ]


def mean_text(mean: PopulationEstimate) -> str:
    """Return a mean with its interval, or its status."""
    if mean.value is None:
        return short_status(mean.status)
    return format_interval(mean.value, mean.ci_low, mean.ci_high)


def short_status(status: str) -> str:
    """Return a status without its code."""
    return status.partition(":")[0]
