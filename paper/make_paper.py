"""Write paper.md and its figure: ``python paper/make_paper.py``, or ``--check`` them only.

Numbers come from the tables of the benchmarks, the validation page and the package; the template
has none of its own. A test compares the paper with what this makes, so it cannot fall behind.
"""

import argparse
import csv
import inspect
import re
import sys
import textwrap
from collections.abc import Mapping, Sequence
from datetime import date
from pathlib import Path
from typing import TYPE_CHECKING, Any

import jinja2

import jointz
from jointz.identify import estimators
from jointz.io.formats import registry
from jointz.io.protocols import builtin_protocols
from jointz.report.style import (
    legend_line,
    new_figure,
    panel_heading,
    place_axes,
    place_legend,
    to_pdf,
)
from jointz.results.figure_style import BLUE, FAINT, GREEN, VERMILION, WIDTH_MM, figure_style
from jointz.rig.devices import drivers
from jointz.rig.experiment import controllers

if TYPE_CHECKING:
    from matplotlib.axes import Axes

HERE = Path(__file__).parent
ROOT = HERE.parent
TABLES = ROOT / "docs" / "tables"
TEMPLATE = HERE / "paper.template.md"
PAPER = HERE / "paper.md"
FIGURE = HERE / "accuracy.pdf"
PARAMETERS = ("stiffness", "damping", "inertia")

Row = Mapping[str, str]
#: Of each bar of the figure: label, and the row of each parameter.
Cases = Mapping[str, Mapping[str, Row]]

#: Row of realistic.csv -> label under the figure.
_STRAPPED = {
    "a": "held torque,\ngoniometer",
    "b": "doublets,\ngoniometer",
    "c": "doublets,\nall sensors",
}
_RIGID = {"dissertation": "dissertation", "rigid": "rigid"}
_RIGID_ROW = "nominal-lag-unknown"
_MARKERS = {
    "stiffness": ("K", "o", BLUE),
    "damping": ("B", "s", VERMILION),
    "inertia": ("J", "^", GREEN),
}


def paper() -> str:
    """Return the text of paper.md."""
    environment = jinja2.Environment(undefined=jinja2.StrictUndefined, keep_trailing_newline=True)
    environment.filters["whole"] = lambda text: f"{float(text):.0f}"
    template = environment.from_string(TEMPLATE.read_text(encoding="utf-8"))
    head, body = template.render(numbers()).split("\n---\n", 1)
    return f"{head}\n---\n\n" + "\n\n".join(_wrapped(part) for part in body.split("\n\n")) + "\n"


def word_count(text: str) -> int:
    """Return the number of words of a paper, tables and captions included, without its head."""
    body = re.sub(r"<!--.*?-->", "", text.split("\n---\n", 1)[1], flags=re.DOTALL)
    return sum(any(c.isalnum() for c in word) for word in body.split())


def _wrapped(part: str) -> str:
    """Return a paragraph in lines of one width; numbers change its length."""
    if part.lstrip().startswith(("|", "#", "<!--")):
        return part.strip()
    return textwrap.fill(part.strip(), 110, break_long_words=False, break_on_hyphens=False)


def numbers() -> dict[str, Any]:
    """Return everything that the template can name."""
    return {
        "authors": authors(),
        "date": paper_date(),
        "level": f"{level_pct():.0f}",
        "accuracy": accuracy(),
        "realistic": nested(table("realistic.csv"), "row", "parameter"),
        "foreign": nested(table("foreign-world.csv"), "protocol", "parameter"),
        "counts": counts(),
        "matlab": matlab(),
        "validation": validation(),
        "unmet": unmet_targets(),
        "triple": triple,
        "ratio": ratio,
    }


# --- sources ----------------------------------------------------------------------------------


def table(name: str) -> list[Row]:
    """Return the rows of a table of docs/tables."""
    with (TABLES / name).open(encoding="utf-8", newline="") as file:
        return list(csv.DictReader(file))


def nested(rows: Sequence[Row], outer: str, inner: str) -> dict[str, dict[str, Row]]:
    """Return rows by the values of two columns."""
    found: dict[str, dict[str, Row]] = {}
    for row in rows:
        found.setdefault(row[outer], {})[row[inner]] = row
    return found


def accuracy() -> dict[str, dict[str, dict[str, Row]]]:
    """Return the accuracy by row of simulated people, method and parameter."""
    rows = table("accuracy-rows.csv")
    names = dict.fromkeys(row["row"] for row in rows)
    return {
        name: nested([row for row in rows if row["row"] == name], "method", "parameter")
        for name in names
    }


def counts() -> dict[str, int]:
    """Return how many of each kind the package registers."""
    return {
        "methods": len(estimators.BUILT_IN),
        "formats": len(set(registry.BUILT_IN.values())),
        "drivers": sum(not name.startswith("rig.") for name in drivers.BUILT_IN),
        "controllers": len(controllers.BUILT_IN),
        "protocols": len(builtin_protocols()),
    }


def unmet_targets() -> dict[str, int]:
    """Return how many accuracy targets of ``rigid`` are missed, and how many by wide intervals."""
    targets = [row for row in table("accuracy-targets.csv") if row["method"] == "rigid"]
    missed = [row["target"] for row in targets if row["met"] == "False"]
    bands = [re.search(r"coverage of \w+ ([\d.]+) \(band [\d.]+-([\d.]+)\)", one) for one in missed]
    too_wide = sum(float(band[1]) > float(band[2]) for band in bands if band)
    return {"all": len(targets), "targets": len(missed), "too_wide": too_wide}


