"""``jointz convert``: files to other formats, studies to Motion-BIDS."""

from pathlib import Path
from typing import Annotated, Literal

import typer

from jointz.terminal.file_options import TextOptions
from jointz.terminal.options import Printing
from jointz.terminal.printout import emit_result

#: Choices of ``--to``.
To = Literal["bids"]


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
    to: Annotated[To | None, typer.Option(help="Write a Motion-BIDS folder of a study.")] = None,
    lossy: Annotated[
        bool, typer.Option("--lossy", help="Leave out what OUT cannot hold, and name it.")
    ] = False,
    overwrite: Annotated[bool, typer.Option("--overwrite", help="Replace OUT.")] = False,
    text: TextOptions = TextOptions(),
    printing: Printing = Printing(),
) -> None:
    """Convert a file of any format that jointz reads to csv, tsv, txt or nc.

    Samples, units and clocks stay unchanged. A study becomes a Motion-BIDS folder with --to bids.
    Exit status: 0 written, 2 the input is not valid, or OUT cannot hold all of it without --lossy.

    Example: jointz convert walk.c3d walk.nc
    """
    from jointz.conversion.convert import convert as convert_file
    from jointz.core.study import FilesSpec

    files = FilesSpec(**text.layout())
    conversion = convert_file(source, target, to=to, files=files, lossy=lossy, overwrite=overwrite)
    emit_result(printing, conversion.to_dict(), conversion.summary())
