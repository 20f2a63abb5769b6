"""``jointz identify``: one time series to a model."""

from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Annotated, Any, Literal

import typer

from jointz.core.codes import Failure
from jointz.core.errors import EstimationError
from jointz.identification.bench_commands import dither, static
from jointz.identification.cycle_commands import phase_curve, time_varying
from jointz.identification.output import Answer, Clock, Output
from jointz.identification.stride_command import stride
from jointz.terminal.file_options import Angle, File, Input, Torque, TorqueActsOn
from jointz.terminal.options import Commands

#: Choices of ``--model``.
TorqueModel = Literal["current", "motor", "friction"]
#: Choices of ``--torque-sign``.
Sign = Literal["1", "-1"]


def actuator(
    file: File,
    current: Annotated[str, typer.Option(help="COL[:unit] of the current (A).")],
    torque: Annotated[str, typer.Option(help="COL[:unit] of the torque sensor (N*m).")],
    gear_ratio: Annotated[float, typer.Option(help="Motor turns a turn of the output.")],
    velocity: Annotated[
        str | None,
        typer.Option(help="COL[:unit] of the output's speed (rad/s); current needs none."),
    ] = None,
    acceleration: Annotated[
        str | None,
        typer.Option(
            help="COL[:unit] of the output's acceleration (rad/s^2); without it the differenced "
            "speed, where --time or --rate is given."
        ),
    ] = None,
    clock: Clock = Clock(),
    model: Annotated[
        TorqueModel,
        typer.Option(
            help="current (3.1); motor (3.2): viscous friction, rotor inertia; friction (3.3): "
            "Coulomb and gear friction, rotor inertia."
        ),
    ] = "friction",
    torque_sign: Annotated[
        Sign, typer.Option(help="-1: the sensor counts against the motor.")
    ] = "1",
    rotor_inertia: Annotated[
        str | None, typer.Option(help="VALUE[:unit] at the output (kg*m^2): given, not fitted.")
    ] = None,
    smooth_velocity: Annotated[
        str | None,
        typer.Option(help="VALUE[:unit] s (rad/s): tanh(velocity/s) in place of the sign."),
    ] = None,
    answer: Answer = Answer(),
) -> None:
    """Fit a torque model to a bench record with a torque sensor.

    Example: jointz identify actuator bench.csv --current i --velocity w --torque tau --gear-ratio 9
    """
    from jointz.identify.actuators.actuator import identify_actuator
    from jointz.io.text.column_arguments import parse_quantity

    output = Output(model, answer, (7.1, 4.6))
    inertia = None if rotor_inertia is None else parse_quantity(rotor_inertia, "rotor-inertia")
    smooth = None if smooth_velocity is None else parse_quantity(smooth_velocity, "smooth-velocity")
    fit, origin = output.identify(
        identify_actuator,
        file,
        {
            "current": current,
            "velocity": velocity,
            "torque": torque,
            "acceleration": acceleration,
            "time": clock.time,
        },
        clock=clock,
        needs_clock=False,
        gear_ratio=gear_ratio,
        model=model,
        torque_sign=float(torque_sign),
        rotor_inertia=inertia,
        smooth_velocity_rad_s=smooth,
    )
    output.report(fit, origin)


#: Choices of ``--method``.
Method = Literal["welch", "blackman_tukey"]


