"""What a collection knows, and what not, as one HTML page that needs nothing else."""

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, fields
from typing import Any, Final

import pandas as pd

from jointz.collections.catalog_query import CatalogFilter
from jointz.collections.coverage_forests import forest_plots
from jointz.collections.pool_result import ONE_STUDY, of_row
from jointz.core.codes import NotPooled
from jointz.core.gait_phases import ALL_POINTS, PHASES
from jointz.report.html_page import render_template
from jointz.report.wording import (
    DASH,
    PARAMETERS,
    format_interval,
    format_number,
    method_name,
    point_name,
    pretty_unit,
)

#: Half the width of the interval over the mean, %: up to this a place is known well, or fairly.
WELL_PCT: Final = 15.0
FAIRLY_PCT: Final = 35.0
_ALONG: Final = ("timing_point", "phase")
_TOLD: Final = {"ok": ""} | {code.value: code.meaning for code in NotPooled}
#: Why a place is not known, for a field of the map: where people are counted, the count says it.
_BRIEFLY: Final = {
    NotPooled.ONE_PERSON: "one person",
    NotPooled.NO_SPREAD: "people do not differ",
    NotPooled.NO_SD: "printed without sd",
}
_FILTERS: Final = frozenset(field.name for field in fields(CatalogFilter))
_UNITS: Final = {"phase_pct": ("phase", "%"), "speed_m_s": ("speed", "m/s")}
_RESEARCH: Final = "research"

_Row = dict[str, Any]
_NO_SUCH_PLACE: Final[_Row] = {"kind": "no-place", "reach": "", "told": [], "title": ""}


@dataclass(frozen=True, slots=True, eq=False)
class CoverageTables:
    """What the page is made of, as pooling writes it."""

    # one row a place, parameter and method, with ``value, ci_low, ci_high, prediction_low,
    # prediction_high, tau, i2_pct, q_p, n_studies, n_people, n_left_out, n_at_bound, n_undecided,
    # n_failed, methods, model, printed, status``
    pooled: pd.DataFrame
    # one row a study at a place, ``study, method, n_people, value, se, ci_low, ci_high, weight_pct,
    # status`` among its columns; printed values by themselves
    studies: pd.DataFrame
    printed: pd.DataFrame
    by: tuple[str, ...]  # columns that tell places apart

    @property
    def along(self) -> str:
        """The column that goes along the gait cycle; empty where places are not told apart so."""
        return next((key for key in _ALONG if key in self.by), "")

    @property
    def aside(self) -> tuple[str, ...]:
        """What else tells places apart, but for the joint."""
        return tuple(key for key in self.by if key not in ("joint", self.along))

    def points(self, activity: str | None = None) -> list[str]:
        """Return what occurs along the gait cycle, of an activity where these are told apart."""
        rows = self.pooled
        if activity is not None and "activity" in self.by:
            rows = rows[rows["activity"] == activity]
        return _in_order(rows[self.along]) if self.along else [""]


def render_coverage(
    tables: CoverageTables,
    *,
    citations: Sequence[Mapping[str, str]],
    rules: Sequence[str] = (),
    notes: Sequence[str] = (),
    asked: Mapping[str, Any] | None = None,
    provenance: Mapping[str, str] | None = None,
) -> str:
    """Write what a collection knows as one HTML page with its figures and styles inside."""
    univariate = tables.pooled[tables.pooled["model"] == "univariate"]
    univariate = univariate.assign(why=pd.Series(_reasons(tables, univariate), univariate.index))
    filters = {key: value for key, value in (asked or {}).items() if key in _FILTERS}
    joints = _in_order(tables.pooled["joint"]) if "joint" in tables.by else [""]
    return render_template(
        "coverage.html.j2",
        facts=_facts(tables, univariate),
        grids=[_joint_grids(tables, univariate, joint) for joint in joints],
        missing=_missing(tables, univariate),
        narrowed=_asked_for(filters),
        asked=_asked_for(asked or {}),
        for_research=[one["study"] for one in citations if one["consent"] == _RESEARCH],
        forests=forest_plots(
            _sorted(tables, univariate), pd.concat([tables.studies, tables.printed]), tables.by
        ),
        rows=_table(tables, _sorted(tables, tables.pooled)),
        printed=_studies(tables, _sorted(tables, tables.printed)),
        left_out=_studies(tables, tables.studies[tables.studies["status"] != "ok"]),
        citations=list(citations),
        rules=list(rules),
        notes=list(notes),
        provenance=sorted((provenance or {}).items()),
        well=f"{WELL_PCT:g}",
        fairly=f"{FAIRLY_PCT:g}",
    )


