"""``jointz control check``: whether an actuator can render a profile."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from jointz.terminal.file_options import Figure
from jointz.terminal.options import Printing
from jointz.terminal.output import EXIT_NO_ESTIMATE, emit, emit_json, emit_table
from jointz.terminal.printout import check_figure, save_drawn

if TYPE_CHECKING:
    from jointz.control.rendering.check import Finding


def check(
    file: Annotated[Path, typer.Argument(dir_okay=False, help="A file of jointz control profile.")],
    actuator: Annotated[
        str, typer.Option(help="qdd (quasi-direct drive), sea (series-elastic), or a TOML file.")
    ] = "qdd",
    load_inertia: Annotated[
        float | None,
        typer.Option(help="Inertia that the actuator moves (kg*m^2); by default shank and foot."),
    ] = None,
    share: Annotated[
        float, typer.Option(help="Share of the profile that the actuator gives.")
    ] = 1.0,
    figure: Figure = None,
    printing: Printing = Printing(),
) -> None:
    """Check whether an actuator can render a profile: stability, passivity, torque, bandwidth.

    Exit status: 0 it can (stable, enough torque, no passive load with which deviations grow),
    1 it cannot, 2 bad input.

    Example: jointz control check S01.json --actuator qdd --figure check.svg
    """
    check_figure(figure)
    from jointz.control.profile_file import read_profile
    from jointz.control.rendering.actuators import read_actuator
    from jointz.control.rendering.check import check_rendering

    rendering = check_rendering(
        read_profile(file), read_actuator(actuator), load_inertia=load_inertia, share=share
    )
    if figure is not None:
        save_drawn(lambda canvas: rendering.plot(canvas.subplots()), figure, rendering.FIGURE_SIZE)
    if printing.as_json:
        emit_json({"status": "ok", **rendering.to_dict()})
    elif not printing.quiet:
        emit_table(
            [_row(one) for one in rendering.findings],
            ["condition", "holds", "value", "95 % interval", "limit", "unit", "holds in draws"],
        )
        emit(rendering.summary())
    raise typer.Exit(0 if rendering.can_render else EXIT_NO_ESTIMATE)


def _row(one: "Finding") -> list[str]:
    def number(value: float | None) -> str:
        return "-" if value is None else f"{value:.3g}"

    interval = "-" if one.low is None else f"{number(one.low)} to {number(one.high)}"
    share = "-" if one.share_of_draws is None else f"{one.share_of_draws:.0%}"
    holds = "yes" if one.holds else "no"
    return [one.condition, holds, number(one.value), interval, number(one.limit), one.unit, share]
