"""``jointz compare``: conditions, days, groups, timing points and studies, over people."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Annotated, Any, Literal

import typer

from jointz.terminal.options import Printing
from jointz.terminal.output import EXIT_NO_ESTIMATE, EXIT_OK, emit, emit_json, emit_table
from jointz.terminal.printout import failures

#: Choices of ``--df``.
Df = Literal["kenward-roger", "satterthwaite"]
#: Choices of ``--adjust``.
Adjust = Literal["bonferroni", "holm", "none"]


#: Choices of ``--error``.
Error = Literal["pooled", "paired"]


def compare(
    results: Annotated[
        list[str],
        typer.Argument(
            help="Results folders of jointz analyze, or the word published for the dissertation's "
            "tables; or one table of your own (csv), with --response, --within and --participant."
        ),
    ],
    out: Annotated[Path | None, typer.Option(help="Folder for tables, figures and a page.")] = None,
    paired: Annotated[
        bool | None,
        typer.Option(
            "--paired/--groups",
            help="For several folders: equal ids are the same people, or (--groups) different "
            "people. By default they are the same if all ids of two folders are equal.",
        ),
    ] = None,
    days: Annotated[
        bool,
        typer.Option(
            "--days", help="For several folders: they are days of one condition; repeatability."
        ),
    ] = False,
    margin: Annotated[
        float | None,
        typer.Option(
            help="For several folders: test equivalence within this percentage of the second mean."
        ),
    ] = None,
    response: Annotated[
        list[str] | None, typer.Option(help="For a table: column of the values; may be repeated.")
    ] = None,
    within: Annotated[
        list[str] | None, typer.Option(help="For a table: column of the compared conditions.")
    ] = None,
    participant: Annotated[
        str | None, typer.Option(help="For a table: column of the participants.")
    ] = None,
    nested: Annotated[
        bool, typer.Option("--nested", help="For a table: rows are replicates, such as pulses.")
    ] = False,
    df: Annotated[
        Df | None,
        typer.Option(
            help="For a table or one folder: denominator degrees of freedom; by default "
            "kenward-roger."
        ),
    ] = None,
    adjust: Annotated[
        Adjust | None,
        typer.Option(
            help="For a table or one folder: correction of p over pairs; by default bonferroni for "
            "a table, holm for a folder."
        ),
    ] = None,
    error: Annotated[
        Error | None,
        typer.Option(
            help="For a table or one folder: error of pairs; by default pooled for a table, paired "
            "for a folder."
        ),
    ] = None,
    overwrite: Annotated[
        bool, typer.Option("--overwrite", help="Replace an existing comparison.")
    ] = False,
    printing: Printing = Printing(),
) -> None:
    """Compare results over people: conditions, days, groups, timing points, published values.

    One folder is compared over its timing points. Several folders with the same participants are
    compared person by person, others as groups; differences are first minus second. A table is
    analysed by a mixed model with participants as a random factor.
    --df, --adjust and --error are for a table or one folder; --paired, --groups, --days and
    --margin are for several folders. An option without effect is refused.
    Exit status: 0 a mean (for several folders: a difference) is available, 1 none is, 2 the input
    cannot be trusted.

    Example: jointz compare results-loaded results-unloaded --margin 20 --out comparison
    """
    columns = {"--response": response, "--within": within, "--participant": participant}
    option_names = [name for name, value in columns.items() if value]
    if not _is_table(results, option_names):
        if nested:
            raise typer.BadParameter("--nested is for a table, not for results folders.")
        options = {"paired": paired, "days": days, "margin_pct": margin,
                   "df": df, "adjust": adjust, "error": error}  # fmt: skip
        _compare_folders(results, out, options, overwrite=overwrite, printing=printing)
        return
    if len(option_names) < len(columns):
        lacking = ", ".join(name for name in columns if name not in option_names)
        raise typer.BadParameter(f"a table needs {lacking} too.")
    if out is not None or paired is not None or days or margin is not None:
        raise typer.BadParameter(
            "--out, --paired, --groups, --days and --margin are for results folders."
        )
    _fit_table(
        Path(results[0]),
        responses=list(dict.fromkeys(response or ())),
        factors=within or [],
        participant=str(participant),
        model={"nested": nested, "df": df or "kenward-roger"},
        pairs={"adjust": adjust or "bonferroni", "error": error or "pooled"},
        printing=printing,
    )


def _is_table(results: Sequence[str], option_names: Sequence[str]) -> bool:
    """Return whether the argument is a table; a reader refuses what is neither."""
    if option_names and (len(results) > 1 or Path(results[0]).is_dir()):
        raise typer.BadParameter(
            f"{option_names[0]} is for one table; results folders need no column names."
        )
    return bool(option_names) or (len(results) == 1 and Path(results[0]).is_file())


# --- a table -------------------------------------------------------------------------------------


def _fit_table(
    file: Path,
    *,
    responses: Sequence[str],
    factors: Sequence[str],
    participant: str,
    model: Mapping[str, Any],
    pairs: Mapping[str, str],
    printing: Printing,
) -> None:
    from jointz.comparison.comparison_table import read_responses
    from jointz.comparison.comparison_text import fit_dict, fit_tables
    from jointz.stats import mixed_model
    from jointz.stats.mixed_model_rows import refuse_several

    refuse_several(factors, responses[0], participant)
    names: Mapping[str, Any] = {"within": factors[0], "participant": participant}
    table = read_responses(file, responses=responses, **names)
    with failures(printing):
        fits = [mixed_model(table, response=name, **names, **model) for name in responses]
    if printing.as_json:
        results = [{"status": "ok", "table": str(file)} | fit_dict(fit, **pairs) for fit in fits]
        several = {"status": "ok", "responses": dict(zip(responses, results, strict=True))}
        emit_json(results[0] if len(results) == 1 else several)
        return
    for fit in fits if not printing.quiet else ():
        emit(fit.summary())
        for title, header, rows in fit_tables(fit, **pairs):
            emit_table(rows, header, title=title)
        emit()


# --- results folders -----------------------------------------------------------------------------


def _compare_folders(
    results: Sequence[str],
    out: Path | None,
    options: Mapping[str, Any],
    *,
    overwrite: bool,
    printing: Printing,
) -> None:
    from jointz.comparison.compare import check_out, compare_results, write_comparison
    from jointz.comparison.comparison_text import comparison_tables

    if out is not None:
        check_out(out, results, overwrite=overwrite)
    comparison = compare_results(results, **options)
    page = None if out is None else write_comparison(comparison, out, overwrite=overwrite)
    if printing.as_json:
        status = "ok" if comparison.available else "nothing_stands"
        emit_json({"status": status, "page": page and str(page)} | comparison.to_dict())
    elif not printing.quiet:
        for title, header, rows in comparison_tables(comparison):
            emit_table(rows, header, title=title)
        for note in comparison.notes:
            emit(f"note: {note}")
        if page is not None:
            emit(f"Page: {page}")
    raise typer.Exit(EXIT_OK if comparison.available else EXIT_NO_ESTIMATE)