def _in_order(values: Iterable[Any]) -> list[str]:
    """Return what occurs, the gait cycle's names in its order, numbers by size, shared last."""
    phases = list(PHASES)

    def rank(name: str) -> tuple[int, float, str]:
        if name in phases:
            return 0, float(phases.index(name)), name
        try:
            return 0, float(name.split()[0]), name
        except (ValueError, IndexError):
            return (2 if name in (ALL_POINTS, "not stated") else 1), 0.0, name

    return sorted({str(value) for value in values}, key=rank)


def _key_name(key: str) -> str:
    return key.replace("_", " ").capitalize()


def _reach_pct(row: Mapping[Any, Any]) -> float | None:
    """Return half the width of the interval over the mean, %."""
    if pd.isna(row["value"]) or not row["value"]:
        return None
    reach = max(row["ci_high"] - row["value"], row["value"] - row["ci_low"])
    return float(100.0 * reach / abs(row["value"]))


def _asked_for(asked: Mapping[str, Any]) -> list[str]:
    """Return what was asked for, each with its name."""
    told = []
    for key, value in asked.items():
        name, unit = _UNITS.get(key, (key.replace("_", " "), ""))
        shown = "" if value is True else value
        if isinstance(value, list | tuple):
            shown = f"{value[0]:g} to {value[1]:g} {unit}" if unit else ", ".join(value)
        told.append(f"{name} {shown}".rstrip())
    return told


def _reasons(tables: CoverageTables, rows: pd.DataFrame) -> list[tuple[str, ...]]:
    """Return, for each row, why it has no value, by the studies that are not pooled in it."""
    keys = [*tables.by, "parameter", "unit"]
    behind = pd.concat([tables.studies, tables.printed])
    held = dict(list(behind[behind["status"] != "ok"].groupby(keys, sort=False)))
    told = []
    for row in rows.to_dict("records"):
        counts = (f"{row[f'n_{word}']} {word}" for word in ("undecided", "failed")
                  if row[f"n_{word}"])  # fmt: skip
        group = held.get(tuple(row[key] for key in keys))
        status = set() if group is None else set(of_row(group, row)["status"])
        told.append((*counts, *(text for code, text in _BRIEFLY.items() if code in status)))
    return told


def _facts(tables: CoverageTables, rows: pd.DataFrame) -> list[tuple[str, str]]:
    standing = tables.studies[tables.studies["n_people"] > 0]
    people = standing.groupby("study")["n_people"].max().sum()
    count = rows["status"].value_counts()
    reached = [reach for row in rows[rows["status"] == "ok"].to_dict("records")
               if (reach := _reach_pct(row)) is not None]  # fmt: skip
    return [
        (str(tables.studies["study"].nunique()), "studies with estimates"),
        (f"\N{GREATER-THAN OR EQUAL TO} {int(people)}", "people with a value"),
        (str(count.get("ok", 0)), "values pooled over studies"),
        (str(sum(reach <= WELL_PCT for reach in reached)), f"of them within {WELL_PCT:g} %"),
        (str(count.get(ONE_STUDY, 0)), "known from one study"),
        (str(tables.printed["study"].nunique()), "studies with printed values"),
    ]


