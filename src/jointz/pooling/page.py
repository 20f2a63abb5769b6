"""Page of pooled results: one HTML file that needs no other."""

from collections.abc import Mapping
from typing import Any, Final

import numpy as np
import pandas as pd

from jointz.core.channels import axis_label
from jointz.core.codes import NotPooled
from jointz.pooling.pooled_result import (
    ONE_STUDY,
    UNDECIDED,
    PooledStudies,
    cell_text,
    condition_text,
    studies_of,
)
from jointz.report.html_page import page_figures, render_template
from jointz.report.style import new_figure, place_axes, to_svg
from jointz.report.wording import (
    DASH,
    format_interval,
    format_number,
    method_name,
    parameter_name,
    point_name,
)
from jointz.results.figure_style import (
    BLUE,
    FAINT,
    INK,
    MUTED,
    WIDTH_MM,
    Axes,
    Figure,
    figure_style,
)

_HASH_DIGITS = 12
_REASONS = {code.value: code.meaning for code in NotPooled}


def render_pool(pooled: PooledStudies, figures: Mapping[str, str]) -> str:
    """Write pooled results as one HTML page with its figures and styles inside."""
    method = " and ".join(method_name(name) for name in sorted(set(pooled.estimates["method"])))
    joint = str(pooled.estimates["joint"].iloc[0])
    is_used = pooled.studies["status"] == "ok"
    captions = (parameter_name(name.removeprefix("forest_")) for name in figures)
    return render_template(
        "pool.html.j2",
        title=f"{joint.capitalize()}: means over studies",
        about=["jointz pool", method, str(pooled.provenance.get("created", ""))],
        level=f"{100 * pooled.ci_level:g} %",
        facts=_facts(pooled),
        notes=pooled.notes,
        figures=page_figures(
            (name, svg, "", caption)
            for (name, svg), caption in zip(figures.items(), captions, strict=True)
        ),
        pooled=_by_parameter(pooled.table),
        studies=_by_parameter(pooled.studies[is_used]),
        left_out=_by_parameter(pooled.studies[~is_used]),
        sources=pooled.settings,
        provenance=pooled.provenance,
        digits=_HASH_DIGITS,
    )


def _facts(pooled: PooledStudies) -> list[tuple[str, str]]:
    count = pooled.table["status"].value_counts()
    people = pooled.estimates[["study", "participant"]].drop_duplicates()
    conditions = {condition_text(row) for row in pooled.table.to_dict("records")}
    facts = {
        "studies": pooled.studies["study"].nunique(),
        "people": len(people),
        "conditions": len(conditions),
        "means over studies": count.get("ok", 0),
        "values of one study": count.get(ONE_STUDY, 0),
        "undecided means": count.get(UNDECIDED, 0),
        "without a value": pooled.table["value"].isna().sum(),
    }
    return [(str(number), name) for name, number in facts.items() if number]


def _by_parameter(table: pd.DataFrame) -> list[dict[str, Any]]:
    return [
        {
            "name": parameter_name(str(name)),
            "unit": group["unit"].iloc[0],
            "rows": [_texts(row) for row in group.to_dict("records")],
        }
        for name, group in table.groupby("parameter", sort=False)
    ]


def _texts(row: Mapping[Any, Any]) -> dict[Any, Any]:
    """Return a row of means or of studies with its numbers as text."""

    def number(name: str) -> str:
        value = row.get(name)
        return DASH if pd.isna(value) else format_number(value, like=row["value"])

    percent = {k: DASH if pd.isna(v) else f"{v:.0f} %" for k, v in row.items() if "pct" in str(k)}
    low, high = number("prediction_low"), number("prediction_high")
    ends = (None if pd.isna(row[k]) else float(row[k]) for k in ("value", "ci_low", "ci_high"))
    texts = {
        "point": point_name(row["timing_point"]),
        "condition": condition_text(row) or DASH,
        "mean": DASH if pd.isna(row["value"]) else format_interval(*ends),
        "next": DASH if low == DASH else f"{low} to {high}",
        "tau": number("tau"),
        "se": number("se"),
        "why": _REASONS.get(row["status"], ""),
    }
    return {**row, **percent, **texts}


