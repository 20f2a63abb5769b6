"""Entry of ``jointz``: listens for a stop first, and loads the command line then."""

import gc
import os
import sys

from jointz.core.stop_signals import end_listening, listen_for_stops
from jointz.terminal.exit_status import EXIT_STOPPED, last_words


def run() -> None:
    """Run the command line, and end the process with its exit status."""
    # Matrices here are small: threads of the linear algebra mostly wait for each other, and take
    # cores from processes that do more. Read when numpy is imported, which is later.
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    # Python would have workers look for modules in the working folder first, where data may lie.
    os.environ.setdefault("PYTHONSAFEPATH", "1")
    # Numba takes these from a file in the working folder otherwise, and unpickles what is there.
    os.environ.setdefault("NUMBA_CACHE_DIR", "")
    os.environ.setdefault("NUMBA_CACHE_LOCATOR_CLASSES", "")
    # Searches for cycles take a tenth of the time of an analysis, most of them while modules load.
    gc.set_threshold(50_000)
    try:
        listen_for_stops()
        from jointz.cli.command_line import run_command_line  # loads typer: a signal can come

        status = run_command_line()
        stopped = end_listening()
    except KeyboardInterrupt:
        stopped = end_listening()
        status = EXIT_STOPPED
    except BaseException:  # --debug, or whoever ends the process himself
        end_listening()
        raise
    if stopped and not status:  # a library swallowed it
        status = EXIT_STOPPED
    if status == EXIT_STOPPED:
        # Python takes an interrupt that went through an exec of text for one that nobody caught,
        # and would kill itself by SIGINT in the end: the next eval of text makes it forget that.
        eval("None")
        _report_stop(f"Stopped. {last_words()}")
    sys.exit(status)


def _report_stop(message: str) -> None:
    if "--json" in sys.argv:
        from jointz.terminal.output import emit_error

        emit_error("KeyboardInterrupt", message)
    sys.stderr.write(f"jointz: {message}\n")
