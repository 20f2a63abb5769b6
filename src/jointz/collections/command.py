"""``jointz collect``: impedance over studies, labs and conditions."""

from dataclasses import replace
from enum import StrEnum
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from jointz.terminal.options import Debug, Json, Quiet
from jointz.terminal.output import (
    EXIT_BAD_INPUT,
    EXIT_NO_ESTIMATE,
    EXIT_OK,
    emit,
    emit_json,
    emit_table,
)
from jointz.terminal.progress_bars import progress_bar

if TYPE_CHECKING:
    from jointz.collections.catalog_query import CatalogFilter
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
        typer.Option("--study", help="Path of the recordings from the entry's folder."),
    ] = "",
    as_json: Json = False,
    quiet: Quiet = False,
    debug: Debug = False,
) -> None:
    """Make an entry of results: known values are filled in, the others are left to you.

    Keys that only you know (licence, consent, how to cite, ...) are comments in entry.toml; jointz
    collect check names them until they are filled in.

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
        emit_json({"status": "ok", "entry": str(file), "open": list(map(str, findings))})
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
    """Check entries: shape, hashes, columns, units, intervals, covariances, repeats.

    Licence, consent, and whether values are plausible, are not judged.

    Every problem has a stable code, its place, the expected and the actual value.
    Exit status: 0 no problem, 2 problems.

    Example: jointz collect check collection
    """
    del debug
    from jointz.collections.checking.check_collection import check_collection

    result = check_collection(folder)
    if as_json:
        emit_json({"status": "ok" if result.clean else "problems"} | result.to_dict())
    elif not (quiet and result.clean):
        emit(result.summary())
    raise typer.Exit(EXIT_OK if result.clean else EXIT_BAD_INPUT)


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

    Exit status: 0 a catalog was made, 1 all entries have problems, 2 the folder holds no entries.

    Example: jointz collect build collection
    """
    del debug
    from jointz.collections.catalog import build_catalog

    _report(build_catalog(folder, out=out), as_json=as_json, quiet=quiet)


def _report(build: "CatalogBuild", *, as_json: bool, quiet: bool) -> None:
    if as_json:
        emit_json({"status": "ok" if build.entries else "nothing_stands"} | build.to_dict())
    elif not quiet:
        emit(build.summary())
    raise typer.Exit(EXIT_OK if build.entries else EXIT_NO_ESTIMATE)


@collect.command("results")
def results_catalog(
    results: Annotated[
        list[Path],
        typer.Argument(help="Results folders of jointz analyze, or folders above them."),
    ],
    out: Annotated[Path, typer.Option("--out", help="The catalog, or its folder.")],
    as_json: Json = False,
    quiet: Quiet = False,
    debug: Debug = False,
) -> None:
    """Make a catalog of your own results folders, for jointz collect query.

    It needs no metadata, and cannot be pooled. Folders that cannot be read are named and skipped.
    Exit status: 0 a catalog was made, 1 no folder could be read, 2 there is none.

    Example: jointz collect results results --out catalog.parquet
    """
    del debug
    from jointz.collections.results_catalog import build_results_catalog

    _report(build_results_catalog(results, out=out), as_json=as_json, quiet=quiet)


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
        bool, typer.Option("--standing", help="Only usable values: status ok or at_bound.")
    ] = False,
    as_csv: Annotated[
        bool, typer.Option("--csv", help="Print every row as csv on stdout.")
    ] = False,
    as_json: Json = False,
    quiet: Quiet = False,
    debug: Debug = False,
) -> None:
    """Query a catalog: the estimates of a joint by phase, speed, condition and study.

    Prints counts and medians by timing point; --csv and --json print every row. The medians are for
    orientation: use jointz collect pool for means. Exit status: 0 rows were found, 1 none.

    Example: jointz collect query collection --joint knee --parameter stiffness --phase 60 90
    """
    del debug
    from jointz.collections.catalog import query_catalog

    if as_csv and as_json:
        raise typer.BadParameter("give --csv or --json, not both.")
    where = _filter(phase, speed, joint=joint, parameter=parameter, condition=condition,
                    activity=activity, entry=entry, method=method)  # fmt: skip
    result = query_catalog(catalog, replace(where, kind=values.value, standing=standing))
    has_rows = not result.table.empty
    if as_json:
        emit_json({"status": "ok" if has_rows else "nothing_found"} | result.to_dict())
    elif as_csv:
        emit(result.to_frame().to_csv(index=False).rstrip("\n"))
    elif not quiet:
        groups = result.groups()
        if len(groups):
            cells = [[f"{c:.4g}" if isinstance(c, float) else str(c) for c in row]
                     for row in groups.itertuples(index=False)]  # fmt: skip
            emit_table(cells, list(groups.columns))
        emit(result.summary())
    raise typer.Exit(EXIT_OK if has_rows else EXIT_NO_ESTIMATE)


def _filter(phase: _Pair, speed: _Pair, **names: _Many) -> "CatalogFilter":
    from jointz.collections.catalog_query import CatalogFilter

    chosen: dict[str, Any] = {name: tuple(values or ()) for name, values in names.items()}
    return CatalogFilter(phase_pct=phase, speed_m_s=speed, **chosen)


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
            help="Column that distinguishes places; may be repeated. Default: joint, timing_point, "
            "activity, speed, slope; also phase, condition, side, surface, sex, age_band, group.",
        ),
    ] = None,
    reanalyse: Annotated[
        str, typer.Option("--reanalyse", help="Method for a new analysis of raw data.")
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
        Path | None, typer.Option("--out", help="Folder for the tables and the page.")
    ] = None,
    overwrite: Annotated[
        bool, typer.Option("--overwrite", help="Replace a folder of pooled values.")
    ] = False,
    as_json: Json = False,
    quiet: Quiet = False,
    debug: Debug = False,
) -> None:
    """Pool people to studies and studies to a mean over studies: random effects, by REML.

    Printed values are kept apart. With --out a page shows which joint, phase and speed is known,
    how well, and what is missing. Exit status: 0 at least one value, 1 none.

    Example: jointz collect pool collection --joint knee --out known
    """
    del debug
    from jointz.collections.coverage import POOL, PoolRules, pool_collection, write_pool
    from jointz.collections.pool_result import DEFAULT_BY
    from jointz.io.new_folder import MARKER, check_free

    if out is not None:
        check_free(out, marker=MARKER, overwrite=overwrite, made_by=POOL)
    where = _filter(phase, speed, joint=joint, parameter=parameter, condition=condition,
                    activity=activity, entry=entry, method=method)  # fmt: skip
    rules = PoolRules(tuple(by or DEFAULT_BY), mix_methods, with_printed, jointly, reanalyse)
    with progress_bar(shown=not (as_json or quiet)) as progress:
        pooled = pool_collection(catalog, where=where, rules=rules, progress=progress)
    page = None if out is None else write_pool(pooled, catalog, out, overwrite=overwrite)
    if as_json:
        status = "ok" if pooled.available else "nothing_stands"
        emit_json({"status": status, "page": page and str(page)} | pooled.to_dict())
    elif not quiet:
        emit(pooled.summary())
        if page is not None:
            emit(f"Page: {page}")
    raise typer.Exit(EXIT_OK if pooled.available else EXIT_NO_ESTIMATE)
