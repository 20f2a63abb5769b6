"""``jointz identify``: one time series to a model."""

from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from enum import StrEnum
from pathlib import Path
from typing import Annotated, Any

import typer

from jointz.core.codes import Failure
from jointz.core.errors import EstimationError
from jointz.identification.bench_commands import dither, static
from jointz.identification.cycle_commands import phase_curve, time_varying
from jointz.identification.stride_command import stride
from jointz.terminal.file_options import (
    ActsOn,
    Decimal,
    DecimalSign,
    Delimiter,
    Encoding,
    Figure,
    File,
    Input,
    NoHeader,
    Perturbed,
    Rate,
    SkipRows,
    Time,
    TorqueActsOn,
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
    encoding: Encoding = None,
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
            files=text_layout(encoding, delimiter, decimal, skip_rows, no_header=no_header),
            rate_hz=rate,
            needs_clock=False,
            gear_ratio=gear_ratio,
            model=model.value,
            torque_sign=float(torque_sign.value),
            rotor_inertia=inertia,
            smooth_velocity_rad_s=smooth,
        )
    output.report(fit, parsed, file=file)


class Method(StrEnum):
    """Choices of ``--method``."""

    WELCH = "welch"
    BLACKMAN_TUKEY = "blackman_tukey"


def bandwidth(
    file: File,
    command: Annotated[
        str, typer.Option("--command", help="COL[:unit] of the commanded torque (N*m).")
    ],
    torque: Annotated[
        str, typer.Option("--torque", help="COL[:unit] of the measured torque (N*m).")
    ],
    time: Time = None,
    rate: Rate = None,
    method: Annotated[
        Method, typer.Option("--method", help="How the spectra are estimated.")
    ] = Method.WELCH,
    window_s: Annotated[
        float | None,
        typer.Option(
            "--window-s",
            help="Length of a Welch segment, or longest lag, s; chosen from the record by default.",
        ),
    ] = None,
    drop_db: Annotated[
        float, typer.Option("--drop-db", help="Loss of gain that ends the bandwidth, dB.")
    ] = 3.0,
    figure: Figure = None,
    encoding: Encoding = None,
    delimiter: Delimiter = None,
    decimal: DecimalSign = Decimal.POINT,
    skip_rows: SkipRows = 0,
    no_header: NoHeader = False,
    as_json: Json = False,
    quiet: Quiet = False,
    debug: Debug = False,
) -> None:
    """Find the frequency at which a torque loop has lost 3 dB.

    Example: jointz identify bandwidth bench.csv --command cmd:Nm --torque tau:Nm --rate 1000
    """
    del debug
    from jointz.identification.identify_file import identify_file
    from jointz.identify.actuators.bandwidth import identify_bandwidth

    if not 0.0 < drop_db < float("inf"):
        raise typer.BadParameter(f"--drop-db {drop_db:g}: expected > 0 dB.")
    output = Output("bandwidth", figure, as_json, quiet, (7.1, 4.0))
    files = text_layout(encoding, delimiter, decimal, skip_rows, no_header=no_header)
    with output.failures(), _reference_advised(file, command, files):
        fit, columns = identify_file(
            identify_bandwidth,
            file,
            given_columns(command=command, torque=torque, time=time),
            files=files,
            rate_hz=rate,
            method=method.value,
            window_s=window_s,
            drop_db=drop_db,
        )
    estimate = {
        "value": fit.bandwidth_hz,
        "unit": "Hz",
        "ci": [fit.ci_low_hz, fit.ci_high_hz],
        "status": fit.status,
    }
    content = {"model": "bandwidth", "status": fit.status, "parameters": {"bandwidth_hz": estimate}}
    output.report(fit, columns, file=file, more=content)


@contextmanager
def _reference_advised(file: Path, command: str, files: Mapping[str, Any]) -> Iterator[None]:
    """Advise the column of a jointz recording that holds the whole commanded torque."""
    try:
        yield
    except EstimationError as exc:
        if exc.code != Failure.CONSTANT_COMMAND.value:
            raise
        from jointz.core.study import FilesSpec
        from jointz.io.formats.registry import list_columns

        names = list_columns(file, FilesSpec.model_validate(files)) or []
        if "reference" not in names or command.partition(":")[0] == "reference":
            raise
        raise EstimationError(
            exc.code,
            f"{exc} The file has a column 'reference': in recordings of jointz it holds the torque "
            "that was commanded, 'command' the pulses alone. Try --command reference.",
        ) from exc


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
    perturbed: Input = Perturbed.TORQUE,
    torque_acts_on: TorqueActsOn = ActsOn.JOINT,
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
    encoding: Encoding = None,
    delimiter: Delimiter = None,
    decimal: DecimalSign = Decimal.POINT,
    skip_rows: SkipRows = 0,
    no_header: NoHeader = False,
    as_json: Json = False,
    quiet: Quiet = False,
    debug: Debug = False,
) -> None:
    """Fit torque = K*angle + B*velocity + J*acceleration to one recording.

    A column without a unit is in that of the file, or in SI if the file states none.
    COL:FACTOR*unit reads numbers that are in the unit when multiplied by the factor.

    Example: jointz identify joint knee.csv --angle knee:deg --torque tau:Nm --time t
    """
    del debug
    from jointz.identification.doubtful_values import with_doubtful_values
    from jointz.identification.identify_file import identify_file
    from jointz.identify.series.joint import identify_joint

    output = Output(model.value, figure, as_json, quiet, _SIZES[model])
    with output.failures():
        fit, columns = identify_file(
            identify_joint,
            file,
            given_columns(angle=angle, torque=torque, time=time, command=command),
            files=text_layout(encoding, delimiter, decimal, skip_rows, no_header=no_header),
            rate_hz=rate,
            input=perturbed.value,
            model=model.value,
            estimator=estimator.value if estimator else None,
            cutoff_hz=cutoff_hz,
            torque_acts_on=torque_acts_on.value,
        )
    output.report(with_doubtful_values(fit), columns, file=file)


identify.command("actuator")(actuator)
identify.command("bandwidth")(bandwidth)
identify.command("static")(static)
identify.command("dither")(dither)
identify.command("time-varying")(time_varying)
identify.command("phase-curve")(phase_curve)
identify.command("stride")(stride)
