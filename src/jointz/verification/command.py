"""``jointz verify``: compare a known addition to the joint with what the pulses show of it."""

from pathlib import Path
from typing import Annotated

import typer

from jointz.core.whole_file import whole_file
from jointz.terminal.file_options import Figure
from jointz.terminal.options import Printing
from jointz.terminal.output import EXIT_NO_ESTIMATE, EXIT_OK
from jointz.terminal.printout import (
    UNWRITTEN,
    check_figure,
    check_table,
    emit_result,
    save_drawn,
)


def verify(
    study: Annotated[Path, typer.Argument(help="Study with [[additions]].")],
    out: Annotated[
        Path | None, typer.Option(help="Write a table: a csv file, one row a person and part.")
    ] = None,
    figure: Figure = None,
    printing: Printing = Printing(),
) -> None:
    """Check a set-up: compare what was added to the joint with what the pulses show of it.

    Pulses without and with a band or a weight are explained as one leg; on a bench, loads are
    compared with their estimates.
    Exit status: 0 everybody passes, 1 somebody fails or nothing can be told, 2 bad input.

    Example: jointz verify study --figure verify.svg
    """
    check_table(out)
    check_figure(figure)
    from jointz.verification.verify import verify

    found = verify(study)
    if out is not None:
        with whole_file(out, UNWRITTEN) as partial:
            found.to_frame().to_csv(partial, index=False)
    if figure is not None:
        save_drawn(lambda canvas: found.plot(canvas.subplots()), figure, found.FIGURE_SIZE)
    status = found.verdict
    emit_result(printing, {**found.to_dict(), "status": status}, found.summary())
    raise typer.Exit(EXIT_OK if status == "pass" else EXIT_NO_ESTIMATE)
