"""``jointz identify``: one time series to a model."""

from enum import StrEnum
from typing import Annotated

import typer

from jointz.identification.actuator_command import actuator
from jointz.identification.bandwidth_command import bandwidth
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


class Perturbed(StrEnum):
    """Choices of ``--input``."""

    TORQUE = "torque"
    ANGLE = "angle"


class ActsOn(StrEnum):
    """Choices of ``--torque-acts-on``."""

    JOINT = "joint"
    DEVICE = "device"


class Model(StrEnum):
    """Choices of ``--model``."""

    KBJ = "kbj"
    IRF = "irf"
    FRF = "frf"
    REFLEX = "reflex"


class Estimator(StrEnum):
    """Choices of ``--estimator``."""

    LEAST_SQUARES = "least_squares"
    BOUNDED_LEAST_SQUARES = "bounded_least_squares"
    ADMITTANCE = "admittance"
    INSTRUMENTAL_VARIABLE = "instrumental_variable"


#: Size of the figure, inches: the frequency response has three parts.
_SIZES = {
    Model.KBJ: (7.1, 3.5),
    Model.IRF: (7.1, 4.0),
    Model.FRF: (7.1, 6.0),
    Model.REFLEX: (7.1, 4.0),
}

identify = typer.Typer(no_args_is_help=True, rich_markup_mode=None, help="Fit a model to a file.")


@identify.callback()
def _identify() -> None:
    """Identify a model from one time series."""


@identify.command("joint")
def joint(
    file: File,
    angle: Annotated[str, typer.Option("--angle", help="COL[:unit] of the angle (rad).")],
    torque: Annotated[str, typer.Option("--torque", help="COL[:unit] of the torque (N*m).")],
    command: Annotated[
        str | None,
        typer.Option("--command", help="COL[:unit] of the commanded torque (N*m)."),
    ] = None,
    time: Time = None,
    rate: Rate = None,
    perturbed: Annotated[
        Perturbed, typer.Option("--input", help="What was perturbed.")
    ] = Perturbed.TORQUE,
    torque_acts_on: Annotated[
        ActsOn, typer.Option("--torque-acts-on", help="device: the sign is flipped.")
    ] = ActsOn.JOINT,
    model: Annotated[
        Model,
        typer.Option(
            "--model",
            help="kbj: stiffness, damping, inertia. irf: impulse response, frf: frequency "
            "response, both with the second-order joint behind them. reflex: stiffness, damping, "
            "inertia beside a stretch reflex with gain and delay.",
        ),
    ] = Model.KBJ,
    estimator: Annotated[
        Estimator | None,
        typer.Option(
            "--estimator",
            help="Of kbj. By default least_squares for angle input; for torque input "
            "instrumental_variable with --command, else admittance.",
        ),
    ] = None,
    cutoff_hz: Annotated[
        float | None,
        typer.Option(
            "--cutoff-hz",
            help="kbj, reflex: low-pass of all signals, by default 30 and 20 Hz. irf, frf: end of "
            "the band, by default where the coherence is lost.",
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
    """Fit torque = K*angle + B*velocity + J*acceleration to one recording.

    Example: jointz identify joint knee.csv --angle knee:deg --torque tau:Nm --time t
    """
    del debug
    from jointz.identification.identify_file import identify_file
    from jointz.identify.series.joint import identify_joint

    output = Output(model.value, figure, as_json, quiet, _SIZES[model])
    with output.failures():
        fit, columns = identify_file(
            identify_joint,
            file,
            given_columns(angle=angle, torque=torque, time=time, command=command),
            files=text_layout(delimiter, decimal, skip_rows, no_header=no_header),
            rate_hz=rate,
            input=perturbed.value,
            model=model.value,
            estimator=estimator.value if estimator else None,
            cutoff_hz=cutoff_hz,
            torque_acts_on=torque_acts_on.value,
        )
    output.report(fit, columns, file=file)


identify.command("actuator")(actuator)
identify.command("bandwidth")(bandwidth)
