"""Page of a pooled collection: what is known, how well, and what is missing."""

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import fields
from math import floor, log10, sqrt
from typing import Any, Final

import pandas as pd

from jointz.collections.catalog_query import CatalogFilter
from jointz.collections.pool import RULES
from jointz.collections.pool_result import ONE_STUDY, CollectionPool, studies_of_row
from jointz.core.codes import NotPooled
from jointz.core.gait_phases import ALL_POINTS, PHASES
from jointz.report.html_page import render_template
from jointz.report.wording import (
    ALL_PARAMETERS,
    DASH,
    format_interval,
    format_number,
    method_name,
    parameter_name,
    point_name,
    pretty_unit,
)

#: Half the width of the interval over the mean, %, up to which a place is known well, or fairly.
WELL_PCT: Final = 15.0
FAIRLY_PCT: Final = 35.0
_ALONG: Final = ("timing_point", "phase")
_REASONS: Final = {"ok": ""} | {code.value: code.meaning for code in NotPooled}
#: Reasons why a place is not known, for a cell of the map; others show as numbers of people.
_SHORT_REASONS: Final = {
    NotPooled.ONE_PERSON: "one person",
    NotPooled.NO_SPREAD: "people do not differ",
    NotPooled.NO_SD: "printed without sd",
}
_FILTERS: Final = frozenset(field.name for field in fields(CatalogFilter))
_UNITS: Final = {"phase_pct": ("phase", "%"), "speed_m_s": ("speed", "m/s")}

_Row = dict[str, Any]
_NO_SUCH_PLACE: Final[_Row] = {"kind": "no-place", "reach": "", "lines": [], "title": ""}


def render_coverage(
    pool: CollectionPool,
    *,
    citations: Sequence[Mapping[str, Any]],
    provenance: Mapping[str, str] | None = None,
) -> str:
    """Write a pooled collection as one HTML page with its figures and styles inside."""
    rows = pool.table[pool.table["model"] == "univariate"]
    rows = rows.assign(why=pd.Series(_reasons(pool, rows), rows.index))
    filters = {key: value for key, value in pool.asked.items() if key in _FILTERS}
    joints = _in_order(pool.table["joint"]) if "joint" in pool.by else [""]
    not_pooled = pool.studies[pool.studies["status"] != "ok"]
    return render_template(
        "coverage.html.j2",
        facts=_facts(pool, rows),
        grids=[_joint_grids(pool, rows, joint) for joint in joints],
        missing=_missing(pool, rows),
        narrowed=_settings(filters),
        asked=_settings(pool.asked),
        forests=forest_plots(pool, _sorted(pool, rows)),
        rows=[_pooled_row(pool, row) for row in _records(_sorted(pool, pool.table))],
        printed=[_study_row(pool, row) for row in _records(_sorted(pool, pool.printed))],
        left_out=[_study_row(pool, row) for row in _records(not_pooled)],
        citations=citations,
        rules=RULES,
        notes=pool.notes,
        provenance=sorted((provenance or {}).items()),
        well=f"{WELL_PCT:g}",
        fairly=f"{FAIRLY_PCT:g}",
    )


def _records(table: pd.DataFrame) -> list[_Row]:
    return [{str(key): value for key, value in row.items()} for row in table.to_dict("records")]


# --- places --------------------------------------------------------------------------------------


def _along(pool: CollectionPool) -> str:
    """Return the column along the gait cycle; empty if places are not distinguished by it."""
    return next((key for key in _ALONG if key in pool.by), "")


def _aside(pool: CollectionPool) -> list[str]:
    """Return the other columns that distinguish places, without the joint."""
    return [key for key in pool.by if key not in ("joint", _along(pool))]


def _points(pool: CollectionPool, activity: str | None = None) -> list[str]:
    """Return the places along the gait cycle, of an activity if activities are distinguished."""
    rows = pool.table
    if activity is not None and "activity" in pool.by:
        rows = rows[rows["activity"] == activity]
    return _in_order(rows[_along(pool)]) if _along(pool) else [""]


