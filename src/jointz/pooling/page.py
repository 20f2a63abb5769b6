"""Page of pooled results: one HTML file that needs no other."""

from collections.abc import Mapping
from typing import Any

import pandas as pd

from jointz.core.codes import NotPooled
from jointz.pooling.pooled_result import ONE_STUDY, UNDECIDED, PooledStudies, condition_text
from jointz.report.html_page import page_figures, render_template
from jointz.report.wording import (
    DASH,
    format_interval,
    format_number,
    method_name,
    parameter_name,
    point_name,
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
