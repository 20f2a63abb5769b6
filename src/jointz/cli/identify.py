"""``jointz identify``: one time series to a model."""

from enum import StrEnum
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from jointz.cli.console import EXIT_NOTHING_STANDS, emit, emit_json, emit_table
from jointz.cli.options import Debug, Json, Quiet
from jointz.core.errors import OutputError

if TYPE_CHECKING:
    from jointz.core.joint_fit import JointFit


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


class Decimal(StrEnum):
    """Choices of ``--decimal``."""

    POINT = "."
    COMMA = ","


class Estimator(StrEnum):
    """Choices of ``--estimator``."""

    LEAST_SQUARES = "least_squares"
    BOUNDED_LEAST_SQUARES = "bounded_least_squares"
    ADMITTANCE = "admittance"
    INSTRUMENTAL_VARIABLE = "instrumental_variable"


identify = typer.Typer(no_args_is_help=True, rich_markup_mode=None, help="Fit a model to a file.")


@identify.callback()
def _identify() -> None:
    """Identify a model from one time series."""


@identify.command("joint")
def joint(
    file: Annotated[Path, typer.Argument(help="Recording: csv, csv.gz, parquet, nc, mat.")],
    angle: Annotated[str, typer.Option("--angle", help="COL[:unit] of the angle (rad).")],
    torque: Annotated[str, typer.Option("--torque", help="COL[:unit] of the torque (N*m).")],
    command: Annotated[
        str | None,
        typer.Option("--command", help="COL[:unit] of the commanded torque (N*m)."),
    ] = None,
    time: Annotated[str | None, typer.Option("--time", help="COL[:unit] of time (s).")] = None,
    rate: Annotated[
        float | None, typer.Option("--rate", help="Sampling rate in Hz, without a time column.")
    ] = None,
    perturbed: Annotated[
        Perturbed, typer.Option("--input", help="What was perturbed.")
    ] = Perturbed.TORQUE,
    torque_acts_on: Annotated[
        ActsOn, typer.Option("--torque-acts-on", help="device: the sign is flipped.")
    ] = ActsOn.JOINT,
    model: Annotated[
        Model, typer.Option("--model", help="kbj: stiffness, damping, inertia.")
    ] = Model.KBJ,
    estimator: Annotated[
        Estimator | None,
        typer.Option(
            "--estimator",
            help="By default least_squares for angle input; for torque input "
            "instrumental_variable with --command, else admittance.",
        ),
    ] = None,
    cutoff_hz: Annotated[
        float, typer.Option("--cutoff-hz", help="Low-pass of all signals, Hz.")
    ] = 30.0,
    figure: Annotated[
        Path | None, typer.Option("--figure", help="Write a figure (svg, pdf, png).")
    ] = None,
    delimiter: Annotated[
        str | None, typer.Option("--delimiter", help="Between the columns of a text file.")
    ] = None,
    decimal: Annotated[Decimal, typer.Option("--decimal", help="Sign in numbers.")] = Decimal.POINT,
    skip_rows: Annotated[
        int, typer.Option("--skip-rows", min=0, help="Rows before the table of a text file.")
    ] = 0,
    no_header: Annotated[
        bool, typer.Option("--no-header", help="No column names: COL is a number, from 1.")
    ] = False,
    as_json: Json = False,
    quiet: Quiet = False,
    debug: Debug = False,
) -> None:
    """Fit torque = K*angle + B*velocity + J*acceleration to one recording.

    Example: jointz identify joint knee.csv --angle knee:deg --torque tau:N*m --time t
    """
    del debug
    from jointz.core.errors import EstimationError
    from jointz.workflows.identification import identify_joint_file

    if figure is not None:
        _check_figure(figure)
    given = {"angle": angle, "torque": torque, "time": time, "command": command}
    try:
        fit, columns = identify_joint_file(
            file,
            {name: text for name, text in given.items() if text is not None},
            files={
                "delimiter": delimiter,
                "decimal": decimal.value,
                "skip_rows": skip_rows,
                "header": not no_header,
            },
            rate_hz=rate,
            input=perturbed.value,
            model=model.value,
            estimator=estimator.value if estimator else None,
            cutoff_hz=cutoff_hz,
            torque_acts_on=torque_acts_on.value,
        )
    except EstimationError as exc:
        if as_json:
            emit_json({"model": model.value, "status": f"failed:{exc.code}", "message": str(exc)})
        else:
            typer.echo(f"jointz: {exc}", err=True)
        raise typer.Exit(EXIT_NOTHING_STANDS) from exc
    if figure is not None:
        _save(fit, figure)
    if as_json:
        echoed = {n: {"column": c.name, "unit": c.unit} for n, c in columns.items()}
        content = {name: value for name, value in fit.to_dict().items() if name != "series"}
        emit_json({**content, "file": str(file), "columns": echoed})
    elif not quiet:
        _print(fit)
    standing = any(p.stands for p in fit.parameters)
    raise typer.Exit(0 if standing else EXIT_NOTHING_STANDS)


def _check_figure(figure: Path) -> None:
    """Refuse a figure that could not be written, before the work is done."""
    kinds = (".svg", ".pdf", ".png")
    if figure.suffix.lower() not in kinds:
        raise typer.BadParameter(f"--figure {figure}: expected a name that ends in {kinds}.")
    if figure.is_dir() or not figure.absolute().parent.is_dir():
        raise typer.BadParameter(f"--figure {figure}: expected a file in a folder that exists.")


def _save(fit: "JointFit", figure: Path) -> None:
    """Write the figure, whole or not at all."""
    from matplotlib.figure import Figure

    canvas = Figure(figsize=(7.1, 3.5))
    fit.plot(canvas.subplots())
    partial = figure.with_name(f".{figure.stem}.partial{figure.suffix}")
    try:
        canvas.savefig(partial, bbox_inches="tight")
        partial.replace(figure)
    except OSError as exc:
        raise OutputError(
            f"{figure}: cannot be written ({exc.strerror or exc}). Make room or ask for "
            "permission, or name another file."
        ) from exc
    finally:
        partial.unlink(missing_ok=True)


def _print(fit: "JointFit") -> None:
    def number(value: float | None) -> str:
        return "-" if value is None else f"{value:.4g}"

    rows: list[list[str]] = [
        [p.name, number(p.value), f"{number(p.ci_low)} to {number(p.ci_high)}", p.unit, p.status]
        for p in fit.parameters
    ]
    emit_table(rows, ["parameter", "value", "95 % interval", "unit", "status"])
    emit(fit.summary())
