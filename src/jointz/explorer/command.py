"""``jointz explore``: a page to look through results."""

import signal
from pathlib import Path
from typing import Annotated

import typer

from jointz.terminal.options import Debug, Json, Quiet
from jointz.terminal.output import emit, emit_json

#: Processes that estimate: one for the participant that is looked at, one for the others. Systems
#: without POSIX signal masks get none, and a thread.
_WORKERS = 2 if hasattr(signal, "pthread_sigmask") else 1


def explore(
    results: Annotated[Path, typer.Argument(help="Folder that jointz analyze made.")],
    study: Annotated[
        Path | None,
        typer.Option(
            "--study", help="Folder of the study; by default one of its name beside the results."
        ),
    ] = None,
    port: Annotated[
        int, typer.Option("--port", min=0, max=65535, help="Port of the page; 0 for a free one.")
    ] = 0,
    listen: Annotated[
        str,
        typer.Option("--listen", help="Address to listen on."),
    ] = "127.0.0.1",
    as_json: Json = False,
    quiet: Quiet = False,
    debug: Debug = False,
) -> None:
    """Look through results in a browser: every pulse, its fit, and the numbers without it.

    Excluded pulses go into the study's exclusions.csv, which jointz analyze honours.
    Ends with Ctrl-C.

    Example: jointz explore results --study my-study
    """
    del debug, quiet
    from jointz.web.server import require_app

    require_app()
    from jointz.explorer.page import explore as serve_explorer
    from jointz.explorer.results_files import open_results
    from jointz.tasks.process_pool import process_pool

    found = open_results(results, study=study)

    def announce(address: str) -> None:
        if as_json:
            emit_json({"status": "serving", "address": address})
        else:  # with --quiet too: without its token nobody can open the page
            emit(f"Open {address}  (Ctrl-C ends it)")

    with process_pool(_WORKERS, needs="jointz.explorer.reestimation") as pool:
        serve_explorer(found, pool=pool, host=listen, port=port, announce=announce)