def _in_order(values: Iterable[Any]) -> list[str]:
    """Return different values: phases in the order of the cycle, numbers by size, shared last."""
    phases = list(PHASES)

    def rank(name: str) -> tuple[int, float, str]:
        if name in phases:
            return 0, float(phases.index(name)), name
        try:
            return 0, float(name.split()[0]), name
        except (ValueError, IndexError):
            return (2 if name in (ALL_POINTS, "not stated") else 1), 0.0, name

    return sorted({str(value) for value in values}, key=rank)


def _sorted(pool: CollectionPool, rows: pd.DataFrame) -> pd.DataFrame:
    """Return rows by place along the gait cycle and by parameter."""
    orders = {key: _in_order(rows[key]) for key in pool.by} | {"parameter": list(ALL_PARAMETERS)}
    ranks = pd.DataFrame(
        {key: pd.Categorical(rows[key].astype(str), order).codes for key, order in orders.items()},
        index=rows.index,
    )
    return rows.loc[ranks.sort_values(list(orders), kind="stable").index]


def _settings(asked: Mapping[str, Any]) -> list[str]:
    """Return the settings of a pool, each with its name."""
    texts = []
    for key, value in asked.items():
        name, unit = _UNITS.get(key, (key.replace("_", " "), ""))
        shown = "" if value is True else value
        if isinstance(value, list | tuple):
            shown = f"{value[0]:g} to {value[1]:g} {unit}" if unit else ", ".join(value)
        texts.append(f"{name} {shown}".rstrip())
    return texts


# --- the summary and the map ---------------------------------------------------------------------


def _reach_pct(row: Mapping[Any, Any]) -> float | None:
    """Return half the width of the interval over the mean, %."""
    if pd.isna(row["value"]) or not row["value"]:
        return None
    reach = max(row["ci_high"] - row["value"], row["value"] - row["ci_low"])
    return float(100.0 * reach / abs(row["value"]))


def _reasons(pool: CollectionPool, rows: pd.DataFrame) -> list[tuple[str, ...]]:
    """Return why each row has no value, by the studies that are not pooled in it."""
    keys = [*pool.by, "parameter", "unit"]
    studies = pd.concat([pool.studies, pool.printed])
    by_place = dict(list(studies[studies["status"] != "ok"].groupby(keys, sort=False)))
    reasons = []
    for row in _records(rows):
        counts = [f"{row[f'n_{word}']} {word}" for word in ("undecided", "failed")
                  if row[f"n_{word}"]]  # fmt: skip
        group = by_place.get(tuple(row[key] for key in keys))
        status = set() if group is None else set(studies_of_row(group, row)["status"])
        reasons.append(
            (*counts, *(text for code, text in _SHORT_REASONS.items() if code in status))
        )
    return reasons


def _facts(pool: CollectionPool, rows: pd.DataFrame) -> list[tuple[str, str]]:
    with_people = pool.studies[pool.studies["n_people"] > 0]
    n_people = int(with_people.groupby("study")["n_people"].max().sum())
    count = rows["status"].value_counts()
    reaches = [_reach_pct(row) for row in _records(rows[rows["status"] == "ok"])]
    n_well = sum(reach is not None and reach <= WELL_PCT for reach in reaches)
    return [
        (str(pool.studies["study"].nunique()), "studies with estimates"),
        (f"\N{GREATER-THAN OR EQUAL TO} {n_people}", "people with a value"),
        (str(count.get("ok", 0)), "values pooled over studies"),
        (str(n_well), f"of them within {WELL_PCT:g} %"),
        (str(count.get(ONE_STUDY, 0)), "known from one study"),
        (str(pool.printed["study"].nunique()), "studies with printed values"),
    ]


