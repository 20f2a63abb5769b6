"""Sections of docs/accuracy.md on realistic people, from the tables beside it."""

from collections.abc import Iterable
from pathlib import Path

import pandas as pd
from benchmarks.realistic.rows import PARAMETERS, ROWS

_TABLE = "realistic.csv"
_HEAD = (
    "| sensors and pulses | people | available % | coverage (band) | RMSE % | bias % | "
    "half-width % | limits hold |\n| --- | --- | --- | --- | --- | --- | --- | --- |"
)
_TITLE = """(accuracy-realistic)=
## Realistic people

People of the preset `realistic`, device strapped to the leg; K / B / J. Pulses of 17 N\\*m held for
250 ms are analysed over 0.1 s, doublets (39 + 21 ms and 91 + 49 ms, both signs, 50 in all at a
timing point) over 0.15 s. "Limits hold" is the share of one-sided 95 % limits of undecided values
that are right ({download}`csv <tables/realistic.csv>`).
"""
_RESEMBLANCE = """(accuracy-resemblance)=
## Which people are like the dissertation's

The dissertation's method applied to ten people of each preset; printed figures are from tables 4.1
to 4.4 ({{download}}`csv <tables/resemblance.csv>`):

{table}

{verdict}
"""
_VERDICT = """\
**No preset is like the printed people in every figure.** `nominal` is nearest in K.
`anthropometric` and `realistic` people have the inertia of published body segments. Their J is over
seven times the printed one, yet their VAF is nearest: a VAF does not show that
estimates are right."""
_KEYS = ("quantity", "unit", "timing_point")
_LINES = (
    ("VAF mean", "all", "mean VAF, %", ".1f"),
    ("K per kg", "LRE", "K at LRE, N\\*m/rad/kg", ".2f"),
    ("J mean", "all", "mean J, kg\\*m^2", ".3f"),
)


def realistic_text(tables: Path) -> str:
    """Return the section on realistic people; "" without its table.

    Parameters
    ----------
    tables : Path
        Folder of the page's tables.
    """
    file = tables / _TABLE
    if not file.is_file():
        return ""
    scores = pd.read_csv(file)
    lines = [_row_line(scores[scores["row"] == name], name) for name in ROWS]
    return "\n".join([_TITLE, _HEAD, *filter(None, lines), ""])


def _row_line(scores: pd.DataFrame, name: str) -> str:
    if scores.empty:
        return ""
    ordered = scores.set_index("parameter").loc[list(PARAMETERS)]
    bands = ["-" if pd.isna(line["coverage"]) else _covered(line) for _, line in ordered.iterrows()]
    columns = [
        ROWS[name].title.replace("*", "\\*"),
        str(int(ordered["people"].iloc[0])),
        _slashed(ordered["decided_pct"], ".0f"),
        " / ".join(bands),
        *(_slashed(ordered[c], ".0f") for c in ("rmse_pct", "bias_pct", "half_width_pct")),
        _slashed(ordered["limits_hold"], ".2f"),
    ]
    return f"| {' | '.join(columns)} |"


def _covered(line: "pd.Series[float]") -> str:
    low, high = line["coverage_low"], line["coverage_high"]
    return f"{line['coverage']:.2f} ({low:.2f}-{high:.2f})"


def _slashed(values: Iterable[float], form: str) -> str:
    return " / ".join(_number(value, form) for value in values)


def _number(value: float, form: str) -> str:
    return "-" if pd.isna(value) else format(value, form)


def resemblance_text(tables: Path) -> str:
    """Return the section on which presets are like the printed people; "" without its table.

    Parameters
    ----------
    tables : Path
        Folder of the page's tables.
    """
    file = tables / "resemblance.csv"
    if not file.is_file():
        return ""
    figures = pd.read_csv(file)
    sources = [name for name in figures.columns if name not in _KEYS]
    lines = {(r["quantity"], r["timing_point"]): r for r in figures.to_dict("records")}
    shown = [
        [title, *(_number(lines[quantity, at][source], form) for source in sources)]
        for quantity, at, title, form in _LINES
    ]
    head = ["", *(s if s == "printed" else f"`{s}`" for s in sources)]
    rows = [head, ["---"] * len(head), *shown]
    table = "\n".join(f"| {' | '.join(row)} |" for row in rows)
    return _RESEMBLANCE.format(table=table, verdict=_VERDICT)
