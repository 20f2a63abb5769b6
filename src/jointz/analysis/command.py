"""``jointz analyze``: impedance, figures and report from recordings."""

from collections.abc import Iterator
from contextlib import contextmanager, nullcontext
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from jointz.core.method_names import RECOMMENDED
from jointz.terminal.options import Printing, SchedulerOption
from jointz.terminal.output import (
    EXIT_NO_ESTIMATE,
    EXIT_OK,
    emit_json,
)
from jointz.terminal.progress_bars import progress_bar

if TYPE_CHECKING:
    from jointz.results.study_analysis import StudyAnalysis
    from jointz.tasks.task_store import TaskStore


def analyze(
    study: Annotated[Path, typer.Argument(help="Folder with study.toml.")],
    out: Annotated[Path, typer.Option(help="Folder to write the results to.")],
    method: Annotated[
        str,
        typer.Option(
            help="recommended (the right one for the study), bayesian, dissertation, pilot, "
            "pre_pulse, matched_strides, least_squares, instrumental_variable or full_record."
        ),
    ] = RECOMMENDED,
    resamples: Annotated[
        int, typer.Option(min=2, help="Bootstrap resamples for each cell.")
    ] = 1000,
    seed: Annotated[int, typer.Option(min=0, help="Seed of the bootstrap.")] = 0,
    certify: Annotated[
        bool,
        typer.Option(
            "--certify",
            help="Add a certificate: the errors to expect, from 10 simulated people who walk the "
            "study's protocol (method bayesian).",
        ),
    ] = False,
    figures: Annotated[
        bool,
        typer.Option(
            " /--no-figures", help="Write tables and report without figures.", show_default=False
        ),
    ] = True,
    pdf: Annotated[bool, typer.Option("--pdf", help="Write the figures as PDF, too.")] = False,
    tables: Annotated[
        bool,
        typer.Option(
            "--tables",
            help="Write all tables: every pulse and stride, posteriors, Parquet, and rounded "
            "tables for print as csv and LaTeX.",
        ),
    ] = False,
    workers: Annotated[
        int | None,
        typer.Option(min=1, help="Participants analysed at once; by default the number of cores."),
    ] = None,
    scheduler: SchedulerOption = None,
    overwrite: Annotated[
        bool, typer.Option("--overwrite", help="Replace an existing results folder.")
    ] = False,
    salvage: Annotated[
        bool,
        typer.Option(
            "--salvage",
            help="Recover damaged recordings from the session's logs, without the damaged parts.",
        ),
    ] = False,
    printing: Printing = Printing(),
) -> None:
    """Estimate joint impedance from the recordings of a study.

    Writes estimates.csv, excluded.csv, figures and report.html to a new folder.
    Exit status: 0 an estimate is available, 1 none is, 2 the input cannot be trusted.

    Example: jointz analyze my-study --out results
    """
    from jointz.io.study_reader import open_study
    from jointz.tasks.open_engine import open_engine

    if method != RECOMMENDED:  # the check loads all methods, which takes time
        from jointz.analysis.analyze import check_method

        try:
            check_method(method)
        except ValueError as exc:
            raise typer.BadParameter(str(exc)) from exc
    if salvage:
        from jointz.analysis.rig_hooks import salvage_recordings

        for sentence in salvage_recordings(study):
            typer.echo(sentence, err=True)
    with _salvage_advised(study):
        opened = open_study(study)
    people = len(opened.spec.participants)
    # Worker processes import their modules at the same time as this one.
    with open_engine(
        scheduler, workers=workers, tasks=people, needs="jointz.analysis.participant_jobs"
    ) as engine:
        from jointz.analysis.analyze import analyze as analyze_study
        from jointz.analysis.results_folder import write_results
        from jointz.io.new_folder import ANALYSIS, MARKER, check_free

        store = _store(out)  # from which a run that ended early continues
        before = check_free(out, marker=MARKER, overwrite=overwrite, made_by=ANALYSIS)
        with (
            progress_bar(shown=not (printing.quiet or printing.as_json)) as progress,
            store.noting_kept_results() if store else nullcontext(),
            _salvage_advised(study),
        ):
            analysis = analyze_study(
                opened,
                method=method,
                resamples=resamples,
                seed=seed,
                certify=certify,
                engine=engine,
                store=store,
                progress=progress,
            )
            if progress:
                progress(1, 1, "drawing the report")
            report = write_results(
                analysis,
                out,
                overwrite=overwrite,
                before=before,
                figures=figures,
                pdf=pdf,
                tables=tables,
                engine=engine,
            )
        complete = not _has_broken(analysis)
        if store and complete:
            store.clear()
    if store and not complete and not printing.quiet:
        typer.echo(
            f"{store.folder}: contains the participants whose analysis did not fail; the same "
            "command with --overwrite repeats the others only.",
            err=True,
        )
    if printing.as_json:
        emit_json(_as_json(analysis, out))
    elif not printing.quiet:
        from jointz.analysis.printed_analysis import print_analysis

        print_analysis(analysis, report)
    raise typer.Exit(EXIT_OK if analysis.n_standing else EXIT_NO_ESTIMATE)


def _store(out: Path) -> "TaskStore | None":
    """Return the store of finished participants, None with a warning if it cannot be written."""
    from jointz.core.errors import WriteError
    from jointz.tasks.task_store import TaskStore

    store = TaskStore(out)
    try:
        store.check_writable()
    except WriteError as exc:
        typer.echo(f"warning: {exc} Until then a run that ends early starts anew.", err=True)
        return None
    return store


@contextmanager
def _salvage_advised(study: Path) -> Iterator[None]:
    """Add advice to an error if the sessions of an unreadable study exist."""
    from jointz.core.errors import DataError

    try:
        yield
    except DataError as exc:
        from jointz.analysis.rig_hooks import salvage_advice

        advice = salvage_advice(study, str(exc))
        if advice:
            exc.add_note(advice)
        raise


def _has_broken(analysis: "StudyAnalysis") -> bool:
    """Return whether the analysis of any participant failed with an error."""
    from jointz.core.codes import Failure

    broke = Failure.ANALYSIS_BROKE.status
    return any(p.status == broke for cell in analysis.cells for p in cell.parameters)


def _as_json(analysis: "StudyAnalysis", out: Path) -> dict[str, Any]:
    from jointz.results.study_counts import study_counts

    return {
        "status": "ok" if analysis.n_standing else "nothing_stands",
        "results": str(out),
        "report": str(out / "report.html"),
        "settings": dict(analysis.settings),
        "n_estimates": sum(len(c.parameters) for c in analysis.cells),
        "n_standing": analysis.n_standing,
        "n_pulses": len(analysis.pulses),
        "n_excluded": study_counts(analysis).excluded,
        "n_aborted": study_counts(analysis).aborted,
        "estimates": [row for cell in analysis.cells for row in cell.rows()],
        "statistics": dict(analysis.statistics),
    }
