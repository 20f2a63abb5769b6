"""Compare results over people: conditions, days, groups, timing points, the published tables."""

import json
import os
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

from jointz.core.comparison import Comparison
from jointz.core.comparison_rows import GROUPS
from jointz.core.errors import DataError
from jointz.core.provenance import now, software
from jointz.report.comparison_figures import draw_comparison
from jointz.report.comparison_page import render_comparison
from jointz.workflows.comparison_cells import LEVEL, comparison_cells, mean_of, pair_designs
from jointz.workflows.comparison_notes import comparison_notes, comparison_references
from jointz.workflows.comparison_sources import read_sources
from jointz.workflows.comparison_tests import (
    between_points,
    between_sources,
    factor_tests,
    repeats_at,
)
from jointz.workflows.results_folder import new_folder, write_marker

MARKER = "provenance.json"
PAGE = "comparison.html"
_FLOAT_FORMAT = "%.10g"


def compare_results(
    sources: Sequence[str | os.PathLike[str]],
    *,
    paired: bool | None = None,
    days: bool = False,
    margin_pct: float | None = None,
) -> Comparison:
    """Compare results folders, and the published tables, over people.

    Parameters
    ----------
    sources : sequence of path
        Results folders of ``jointz analyze``; ``published`` stands for the dissertation's
        tables 4.1 to 4.3. One alone is compared over its timing points.
    paired : bool, optional
        Whether equal ids are the same people. By default they are where all ids of two folders
        are equal, and are not where none is. The published people are always others.
    days : bool
        Whether the folders are days of one condition: how well do people repeat?
    margin_pct : float, optional
        Margin of equivalence, % of the second mean.

    Returns
    -------
    Comparison
        First minus second, n counting people.

    Raises
    ------
    DataError
        When a folder cannot be read, folders share some participants only and ``paired`` is
        not given, or they have no timing point in common.
    """
    read = read_sources([str(source) for source in sources])
    designs = pair_designs(read, paired=paired)
    if days and (len(read) < 2 or GROUPS in designs.values()):
        raise DataError(
            "compare: days are two or more results of the same people. Name a folder a day, with "
            "--paired where some people came on some days only."
        )
    if margin_pct is not None and not 0.0 < margin_pct < float("inf"):
        raise DataError(f"compare: expected a margin above 0 %, got {margin_pct:g}.")
    cells = comparison_cells(read)
    differences = between_sources(read, cells, designs, margin_pct) if len(read) > 1 else ()
    tests = factor_tests(read, cells, designs)
    made = Comparison(
        sources=tuple(results.source for results in read),
        values=tuple(v for row in cells.values() for own in row for v in own.values()),
        means=tuple(mean_of(row[i], place) for place, row in cells.items() for i in range(len(read))
                    if row[i]),
        differences=differences or between_points(tests, cells),
        tests=tests,
        repeatability=tuple(repeats_at(place, row) for place, row in cells.items() if all(row))
        if days else (),
        references=comparison_references(read, list(cells)),
        margin_pct=margin_pct,
        ci_level=LEVEL,
        settings={"sources": [r.source.name for r in read], "paired": paired, "days": days,
                  "margin_pct": margin_pct},
        provenance={**software(), "created": now(),
                    "inputs": [dict(one) for r in read for one in r.inputs]},
    )  # fmt: skip
    return replace(made, notes=comparison_notes(made, read, designs))


def write_comparison(
    comparison: Comparison, out: str | os.PathLike[str], *, overwrite: bool = False
) -> Path:
    """Write a comparison as tables, figures and one page.

    Parameters
    ----------
    comparison : Comparison
        What to write.
    out : path
        The folder to make.
    overwrite : bool
        Replace a folder that jointz made.

    Returns
    -------
    pathlib.Path
        The page.

    Raises
    ------
    OutputError
        When the folder exists and may not be replaced, or cannot be written.
    """
    out = Path(out)
    with new_folder(out, marker=MARKER, overwrite=overwrite) as folder:
        figures = draw_comparison(comparison)
        (folder / "figures").mkdir()
        for name, svg in figures.items():
            (folder / "figures" / f"{name}.svg").write_text(svg, encoding="utf-8")
        for name, frame in {
            "comparison": comparison.to_frame(),
            "means": comparison.means_frame(),
            "repeatability": comparison.repeatability_frame(),
        }.items():
            if len(frame):
                frame.to_csv(folder / f"{name}.csv", index=False, float_format=_FLOAT_FORMAT)
        text = json.dumps(comparison.to_dict(), allow_nan=False)
        (folder / "comparison.json").write_text(text + "\n", encoding="utf-8")
        (folder / PAGE).write_text(render_comparison(comparison, figures), encoding="utf-8")
        settings = {"settings": dict(comparison.settings)}
        write_marker(folder, MARKER, {**comparison.provenance, **settings})
    return out / PAGE
