"""The ``jointz`` command."""

import io
import os
import signal
import sys
from typing import Annotated, Any

import typer

from jointz import __version__
from jointz.cli.analyze import analyze
from jointz.cli.calibrate import calibrate
from jointz.cli.collect import collect
from jointz.cli.compare import compare
from jointz.cli.console import (
    EXIT_BAD_INPUT,
    EXIT_DEVICE,
    EXIT_NOTHING_STANDS,
    EXIT_STOPPED,
    emit,
    emit_error,
)
from jointz.cli.console_page import console
from jointz.cli.convert import convert
from jointz.cli.demo import demo
from jointz.cli.explore import explore
from jointz.cli.identify import identify
from jointz.cli.inspect import inspect
from jointz.cli.protocols import protocols
from jointz.cli.reproduce import reproduce
from jointz.cli.run import STILL_THERE
from jointz.cli.run import run as run_experiment
from jointz.cli.stream import stream as stream_session
from jointz.core.errors import (
    DeviceError,
    EngineError,
    JointzError,
    WorkerLostError,
    WriteError,
)

_EXIT_BUG = 70
LIMIT_VARIABLE = "JOINTZ_MEMORY_LIMIT"  # read by jointz.io.memory_limit

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
    if memory_limit:
        os.environ[LIMIT_VARIABLE] = memory_limit  # workers inherit it


def run() -> None:
    """Run the command line; errors become one message and an exit status."""
    _prepare_process()
    if "--debug" in sys.argv:
        app(prog_name="jointz")
        return
    try:
        status = app(prog_name="jointz", standalone_mode=False)
    except _UsageError as exc:
        exc.show()
        if "--json" in sys.argv:
            emit_error("UsageError", exc.format_message())
        sys.exit(EXIT_BAD_INPUT)
    except JointzError as exc:
        _report(type(exc).__name__, _with_notes(exc, str(exc)))
        sys.exit(_exit_of(exc))
    except (typer.Abort, KeyboardInterrupt):
        status = EXIT_STOPPED
    except MemoryError as exc:
        what = _with_notes(exc, f"this machine has too little memory for it ({exc})")
        _report("MemoryError", f"{what} Use fewer --workers, or a larger one.")
        sys.exit(EXIT_NOTHING_STANDS)
    except Exception as exc:  # noqa: BLE001 - the last line: no traceback without --debug
        what = _with_notes(exc, f"{type(exc).__name__}: {exc}")
        _report("Bug", f"{what} This is a bug in jointz; --debug shows where.")
        sys.exit(_EXIT_BUG)
    if status == EXIT_STOPPED:  # typer makes it of Ctrl-C, or raises, by its version
        signal.signal(signal.SIGINT, signal.SIG_IGN)  # a second one must not change the status
        _report("KeyboardInterrupt", f"Stopped. {_left_behind()}")
    sys.exit(status)


def _prepare_process() -> None:
    # Matrices here are small: threads of the linear algebra mostly wait for each other, and take
    # cores from processes that do more. Read when numpy is imported, which is later.
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    # Python would have workers look for modules in the working folder first, where data may lie.
    os.environ.setdefault("PYTHONSAFEPATH", "1")
    for name in ("SIGTERM", "SIGHUP"):  # a batch system's Ctrl-C; a closed terminal, not on Windows
        number = getattr(signal, name, None)
        if number is not None and signal.getsignal(number) != signal.SIG_IGN:
            signal.signal(number, signal.default_int_handler)
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, io.TextIOWrapper):
            stream.reconfigure(errors="backslashreplace")  # a terminal may lack a letter of a name


def _with_notes(exc: Exception, what: str) -> str:
    parts = [what, *getattr(exc, "__notes__", ())]
    between = "\n" if "\n" in what else " "  # a list of problems ends with its last
    return between.join(part if part.endswith((".", "?")) else f"{part}." for part in parts)


def _exit_of(exc: JointzError) -> int:
    if isinstance(exc, DeviceError):
        return EXIT_DEVICE
    if isinstance(exc, (WriteError, EngineError, WorkerLostError)):
        return EXIT_NOTHING_STANDS  # the input is not to blame
    return EXIT_BAD_INPUT


def _report(kind: str, message: str) -> None:
    if "--json" in sys.argv:
        emit_error(kind, message)
    sys.stderr.write(f"jointz: {message}\n")


def _left_behind() -> str:
    if sys.argv[1:2] == ["run"]:
        return STILL_THERE
    if sys.argv[1:2] == ["console"]:
        return "The page was not open yet, and no session was begun."
    return "Nothing half-written was left behind."
