"""Results and failures that commands print, and the figures and tables that they write."""

from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any

import typer

from jointz.core.errors import EstimationError
from jointz.core.whole_file import whole_file
from jointz.terminal.options import Printing
from jointz.terminal.output import EXIT_NO_ESTIMATE, emit, emit_json

if TYPE_CHECKING:
    from matplotlib.figure import Figure as Canvas

#: What to do about a file that the system does not let be written.
UNWRITTEN = "Make room or ask for permission, or name another file."


def emit_result(printing: Printing, content: Mapping[str, Any], *lines: str) -> None:
    """Print a result: as one JSON object, as lines of text, or not at all."""
    if printing.as_json:
        emit_json({"status": "ok", **content})
    elif not printing.quiet:
        for line in lines:
            emit(line)


@contextmanager
def failures(printing: Printing, **about: Any) -> Iterator[None]:
    """Turn a fit without an answer into exit status 1, with its code."""
    try:
        yield
    except EstimationError as exc:
        if printing.as_json:
            emit_json({**about, "status": f"failed:{exc.code}", "message": str(exc)})
        else:
            typer.echo(f"jointz: {exc}", err=True)
        raise typer.Exit(EXIT_NO_ESTIMATE) from exc


def check_figure(figure: Path | None) -> None:
    """Refuse a figure that could not be written."""
    _check_target("--figure", figure, (".svg", ".pdf", ".png"))


def check_table(out: Path | None) -> None:
    """Refuse a csv file that could not be written."""
    _check_target("--out", out, (".csv",))


def _check_target(option: str, file: Path | None, kinds: tuple[str, ...]) -> None:
    if file is None:
        return
    if file.suffix.lower() not in kinds:
        raise typer.BadParameter(
            f"{option} {file}: expected a name that ends in {' or '.join(kinds)}."
        )
    if file.is_dir() or not file.absolute().parent.is_dir():
        raise typer.BadParameter(f"{option} {file}: expected a file in a folder that exists.")


def save_drawn(draw: "Callable[[Canvas], object]", figure: Path, size: tuple[float, float]) -> None:
    """Draw on a canvas of a size in inches, in the style of figures, and write it."""
    from matplotlib.figure import Figure

    from jointz.results.figure_style import figure_style

    with figure_style():
        canvas = Figure(figsize=size, layout="constrained")
        draw(canvas)
        save_canvas(canvas, figure)


def save_canvas(canvas: "Canvas", figure: Path) -> None:
    """Write a figure, whole or not at all."""
    kind = figure.suffix.removeprefix(".")
    with whole_file(figure, UNWRITTEN) as partial:
        canvas.savefig(partial, format=kind, bbox_inches="tight", dpi=150)
