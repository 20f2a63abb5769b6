"""Write from-matlab.md out of its rows: ``python docs/make_from_matlab.py``.

With ``--reference`` it first runs the other side of every row in Octave and R, and with
``--spm1d PYTHON`` in a Python that has spm1d, and stores what they say. A test compares the page
with what this makes, and what is stored with what jointz gives.
"""

import argparse
from collections import Counter
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from from_matlab.programs import make_reference, stored
from from_matlab.rows import Row, Topic, all_rows, topics

PAGE = Path(__file__).parent / "from-matlab.md"

# Code is wide: the tables take the place of the list of headings, and break lines where they must.
_HEAD = """\
---
html_theme.sidebar_secondary.remove: true
---
# From MATLAB

```{{raw}} html
<style>
.bd-main .bd-content .bd-article-container {{ max-width: 90em; }}
.bd-article table {{ table-layout: fixed; width: 100%; }}
.bd-article table th:first-child {{ width: 30%; }}
.bd-article table code {{ overflow-wrap: anywhere; }}
</style>
```

<!-- Made by docs/make_from_matlab.py out of docs/from_matlab; do not edit. -->

Calls of MATLAB and other programs, their equivalents here, and the number on which both agree.
Of {n} rows {tested} are
compared, each number to the share stated, on the same data; the other {untested} say why not. In
{run} of them the left side ran in the program named *in italics*: {by}. In the
other {formulas}, *Octave, the formula*, Octave does not have the function: what ran is its
published formula written out, not the function itself. The tests of jointz run the right side.

MATLAB itself was not at hand. *Octave* means that Octave and its packages ran the call, spelled as
Octave wants it where that differs; *R* and *spm1d* that those did. Made with
{versions}.

Given to all rows, SI throughout and angles in rad:

- `rate` (500 Hz), `t`, `theta`, `tau`, `command`: 20 s of a joint of 60 N\\*m/rad,
  1 N\\*m\\*s/rad and 0.05 kg\\*m^2 under a random torque; `u`, `v`: white noise and what a filter
  makes of it;
- `contact`, `knee`: a walk; `knee_mean`, `knee_moment`: one cycle of 101 nodes;
- `pulse_theta`, `pulse_velocity`, `pulse_acceleration`, `pulse_tau`, `soft_tau`: pulses by samples;
  `draws`: which pulses a replicate holds, counted from 1;
- `current`, `motor_speed`, `motor_acceleration`, `sensor_torque`: a motor on a bench;
- `subject`, `point`, `stiffness`: one row a participant and timing point; `curves_a`, `curves_b`:
  people by nodes; `x`, `y`, `x_nan`: two small samples, and one with holes.

`np` is numpy, `pd` pandas. Your own .mat
files need no translation: [the study file](study-format.md) names their structs and units.
"""


def page() -> str:
    """Return the text of from-matlab.md."""
    return "\n".join([_head(), *(_section(topic) for topic in topics())])


def _head() -> str:
    rows = all_rows()
    compared = [row for row in rows if row.program]
    ran = Counter(row.program for row in compared if not row.formula)
    programs: dict[str, dict[str, str]] = stored()["programs"]
    versions = [
        ", ".join(f"{name} {version}" for name, version in found.items())
        for found in programs.values()
    ]
    return _HEAD.format(
        n=len(rows),
        tested=len(compared),
        untested=len(rows) - len(compared),
        run=ran.total(),
        formulas=len(compared) - ran.total(),
        by=", ".join(f"{n} with {program}" for program, n in ran.most_common()),
        versions="; ".join(versions),
    )


def _section(topic: Topic) -> str:
    table = ["| step | MATLAB | here |", "|---|---|---|"]
    return "\n".join([f"## {topic.title}\n", topic.text, "", *table, *map(_line, topic.rows), ""])


def _line(row: Row) -> str:
    step = "<br>".join(filter(None, (f"**{row.step}**", row.note, _compared(row))))
    cells = (step, _code(row.matlab), _code(row.python) or "none")
    return "| " + " | ".join(cell.replace("|", "\\|") for cell in cells) + " |"


def _code(snippet: str) -> str:
    """Return the lines of a snippet, each as code; words that say there is none as they are."""
    if snippet.startswith("none"):
        return snippet
    return "<br>".join(f"`{line.strip()}`" for line in _joined(snippet.splitlines()))


def _joined(lines: list[str]) -> Iterator[str]:
    """Yield lines with those that end inside a bracket joined to the next."""
    held = ""
    for line in lines:
        held = f"{held} {line.strip()}".strip()
        if held.count("(") == held.count(")"):
            yield held.replace("( ", "(")
            held = ""
    if held:
        yield held


def _compared(row: Row) -> str:
    if row.untested:
        return f"*Not compared:* {row.untested}"
    name = "Octave, the formula" if row.formula else row.program
    share = "exactly" if row.rtol == 0.0 else f"to {row.rtol:.0e}".replace("e-0", "e-")
    return f"*{name}, {share}*"


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
