"""Section of docs/accuracy.md on plans, from the table beside it."""

from pathlib import Path

import pandas as pd
from benchmarks.planning.obtained import PLANNED

_BAND = (0.8, 1.25)
_COLUMNS = (
    "pulses, sensors",
    "ratio of K",
    "ratio of B",
    "narrow, predicted %",
    "narrow, obtained %",
    "decided, predicted %",
    "decided, obtained %",
    "reached %",
)
_TEXT = """(accuracy-plans)=
## Plans beside what came out

[`jointz plan`](plan.md) knows the priors of the estimator, the mass and height of a person and four
minutes of unperturbed walking. Beside it the analysis of 50 pulses a timing point, of {people}
`realistic` people; window 0.15 s ({{download}}`csv <tables/planning.csv>`). Ratio: predicted over
obtained SD of the logarithm, medians over people, least to largest over six timing points. Narrow:
share of values with a half-width of at most 25 %. Reached: share of people at or below the
half-width that 80 of 100 drawn legs do not exceed. K / B.

{head}
{rows}

The ratio is within {low} to {high} in {inside:.0f} % of {cells} cells. The priors are the same at
all timing points, and legs are not: stiff or strongly damped ones are known better than planned,
soft ones worse. Legs drawn from the priors differ more than these people, so that more than 80 %
reach what 80 % should.
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
        rows="\n".join(_row(kb[kb["row"] == name], name) for name in PLANNED),
        low=_BAND[0],
        high=_BAND[1],
        inside=100.0 * inside.mean(),
        cells=len(kb),
    )


def _row(cells: pd.DataFrame, name: str) -> str:
    shape, sensors = name.split("-")
    shapes = {"hold": "250 ms hold", "doublets": "two doublets", "short": "60 ms pulses"}
    seen = {"goniometer": "goniometer", "three": "goniometer, encoder, gyroscopes"}
    by = dict(iter(cells.groupby("parameter")))
    ranges = [
        f"{by[p]['ratio'].min():.2f} to {by[p]['ratio'].max():.2f}"
        for p in ("stiffness", "damping")
    ]
    columns = (
        "predicted_narrow",
        "obtained_narrow",
        "predicted_decided",
        "obtained_decided",
        "within_assured",
    )
    shares = [
        " / ".join(f"{100.0 * by[p][c].mean():.0f}" for p in ("stiffness", "damping"))
        for c in columns
    ]
    return f"| {shapes[shape]}, {seen[sensors]} | {' | '.join([*ranges, *shares])} |"
