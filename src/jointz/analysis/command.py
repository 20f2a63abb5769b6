"""``jointz analyze``: recordings to impedance, figures and report."""

from collections.abc import Iterator
from contextlib import contextmanager, nullcontext
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from jointz.terminal.options import Debug, Json, Quiet, SchedulerOption
from jointz.terminal.output import (
    EXIT_NOTHING_STANDS,
    EXIT_OK,
    emit,
    emit_json,
    emit_table,
    progress_bar,
)

if TYPE_CHECKING:
    from jointz.results.estimates import CellEstimate
    from jointz.results.study_analysis import StudyAnalysis
    from jointz.tasks.task_store import TaskStore

_USUAL = "recommended"


def analyze(
    study: Annotated[Path, typer.Argument(help="Folder that holds study.toml.")],
    out: Annotated[Path, typer.Option("--out", help="Folder to write the results to.")],
    method: Annotated[
        str,
        typer.Option(
            "--method",
            help="recommended, dissertation, pilot, pre_pulse, matched_strides, least_squares, "
            "instrumental_variable, output_error, errors_in_variables, weak_form or full_record.",
        ),
    ] = _USUAL,
    resamples: Annotated[
        int, typer.Option("--resamples", min=2, help="Bootstrap resamples a cell.")
    ] = 1000,
    seed: Annotated[int, typer.Option("--seed", min=0, help="Seed of the bootstrap.")] = 0,
    workers: Annotated[
        int | None,
        typer.Option("--workers", min=1, help="Participants at once; as many as cores by default."),
    ] = None,
    scheduler: SchedulerOption = None,
    overwrite: Annotated[
        bool, typer.Option("--overwrite", help="Replace a results folder that exists.")
    ] = False,
    salvage: Annotated[
        bool,
        typer.Option(
            "--salvage",
            help="Make damaged recordings again from the session's logs, less what is damaged "
            "there.",
        ),
    ] = False,
    as_json: Json = False,
    quiet: Quiet = False,
    debug: Debug = False,
) -> None:
    """Estimate joint impedance from the recordings of a study.

    Writes estimates.csv, excluded.csv, figures and report.html to a new folder.
    Exit status: 0 an estimate stands, 1 none does, 2 the input cannot be trusted.

    Example: jointz analyze my-study --out results
    """
    del debug
    from jointz.io.study_reader import open_study
    from jointz.tasks.open_engine import open_engine

    if method != _USUAL:  # who asks for the usual one need not wait for all methods to be loaded
        from jointz.analysis.analyze import check_method

        _usage(check_method, method)
    if salvage:
        from jointz.session.salvage import salvage_recordings

        for sentence in salvage_recordings(study):
            typer.echo(sentence, err=True)
    with _salvage_advised(study):
        opened = open_study(study)
    people = len(opened.spec.participants)
    # Processes import while this one does.
    with open_engine(
        scheduler, workers=workers, tasks=people, needs="jointz.analysis.participant_jobs"
    ) as engine:
        from jointz.analysis.analyze import analyze as analyze_study
        from jointz.analysis.results_folder import ANALYSIS, MARKER, check_free, write_results

        store = _store(out)  # a run that ends early goes on from what is there
        check_free(out, marker=MARKER, overwrite=overwrite, made_by=ANALYSIS)
        with (
            progress_bar(shown=not (quiet or as_json)) as progress,
            store.told_with_errors() if store else nullcontext(),
            _salvage_advised(study),
        ):
            analysis = analyze_study(
                opened,
                method=method,
                resamples=resamples,
                seed=seed,
                engine=engine,
                store=store,
                progress=progress,
            )
            if progress:
                progress(1, 1, "drawing the report")
            report = write_results(analysis, out, overwrite=overwrite, engine=engine)
        broke = _broke(analysis)
        if store and not broke:
            store.clear()
    if store and broke and not quiet:
        typer.echo(
            f"{store.folder}: keeps everybody whose analysis did not break; the same command with "
            "--overwrite does only the others again.",
            err=True,
        )
    if as_json:
        emit_json(_as_json(analysis, out))
    elif not quiet:
        _print(analysis, report)
    raise typer.Exit(EXIT_OK if analysis.n_standing else EXIT_NOTHING_STANDS)


