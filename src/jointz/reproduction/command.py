"""``jointz reproduce``: chapters of the dissertation beside ours."""

from enum import StrEnum
from pathlib import Path
from typing import Annotated

import typer

from jointz.terminal.options import Debug, Json, Quiet
from jointz.terminal.output import emit, emit_json
from jointz.terminal.progress_bars import progress_bar


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

    Example: jointz reproduce 2 --out reproduced
    """
    del debug
    from jointz.reproduction.reproduce import CHAPTERS, PAGE
    from jointz.reproduction.reproduce import reproduce as run_chapters
    from jointz.reproduction.reproduction_tables import tally, tally_text

    wanted = CHAPTERS if chapter is ChapterName.all else (int(chapter.value),)
    with progress_bar(shown=not (quiet or as_json)) as tell:
        made = run_chapters(
            wanted,
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
