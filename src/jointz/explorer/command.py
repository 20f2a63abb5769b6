"""``jointz explore``: a page to explore results."""

import signal
from pathlib import Path
from typing import Annotated

import typer

from jointz.terminal.options import Printing
from jointz.terminal.output import emit, emit_json

#: Processes: one that estimates, one that reads recordings. Systems without POSIX signal masks use
#: a thread.
_WORKERS = 2 if hasattr(signal, "pthread_sigmask") else 1


def explore(
    results: Annotated[Path, typer.Argument(help="Results folder of jointz analyze.")],
    study: Annotated[
        Path | None,
        typer.Option(
            help="Folder of the study; by default the one with its name beside the results."
        ),
    ] = None,
    port: Annotated[
        int, typer.Option(min=0, max=65535, help="Port of the page; 0 for a free one.")
    ] = 0,
    listen: Annotated[str, typer.Option(help="Address to listen on.")] = "127.0.0.1",
    printing: Printing = Printing(),
) -> None:
    """Explore results in a browser: every pulse, its fit, and the numbers without it.

    Excluded pulses are written to the study's exclusions.csv, which jointz analyze reads.
    Ctrl-C ends it.

    Example: jointz explore results --study my-study
    """
    from jointz.web.server import require_app

    require_app()
    from jointz.explorer.page import explore as serve_explorer
    from jointz.explorer.results_files import open_results
    from jointz.tasks.process_pool import process_pool

    exploration = open_results(results, study=study)

    def announce(address: str) -> None:
        if printing.as_json:
            emit_json({"status": "serving", "address": address})
        else:  # also with --quiet: nobody can open the page without its token
            emit(f"Open {address}  (Ctrl-C ends it)")

    with process_pool(_WORKERS, needs="jointz.explorer.reestimation") as pool:
        serve_explorer(exploration, pool=pool, host=listen, port=port, announce=announce)
