"""Section of docs/accuracy.md on plans, from the table beside it."""

from pathlib import Path

import pandas as pd
from benchmarks.planning.obtained import PLANNED

_BAND = (0.8, 1.25)
_COLUMNS = (
    "pulses, sensors",
    "narrow, predicted %",
    "narrow, obtained %",
    "available, predicted %",
    "available, obtained %",
)
_TEXT = """(accuracy-plans)=
## Predictions of plans

The intervals that [`jointz plan`](plan.md) predicts are compared with the analysis of {people}
`realistic` people, 50 pulses a timing point ({{download}}`csv <tables/planning.csv>`); K / B.
"Narrow" is a half-width of at most 25 %.

{head}
{rows}

With pulses that hold one torque, K and B are not available, as predicted. In {inside:.0f} % of
{cells} cells the predicted SD is {low} to {high} times the obtained one. Intervals of soft legs are
wider than planned.
"""


def planning_text(tables: Path) -> str:
    """Return the section on plans; "" without its table.

    Parameters
    ----------
    tables : Path
        Folder of the page's tables.
    """
    file = tables / "planning.csv"
    if not file.is_file():
        return ""
    table = pd.read_csv(file)
    kb = table[table["parameter"] != "inertia"]
    inside = kb["ratio"].between(*_BAND)
    return _TEXT.format(
        head="\n".join(f"| {' | '.join(r)} |" for r in (_COLUMNS, ["---"] * len(_COLUMNS))),
        people=int(table["people"].max()),
        rows="\n".join(_row(kb[kb["row"] == name], name) for name in PLANNED if "hold" not in name),
        low=_BAND[0],
        high=_BAND[1],
        inside=100.0 * inside.mean(),
        cells=len(kb),
    )


def _row(cells: pd.DataFrame, name: str) -> str:
    shape, sensors = name.split("-")
    shapes = {"doublets": "two doublets", "short": "60 ms pulses"}
    seen = {"goniometer": "goniometer", "three": "goniometer, encoder, gyroscopes"}
    by = dict(iter(cells.groupby("parameter")))
    columns = (
        "predicted_narrow",
        "obtained_narrow",
        "predicted_decided",
        "obtained_decided",
    )
    shares = [
        " / ".join(f"{100.0 * by[p][c].mean():.0f}" for p in ("stiffness", "damping"))
        for c in columns
    ]
    return f"| {shapes[shape]}, {seen[sensors]} | {' | '.join(shares)} |"