def _cell(rows: list[_Row]) -> _Row:
    """Return a cell of the map: the best of the rows of a place."""
    known = [row for row in rows if row["status"] in ("ok", ONE_STUDY)]
    if not known:
        why = dict.fromkeys(text for row in rows for text in row["why"])
        told = list(why) or ["no value" if rows else "no study"]
        return {"kind": "none", "reach": DASH, "told": told, "title": "not known"}
    row = max(known, key=lambda one: (one["status"] == "ok", one["n_people"]))
    reach = _reach_pct(row)
    kind = "far" if reach is None or reach > FAIRLY_PCT else "fair"
    kind = "well" if reach is not None and reach <= WELL_PCT else kind
    studies = f"{row['n_studies']} studies" if row["status"] == "ok" else "1 study"
    value = format_interval(row["value"], row["ci_low"], row["ci_high"])
    return {
        "kind": kind if row["status"] == "ok" else f"{kind} alone",
        "reach": DASH if reach is None else f"± {reach:.0f} %" if reach < 1000 else "± > 999 %",
        "told": [studies, f"{row['n_people']} people"],
        "title": f"{value} {pretty_unit(row['unit'])}",
    }


def _joint_grids(tables: CoverageTables, rows: pd.DataFrame, joint: str) -> _Row:
    """Return the maps of a joint, one a parameter: places aside by places along the cycle."""
    own = rows[rows["joint"] == joint] if joint else rows
    several = len(set(own["methods"])) > 1
    aside = [*tables.aside, *(["methods"] if several else [])]
    grids = []
    for parameter in [name for name in PARAMETERS if name in set(own["parameter"])]:
        lines: dict[tuple[str, ...], list[_Row]] = {}
        for row in own[own["parameter"] == parameter].to_dict("records"):
            place = tuple(str(row[key]) for key in aside)
            lines.setdefault(place, []).append({str(k): v for k, v in row.items()})
        columns = _columns(tables, [row for line in lines.values() for row in line])
        grids.append(
            {
                "name": PARAMETERS[parameter][0],
                "columns": [point_name(column) for column in columns],
                "lines": [
                    {"names": names, "cells": _line(tables, line, columns)}
                    for names, line in sorted(lines.items())
                ],
            }
        )
    return {"joint": joint, "aside": [_key_name(key) for key in aside], "grids": grids}


def _columns(tables: CoverageTables, rows: list[_Row]) -> list[str]:
    """Return what is along the cycle where these rows are; one value for all of it by itself."""
    if not tables.along:
        return [""]
    own = {str(row[tables.along]) for row in rows}
    there = own.union(*(tables.points(row.get("activity")) for row in rows))
    return [p for p in tables.points() if p in there and (p != ALL_POINTS) == (own != {ALL_POINTS})]


def _line(tables: CoverageTables, rows: list[_Row], columns: list[str]) -> list[_Row]:
    """Return the cells of a line of the map, empty where its activity has no such place."""
    there = tables.points(rows[0].get("activity"))
    cells: dict[str, list[_Row]] = {}
    for row in rows:
        cells.setdefault(str(row[tables.along]) if tables.along else "", []).append(row)
    return [_cell(cells.get(c, [])) if c in there else _NO_SUCH_PLACE for c in columns]


def _missing(tables: CoverageTables, rows: pd.DataFrame) -> list[str]:
    """Return what nobody knows of a joint that is known of others, and what stands on little."""
    told: list[str] = []
    aside = list(tables.aside)
    known = rows[rows["value"].notna()]
    everywhere = rows[aside].astype(str).drop_duplicates().sort_values(aside) if aside else None
    for joint in _in_order(rows["joint"]) if "joint" in tables.by else []:
        own = known[known["joint"] == joint]
        if everywhere is not None:
            told += _missing_places(tables, own, everywhere, joint)
        else:
            told += _missing_points(tables, own, joint, None)
        wide = sum((_reach_pct(row) or 0.0) > FAIRLY_PCT for row in own.to_dict("records"))
        alone = f"known from one study: {(own['status'] == ONE_STUDY).sum()}"
        told.append(f"{joint}, of {len(own)} values: {alone}; not known within "
                    f"{FAIRLY_PCT:g} %: {wide}.")  # fmt: skip
    return told