def level_pct() -> float:
    """Return the level of intervals, percent."""
    return 100.0 * float(inspect.signature(jointz.identify_joint).parameters["ci_level"].default)


def matlab() -> dict[str, str]:
    """Return how many calls of MATLAB the page compares with ours."""
    page = (ROOT / "docs" / "from-matlab.md").read_text(encoding="utf-8")
    return _only(r"Of (?P<rows>\d+) rows (?P<compared>\d+) are compared", page).groupdict()


def validation() -> dict[str, Any]:
    """Return the sums at the head of each chapter of the validation page."""
    page = (ROOT / "docs" / "validation.html").read_text(encoding="utf-8")
    held = re.findall(r"<b>(\d+) of (\d+)</b>intervals of the recommended method hold", page)
    statements = re.findall(r"<b>(\d+)</b>printed statements ([^<]+)</li>", page)
    return {
        "held": sum(int(inside) for inside, _ in held),
        "intervals": sum(int(total) for _, total in held),
        "statements": {verdict: int(number) for number, verdict in statements},
    }


def authors() -> list[str]:
    """Return the authors of CITATION.cff."""
    return re.findall(r'^  - name: "(.+)"$', _citation(), re.MULTILINE)


def paper_date() -> str:
    """Return the date of the release, as JOSS writes it."""
    released = _only(r'^date-released: "?([\d-]+)"?$', _citation())[1]
    day = date.fromisoformat(released)
    return f"{day.day} {day:%B %Y}"


def _citation() -> str:
    return (ROOT / "CITATION.cff").read_text(encoding="utf-8")


def _only(pattern: str, text: str) -> re.Match[str]:
    found = re.search(pattern, text, re.MULTILINE)
    if found is None:
        raise SystemExit(f"make_paper: nothing matches {pattern!r}: the source has changed.")
    return found


# --- numbers in the text ----------------------------------------------------------------------


def triple(
    rows: Mapping[str, Row],
    column: str,
    times: float = 1.0,
    decimals: int = 0,
    parameters: Sequence[str] = PARAMETERS,
) -> str:
    """Return a column of K, B and J, such as ``8 / 5 / 4``."""
    values = [rows[parameter][column] for parameter in parameters]
    return " / ".join(f"{times * float(v):.{decimals}f}" if v else "-" for v in values)


def ratio(quantity: str) -> str:
    """Return how many times as fast as the peer a benchmark is."""
    (row,) = (r for r in table("benchmarks.csv") if r["quantity"] == quantity)
    return f"{float(row['ratio']):.0f}"


# --- figure -----------------------------------------------------------------------------------


def figure() -> bytes:
    """Return the figure: error and coverage of K, B and J by method, sensors and pulses."""
    rigid = accuracy()[_RIGID_ROW]
    strapped = nested(table("realistic.csv"), "row", "parameter")
    panels = [
        (
            "device moves with the bone",
            {label: rigid[name] for name, label in _RIGID.items()},
            "coverage.rate",
        ),
        (
            "device strapped to the leg",
            {label: strapped[name] for name, label in _STRAPPED.items()},
            "coverage",
        ),
    ]
    with figure_style():
        drawn = new_figure(96.0)
        for column, (title, cases, coverage) in enumerate(panels):
            left = 15.0 + column * (WIDTH_MM / 2.0)
            size = {"width_mm": WIDTH_MM / 2.0 - 17.0, "height_mm": 32.0}
            above = place_axes(drawn, left, 12.0, **size)
            below = place_axes(drawn, left, 51.0, **size)
            _draw(above, cases, "rmse_pct", times=1.0, label="RMSE, %")
            _draw(below, cases, coverage, times=100.0, label="coverage, %")
            panel_heading(above, title)
            above.set_ylim(0.0, 100.0)
            above.set_xticklabels([])
            below.set_ylim(0.0, 105.0)
            below.axhline(level_pct(), color=FAINT, zorder=0)
        handles = [
            legend_line(name, colour, marker=marker, linestyle="none")
            for name, marker, colour in _MARKERS.values()
        ]
        place_legend(drawn, handles)
        return to_pdf(drawn)


def _draw(axes: "Axes", cases: Cases, column: str, *, times: float, label: str) -> None:
    """Draw one column of the rows: a group a case, a marker a parameter."""
    for at, rows in enumerate(cases.values()):
        for step, parameter in enumerate(PARAMETERS):
            text = rows[parameter][column]
            _, marker, colour = _MARKERS[parameter]
            if text:
                x = at + 0.2 * (step - 1)
                axes.plot([x], [times * float(text)], marker, color=colour, markersize=5.0)
    axes.set_xlim(-0.5, len(cases) - 0.5)
    axes.set_xticks(range(len(cases)), labels=list(cases))
    axes.set_ylabel(label)


# --- command ----------------------------------------------------------------------------------


def outdated() -> list[str]:
    """Return the files that differ from what this script makes."""
    made = {PAPER: paper().encode("utf-8"), FIGURE: figure()}
    return [
        path.name
        for path, content in made.items()
        if not path.exists() or path.read_bytes() != content
    ]


def main() -> None:
    """Write the paper, or compare it."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--check", action="store_true", help="compare only; exit 1 if outdated")
    if parser.parse_args().check:
        names = outdated()
        if names:
            sys.exit(f"{', '.join(names)}: not what make_paper.py makes. Run: make paper")
        return
    PAPER.write_text(paper(), encoding="utf-8")
    FIGURE.write_bytes(figure())


if __name__ == "__main__":
    main()