def _joint_grids(pool: CollectionPool, rows: pd.DataFrame, joint: str) -> _Row:
    """Return the maps of a joint, one a parameter: places aside by places along the cycle."""
    of_joint = rows[rows["joint"] == joint] if joint else rows
    several = len(set(of_joint["methods"])) > 1
    aside = _aside(pool) + ["methods"] * several
    grids = []
    for parameter in [name for name in ALL_PARAMETERS if name in set(of_joint["parameter"])]:
        lines: dict[tuple[str, ...], list[_Row]] = {}
        records = _records(of_joint[of_joint["parameter"] == parameter])
        for row in records:
            lines.setdefault(tuple(str(row[key]) for key in aside), []).append(row)
        columns = _columns(pool, records)
        grids.append(
            {
                "name": parameter_name(parameter),
                "columns": [point_name(column) for column in columns],
                "lines": [
                    {"names": names, "cells": _line(pool, line, columns)}
                    for names, line in sorted(lines.items())
                ],
            }
        )
    heads = [key.replace("_", " ").capitalize() for key in aside]
    return {"joint": joint, "aside": heads, "grids": grids}


def _columns(pool: CollectionPool, rows: list[_Row]) -> list[str]:
    """Return the places along the cycle; a value of the whole cycle is a column by itself."""
    if not _along(pool):
        return [""]
    used = {str(row[_along(pool)]) for row in rows}
    present = used.union(*(_points(pool, row.get("activity")) for row in rows))
    whole_cycle = used == {ALL_POINTS}
    return [p for p in _points(pool) if p in present and (p == ALL_POINTS) == whole_cycle]


def _line(pool: CollectionPool, rows: list[_Row], columns: list[str]) -> list[_Row]:
    """Return the cells of a line of the map, empty if its activity has no such place."""
    present = _points(pool, rows[0].get("activity"))
    cells: dict[str, list[_Row]] = {}
    for row in rows:
        cells.setdefault(str(row[_along(pool)]) if _along(pool) else "", []).append(row)
    return [_cell(cells.get(c, [])) if c in present else _NO_SUCH_PLACE for c in columns]


def _cell(rows: list[_Row]) -> _Row:
    """Return a cell of the map: the best of the rows of a place."""
    known = [row for row in rows if row["status"] in ("ok", ONE_STUDY)]
    if not known:
        reasons = list(dict.fromkeys(text for row in rows for text in row["why"]))
        lines = reasons or ["no value" if rows else "no study"]
        return {"kind": "none", "reach": DASH, "lines": lines, "title": "not known"}
    row = max(known, key=lambda row: (row["status"] == "ok", row["n_people"]))
    reach = _reach_pct(row)
    limits = ((WELL_PCT, "well"), (FAIRLY_PCT, "fair"))
    kind = next((kind for pct, kind in limits if reach is not None and reach <= pct), "far")
    pooled = row["status"] == "ok"
    value = format_interval(row["value"], row["ci_low"], row["ci_high"])
    return {
        "kind": kind if pooled else f"{kind} alone",
        "reach": DASH if reach is None else f"± {reach:.0f} %" if reach < 1000 else "± > 999 %",
        "lines": [f"{row['n_studies']} studies" if pooled else "1 study",
                  f"{row['n_people']} people"],
        "title": f"{value} {pretty_unit(row['unit'])}",
    }  # fmt: skip


# --- what is missing -----------------------------------------------------------------------------


def _missing(pool: CollectionPool, rows: pd.DataFrame) -> list[str]:
    """Return what is missing of a joint but known of others, and how much is known poorly."""
    sentences: list[str] = []
    aside = _aside(pool)
    known = rows[rows["value"].notna()]
    places = rows[aside].astype(str).drop_duplicates()
    for joint in _in_order(rows["joint"]) if "joint" in pool.by else []:
        of_joint = known[known["joint"] == joint]
        if aside:
            sentences += _missing_places(pool, of_joint, places.sort_values(aside), joint)
        else:
            sentences += _missing_points(pool, of_joint, joint, None)
        wide = sum((_reach_pct(row) or 0.0) > FAIRLY_PCT for row in _records(of_joint))
        one_study = (of_joint["status"] == ONE_STUDY).sum()
        sentences.append(
            f"{joint}, of {len(of_joint)} values: known from one study: {one_study}; not known "
            f"within {FAIRLY_PCT:g} %: {wide}."
        )
    return sentences