def _missing_places(
    tables: CoverageTables, own: pd.DataFrame, everywhere: pd.DataFrame, joint: str
) -> Iterator[str]:
    """Yield what is missing of a joint; an activity without any study is told once."""
    if "activity" in tables.by:
        lacking = sorted(set(everywhere["activity"]) - set(own["activity"]))
        yield from (f"{joint}: nothing while {activity}." for activity in lacking)
        everywhere = everywhere[~everywhere["activity"].isin(lacking)]
    for place in everywhere.to_dict("records"):
        here = own[(own[list(place)].astype(str) == pd.Series(place)).all(axis=1)]
        where = ", ".join([joint, *map(str, place.values())])
        yield from _missing_points(tables, here, where, place.get("activity"))


def _missing_points(
    tables: CoverageTables, here: pd.DataFrame, where: str, activity: str | None
) -> Iterator[str]:
    points = [p for p in tables.points(activity) if p != ALL_POINTS] if tables.along else []
    gone = [p for p in points if p not in set(here[tables.along].astype(str))]
    if here.empty or (gone and len(gone) == len(points)):
        yield f"{where}: nothing anywhere."
    elif gone:
        yield f"{where}: nothing at {', '.join(map(point_name, gone))}."


def _mean(row: Mapping[Any, Any]) -> str:
    """Return a mean with its interval, as far as there are any."""
    if pd.isna(row["value"]):
        return DASH
    held = (row[key] for key in ("value", "ci_low", "ci_high"))
    return format_interval(*(None if pd.isna(number) else float(number) for number in held))


def _place(tables: CoverageTables, row: Mapping[Any, Any]) -> _Row:
    """Return a place as tables name it: joint and phase, and the rest in small print."""
    first = [key for key in tables.by if key not in tables.aside]
    return {
        "name": ", ".join(point_name(str(row[key])) for key in first),
        "rest": ", ".join(str(row[key]) for key in tables.aside),
    }


def _table(tables: CoverageTables, rows: pd.DataFrame) -> list[_Row]:
    return [
        {
            "place": _place(tables, row),
            "parameter": PARAMETERS[row["parameter"]][0],
            "unit": row["unit"],
            "mean": _mean(row),
            "status": row["status"],
            "next": DASH if pd.isna(row["prediction_low"]) else _range(row),
            "tau": format_number(row["tau"], like=row["value"]),
            "i2": DASH if pd.isna(row["i2_pct"]) else f"{row['i2_pct']:.0f} %",
            "studies": row["n_studies"],
            "people": row["n_people"],
            "lacking": f"{row['n_undecided'] + row['n_failed']}, {row['n_at_bound']}",
            "methods": ", ".join(method_name(m) for m in str(row["methods"]).split(", ")),
            "model": row["model"],
            "printed": row["printed"],
        }
        for row in rows.to_dict("records")
    ]


def _sorted(tables: CoverageTables, rows: pd.DataFrame) -> pd.DataFrame:
    """Return rows in the order of the page: places along the gait cycle, parameters as always."""
    orders = {key: _in_order(rows[key]) for key in tables.by} | {"parameter": list(PARAMETERS)}
    ranks = pd.DataFrame(
        {key: rows[key].map(lambda v, o=order: o.index(str(v))) for key, order in orders.items()}
    )
    return rows.loc[ranks.sort_values(list(orders), kind="stable").index]


def _range(row: Mapping[Any, Any]) -> str:
    low, high = row["prediction_low"], row["prediction_high"]
    like = max(abs(low), abs(high))
    return f"{format_number(low, like=like)} to {format_number(high, like=like)}"


def _studies(tables: CoverageTables, rows: pd.DataFrame) -> list[_Row]:
    return [
        {
            "place": _place(tables, row),
            "parameter": PARAMETERS[row["parameter"]][0],
            "unit": row["unit"],
            "study": row["study"],
            "mean": _mean(row),
            "people": row["n_people"],
            "method": method_name(str(row["method"])),
            "why": _TOLD[str(row["status"])],
            "pooled": pd.notna(row["weight_pct"]),
        }
        for row in rows.to_dict("records")
    ]
