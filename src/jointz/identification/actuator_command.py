"""``jointz identify actuator``: the torque model of an actuator, 3.1 to 3.3."""

from enum import StrEnum
from typing import Annotated

import typer

from jointz.terminal.file_options import (
    Decimal,
    DecimalSign,
    Delimiter,
    Figure,
    File,
    NoHeader,
    Rate,
    SkipRows,
    Time,
    given_columns,
    text_layout,
)
from jointz.terminal.options import Debug, Json, Quiet
from jointz.terminal.printout import Output


class TorqueModel(StrEnum):
    """Choices of ``--model``."""

    CURRENT = "current"
    MOTOR = "motor"
    FRICTION = "friction"


class Sign(StrEnum):
    """Choices of ``--torque-sign``."""

    SAME = "1"
    OPPOSITE = "-1"


def actuator(
    file: File,
    current: Annotated[str, typer.Option("--current", help="COL[:unit] of the current (A).")],
    torque: Annotated[str, typer.Option("--torque", help="COL[:unit] of the torque sensor (N*m).")],
    gear_ratio: Annotated[
        float, typer.Option("--gear-ratio", help="Motor turns a turn of the output.")
    ],
    velocity: Annotated[
        str | None,
        typer.Option(
            "--velocity", help="COL[:unit] of the output's speed (rad/s); current needs none."
        ),
    ] = None,
    acceleration: Annotated[
        str | None,
        typer.Option(
            "--acceleration",
            help="COL[:unit] of the output's acceleration (rad/s^2); without it the differenced "
            "speed, where --time or --rate is given.",
        ),
    ] = None,
    time: Time = None,
    rate: Rate = None,
    model: Annotated[
        TorqueModel,
        typer.Option(
            "--model",
            help="current (3.1); motor (3.2): viscous friction, rotor inertia; friction (3.3): "
            "Coulomb and gear friction, rotor inertia.",
        ),
    ] = TorqueModel.FRICTION,
    torque_sign: Annotated[
        Sign, typer.Option("--torque-sign", help="-1: the sensor counts against the motor.")
    ] = Sign.SAME,
    rotor_inertia: Annotated[
        str | None,
        typer.Option(
            "--rotor-inertia", help="VALUE[:unit] at the output (kg*m^2): given, not fitted."
        ),
    ] = None,
    smooth_velocity: Annotated[
        str | None,
        typer.Option(
            "--smooth-velocity",
            help="VALUE[:unit] s (rad/s): tanh(velocity/s) in place of the sign.",
        ),
    ] = None,
    figure: Figure = None,
    delimiter: Delimiter = None,
    decimal: DecimalSign = Decimal.POINT,
    skip_rows: SkipRows = 0,
    no_header: NoHeader = False,
    as_json: Json = False,
    quiet: Quiet = False,
    debug: Debug = False,
) -> None:
    """Fit a torque model to a bench record with a torque sensor.

    Example: jointz identify actuator bench.csv --current i --velocity w --torque tau --gear-ratio 9
    """
    del debug
    from jointz.identification.identify_file import identify_file
    from jointz.identify.actuators.actuator import identify_actuator
    from jointz.io.text.column_arguments import parse_quantity

    output = Output(model.value, figure, as_json, quiet, (7.1, 4.6))
    columns = given_columns(
        current=current, velocity=velocity, torque=torque, acceleration=acceleration, time=time
    )
    inertia = None if rotor_inertia is None else parse_quantity(rotor_inertia, "rotor-inertia")
    smooth = None if smooth_velocity is None else parse_quantity(smooth_velocity, "smooth-velocity")
    with output.failures():
        fit, parsed = identify_file(
            identify_actuator,
            file,
            columns,
            files=text_layout(delimiter, decimal, skip_rows, no_header=no_header),
            rate_hz=rate,
            needs_clock=False,
            gear_ratio=gear_ratio,
            model=model.value,
            torque_sign=float(torque_sign.value),
            rotor_inertia=inertia,
            smooth_velocity_rad_s=smooth,
        )
    output.report(fit, parsed, file=file)
