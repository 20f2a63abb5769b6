"""Run the accuracy benchmark: ``python -m benchmarks.accuracy``, from the repository's root."""

import argparse
import sys
from collections.abc import Sequence
from pathlib import Path
from time import perf_counter

from benchmarks.accuracy.page import FORMER_METHODS, RANK_ROWS, draw_ranks, page_of, write_tables
from benchmarks.accuracy.rows import Row, all_rows
from benchmarks.accuracy.runs import Cache, Job, jobs_of, run_jobs
from benchmarks.accuracy.summaries import read_summaries, summarise, verdicts, write_summary
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeRemainingColumn

from jointz.identify.estimators import METHODS

_ROOT = Path(__file__).parents[2]
_RESULTS = Path(__file__).with_name("results")
_PAGE = _ROOT / "docs" / "accuracy.md"
_JUDGED = "bayesian"


def main(arguments: Sequence[str] | None = None) -> int:
    """Run rows, write their figures and the page; return the exit code.

    Parameters
    ----------
    arguments : sequence of str, optional
        Of the command line by default.
    """
    asked = _parser().parse_args(arguments)
    rows = all_rows()
    if asked.list:
        for row in rows.values():
            print(f"{row.name:<26}{row.title}")
        return 0
    chosen = [] if asked.page_only else _chosen_rows(asked.rows, rows)
    methods = _chosen_methods(asked.methods)
    if not asked.page_only:
        _run(chosen, methods, asked)
    _write_page(asked.results, asked.page, list(rows))
    return 0


def _run(rows: Sequence[Row], methods: Sequence[str], asked: argparse.Namespace) -> None:
    store = Cache(asked.cache)
    jobs = jobs_of(rows, methods, asked.participants, asked.seed, store)
    start = perf_counter()
    columns = (TextColumn("{task.description}"), BarColumn(), MofNCompleteColumn())
    with Progress(*columns, TimeRemainingColumn(), disable=asked.quiet) as progress:
        task = progress.add_task("participants", total=len(jobs))

        def tell(job: Job) -> None:
            progress.update(task, advance=1, description=job.row.name)

        run_jobs(jobs, workers=asked.workers, store=store, tell=tell)
    print(f"{len(jobs)} participants in {perf_counter() - start:.0f} s")
    judged = _JUDGED if _JUDGED in methods else methods[0]
    for row in rows:
        summary = summarise(
            row, methods, participants=asked.participants, seed=asked.seed, store=store
        )
        write_summary(summary, asked.results)
        print(f"{row.title} ({judged})")
        for text, met in verdicts(summary, judged):
            print(f"  {'met    ' if met else 'NOT MET'} {text}")


def _write_page(results: Path, page: Path, order: Sequence[str]) -> None:
    """Write the page and its tables from every row that has been run, now or earlier."""
    summaries = read_summaries(results, order)
    there = {s["method"] for summary in summaries for s in summary["scores"]}
    usual = (_JUDGED, *FORMER_METHODS)
    judged = next((m for m in (*usual, *sorted(there)) if m in there), _JUDGED)
    by_row = {summary["row"]: summary for summary in summaries}
    drawn = [
        row
        for row in RANK_ROWS
        if row in by_row
        and draw_ranks(by_row[row], judged, page.parent / "images" / f"accuracy-{row}.svg")
    ]
    tables = page.parent / "tables"
    write_tables(summaries, judged, tables)
    page.write_text(page_of(summaries, judged, drawn, tables))
    print(f"Page: {page}")


def _chosen_rows(names: str, rows: dict[str, Row]) -> list[Row]:
    wanted = list(rows) if names == "all" else names.split(",")
    unknown = [name for name in wanted if name not in rows]
    if unknown:
        sys.exit(f"--rows: no row {', '.join(unknown)}; --list shows all.")
    return [rows[name] for name in wanted]


def _chosen_methods(names: str) -> list[str]:
    walking = METHODS.serving("walking")
    wanted = walking if names == "all" else names.split(",")
    unknown = [name for name in wanted if name not in walking]
    if unknown:
        print(f"--methods: this version has no {', '.join(unknown)} for walking.")
    found = [name for name in wanted if name in walking]
    return found or sys.exit("--methods: nothing left to run.")


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(prog="python -m benchmarks.accuracy", description=__doc__)
    add = parser.add_argument
    add("--rows", default="all", help="names, separated by commas; or all")
    add("--methods", default="bayesian,dissertation", help="names, or all")
    add("--participants", type=int, default=400, help="of every row")
    add("--seed", type=int, default=20260, help="of the population")
    add("--workers", type=int, default=2, help="processes")
    add("--cache", type=Path, default=_ROOT / ".accuracy-cache", help="results of participants")
    add("--results", type=Path, default=_RESULTS, help="figures of rows, JSON and CSV")
    add("--page", type=Path, default=_PAGE, help="page of the documentation to write")
    add("--page-only", action="store_true", help="write the page from the figures that are there")
    add("--list", action="store_true", help="list the rows")
    add("--quiet", action="store_true", help="no progress bar")
    return parser


if __name__ == "__main__":
    sys.exit(main())
