"""Options about recording files that several commands share."""

from dataclasses import dataclass
from enum import StrEnum
from pathlib import Path
from typing import Annotated, Any, Literal

import typer


class Decimal(StrEnum):
    """Choices of ``--decimal``."""

    POINT = "."
    COMMA = ","


#: Choices of ``--input``.
Perturbed = Literal["torque", "angle"]
#: Choices of ``--torque-acts-on``.
ActsOn = Literal["joint", "device"]


File = Annotated[
    Path, typer.Argument(dir_okay=False, help="Recording: csv, csv.gz, parquet, nc, mat.")
]
Angle = Annotated[str, typer.Option(help="COL[:unit] of the angle (rad).")]
Torque = Annotated[str, typer.Option(help="COL[:unit] of the torque (N*m).")]
Time = Annotated[str | None, typer.Option(help="COL[:unit] of time (s).")]
Rate = Annotated[float | None, typer.Option(help="Sampling rate in Hz, without a time column.")]
Input = Annotated[Perturbed, typer.Option("--input", help="What was perturbed.")]
TorqueActsOn = Annotated[ActsOn, typer.Option(help="device: the sign is flipped.")]
Figure = Annotated[Path | None, typer.Option(help="Write a figure (svg, pdf, png).")]
Encoding = Annotated[
    str | None, typer.Option(help="Of a text file, such as cp1252; default UTF-8.")
]
Delimiter = Annotated[str | None, typer.Option(help="Between the columns of a text file.")]
DecimalSign = Annotated[
    Decimal, typer.Option("--decimal", help="Decimal sign in text and OpenSim files.")
]
SkipRows = Annotated[int, typer.Option(min=0, help="Rows before the table of a text file.")]
NoHeader = Annotated[
    bool, typer.Option("--no-header", help="No column names: COL is a number, from 1.")
]


@dataclass(frozen=True, slots=True)
class TextOptions:
    """Options of a text file."""

    encoding: Encoding = None
    delimiter: Delimiter = None
    decimal: DecimalSign = Decimal.POINT
    skip_rows: SkipRows = 0
    no_header: NoHeader = False

    def layout(self) -> dict[str, Any]:
        """Return the layout of the file, as under ``[files]`` of a study."""
        if self.delimiter == "":
            raise typer.BadParameter("--delimiter '': expected a character, such as ';'.")
        return {
            "encoding": self.encoding,
            "delimiter": self.delimiter,
            "decimal": self.decimal.value,
            "skip_rows": self.skip_rows,
            "header": not self.no_header,
        }
