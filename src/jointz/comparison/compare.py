"""Compare results over people: conditions, days, groups, timing points, the published tables."""

import json
import os
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

from jointz.analysis.results_folder import (
    COMPARISON,
    MARKER,
    check_free,
    new_folder,
    write_marker,
)
from jointz.comparison.comparison_cells import LEVEL, comparison_cells, mean_of, pair_designs
from jointz.comparison.comparison_notes import comparison_notes, comparison_references
from jointz.comparison.comparison_onsets import check_onsets
from jointz.comparison.comparison_result import Comparison
from jointz.comparison.comparison_sources import read_sources, result_paths
from jointz.comparison.comparison_tests import (
    between_points,
    between_sources,
    factor_tests,
    repeats_at,
)
from jointz.comparison.figures import draw_comparison
from jointz.comparison.page import render_comparison
from jointz.core.errors import DataError, OutputError
from jointz.core.provenance import now, software
from jointz.results.statistics.comparison_rows import GROUPS, PAIRED
from jointz.results.statistics.mixed_model_fit import ADJUSTMENTS, ERRORS
from jointz.stats.mixed_model import DF_METHODS

PAGE = "comparison.html"
_FLOAT_FORMAT = "%.10g"


def compare_results(
    sources: Sequence[str | os.PathLike[str]],
    *,
    paired: bool | None = None,
    days: bool = False,
    margin_pct: float | None = None,
    df: str | None = None,
    adjust: str | None = None,
    error: str | None = None,
) -> Comparison:
    """Compare results folders, and the published tables, over people.

    Parameters
    ----------
    sources : sequence of path
        Results folders of ``jointz analyze``; the word ``published`` stands for the
        dissertation's tables 4.1 to 4.3. One alone is compared over its timing points.
    paired : bool, optional
        Whether equal ids are the same people. By default they are where all ids of two folders
        are equal, and are not where none is. The published people are always others.
    days : bool
        Whether the folders are days of one condition: how well do people repeat?
    margin_pct : float, optional
        Margin of equivalence, % of the second mean.
    df : str, optional
        Of one source: denominator degrees of freedom of its mixed model, ``kenward-roger`` by
        default, or ``satterthwaite``.
    adjust : str, optional
        Of one source: correction of p over its pairs, ``holm`` by default, ``bonferroni`` or
        ``none``.
    error : str, optional
        Of one source: error of its pairs. ``paired`` by default: each has its own, whether or
        not all pairs vary alike; ``pooled``: that of the mixed model, as published.

    Returns
    -------
    Comparison
        First minus second, n counting people.

    Raises
    ------
    DataError
        When a folder cannot be read, folders share some participants only and ``paired`` is
        not given, or they have no timing point in common; when timing points of one name are
        more than 2 % of the gait cycle apart; when an option is not of as many sources.
    """
    _check_options(
        len(sources),
        {"--df": (df, DF_METHODS), "--adjust": (adjust, ADJUSTMENTS), "--error": (error, ERRORS)},
        {"--paired and --groups": paired, "--margin": margin_pct},
    )
    read = read_sources(sources)
    check_onsets(read)
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
    tests = factor_tests(read, cells, designs, df=df or DF_METHODS[0])
    adjust = adjust or "holm"
    pairs = {"adjust": adjust, "error": error or PAIRED}
    made = Comparison(
        sources=tuple(results.source for results in read),
        values=tuple(v for row in cells.values() for own in row for v in own.values()),
        means=tuple(mean_of(row[i], place) for place, row in cells.items() for i in range(len(read))
                    if row[i]),
        differences=differences or between_points(tests, cells, **pairs),
        tests=tests,
        repeatability=tuple(repeats_at(place, row) for place, row in cells.items() if all(row))
        if days else (),
        references=comparison_references(read, list(cells)),
        margin_pct=margin_pct,
        adjust=adjust,
        ci_level=LEVEL,
        settings={"sources": [r.source.name for r in read], "paired": paired, "days": days,
                  "margin_pct": margin_pct} | (pairs | {"df": df or DF_METHODS[0]}
                                               if len(read) == 1 else {}),
        provenance={**software(), "created": now(),
                    "inputs": [dict(one) for r in read for one in r.inputs]},
    )  # fmt: skip
    return replace(made, notes=comparison_notes(made, read, designs))


def _check_options(
    n_sources: int,
    of_one: Mapping[str, tuple[str | None, Sequence[str]]],
    of_several: Mapping[str, Any],
) -> None:
    """Refuse what would not be used."""
    for name, (value, choices) in of_one.items():
        if value is not None and value not in choices:
            raise DataError(f"compare: expected {name} {', '.join(choices)}, got {value!r}.")
    given = {name for name, (value, _) in of_one.items() if value is not None}
    if n_sources > 1 and given:
        raise DataError(
            f"compare: of a table or one results folder only: {', '.join(sorted(given))}. Several "
            "folders are compared by t tests, with p by Holm."
        )
    given = {name for name, value in of_several.items() if value is not None}
    if n_sources == 1 and given:
        raise DataError(
            f"compare: of two or more results only: {', '.join(sorted(given))}. Name another "
            "folder, or leave the option out."
        )


def check_out(
    out: str | os.PathLike[str],
    sources: Sequence[str | os.PathLike[str]],
    *,
    overwrite: bool = False,
) -> None:
    """Raise unless a comparison can be written there."""
    for path in result_paths(sources):
        if path is not None and path.resolve() == Path(out).resolve():
            raise OutputError(
                f"{out}: is what is compared ({path}), and is kept. Name another folder."
            )
    check_free(Path(out), marker=MARKER, overwrite=overwrite, made_by=COMPARISON)


def write_comparison(
    comparison: Comparison, out: str | os.PathLike[str], *, overwrite: bool = False
) -> Path:
    """Write a comparison as tables, figures and one page."""
    out = Path(out)
    with new_folder(out, marker=MARKER, overwrite=overwrite, made_by=COMPARISON) as folder:
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
        settings = {"settings": dict(comparison.settings), "made_by": COMPARISON}
        write_marker(folder, MARKER, {**comparison.provenance, **settings})
    return out / PAGE
