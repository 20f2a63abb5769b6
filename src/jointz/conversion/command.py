"""``jointz convert``: files to other formats, studies to Motion-BIDS."""

from enum import StrEnum
from pathlib import Path
from typing import Annotated

import typer

from jointz.terminal.file_options import (
    Decimal,
    DecimalSign,
    Delimiter,
    Encoding,
    NoHeader,
    SkipRows,
    text_layout,
)
from jointz.terminal.options import Debug, Json, Quiet
from jointz.terminal.output import emit, emit_json


class To(StrEnum):
    """Choices of ``--to``."""

    BIDS = "bids"


def convert(
    source: Annotated[
        Path,
        typer.Argument(
            metavar="IN", help="File of any format that jointz reads; a study; a BIDS folder."
        ),
    ],
    target: Annotated[
        Path,
        typer.Argument(
            metavar="OUT", help="File to write; its suffix gives the format. Or a folder."
        ),
    ],
    to: Annotated[
        To | None, typer.Option("--to", help="Write a Motion-BIDS folder of a study.")
    ] = None,
    lossy: Annotated[
        bool, typer.Option("--lossy", help="Leave out what OUT cannot hold, and name it.")
    ] = False,
    overwrite: Annotated[bool, typer.Option("--overwrite", help="Replace OUT.")] = False,
    encoding: Encoding = None,
    delimiter: Delimiter = None,
    decimal: DecimalSign = Decimal.POINT,
    skip_rows: SkipRows = 0,
    no_header: NoHeader = False,
    as_json: Json = False,
    quiet: Quiet = False,
    debug: Debug = False,
) -> None:
    """Convert a file of any format that jointz reads to csv, tsv, txt or nc.

    Samples, units and clocks stay unchanged. A study becomes a Motion-BIDS folder with --to bids.
    Exit status: 0 written, 2 the input is not valid, or OUT cannot hold all of it without --lossy.

    Example: jointz convert walk.c3d walk.nc
    """
    del debug
    from jointz.conversion.convert import convert as convert_file
    from jointz.core.study import FilesSpec

    layout = text_layout(encoding, delimiter, decimal, skip_rows, no_header=no_header)
    conversion = convert_file(
        source,
        target,
        to=None if to is None else to.value,
        files=FilesSpec(**layout),
        lossy=lossy,
        overwrite=overwrite,
    )
    if as_json:
        emit_json({"status": "ok", **conversion.to_dict()})
    elif not quiet:
        emit(conversion.summary())
