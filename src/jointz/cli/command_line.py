"""Commands of ``jointz``, and what their errors become."""

import io
import os
import sys
from typing import Annotated, Any

import typer

from jointz import __version__
from jointz.analysis.command import analyze
from jointz.calibration.command import calibrate
from jointz.collections.command import collect
from jointz.comparison.command import compare
from jointz.console.command import console
from jointz.conversion.command import convert
from jointz.core.errors import (
    DeviceError,
    EngineError,
    EstimationError,
    JointzError,
    WorkerLostError,
    WriteError,
)
from jointz.core.stop_signals import is_stop_noted
from jointz.demo.command import demo
from jointz.explorer.command import explore
from jointz.identification.command import identify
from jointz.inspection.command import inspect
from jointz.io.formats.memory_limit import VARIABLE
from jointz.io.formats.memory_limit import memory_limit as checked_memory_limit
from jointz.reproduction.command import reproduce
from jointz.session.command import run as run_experiment
from jointz.session.protocols_command import protocols
from jointz.session.stream_command import stream as stream_session
from jointz.terminal.exit_status import EXIT_STOPPED, note_command
from jointz.terminal.output import (
    EXIT_BAD_INPUT,
    EXIT_DEVICE,
    EXIT_NO_ESTIMATE,
    emit,
    emit_error,
)

_EXIT_BUG = 70

#: Wrong options; typer gives it no name of its own.
_UsageError: Any = typer.BadParameter.__base__

app = typer.Typer(
    name="jointz",
    no_args_is_help=True,
    pretty_exceptions_enable=False,
    rich_markup_mode=None,
    add_completion=False,
)
app.command("demo")(demo)
app.add_typer(protocols, name="protocols")
app.command("run")(run_experiment)
app.command("console")(console)
app.command("stream")(stream_session)
app.command("calibrate")(calibrate)
app.command("inspect")(inspect)
app.command("convert")(convert)
app.command("analyze")(analyze)
app.add_typer(identify, name="identify")
app.command("compare")(compare)
app.add_typer(collect, name="collect")
app.command("explore")(explore)
app.command("reproduce")(reproduce)


def _version(value: bool) -> None:
    if value:
        emit(f"jointz {__version__}")
        raise typer.Exit


@app.callback()
def _jointz(
    context: typer.Context,
    version: Annotated[
        bool, typer.Option("--version", callback=_version, is_eager=True, help="Show the version.")
    ] = False,
    memory_limit: Annotated[
        str,
        typer.Option(
            "--memory-limit",
            help="Most memory that one packed file may take, such as 8GB; a quarter of this "
            "machine's by default. Also: JOINTZ_MEMORY_LIMIT.",
        ),
    ] = "",
    debug: Annotated[
        bool, typer.Option("--debug", help="Show the traceback of an error, for a bug report.")
    ] = False,
) -> None:
    """Joint mechanical impedance: stiffness, damping and inertia with honest intervals.

    Start with: jointz demo
    """
    del version, debug
    note_command(context.invoked_subcommand)
    if memory_limit:
        os.environ[VARIABLE] = memory_limit  # workers inherit it
        checked_memory_limit()


def run_command_line() -> int:
    """Run the command line and return its exit status; errors become one message."""
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, io.TextIOWrapper):
            stream.reconfigure(errors="backslashreplace")  # a terminal may lack a letter of a name
    if "--debug" in sys.argv:
        app(prog_name="jointz")
    try:
        return app(prog_name="jointz", standalone_mode=False) or 0
    except _UsageError as exc:
        exc.show()
        if "--json" in sys.argv:
            emit_error("UsageError", exc.format_message())
        return EXIT_BAD_INPUT
    except typer.Abort:  # by typer's version; others return the status
        return EXIT_STOPPED
    except Exception as exc:  # noqa: BLE001 - the last line: no traceback without --debug
        if is_stop_noted() and not isinstance(exc, (DeviceError, WriteError)):
            return EXIT_STOPPED  # a library made another error of it
        return _report(exc)


def _report(exc: Exception) -> int:
    """Print what went wrong and return the exit status of it."""
    kind, status = type(exc).__name__, EXIT_NO_ESTIMATE
    if isinstance(exc, JointzError):
        message, status = _with_notes(exc, str(exc)), _exit_of(exc)
    elif isinstance(exc, MemoryError):
        what = _with_notes(exc, f"this machine has too little memory for it ({exc})")
        kind, message = "MemoryError", f"{what} Use fewer --workers, or a larger one."
    else:
        what = _with_notes(exc, f"{kind}: {exc}")
        message = f"{what} This is a bug in jointz; --debug shows where."
        kind, status = "Bug", _EXIT_BUG
    if "--json" in sys.argv:
        emit_error(kind, message)
    sys.stderr.write(f"jointz: {message}\n")
    return status


def _with_notes(exc: Exception, what: str) -> str:
    parts = [what, *getattr(exc, "__notes__", ())]
    between = "\n" if "\n" in what else " "  # a list of problems ends with its last
    return between.join(part if part.endswith((".", "?")) else f"{part}." for part in parts)


def _exit_of(exc: JointzError) -> int:
    if isinstance(exc, DeviceError):
        return EXIT_DEVICE
    if isinstance(exc, (WriteError, EngineError, WorkerLostError, EstimationError)):
        return EXIT_NO_ESTIMATE  # the input is not to blame
    return EXIT_BAD_INPUT