def _missing_places(
    pool: CollectionPool, known: pd.DataFrame, places: pd.DataFrame, joint: str
) -> Iterator[str]:
    """Yield what is missing of a joint; an activity without any study once."""
    if "activity" in pool.by:
        missing = sorted(set(places["activity"]) - set(known["activity"]))
        yield from (f"{joint}: nothing while {activity}." for activity in missing)
        places = places[~places["activity"].isin(missing)]
    for place in _records(places):
        here = known[(known[list(place)].astype(str) == pd.Series(place)).all(axis=1)]
        where = ", ".join([joint, *map(str, place.values())])
        yield from _missing_points(pool, here, where, place.get("activity"))


def _missing_points(
    pool: CollectionPool, known: pd.DataFrame, where: str, activity: str | None
) -> Iterator[str]:
    along = _along(pool)
    points = [p for p in _points(pool, activity) if p != ALL_POINTS] if along else []
    missing = [p for p in points if p not in set(known[along].astype(str))]
    if known.empty or (missing and len(missing) == len(points)):
        yield f"{where}: nothing anywhere."
    elif missing:
        yield f"{where}: nothing at {', '.join(map(point_name, missing))}."


# --- tables --------------------------------------------------------------------------------------


def _row_head(pool: CollectionPool, row: _Row) -> _Row:
    """Return the columns that both tables have: place, parameter and mean."""
    aside = _aside(pool)
    ends = (row[key] for key in ("value", "ci_low", "ci_high"))
    mean = format_interval(*(None if pd.isna(end) else float(end) for end in ends))
    return {
        "place": {
            "name": ", ".join(point_name(str(row[key])) for key in pool.by if key not in aside),
            "rest": ", ".join(str(row[key]) for key in aside),
        },
        "parameter": parameter_name(row["parameter"]),
        "unit": row["unit"],
        "mean": DASH if pd.isna(row["value"]) else mean,
        "people": row["n_people"],
    }


def _pooled_row(pool: CollectionPool, row: _Row) -> _Row:
    low, high = row["prediction_low"], row["prediction_high"]
    like = max(abs(low), abs(high))
    prediction = f"{format_number(low, like=like)} to {format_number(high, like=like)}"
    return _row_head(pool, row) | {
        "status": row["status"],
        "next": DASH if pd.isna(low) else prediction,
        "tau": format_number(row["tau"], like=row["value"]),
        "i2": DASH if pd.isna(row["i2_pct"]) else f"{row['i2_pct']:.0f} %",
        "studies": row["n_studies"],
        "lacking": f"{row['n_undecided'] + row['n_failed']}, {row['n_at_bound']}",
        "methods": ", ".join(method_name(name) for name in str(row["methods"]).split(", ")),
        "model": row["model"],
        "printed": row["printed"],
    }


def _study_row(pool: CollectionPool, row: _Row) -> _Row:
    return _row_head(pool, row) | {
        "study": row["study"],
        "method": method_name(str(row["method"])),
        "why": _REASONS[str(row["status"])],
        "pooled": pd.notna(row["weight_pct"]),
    }


_LABEL_X, _LEFT, _RIGHT, _WIDTH, _LINE = 8, 240, 560, 760, 24
_TICKS, _LONGEST, _SQUARE_SMALLEST, _SQUARE_LARGEST = 5, 24, 5.0, 13.0
#: Largest reach of the axis beyond the studies, in spans of the studies.
_BEYOND = 0.5
_P_SMALLEST = 0.001


