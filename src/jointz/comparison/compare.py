"""Comparison over people: of conditions, days, groups, timing points and published tables."""

import json
import os
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

from jointz.comparison.comparison_cells import (
    LEVEL,
    check_onsets,
    comparison_cells,
    pair_designs,
    source_mean,
)
from jointz.comparison.comparison_notes import comparison_notes, comparison_references
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
from jointz.comparison.people_comparison import ComparedPeople
from jointz.core.errors import DataError, OutputError
from jointz.core.provenance import now, software
from jointz.io.new_folder import COMPARISON, MARKER, check_free, new_folder, write_marker
from jointz.results.statistics.comparison_rows import GROUPS, PAIRED
from jointz.results.statistics.mixed_model_fit import ADJUSTMENTS, ERRORS
from jointz.stats.mixed_models import DF_METHODS

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
        dissertation's tables 4.1 to 4.3. A single source is compared over its timing points.
    paired : bool, optional
        Whether equal ids are the same people. By default they are if all ids of two folders are
        equal, and are not if no id is. The published people are always other people.
    days : bool
        Whether the folders are days of one condition, to estimate repeatability.
    margin_pct : float, optional
        Margin of equivalence, % of the second mean.
    df : str, optional
        For one source: denominator degrees of freedom of its mixed model, ``kenward-roger`` by
        default, or ``satterthwaite``.
    adjust : str, optional
        For one source: correction of p over its pairs, ``holm`` by default, ``bonferroni`` or
        ``none``.
    error : str, optional
        For one source: error of its pairs. ``paired`` by default: each pair has its own error,
        whether or not all pairs have equal variance; ``pooled``: that of the mixed model, as
        published.

    Returns
    -------
    Comparison
        First minus second, n counting people.

    Raises
    ------
    DataError
        If a folder cannot be read; if folders share only some participants and ``paired`` is
        not given; if they have no timing point in common; if timing points of one name are
        more than 2 % of the gait cycle apart; if an option does not apply to the number of
        sources.
    """
    _check_options(
        len(sources),
        {"--df": (df, DF_METHODS), "--adjust": (adjust, ADJUSTMENTS), "--error": (error, ERRORS)},
        {"--paired and --groups": paired, "--margin": margin_pct},
    )
    results = read_sources(sources)
    check_onsets(results)
    designs = pair_designs(results, paired=paired)
    single = len(results) == 1
    if days and (single or GROUPS in designs.values()):
        raise DataError(
            "compare: --days needs two or more results of the same people. Name one folder for "
            "each day, with --paired if some people came on some days only."
        )
    if margin_pct is not None and not 0.0 < margin_pct < float("inf"):
        raise DataError(f"compare: expected a margin above 0 %, got {margin_pct:g}.")
    model = {"adjust": adjust or "holm", "error": error or PAIRED, "df": df or DF_METHODS[0]}
    cells = comparison_cells(results)
    tests = factor_tests(results, cells, designs, df=model["df"])
    pairs = {key: model[key] for key in ("adjust", "error")}
    people = ComparedPeople(results, designs, list(dict.fromkeys(name for name, _ in cells)))
    comparison = Comparison(
        sources=tuple(result.source for result in results),
        values=tuple(v for row in cells.values() for people in row for v in people.values()),
        means=tuple(people.mean(source_mean(values, place))
                    for place, row in cells.items() for values in row if values),
        differences=between_points(tests, cells, people, **pairs) if single
        else between_sources(results, cells, designs, people, margin_pct=margin_pct),
        tests=tests,
        repeatability=tuple(repeats_at(place, row) for place, row in cells.items() if all(row))
        if days else (),
        references=comparison_references(results, list(cells)),
        margin_pct=margin_pct,
        adjust=model["adjust"],
        ci_level=LEVEL,
        settings={"sources": [r.source.name for r in results], "paired": paired, "days": days,
                  "margin_pct": margin_pct} | (model if single else {}),
        provenance={**software(), "created": now(),
                    "inputs": [dict(file) for r in results for file in r.inputs]},
    )  # fmt: skip
    return replace(comparison, notes=comparison_notes(comparison, results, designs, people.sources))


def _check_options(
    n_sources: int,
    of_one: Mapping[str, tuple[str | None, Sequence[str]]],
    of_several: Mapping[str, Any],
) -> None:
    """Refuse options that would have no effect."""
    for name, (value, choices) in of_one.items():
        if value is not None and value not in choices:
            raise DataError(f"compare: expected {name} {', '.join(choices)}, got {value!r}.")
    option_names = {name for name, (value, _) in of_one.items() if value is not None}
    if n_sources > 1 and option_names:
        raise DataError(
            f"compare: {', '.join(sorted(option_names))}: for a table or one results folder only. "
            "Several folders are compared by t tests, with p adjusted by Holm."
        )
    option_names = {name for name, value in of_several.items() if value is not None}
    if n_sources == 1 and option_names:
        raise DataError(
            f"compare: {', '.join(sorted(option_names))}: for two or more results only. Name "
            "another folder, or leave the option out."
        )


def check_out(
    out: str | os.PathLike[str],
    sources: Sequence[str | os.PathLike[str]],
    *,
    overwrite: bool = False,
) -> None:
    """Raise unless a comparison can be written to ``out``."""
    for path in result_paths(sources):
        if path is not None and path.resolve() == Path(out).resolve():
            raise OutputError(
                f"{out}: is one of the compared folders ({path}) and is kept. Name another folder."
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
