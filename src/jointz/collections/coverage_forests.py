"""Forest plots of the page of a pooled collection, as numbers for inline svg."""

from collections.abc import Mapping, Sequence
from math import floor, log10, sqrt
from typing import Any

import pandas as pd

from jointz.collections.pool_result import CollectionPool, of_row
from jointz.report.wording import (
    PARAMETERS,
    format_interval,
    format_number,
    method_name,
    point_name,
    pretty_unit,
)

_LABEL_X, _LEFT, _RIGHT, _WIDTH, _LINE = 8, 240, 560, 760, 24
_TICKS, _LONGEST, _SQUARE_SMALLEST, _SQUARE_LARGEST = 5, 24, 5.0, 13.0
#: Largest reach of the axis beyond the studies, in spans of the studies.
_BEYOND = 0.5
_P_SMALLEST = 0.001

_Row = dict[str, Any]


def forest_plots(pool: CollectionPool, rows: pd.DataFrame) -> list[dict[str, Any]]:
    """Return the forest plots of rows of the pooled table, by joint and parameter."""
    studies = pd.concat([pool.studies, pool.printed])
    keys = [*pool.by, "parameter", "unit"]
    by_place = dict(list(studies[studies["weight_pct"].notna()].groupby(keys, sort=False)))
    groups: dict[str, list[_Row]] = {}
    for row in rows[rows["status"] == "ok"].to_dict("records"):
        group = of_row(by_place[tuple(row[key] for key in keys)], row)
        joint = str(row["joint"]).capitalize() if "joint" in pool.by else ""
        name = ": ".join(part for part in (joint, PARAMETERS[row["parameter"]][0]) if part)
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
