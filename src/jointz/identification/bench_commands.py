"""``jointz identify static`` and ``dither``: stiffness of a bench."""

from typing import Annotated

import typer

from jointz.terminal.file_options import Figure, File, Rate, TextOptions, Time, given_columns
from jointz.terminal.options import Printing
from jointz.terminal.printout import Output

Angle = Annotated[str, typer.Option("--angle", help="COL[:unit] of the deflection (rad).")]
Torque = Annotated[str, typer.Option("--torque", help="COL[:unit] of the torque on it (N*m).")]

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
    time: Time = None,
    rate: Rate = None,
    cutoff_hz: Annotated[
        float | None, typer.Option(help="Low-pass of angle and torque, by default none.")
    ] = None,
    figure: Figure = None,
    text: TextOptions = TextOptions(),
    printing: Printing = Printing(),
) -> None:
    """Fit the slope of torque over angle to a slow bench record.

    Example: jointz identify static bench.csv --angle q:deg --torque tau:Nm --time t
    """
    from jointz.identification.identify_file import identify_file
    from jointz.identify.bench.static_stiffness import identify_static_stiffness

    output = Output("static", figure, printing, _SIZE)
    with output.failures():
        fit, columns = identify_file(
            identify_static_stiffness,
            file,
            given_columns(angle=angle, torque=torque, direction=direction, time=time),
            files=text.layout(),
            rate_hz=rate,
            cutoff_hz=cutoff_hz,
        )
    output.report(fit, columns, file=file, more={"model": "static", "status": fit.status})


def dither(
    file: File,
    angle: Angle,
    torque: Torque,
    frequency_hz: Annotated[float, typer.Option(help="Frequency of the dither, Hz.")],
    time: Time = None,
    rate: Rate = None,
    inertia: Annotated[
        str,
        typer.Option(
            help="VALUE[:unit] of the inertia that moves with the angle (kg*m^2); its torque is "
            "subtracted."
        ),
    ] = "0",
    figure: Figure = None,
    text: TextOptions = TextOptions(),
    printing: Printing = Printing(),
) -> None:
    """Fit stiffness and damping to torque and angle at the frequency of a dither.

    Example: jointz identify dither bench.csv --angle q --torque tau --rate 500 --frequency-hz 5
    """
    from jointz.identification.identify_file import identify_file
    from jointz.identify.bench.dither_stiffness import identify_dither_stiffness
    from jointz.io.text.column_arguments import parse_quantity

    output = Output("dither", figure, printing, _SIZE)
    moved = parse_quantity(inertia, "inertia")
    with output.failures():
        fit, columns = identify_file(
            identify_dither_stiffness,
            file,
            given_columns(angle=angle, torque=torque, time=time),
            files=text.layout(),
            rate_hz=rate,
            frequency_hz=frequency_hz,
            inertia=moved,
        )
    output.report(fit, columns, file=file, more={"model": "dither", "status": fit.status})
