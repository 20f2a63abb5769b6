"""Chapters of the dissertation again: every table and figure printed beside ours."""

import json
import os
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from jointz.core.whole_file import whole_file
from jointz.io.new_folder import check_free, new_folder, write_marker
from jointz.tasks.progress import Progress
from reproduction.chapter2_figures import draw_chapter2
from reproduction.chapter3_figures import draw_chapter3
from reproduction.chapter4.figures import draw_chapter4
from reproduction.chapter4.reproduce_chapter4 import reproduce_chapter4
from reproduction.chapter_page import render_chapter, render_validation
from reproduction.reproduce_chapter2 import reproduce_chapter2
from reproduction.reproduce_chapter3 import reproduce_chapter3
from reproduction.reproduction_result import Reproduction

MARKER = "provenance.json"
#: Content of a folder in its marker: analyses and comparisons do not replace it.
_KIND = "reproduction"
#: All chapters on one page.
PAGE = "validation.html"
CHAPTERS = (2, 3, 4)


@dataclass(frozen=True, slots=True)
class Chapter:
    """A chapter that was written."""

    page: Path  # main page
    reproduction: Reproduction  # numbers of the chapter


def reproduce(
    chapters: Iterable[int],
    *,
    out: str | os.PathLike[str],
    seed: int = 1,
    preset: str = "nominal",
    overwrite: bool = False,
    progress: Progress | None = None,
) -> tuple[Chapter, ...]:
    """Run the simulated protocols of chapters and write their numbers beside the printed ones."""
    tell = progress or (lambda _done, _total, _what: None)
    folders = {number: _folder(Path(out), number) for number in chapters}
    before = {  # before hours of work, not after
        number: check_free(folder, marker=MARKER, overwrite=overwrite, made_by=_KIND)
        for number, folder in folders.items()
    }
    written = []
    for number, folder in folders.items():
        with new_folder(
            folder,
            marker=MARKER,
            overwrite=overwrite,
            made_by=_KIND,
            before=before[number],
        ) as partial:
            made = _CHAPTERS[number](seed, preset, tell)
            _write(made, partial)
        written.append(Chapter(folder / f"chapter{number}.html", made))
    _write_page(Path(out))
    return tuple(written)


def _folder(out: Path, number: int) -> Path:
    return out / f"chapter{number}"


def _write_page(out: Path) -> None:
    """Write all chapters that are there as one page: it never shows an older one."""
    files = [_folder(out, number) / f"chapter{number}.json" for number in CHAPTERS]
    page = render_validation([_written(file) for file in files if file.exists()])
    with whole_file(out / PAGE) as under:
        under.write_text(page, encoding="utf-8")


def _written(file: Path) -> tuple[Reproduction, dict[str, str]]:
    """Read a chapter and its figures back."""
    made = Reproduction.from_dict(json.loads(file.read_text(encoding="utf-8")))
    figures = sorted((file.parent / "figures").glob("*.svg"))
    return made, {figure.stem: figure.read_text(encoding="utf-8") for figure in figures}


def _write(made: Reproduction, folder: Path) -> None:
    figures = _FIGURES[made.chapter](made.curves)
    name = f"chapter{made.chapter}"
    (folder / "tables").mkdir()
    (folder / "figures").mkdir()
    for table in made.tables:
        table.frame().to_csv(folder / "tables" / f"{table.name}.csv", index=False)
    for figure, svg in figures.items():
        (folder / "figures" / f"{figure}.svg").write_text(svg, encoding="utf-8")
    text = json.dumps(made.to_dict(), allow_nan=False)
    (folder / f"{name}.json").write_text(text, encoding="utf-8")
    (folder / f"{name}.html").write_text(render_chapter(made, figures), encoding="utf-8")
    write_marker(folder, MARKER, {**made.provenance, "made_by": _KIND})


_CHAPTERS: Mapping[int, Callable[[int, str, Progress], Reproduction]] = {
    2: reproduce_chapter2,
    3: reproduce_chapter3,
    4: reproduce_chapter4,
}
_FIGURES: Mapping[int, Callable[[Mapping[str, Any]], dict[str, str]]] = {
    2: draw_chapter2,
    3: draw_chapter3,
    4: draw_chapter4,
}