_LINE_MM: Final = 4.6
_LEFT_MM, _RIGHT_MM, _TOP_MM, _BELOW_MM = 58.0, 42.0, 2.0, 11.0
_LONGEST: Final = 30

_Row = Mapping[Any, Any]


def draw_forests(pooled: PooledStudies) -> dict[str, str]:
    """Return the forest plot of each parameter with a value, as SVG."""
    with figure_style():
        return {
            f"forest_{name}": to_svg(_forest(rows, pooled.studies))
            for name, rows in pooled.table.groupby("parameter", sort=False)
            if rows["value"].notna().any()
        }


def _forest(rows: pd.DataFrame, studies: pd.DataFrame) -> "Figure":
    """Draw the cells of a parameter below each other, with a common axis."""
    cells = [(row, _used(studies, row)) for row in rows[rows["value"].notna()].to_dict("records")]
    n_lines = sum(len(used) + 2.4 - (row["n_studies"] == 1) for row, used in cells)
    height = _LINE_MM * n_lines
    figure = new_figure(height + _TOP_MM + _BELOW_MM)
    axes = place_axes(
        figure, _LEFT_MM, _TOP_MM, width_mm=WIDTH_MM - _LEFT_MM - _RIGHT_MM, height_mm=height
    )
    y = 0.5
    for row, used in cells:
        y = _draw_cell(axes, row, used, y)
    axes.set_ylim(n_lines, 0.0)
    ends = np.concatenate([used[["ci_low", "ci_high"]].to_numpy().ravel() for _, used in cells])
    margin = 0.04 * float(np.ptp(ends)) or 1.0
    axes.set_xlim(float(ends.min()) - margin, float(ends.max()) + margin)
    if ends.min() < 0.0 < ends.max():
        axes.axvline(0.0, color=FAINT, lw=0.8, zorder=0)
    axes.set_yticks([])
    axes.spines["left"].set_visible(False)
    first = cells[0][0]
    axes.set_xlabel(axis_label(first["parameter"]))
    return figure


def _used(studies: pd.DataFrame, row: _Row) -> pd.DataFrame:
    used = studies_of(studies, row)
    return used[used["status"] == "ok"]


def _draw_cell(axes: "Axes", row: _Row, used: pd.DataFrame, y: float) -> float:
    """Draw the studies of a cell and their mean; return the height of the next cell."""
    _text(axes, y, cell_text(row), "", fontweight="bold")
    for study in used.to_dict("records"):
        y += 1.0
        weight = 100.0 if np.isnan(study["weight_pct"]) else study["weight_pct"]
        axes.plot([study["ci_low"], study["ci_high"]], [y, y], color=MUTED, lw=1.0)
        axes.plot(study["value"], y, "s", color=INK, ms=2.0 + 0.035 * weight)
        _text(axes, y, f"{_short(study['study'])} ({study['n_people']})", _interval(study))
    if row["n_studies"] > 1:
        y += 1.0
        is_undecided = row["status"] == UNDECIDED
        color, undecided = (MUTED, ", undecided") if is_undecided else (BLUE, "")
        axes.plot([row["prediction_low"], row["prediction_high"]], [y, y], color=color, lw=0.8)
        across = [row["ci_low"], row["value"], row["ci_high"], row["value"]]
        axes.fill(across, [y, y - 0.3, y, y + 0.3], color=color, lw=0)
        label = f"Mean over {row['n_studies']} studies{undecided}"
        _text(axes, y, label, _interval(row), color=color)
    return y + 1.4


def _text(axes: "Axes", y: float, left: str, right: str, **style: Any) -> None:
    place = {"transform": axes.get_yaxis_transform(), "va": "center", **style}
    axes.text(-_LEFT_MM / (WIDTH_MM - _LEFT_MM - _RIGHT_MM), y, left, ha="left", **place)
    axes.text(1.03, y, right, ha="left", **place)


def _interval(row: _Row) -> str:
    return format_interval(row["value"], row["ci_low"], row["ci_high"])


def _short(name: str) -> str:
    return name if len(name) <= _LONGEST else f"{name[: _LONGEST - 1]}\N{HORIZONTAL ELLIPSIS}"
