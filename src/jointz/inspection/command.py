"""``jointz inspect``: content of a file, and a study to start from."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from jointz.core.errors import OutputError
from jointz.core.whole_file import whole_file
from jointz.terminal.file_options import Decimal, Delimiter, Encoding, Figure
from jointz.terminal.options import Printing
from jointz.terminal.output import emit, emit_json
from jointz.terminal.printout import check_figure, save_canvas

if TYPE_CHECKING:
    from jointz.inspection.inspection_result import Inspection


def inspect(
    file: Annotated[
        Path, typer.Argument(help="Recording of any format that jointz reads, or a folder of them.")
    ],
    toml: Annotated[
        Path | None,
        typer.Option(help="Write the proposed study to this file, or into this folder."),
    ] = None,
    overwrite: Annotated[
        bool, typer.Option("--overwrite", help="Replace a study file, or a figure, that exists.")
    ] = False,
    figure: Figure = None,
    encoding: Encoding = None,
    delimiter: Delimiter = None,
    decimal: Annotated[
        Decimal | None, typer.Option(help="Decimal sign in numbers; detected by default.")
    ] = None,
    skip_rows: Annotated[
        int | None, typer.Option(min=0, help="Rows before the table; detected by default.")
    ] = None,
    no_header: Annotated[
        bool, typer.Option("--no-header", help="The columns of a text file have no names.")
    ] = False,
    printing: Printing = Printing(),
) -> None:
    """Show the content of a file or a folder and propose a study.toml for it.

    Prints channels, units, rates, gaps, ranges, thumbnails, obstacles to an analysis, what must be
    decided, and a study.toml in which every guess is marked. No file is ever changed.

    Example: jointz inspect my-study --toml my-study
    """
    check_figure(figure)
    target = None if toml is None else _target(toml)
    for output in filter(None, (target, figure)):
        _check_free(output, file, overwrite=overwrite)
    from jointz.inspection.inspect_file import inspect_file

    layout = _stated_layout(
        encoding=encoding,
        delimiter=delimiter,
        decimal=decimal and decimal.value,
        skip_rows=skip_rows,
        header=False if no_header else None,
    )
    inspection = inspect_file(file, layout=layout, study_folder=target.parent if target else None)
    if figure is not None:
        _draw(inspection, figure)
    if target is not None:
        with whole_file(target, "Name another place.") as partial:
            partial.write_text(inspection.toml, encoding="utf-8")
    if printing.as_json:
        written_file = str(target) if target else None
        emit_json({"status": "ok", **inspection.to_dict(), "written": written_file})
    elif not printing.quiet:
        _print(inspection, target)


def _target(toml: Path) -> Path:
    """Return the study file; another ending could be that of a recording."""
    target = toml / "study.toml" if toml.is_dir() else toml
    if target.suffix.lower() != ".toml":
        raise typer.BadParameter(f"--toml {toml}: expected a folder, or a name that ends in .toml.")
    if not target.absolute().parent.is_dir():
        raise typer.BadParameter(f"--toml {toml}: expected a file in a folder that exists.")
    return target


def _check_free(target: Path, file: Path, *, overwrite: bool) -> None:
    """Refuse to replace existing files without --overwrite, and the recording in any case."""
    if not target.exists():
        return
    if file.is_file() and target.samefile(file):
        raise OutputError(f"{target}: is the file to inspect. Name another file.")
    if not overwrite:
        raise OutputError(
            f"{target}: exists and is kept. Name another file, or add --overwrite to replace it."
        )


def _stated_layout(**keys: Any) -> dict[str, Any]:
    """Return the keys of ``[files]`` that options state; the others are detected."""
    if keys["delimiter"] == "":
        raise typer.BadParameter("--delimiter '': expected a character, such as ';'.")
    return {name: value for name, value in keys.items() if value is not None}


def _draw(inspection: "Inspection", figure: Path) -> None:
    from matplotlib.figure import Figure as Canvas

    drawn = sum(any(v is not None for v in c.outline) for c in inspection.channels)
    canvas = Canvas(figsize=(7.0, max(2.0, 0.45 * drawn + 0.8)), layout="constrained")
    inspection.plot(canvas.subplots())
    save_canvas(canvas, figure)


def _print(inspection: "Inspection", target: Path | None) -> None:
    emit(inspection.summary())
    if target is None:
        emit("\nA study.toml to start from (--toml FILE writes it):\n")
        emit(inspection.toml.rstrip("\n"))
    else:
        emit(f"\nWrote {target}: {inspection.n_guesses} guesses to check.")
