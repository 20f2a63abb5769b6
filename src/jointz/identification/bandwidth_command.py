"""``jointz identify bandwidth``: the bandwidth of a closed torque loop."""

from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from enum import StrEnum
from pathlib import Path
from typing import Annotated, Any

import typer

from jointz.core.codes import Failure
from jointz.core.errors import EstimationError
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
    files = text_layout(delimiter, decimal, skip_rows, no_header=no_header)
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
