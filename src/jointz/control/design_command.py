"""``jointz control design``: what a joint must be able to do for a profile."""

from pathlib import Path
from typing import Annotated

import typer

from jointz.core.errors import DataError
from jointz.core.whole_file import refuse_existing
from jointz.terminal.file_options import Figure
from jointz.terminal.options import Printing
from jointz.terminal.output import EXIT_NO_ESTIMATE
from jointz.terminal.printout import check_figure, emit_result, save_drawn

#: Inches: width, and height of a profile's row.
_WIDTH, _ROW = 7.0, 2.8


def design(
    files: Annotated[
        list[Path], typer.Argument(dir_okay=False, help="Files of jointz control profile.")
    ],
    motor: Annotated[
        Path | None,
        typer.Option(dir_okay=False, help="Motor (TOML); by default that of chapter III."),
    ] = None,
    efficiency: Annotated[
        float, typer.Option(help="Part of negative power that can be stored, 0 to 1.")
    ] = 0.6,
    figure: Figure = None,
    printing: Printing = Printing(),
) -> None:
    """Compute what a joint must be able to do for profiles, and springs and gears that come near.

    Exit status: 0 done, 1 no gear ratio can do it, 2 bad input.

    Example: jointz control design S01.json --motor motor.toml --figure design.svg
    """
    check_figure(figure)
    if figure is not None:
        refuse_existing(figure)
    from jointz.control.design import design_joint, draw_design
    from jointz.control.motor import read_motor
    from jointz.control.profile_file import read_profile

    named = None if motor is None else read_motor(motor)
    profiles = {name: read_profile(file) for name, file in _names(files).items()}
    requirements = design_joint(profiles, motor=named, efficiency=efficiency)
    if figure is not None:
        size = (_WIDTH, _ROW * len(requirements.profiles))
        save_drawn(lambda canvas: draw_design(canvas, requirements), figure, size)
    emit_result(printing, requirements.to_dict(), requirements.summary())
    if requirements.ratio is None:
        raise typer.Exit(EXIT_NO_ESTIMATE)


def _names(files: list[Path]) -> dict[str, Path]:
    """Return a name for each file: its own without suffix where that is unique."""
    stems = [file.stem for file in files]
    names = {f.stem if stems.count(f.stem) == 1 else str(f): f for f in files}
    if len(names) < len(files):
        raise DataError("design: a profile is named more than once. Name each file once.")
    return names
