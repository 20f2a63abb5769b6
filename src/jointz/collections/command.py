"""``jointz collect``: impedance over studies, labs and conditions."""

from dataclasses import replace
from enum import StrEnum
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from jointz.terminal.options import Debug, Json, Quiet
from jointz.terminal.output import (
    EXIT_BAD_INPUT,
    EXIT_NOTHING_STANDS,
    EXIT_OK,
    emit,
    emit_json,
    emit_table,
    progress_bar,
)

if TYPE_CHECKING:
    from jointz.collections.catalog_query import CatalogFilter, QueryResult
    from jointz.collections.checking.findings import CatalogBuild

collect = typer.Typer(
    no_args_is_help=True,
    rich_markup_mode=None,
    help="Collect impedance over studies, labs and conditions: describe, check, build, query.",
)

_Many = list[str] | None
_Pair = tuple[float, float] | None
_Catalog = Annotated[Path, typer.Argument(help="The collection's folder, or its catalog.")]
_Joints = Annotated[_Many, typer.Option("--joint", help="May be repeated.")]
_Parameters = Annotated[
    _Many, typer.Option("--parameter", help="Such as stiffness; may be repeated.")
]
_Phase = Annotated[
    _Pair, typer.Option("--phase", help="Onsets from, to, % of the cycle; 90 10 goes over 0.")
]
_Speed = Annotated[_Pair, typer.Option("--speed", help="Walking speeds from, to, m/s.")]
_Conditions = Annotated[_Many, typer.Option("--condition", help="May be repeated.")]
_Activities = Annotated[_Many, typer.Option("--activity", help="Such as walking; may be repeated.")]
_Entries = Annotated[
    _Many, typer.Option("--entry", help="Folder or id of a study; may be repeated.")
]
_Methods = Annotated[_Many, typer.Option("--method", help="May be repeated.")]


class Values(StrEnum):
    """Choices of ``--values``."""

    ESTIMATES = "estimates"
    PRINTED = "printed"


@collect.command("entry")
def entry(
    results: Annotated[
        str,
        typer.Argument(
            help="Results folder of jointz analyze; dissertation: the dissertation's tables."
        ),
    ],
    out: Annotated[Path, typer.Option("--out", help="Folder of the entry, in the collection.")],
    study_id: Annotated[
        str | None,
        typer.Option("--id", help="Id of the study; by default the name of the entry's folder."),
    ] = None,
    version: Annotated[str, typer.Option("--version", help="Version of the entry.")] = "1.0",
    study: Annotated[
        str,
        typer.Option("--study", help="Where the recordings are, as seen from the entry's folder."),
    ] = "",
    as_json: Json = False,
    quiet: Quiet = False,
    debug: Debug = False,
) -> None:
    """Make an entry of results: what they know is filled in, the rest is yours to tell.

    What nobody but you knows (licence, consent, how to cite, ...) stands in entry.toml as comments;
    jointz collect check names it until it is filled in.

    Example: jointz collect entry results --out collection/our-knees
    """
    del debug
    from jointz.collections.checking.check_collection import check_entry
    from jointz.collections.dissertation_entry import DISSERTATION, write_dissertation_entry
    from jointz.collections.entry import make_entry

    if results == DISSERTATION and not Path(results).is_dir():
        file = write_dissertation_entry(out)
    else:
        name = study_id or out.resolve().name.lower()
        file = make_entry(Path(results), out=out, study_id=name, version=version, study=study)
    findings = check_entry(out.resolve()).findings
    if as_json:
        told = [str(finding) for finding in findings]
        emit_json({"status": "ok", "entry": str(file), "open": told})
    elif not quiet:
        emit(f"Entry: {file}")
        for finding in findings:
            emit(f"  still open: {finding}")


