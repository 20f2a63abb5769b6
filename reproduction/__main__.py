"""Command ``python -m reproduction``: chapters of the dissertation beside ours."""

import os
import sys
from enum import StrEnum
from pathlib import Path
from typing import Annotated

import typer

from jointz.core.errors import JointzError, WriteError
from jointz.terminal.options import Debug, Json, Quiet
from jointz.terminal.output import EXIT_BAD_INPUT, EXIT_NO_ESTIMATE, emit, emit_error, emit_json
from jointz.terminal.progress_bars import progress_bar

_NAME = "python -m reproduction"
app = typer.Typer(add_completion=False, pretty_exceptions_enable=False, rich_markup_mode=None)


class ChapterName(StrEnum):
    """Choices of the chapter."""

    two = "2"
    three = "3"
    four = "4"
    all = "all"


class SimulationPreset(StrEnum):
    """How well the simulations behave."""

    clean = "clean"
    nominal = "nominal"
    hard = "hard"


@app.command()
def reproduce(
    out: Annotated[Path, typer.Option("--out", help="A folder for the chapters.")],
    chapter: Annotated[ChapterName, typer.Argument(help="2, 3, 4 or all.")] = ChapterName.all,
    seed: Annotated[int, typer.Option("--seed", min=0, help="Seed of the simulation.")] = 1,
    preset: Annotated[
        SimulationPreset, typer.Option("--preset", help="How well the simulations behave.")
    ] = SimulationPreset.nominal,
    overwrite: Annotated[
        bool, typer.Option("--overwrite", help="Replace chapters that are there.")
    ] = False,
    as_json: Json = False,
    quiet: Quiet = False,
    debug: Debug = False,
) -> None:
    """Run the simulated experiments of a chapter and print its numbers beside ours.

    Example: python -m reproduction 2 --out reproduced
    """
    del debug  # main reads it
    from reproduction.reproduce import CHAPTERS, PAGE
    from reproduction.reproduce import reproduce as run_chapters
    from reproduction.reproduction_tables import tally, tally_text

    chapters = CHAPTERS if chapter is ChapterName.all else (int(chapter.value),)
    with progress_bar(shown=not (quiet or as_json)) as tell:
        made = run_chapters(
            chapters,
            out=out,
            seed=seed,
            preset=preset.value,
            overwrite=overwrite,
            progress=tell,
        )
    evidence = tally(table for one in made for table in one.reproduction.tables)
    if as_json:
        content = [{"page": str(one.page), **one.reproduction.to_dict()} for one in made]
        shown = [{k: v for k, v in entry.items() if k != "curves"} for entry in content]
        emit_json({"status": "ok", "evidence": evidence, "chapters": shown})
        return
    for one in made if not quiet else ():
        emit(one.reproduction.summary())
        emit(f"Page: {one.page}")
    if not quiet:
        emit(f"All chapters: {out / PAGE}\n{tally_text(evidence)}")


def main() -> None:
    """Run the command and end the process with its exit status."""
    # Threads of the linear algebra would only wait for each other. Read when numpy is imported.
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    try:
        app(prog_name=_NAME)
    except JointzError as exc:
        if "--debug" in sys.argv:
            raise
        if "--json" in sys.argv:
            emit_error(type(exc).__name__, str(exc))
        sys.stderr.write(f"{_NAME}: {exc}\n")
        sys.exit(EXIT_NO_ESTIMATE if isinstance(exc, WriteError) else EXIT_BAD_INPUT)


if __name__ == "__main__":
    main()