def _store(out: Path) -> "TaskStore | None":
    """Return where finished participants are kept, None with a warning where none can be."""
    from jointz.core.errors import WriteError
    from jointz.tasks.task_store import TaskStore

    store = TaskStore(out)
    try:
        store.check_writable()
    except WriteError as exc:
        typer.echo(f"warning: {exc} Until then nothing is kept of a run that ends early.", err=True)
        return None
    return store


@contextmanager
def _salvage_advised(study: Path) -> Iterator[None]:
    """Say how to go on where the sessions of an unreadable study are there."""
    from jointz.core.errors import DataError

    try:
        yield
    except DataError as exc:
        from jointz.session.salvage import salvage_advice

        advice = salvage_advice(study, str(exc))
        if advice:
            exc.add_note(advice)
        raise


def _broke(analysis: "StudyAnalysis") -> bool:
    """Tell whether the analysis of somebody broke off."""
    from jointz.core.codes import Failure

    broke = Failure.ANALYSIS_BROKE.status
    return any(p.status == broke for cell in analysis.cells for p in cell.parameters)


def _usage(check: Any, value: str) -> None:
    try:
        check(value)
    except ValueError as exc:
        raise typer.BadParameter(str(exc)) from exc


def _as_json(analysis: "StudyAnalysis", out: Path) -> dict[str, Any]:
    return {
        "status": "ok" if analysis.n_standing else "nothing_stands",
        "results": str(out),
        "report": str(out / "report.html"),
        "settings": dict(analysis.settings),
        "n_estimates": sum(len(c.parameters) for c in analysis.cells),
        "n_standing": analysis.n_standing,
        "n_pulses": len(analysis.pulses),
        "n_excluded": sum(bool(p.code) for p in analysis.pulses),
        "estimates": [row for cell in analysis.cells for row in cell.rows()],
        "statistics": dict(analysis.statistics),
    }


def _print(analysis: "StudyAnalysis", report: Path) -> None:
    for warning in analysis.statistics.get("warnings", []):
        emit(f"WARNING: {warning}")
    rows = [
        [
            p.timing_point,
            p.parameter,
            f"{p.value:.4g}" if p.value is not None else p.status,
            f"{p.ci_low:.4g} to {p.ci_high:.4g}" if p.ci_low is not None else "-",
            p.unit,
            str(p.n_participants),
        ]
        for p in analysis.population
    ]
    if any(p.n_participants > 1 for p in analysis.population):
        header = ["timing point", "parameter", "mean", "95 % interval", "unit", "people"]
        emit_table(rows, header, title="Means over people")
    else:
        _print_cells(analysis)
    emit(_counted(analysis))
    for note in analysis.statistics.get("notes", []):
        emit(f"note: {note}")
    failed = {p.status for c in analysis.cells for p in c.parameters if not p.stands}
    if failed:
        emit(f"without an estimate: {', '.join(sorted(failed))}")
    emit(f"Report: {report}")


def _counted(analysis: "StudyAnalysis") -> str:
    """Say who was measured, by which methods, with how many pulses."""
    from jointz.report.prose import pulse_counts
    from jointz.report.subjects import subjects

    words = subjects(analysis)
    used, left_out = pulse_counts(analysis)
    methods = dict.fromkeys(c.method for c in analysis.cells)
    return (
        f"{words.counted(len({c.participant for c in analysis.cells}))}, "
        f"{len(analysis.cells)} cells, method {' and '.join(methods) or '-'}: {used} pulses used, "
        f"{left_out} left out."
    )


def _print_cells(analysis: "StudyAnalysis") -> None:
    from jointz.report.subjects import subjects

    words = subjects(analysis)
    rows = [row for cell in analysis.cells for row in _cell_rows(cell)]
    header = [
        f"{words.one}, {words.point}",
        "parameter",
        "value",
        "95 % interval",
        "unit",
        "status",
    ]
    emit_table(rows, header, title="Estimates")


def _cell_rows(cell: "CellEstimate") -> list[list[str]]:
    name = f"{cell.label} {cell.timing_point}"
    statuses = {p.status for p in cell.parameters}
    if len(statuses) == 1 and not cell.parameters[0].stands:
        return [[name, "all", "-", "-", "-", statuses.pop()]]
    return [
        [
            name,
            p.name,
            f"{p.value:.4g}" if p.value is not None else "-",
            f"{p.ci_low:.4g} to {p.ci_high:.4g}" if p.ci_low is not None else "-",
            p.unit,
            p.status,
        ]
        for p in cell.parameters
    ]