def forest_plots(pool: CollectionPool, rows: pd.DataFrame) -> list[dict[str, Any]]:
    """Return the forest plots of rows of the pooled table, by joint and parameter."""
    studies = pd.concat([pool.studies, pool.printed])
    keys = [*pool.by, "parameter", "unit"]
    by_place = dict(list(studies[studies["weight_pct"].notna()].groupby(keys, sort=False)))
    groups: dict[str, list[_Row]] = {}
    for row in rows[rows["status"] == "ok"].to_dict("records"):
        group = studies_of_row(by_place[tuple(row[key] for key in keys)], row)
        joint = str(row["joint"]).capitalize() if "joint" in pool.by else ""
        name = ": ".join(part for part in (joint, parameter_name(row["parameter"])) if part)
        place = [point_name(str(row[key])) for key in pool.by if key != "joint"]
        p = f"p {row['q_p']:.2g}" if row["q_p"] >= _P_SMALLEST else "p < 0.001"
        groups.setdefault(name, []).append(
            _forest(group.to_dict("records"), row)
            | {
                "title": ", ".join(place),
                "methods": ", ".join(map(method_name, sorted(set(group["method"])))),
                "spread": f"sd between studies {format_number(row['tau'], like=row['value'])} "
                f"{pretty_unit(row['unit'])}, I² {row['i2_pct']:.0f} %, Q {row['q']:.3g} ({p})",
            }
        )
    return [{"name": name, "plots": plots} for name, plots in groups.items()]


def _forest(studies: Sequence[Mapping[Any, Any]], row: Mapping[Any, Any]) -> _Row:
    """Return the positions of all parts of a forest plot."""
    low = min(*(s["ci_low"] for s in studies), row["value"])
    high = max(*(s["ci_high"] for s in studies), row["value"])
    span = high - low
    low = max(min(low, row["prediction_low"]), low - _BEYOND * span)
    high = min(max(high, row["prediction_high"]), high + _BEYOND * span)

    def x(value: float) -> float:
        share = (min(max(value, low), high) - low) / (high - low)
        return float(round(_LEFT + share * (_RIGHT - _LEFT), 1))

    largest = max(float(s["weight_pct"]) for s in studies)
    lines = [
        {
            "y": _LINE * (k + 1),
            "label": f"{_short(str(s['study']))} ({s['n_people']})",
            "ends": (x(s["ci_low"]), x(s["ci_high"])),
            "at": x(s["value"]),
            "size": round(max(_SQUARE_SMALLEST, _SQUARE_LARGEST
                              * sqrt(s["weight_pct"] / largest)), 1),
            "value": format_interval(s["value"], s["ci_low"], s["ci_high"]),
            "printed": s["values"] == "printed",
        }
        for k, s in enumerate(studies)
    ]  # fmt: skip
    bottom = _LINE * (len(lines) + 1) + 6
    names = ("prediction_low", "ci_low", "value", "ci_high", "prediction_high")
    return {
        "lines": lines,
        "y": bottom,
        "mean": {name: x(row[name]) for name in names},
        "cut": (row["prediction_low"] < low, row["prediction_high"] > high),
        "mean_text": format_interval(row["value"], row["ci_low"], row["ci_high"]),
        "ticks": [(x(tick), format_number(tick, like=high - low)) for tick in _ticks(low, high)],
        "unit": row["unit"],
        "label_x": _LABEL_X, "left": _LEFT, "right": _RIGHT, "width": _WIDTH,
        "axis": bottom + 18, "height": bottom + 54,
    }  # fmt: skip


def _short(name: str) -> str:
    """Return a name that fits beside the plot."""
    return name if len(name) <= _LONGEST else f"{name[: _LONGEST - 1]}\N{HORIZONTAL ELLIPSIS}"


def _ticks(low: float, high: float) -> list[float]:
    """Return round numbers between two ends."""
    rough = (high - low) / _TICKS
    decade = 10.0 ** floor(log10(rough))
    step = float(next(m * decade for m in (1.0, 2.0, 5.0, 10.0) if m * decade >= rough))
    first = floor(low / step) + 1
    return [k * step for k in range(first, first + 2 * _TICKS) if k * step <= high]