@collect.command("check")
def check(
    folder: Annotated[Path, typer.Argument(help="A collection, or the folder of one entry.")],
    as_json: Json = False,
    quiet: Quiet = False,
    debug: Debug = False,
) -> None:
    """Check entries: shape, licence, consent, hashes, units, signs, sizes, intervals, people twice.

    Every problem has a stable code, its place, what was expected and what was found.
    Exit status: 0 no problem, 2 problems.

    Example: jointz collect check collection
    """
    del debug
    from jointz.collections.checking.check_collection import check_collection

    found = check_collection(folder)
    if as_json:
        emit_json({"status": "ok" if found.clean else "problems"} | found.to_dict())
    elif not (quiet and found.clean):
        emit(found.summary())
    raise typer.Exit(EXIT_OK if found.clean else EXIT_BAD_INPUT)


@collect.command("build")
def build(
    folder: Annotated[Path, typer.Argument(help="The collection: a folder for each entry.")],
    out: Annotated[
        Path | None, typer.Option("--out", help="The catalog; by default in the collection.")
    ] = None,
    as_json: Json = False,
    quiet: Quiet = False,
    debug: Debug = False,
) -> None:
    """Make catalog.parquet of all entries without problems; others are named and skipped.

    Exit status: 0 a catalog was made, 1 no entry stands, 2 the folder holds no entries.

    Example: jointz collect build collection
    """
    del debug
    from jointz.collections.catalog import build_catalog

    _told(build_catalog(folder, out=out), as_json=as_json, quiet=quiet)


def _told(made: "CatalogBuild", *, as_json: bool, quiet: bool) -> None:
    if as_json:
        emit_json({"status": "ok" if made.entries else "nothing_stands"} | made.to_dict())
    elif not quiet:
        emit(made.summary())
    raise typer.Exit(EXIT_OK if made.entries else EXIT_NOTHING_STANDS)


@collect.command("results")
def results_catalog(
    results: Annotated[
        list[Path],
        typer.Argument(help="Results folders of jointz analyze, or folders that hold such."),
    ],
    out: Annotated[Path, typer.Option("--out", help="The catalog, or the folder it goes to.")],
    as_json: Json = False,
    quiet: Quiet = False,
    debug: Debug = False,
) -> None:
    """Make a catalog of your own results folders, to be asked by jointz collect query.

    No page of metadata is needed, and nothing is pooled. Folders that cannot be read are named
    and skipped. Exit status: 0 a catalog was made, 1 no folder stands, 2 there is none.

    Example: jointz collect results results --out catalog.parquet
    """
    del debug
    from jointz.collections.results_catalog import build_results_catalog

    _told(build_results_catalog(results, out=out), as_json=as_json, quiet=quiet)


@collect.command("query")
def query(
    catalog: _Catalog,
    joint: _Joints = None,
    parameter: _Parameters = None,
    phase: _Phase = None,
    speed: _Speed = None,
    condition: _Conditions = None,
    activity: _Activities = None,
    entry: _Entries = None,
    method: _Methods = None,
    values: Annotated[
        Values, typer.Option("--values", help="Estimates or printed values, never both.")
    ] = Values.ESTIMATES,
    standing: Annotated[
        bool, typer.Option("--standing", help="Only values to use: status ok or at_bound.")
    ] = False,
    as_csv: Annotated[
        bool, typer.Option("--csv", help="Print every row as csv on stdout.")
    ] = False,
    as_json: Json = False,
    quiet: Quiet = False,
    debug: Debug = False,
) -> None:
    """Ask a catalog: what is known of a joint, at which phases and speeds, by whom.

    Prints how much there is by timing point; --csv and --json print every row. Medians shown are
    to look at: jointz collect pool pools. Exit status: 0 rows were found, 1 none.

    Example: jointz collect query collection --joint knee --parameter stiffness --phase 60 90
    """
    del debug
    from jointz.collections.catalog import query_catalog

    if as_csv and as_json:
        raise typer.BadParameter("give --csv or --json, not both.")
    anything = _filter(joint, parameter, phase, speed, condition, activity, entry, method)
    where = replace(anything, kind=values.value, standing=standing)
    found = query_catalog(catalog, where)
    stands = not found.table.empty
    if as_json:
        emit_json({"status": "ok" if stands else "nothing_found"} | found.to_dict())
    elif as_csv:
        emit(found.to_frame().to_csv(index=False).rstrip("\n"))
    elif not quiet:
        _emit_found(found)
    raise typer.Exit(EXIT_OK if stands else EXIT_NOTHING_STANDS)