def bandwidth(
    file: File,
    command: Annotated[str, typer.Option(help="COL[:unit] of the commanded torque (N*m).")],
    torque: Annotated[str, typer.Option(help="COL[:unit] of the measured torque (N*m).")],
    clock: Clock = Clock(),
    method: Annotated[Method, typer.Option(help="How the spectra are estimated.")] = "welch",
    window_s: Annotated[
        float | None,
        typer.Option(
            help="Length of a Welch segment, or longest lag, s; chosen from the record by default."
        ),
    ] = None,
    drop_db: Annotated[float, typer.Option(help="Loss of gain that ends the bandwidth, dB.")] = 3.0,
    answer: Answer = Answer(),
) -> None:
    """Find the frequency at which a torque loop has lost 3 dB.

    Example: jointz identify bandwidth bench.csv --command cmd:Nm --torque tau:Nm --rate 1000
    """
    from jointz.identify.actuators.bandwidth import identify_bandwidth

    if not 0.0 < drop_db < float("inf"):
        raise typer.BadParameter(f"--drop-db {drop_db:g}: expected > 0 dB.")
    output = Output("bandwidth", answer, (7.1, 4.0))
    fit, origin = output.identify(
        _reference_advised(file, command, answer.text.layout())(identify_bandwidth),
        file,
        {"command": command, "torque": torque, "time": clock.time},
        clock=clock,
        method=method,
        window_s=window_s,
        drop_db=drop_db,
    )
    estimate = {
        "value": fit.bandwidth_hz,
        "unit": "Hz",
        "ci": [fit.ci_low_hz, fit.ci_high_hz],
        "status": fit.status,
    }
    output.report(fit, origin, parameters={"bandwidth_hz": estimate})


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


#: Choices of ``--model``.
Model = Literal["kbj", "irf", "frf", "reflex"]
#: Choices of ``--estimator``.
Estimator = Literal["least_squares", "bounded_least_squares", "admittance", "instrumental_variable"]


#: Size of the figure, inches: the frequency response has three parts.
_SIZES = {
    "kbj": (7.1, 3.5),
    "irf": (7.1, 4.0),
    "frf": (7.1, 6.0),
    "reflex": (7.1, 4.0),
}

identify = Commands(no_args_is_help=True, rich_markup_mode=None, help="Fit a model to a file.")


@identify.callback()
def _identify() -> None:
    """Identify a model from one time series."""


@identify.command()
def joint(
    file: File,
    angle: Angle,
    torque: Torque,
    command: Annotated[
        str | None, typer.Option(help="COL[:unit] of the commanded torque (N*m).")
    ] = None,
    clock: Clock = Clock(),
    perturbed: Input = "torque",
    torque_acts_on: TorqueActsOn = "joint",
    model: Annotated[
        Model,
        typer.Option(
            help="kbj: stiffness, damping, inertia. irf: impulse response, frf: frequency "
            "response, both with the second-order joint behind them. reflex: stiffness, damping, "
            "inertia beside a stretch reflex with gain and delay."
        ),
    ] = "kbj",
    estimator: Annotated[
        Estimator | None,
        typer.Option(
            help="Of kbj. By default least_squares for angle input; for torque input "
            "instrumental_variable with --command, else admittance."
        ),
    ] = None,
    cutoff_hz: Annotated[
        float | None,
        typer.Option(
            help="kbj, reflex: low-pass of all signals, by default 30 and 20 Hz. irf, frf: end of "
            "the band, by default where the coherence is lost."
        ),
    ] = None,
    answer: Answer = Answer(),
) -> None:
    """Fit torque = K*angle + B*velocity + J*acceleration to one recording.

    A column without a unit is in that of the file, or in SI if the file states none.
    COL:FACTOR*unit reads numbers that are in the unit when multiplied by the factor.

    Example: jointz identify joint knee.csv --angle knee:deg --torque tau:Nm --time t
    """
    from jointz.identification.doubtful_values import with_doubtful_values
    from jointz.identify.record.joint import identify_joint

    output = Output(model, answer, _SIZES[model])
    fit, origin = output.identify(
        identify_joint,
        file,
        {"angle": angle, "torque": torque, "time": clock.time, "command": command},
        clock=clock,
        input=perturbed,
        model=model,
        estimator=estimator,
        cutoff_hz=cutoff_hz,
        torque_acts_on=torque_acts_on,
    )
    output.report(with_doubtful_values(fit), origin)


for _command in (actuator, bandwidth, static, dither, time_varying, phase_curve, stride):
    identify.command()(_command)
