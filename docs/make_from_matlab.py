"""Write from-matlab.md and its files of programs: ``python docs/make_from_matlab.py``.

With ``--reference`` it first runs the other side of every row in Octave and R, and with
``--spm1d PYTHON`` in a Python that has spm1d, and stores their numbers. A test compares the page
and the files with what this script makes, and the stored numbers with those of jointz.
"""

import argparse
from collections import Counter
from pathlib import Path
from typing import Any

from from_matlab.programs import make_reference, stored
from from_matlab.rows import Row, Topic, all_rows, topics

PAGE = Path(__file__).parent / "from-matlab.md"
TABLES = Path(__file__).parent / "tables"

_HEAD = """\
# From MATLAB

<!-- Made by docs/make_from_matlab.py out of docs/from_matlab; do not edit. -->

This page lists Python equivalents of calls of MATLAB, NLID and spm1d, and the differences that
change numbers without an error. `.mat` files need no translation: name their structs and units in
[the study file](study-format.md).

`p = [q v w] \\ m`, with its filters and derivatives, becomes

```python
import numpy as np
import pandas as pd
import jointz

ankle = pd.read_csv("ankle.csv")  # angle in degrees, 500 Hz
angle = np.deg2rad(ankle["pos"])
fit = jointz.identify_joint(angle=angle, torque=ankle["tau"], rate_hz=500, input="angle")
print(fit.parameter("stiffness").value)
```

The file under each table has more rows, with both programs, notes and agreement.
Of {n} rows {tested} are compared on the same data: {run} in {programs} ({by}), {formulas} by the
published formula, because Octave lacks the function. MATLAB itself was not run.
"""
_DATA = """\
Data of all programs (SI units, angles in rad; np is numpy, pd is pandas)

rate (500 Hz), t, theta, tau, command
    20 s of a joint of 60 N*m/rad, 1 N*m*s/rad and 0.05 kg*m^2 under a random torque
u, v
    white noise, and the same after a filter
contact, knee
    a walk
knee_mean, knee_moment
    one gait cycle of 101 nodes
pulse_theta, pulse_velocity, pulse_acceleration, pulse_tau, soft_tau
    pulses by samples
draws
    pulses of each bootstrap replicate, counted from 1
current, motor_speed, motor_acceleration, sensor_torque
    a motor on a bench
subject, point, stiffness
    one row a participant and timing point
curves_a, curves_b
    people by nodes
x, y, x_nan
    two small samples, and one with missing values

Made with {versions}.
"""


def page() -> str:
    """Return the text of from-matlab.md."""
    return "\n".join([_head(), *(_section(topic) for topic in topics())])


def program_files() -> dict[str, str]:
    """Return the text of the files of programs by name, one for each topic."""
    data = _DATA.format(versions=_versions())
    return {
        _file_name(topic): "\n".join([topic.title, "", data, *map(_programs, topic.rows)])
        for topic in topics()
    }


def _file_name(topic: Topic) -> str:
    return f"from-matlab-{topic.name}.txt"


def _head() -> str:
    rows = all_rows()
    compared = [row for row in rows if row.program]
    ran = Counter(row.program for row in compared if not row.formula)
    return _HEAD.format(
        n=len(rows),
        tested=len(compared),
        run=ran.total(),
        formulas=len(compared) - ran.total(),
        programs=" or ".join([", ".join([*ran][:-1]), [*ran][-1]]),
        by=", ".join(str(n) for n in ran.values()),
    )


def _versions() -> str:
    programs: dict[str, dict[str, str]] = stored()["programs"]
    return "; ".join(
        ", ".join(f"{name} {version}" for name, version in found.items())
        for found in programs.values()
    )


def _section(topic: Topic) -> str:
    table = ["| MATLAB | Python | caution |", "|---|---|---|"]
    lines = [_line(row) for row in topic.rows if row.call]
    programs = f"Programs: {{download}}`{_file_name(topic)} <tables/{_file_name(topic)}>`"
    return "\n".join([f"## {topic.title}\n", topic.text, "", *table, *lines, "", programs, ""])


def _line(row: Row) -> str:
    cells = (row.call, row.equivalent, row.caution)
    return "| " + " | ".join(cell.replace("|", "\\|") for cell in cells) + " |"


def _programs(row: Row) -> str:
    parts = [f"{row.step}\n{'-' * len(row.step)}", row.note, _compared(row)]
    parts += [f"MATLAB\n{_indented(row.matlab)}", f"Python\n{_indented(row.python or 'none')}"]
    return "\n\n".join(filter(None, parts)) + "\n"


def _indented(program: str) -> str:
    return "\n".join(f"    {line}" for line in program.splitlines())


def _compared(row: Row) -> str:
    if row.untested:
        return f"Not compared: {row.untested}"
    name = "the published formula in Octave" if row.formula else row.program
    share = "exactly" if row.rtol == 0.0 else f"to {row.rtol:.0e}".replace("e-0", "e-")
    return f"Agrees with {name} {share}."


def _arguments() -> Any:
    parser = argparse.ArgumentParser(description="Write from-matlab.md.")
    parser.add_argument("--reference", action="store_true", help="run Octave and R first")
    parser.add_argument("--spm1d", default="", metavar="PYTHON", help="and spm1d in this Python")
    return parser.parse_args()


if __name__ == "__main__":
    chosen = _arguments()
    if chosen.reference:
        make_reference(spm1d=chosen.spm1d)
    PAGE.write_text(page(), encoding="utf-8")
    for name, text in program_files().items():
        (TABLES / name).write_text(text, encoding="utf-8")