def _filter(
    joint: _Many,
    parameter: _Many,
    phase: _Pair,
    speed: _Pair,
    condition: _Many,
    activity: _Many,
    entry: _Many,
    method: _Many,
) -> "CatalogFilter":
    from jointz.collections.catalog_query import CatalogFilter

    return CatalogFilter(
        joint=tuple(joint or ()),
        parameter=tuple(parameter or ()),
        condition=tuple(condition or ()),
        activity=tuple(activity or ()),
        entry=tuple(entry or ()),
        method=tuple(method or ()),
        phase_pct=phase,
        speed_m_s=speed,
    )


def _emit_found(found: "QueryResult") -> None:
    groups = found.groups()
    rows = [[_cell(cell) for cell in row] for row in groups.itertuples(index=False)]
    if rows:
        emit_table(rows, list(groups.columns))
    emit(found.summary())


def _cell(value: object) -> str:
    return f"{value:.4g}" if isinstance(value, float) else str(value)


@collect.command("pool")
def pool(
    catalog: _Catalog,
    joint: _Joints = None,
    parameter: _Parameters = None,
    phase: _Phase = None,
    speed: _Speed = None,
    condition: _Conditions = None,
    activity: _Activities = None,
    entry: _Entries = None,
    method: _Methods = None,
    by: Annotated[
        _Many,
        typer.Option(
            "--by",
            help="What tells places apart; may be repeated. joint, timing_point, activity, speed, "
            "slope by default; phase, condition, side, surface, sex, age_band, group too.",
        ),
    ] = None,
    reanalyse: Annotated[
        str, typer.Option("--reanalyse", help="Method by which raw data are analysed again.")
    ] = "",
    mix_methods: Annotated[
        bool, typer.Option("--mix-methods", help="Pool different methods; rows name them.")
    ] = False,
    with_printed: Annotated[
        bool, typer.Option("--with-printed", help="Pool printed values too; rows name them.")
    ] = False,
    jointly: Annotated[
        bool, typer.Option("--jointly", help="Also pool stiffness, damping, inertia together.")
    ] = False,
    out: Annotated[
        Path | None, typer.Option("--out", help="Folder for tables and the page of what is known.")
    ] = None,
    overwrite: Annotated[
        bool, typer.Option("--overwrite", help="Replace a folder of pooled values.")
    ] = False,
    as_json: Json = False,
    quiet: Quiet = False,
    debug: Debug = False,
) -> None:
    """Pool people to studies and studies to a mean over studies: random effects, by REML.

    Printed values stand apart. With --out a page shows which joint, phase and speed is known, how
    well, and what is missing. Exit status: 0 a pooled value stands, 1 none does.

    Example: jointz collect pool collection --joint knee --out known
    """
    del debug
    from jointz.analysis.results_folder import MARKER, check_free
    from jointz.collections.coverage import POOL, PoolRules, pool_collection, write_pool
    from jointz.collections.pool_result import DEFAULT_BY

    if out is not None:
        check_free(out, marker=MARKER, overwrite=overwrite, made_by=POOL)
    where = _filter(joint, parameter, phase, speed, condition, activity, entry, method)
    rules = PoolRules(
        by=tuple(by) if by else DEFAULT_BY,
        mix_methods=mix_methods,
        with_printed=with_printed,
        jointly=jointly,
        reanalyse=reanalyse,
    )
    with progress_bar(shown=not (as_json or quiet)) as progress:
        pooled = pool_collection(catalog, where=where, rules=rules, progress=progress)
    page = None if out is None else write_pool(pooled, catalog, out, overwrite=overwrite)
    if as_json:
        status = "ok" if pooled.stands else "nothing_stands"
        emit_json({"status": status, "page": page and str(page)} | pooled.to_dict())
    elif not quiet:
        emit(pooled.summary())
        if page is not None:
            emit(f"Page: {page}")
    raise typer.Exit(EXIT_OK if pooled.stands else EXIT_NOTHING_STANDS)
