"""Page of a comparison in the test bed: a folder with one page, a table and figures."""

import os
from pathlib import Path
from typing import Any, Final

from jointz.control.testbed.bed_comparison import (
    BedComparison,
    BedCorrelation,
    bed_text,
    people_text,
)
from jointz.control.testbed.bed_laws import REFERENCE
from jointz.control.testbed.figures import bed_figures
from jointz.control.testbed.scores import PLAIN, SCORES, TESTS
from jointz.core.whole_file import refuse_existing
from jointz.io.new_folder import MARKER, new_folder, write_marker
from jointz.report.html_page import page_figures, render_template
from jointz.report.wording import DASH

PAGE: Final = "page.html"
_KIND: Final = "controllers"
_CAPTIONS: Final = {
    "scores": "Means over people with {level} t interval over people; blue: the reference. Plain "
    "walking, and pushes. Work, clearance and pushes are those of strides without a fall.",
    "angles": "First person: mean over the strides without a fall; where all fall, the first.",
    "pushes": "First person, first seed: the run with pushes minus the same run without, until a "
    "fall.",
}


def check_page(out: str | os.PathLike[str]) -> None:
    """Raise OutputError where the folder exists."""
    refuse_existing(Path(out), "folder")


def write_page(found: BedComparison, out: str | os.PathLike[str]) -> Path:
    """Write page, table and figures.

    Parameters
    ----------
    found : BedComparison
        A comparison.
    out : path
        The folder: page.html, table.csv (one row a run), means.csv and the figures as SVG.

    Returns
    -------
    pathlib.Path
        The page.

    Raises
    ------
    OutputError
        When the folder exists.
    WriteError
        When it cannot be written.
    """
    check_page(out)
    path = Path(out)
    with new_folder(path, marker=MARKER, overwrite=False, made_by=_KIND) as folder:
        figures = bed_figures(found)
        (folder / "figures").mkdir()
        for name, svg in figures.items():
            (folder / "figures" / f"{name}.svg").write_text(svg, encoding="utf-8")
        found.to_frame().to_csv(folder / "table.csv", index=False, float_format="%.6g")
        found.means_frame().to_csv(folder / "means.csv", index=False, float_format="%.6g")
        (folder / PAGE).write_text(bed_page(found, figures), encoding="utf-8")
        settings = {"settings": dict(found.settings), "made_by": _KIND}
        write_marker(folder, MARKER, {**found.provenance, **settings})
    return path / PAGE


def bed_page(found: BedComparison, figures: dict[str, str]) -> str:
    """Return the page as HTML with its figures inside."""
    level = f"{100 * found.ci_level:g} %"
    return render_template(
        "controllers.html.j2",
        people=people_text(len(found.participants)),
        controllers=len(found.controllers),
        seeds=found.settings["seeds"],
        reference=REFERENCE,
        level=level,
        figures=page_figures(
            (name, svg, "", _CAPTIONS[name].format(level=level)) for name, svg in figures.items()
        ),
        tests=[_test(found, test) for test in TESTS],
        correlations=_correlations(found),
        scores=[{"name": _words(s), "unit": unit, "text": t} for s, (t, unit) in SCORES.items()],
        provenance=[
            *((key, str(found.provenance[key])) for key in ("jointz", "created")),
            *((f"setting {key}", str(value)) for key, value in found.settings.items()),
            ("people", ", ".join(found.participants)),
        ],
    )


def _test(found: BedComparison, test: str) -> dict[str, Any]:
    """Return the table of a test: means, and differences to the reference below them."""
    own = [mean for mean in found.means if mean.test == test]
    away = {(d.controller, d.score): d for d in found.differences if d.test == test}
    names = tuple(dict.fromkeys(mean.score for mean in own))
    rows = []
    for name in found.controllers:
        means = {mean.score: mean for mean in own if mean.controller == name}
        rows.append({
            "name": name,
            "cells": [
                {
                    "mean": _cell(bed_text(means[s])),
                    "difference": _cell(bed_text(away[name, s])) if (name, s) in away else "",
                }
                for s in names
            ],
        })  # fmt: skip
    heads = [{"name": _words(s), "unit": SCORES[s][1]} for s in names]
    return {"label": TESTS[test].label, "heads": heads, "rows": rows, "open": test == PLAIN}


def _cell(text: str) -> str:
    return DASH if text == "none" else text


def _words(score: str) -> str:
    return score.replace("_", " ")


def _correlations(found: BedComparison) -> list[dict[str, Any]]:
    return [
        {"test": TESTS[c.test].label, "score": _words(c.score), "rho": _rho(c), "n": c.n}
        for c in found.correlations
    ]


def _rho(c: BedCorrelation) -> str:
    if c.rho is None:
        return DASH
    if c.ci_low is None or c.ci_high is None:
        return f"{c.rho:.2f}"
    return f"{c.rho:.2f} [{max(c.ci_low, -1.0):.2f}, {min(c.ci_high, 1.0):.2f}]"
