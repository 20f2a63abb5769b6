"""Section of docs/accuracy.md on the foreign world, from the table beside it."""

from pathlib import Path

import pandas as pd

_TABLE = "foreign-world.csv"
_TITLE = """(accuracy-foreign-world)=
## A foreign world

Twenty people of another physics: muscles of Hill's type with tendons and short-range stiffness,
spindles, a yielding ground, in MuJoCo (`benchmarks/worlds`). Its author had not read the method;
nothing was tuned on it; it was run once. Truth: K of the frozen muscles along the motion, with
gravity and the moving limb, B of the muscles, J 60 ms after the onset. Last column: what a
noiseless second-order fit makes of the whole leg ({download}`csv <tables/foreign-world.csv>`).

| protocol | parameter | decided % | failed % | truth (median) | withheld / truth | whole leg |
| --- | --- | --- | --- | --- | --- | --- |"""
_TEXT = """
**`strapped` gives none of 720 values here, and no wrong one**: doubts withhold everything. Rightly
so: what was withheld is half of K, three times B and a quarter of J. Why:

- In stance the leg is no second-order system: trunk, foot and sole resonate at 4 to 15 Hz, body
  weight makes the whole leg's stiffness negative (to -240 N\\*m/rad) and its J nearly zero. K and J
  of the method are positive by construction, so the fit leaves 5 to 20 times the noise
  (`responses_misfit`) and J is unlike the body (`inertia_unlike_body`).
- In swing the whole leg is nearly of second order, but K x + B v explains only 65 to 85 % of the
  torque of the muscles, as short-range stiffness yields within 1 to 2 deg. The misfit is taken up
  by lag and gain of the gyroscopes, 4 to 10 SDs from their calibration (`instruments_unlikely`,
  `lag_unlikely`). Swing alone (two people) is withheld as well.

Whether real legs are like this world, nobody has shown; a lab that sees these doubts in everybody
should think so."""


def foreign_text(tables: Path) -> str:
    """Return the section on the foreign world; "" without its table."""
    file = tables / _TABLE
    if not file.is_file():
        return ""
    lines = [
        f"| {row['protocol']} | {row['parameter']} | {row['decided_pct']:.0f} | "
        f"{row['failed_pct']:.0f} | {row['truth']:.3g} | {row['withheld_over_truth']:.2g} | "
        f"{row['apparent']:.3g} |"
        for _, row in pd.read_csv(file).iterrows()
    ]
    return "\n".join([_TITLE, *lines, _TEXT, ""])
