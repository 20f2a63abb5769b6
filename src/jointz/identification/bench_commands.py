"""``jointz identify static`` and ``dither``: stiffness of a bench."""

from typing import Annotated

import typer

from jointz.identification.output import Answer, Clock, Output
from jointz.terminal.file_options import File

Angle = Annotated[str, typer.Option(help="COL[:unit] of the deflection (rad).")]
Torque = Annotated[str, typer.Option(help="COL[:unit] of the torque on it (N*m).")]

#: Size of the figure of torque over angle, inches.
_SIZE = (6.0, 4.5)


def static(
    file: File,
    angle: Angle,
    torque: Torque,
    direction: Annotated[
        str | None,
        typer.Option(
            help="COL whose sign says which way the angle moves, such as its low-passed velocity. "
            "With it friction is fitted, too; samples where it is 0 are left out."
        ),
    ] = None,
    clock: Clock = Clock(),
    cutoff_hz: Annotated[
        float | None, typer.Option(help="Low-pass of angle and torque, by default none.")
    ] = None,
    answer: Answer = Answer(),
) -> None:
    """Fit the slope of torque over angle to a slow bench record.

    Example: jointz identify static bench.csv --angle q:deg --torque tau:Nm --time t
    """
    from jointz.identify.bench.static_stiffness import identify_static_stiffness

    output = Output("static", answer, _SIZE)
    columns = {"angle": angle, "torque": torque, "direction": direction, "time": clock.time}
    output.report(
        *output.identify(identify_static_stiffness, file, columns, clock=clock, cutoff_hz=cutoff_hz)
    )


def dither(
    file: File,
    angle: Angle,
    torque: Torque,
    frequency_hz: Annotated[float, typer.Option(help="Frequency of the dither, Hz.")],
    clock: Clock = Clock(),
    inertia: Annotated[
        str,
        typer.Option(
            help="VALUE[:unit] of the inertia that moves with the angle (kg*m^2); its torque is "
            "subtracted."
        ),
    ] = "0",
    answer: Answer = Answer(),
) -> None:
    """Fit stiffness and damping to torque and angle at the frequency of a dither.

    Example: jointz identify dither bench.csv --angle q --torque tau --rate 500 --frequency-hz 5
    """
    from jointz.identify.bench.dither_stiffness import identify_dither_stiffness
    from jointz.io.text.column_arguments import parse_quantity

    output = Output("dither", answer, _SIZE)
    moved = parse_quantity(inertia, "inertia")
    columns = {"angle": angle, "torque": torque, "time": clock.time}
    settings = {"frequency_hz": frequency_hz, "inertia": moved}
    output.report(
        *output.identify(identify_dither_stiffness, file, columns, clock=clock, **settings)
    )
