"""Section of docs/accuracy.md on the foreign world, from the table beside it."""

from pathlib import Path

import pandas as pd

_TABLE = "foreign-world.csv"
_TITLE = """(accuracy-foreign-world)=
## A foreign world

Twenty people of an independent simulation in MuJoCo (`benchmarks/worlds`): Hill-type muscles with
tendons and short-range stiffness, spindles, a yielding ground. Its author did not know the method,
and nothing was tuned on it ({download}`csv <tables/foreign-world.csv>`).

| protocol | parameter | available % | failed % | withheld value / truth |
| --- | --- | --- | --- | --- |"""
_TEXT = """
**None of 720 values is available here**: checks of the model withhold them. Rightly, as the values
are wrong:

- In stance the whole leg is no second-order system: trunk, foot and sole resonate at 4 to 15 Hz,
  and body weight makes its stiffness negative.
- In swing, K and B explain only 65 to 85 % of the torque of the muscles, as short-range stiffness
  yields within 1 to 2 deg.

Whether real legs are like this is unknown. Consider it if all participants have doubts such as
`responses_misfit`, `inertia_unlike_body` or `instruments_unlikely`."""


def foreign_text(tables: Path) -> str:
    """Return the section on the foreign world; "" without its table."""
    file = tables / _TABLE
    if not file.is_file():
        return ""
    lines = [
        f"| {row['protocol']} | {row['parameter']} | {row['decided_pct']:.0f} | "
        f"{row['failed_pct']:.0f} | {row['withheld_over_truth']:.2g} |"
        for _, row in pd.read_csv(file).iterrows()
    ]
    return "\n".join([_TITLE, *lines, _TEXT, ""])
