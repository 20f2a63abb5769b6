"""Commands of ``jointz``, and the message and exit status of their errors."""

import io
import os
import sys
from collections.abc import Sequence
from importlib import import_module
from typing import Annotated, Any

import typer

from jointz import __version__
from jointz.core.errors import (
    DeviceError,
    EngineError,
    EstimationError,
    JointzError,
    WorkerLostError,
    WriteError,
)
from jointz.core.stop_signals import is_stop_noted
from jointz.io.formats.memory_limit import VARIABLE
from jointz.io.formats.memory_limit import memory_limit as checked_memory_limit
from jointz.terminal.exit_status import EXIT_STOPPED, note_command
from jointz.terminal.options import Commands, Debug
from jointz.terminal.output import EXIT_BAD_INPUT, EXIT_DEVICE, EXIT_NO_ESTIMATE, emit, emit_error

_EXIT_BUG = 70

#: Wrong options; typer gives it no name of its own.
_UsageError: Any = typer.BadParameter.__base__

#: Commands in the order of the help: where they are, and what they do, in one line of a terminal.
_COMMANDS = {
    "demo": ("jointz.demo.command:demo", "See it work on simulated people."),
    "inspect": (
        "jointz.inspection.command:inspect",
        "Show what is in a file, and draft study.toml.",
    ),
    "analyze": ("jointz.analysis.command:analyze", "Estimate K, B and J, and write the report."),
    "explore": ("jointz.explorer.command:explore", "Look at every pulse and fit in a browser."),
    "compare": (
        "jointz.comparison.command:compare",
        "Compare conditions, days, groups or methods.",
    ),
    "verify": (
        "jointz.verification.command:verify",
        "Check a set-up by a known addition to the joint.",
    ),
    "pool": ("jointz.pooling.command:pool", "Pool results of several studies and conditions."),
    "identify": ("jointz.identification.command:identify", "Fit one model to one record."),
    "convert": ("jointz.conversion.command:convert", "Convert a recording to another format."),
    "plan": (
        "jointz.planning.command:plan",
        "Plan pulses, sensors and people for a wanted interval.",
    ),
    "protocols": (
        "jointz.rig.session.protocols_command:protocols",
        "List, show and check experiments.",
    ),
    "run": ("jointz.rig.session.command:run", "Run an experiment, on devices or simulated."),
    "console": (
        "jointz.rig.console.command:console",
        "Run an experiment from a page in a browser.",
    ),
    "calibrate": (
        "jointz.rig.calibration.command:calibrate",
        "Measure lags, gains and the device itself.",
    ),
    "stream": ("jointz.rig.session.stream_command:stream", "Put a session on Lab Streaming Layer."),
    "control": (
        "jointz.control.command:control",
        "Make a controller's profile of a measured leg.",
    ),
}
#: Commands that are gone: what replaces each of them.
_REPLACED = {
    "collect": "this command was replaced by jointz pool RESULTS... --out pooled "
    "(jointz pool --help).",
    "reproduce": "this command moved beside the package: in a checkout, run make reproduce, or "
    "python -m reproduction all --out DIR.",
}


def _version(value: bool) -> None:
    if value:
        emit(f"jointz {__version__}")
        raise typer.Exit


def _jointz(
    context: typer.Context,
    version: Annotated[
        bool, typer.Option("--version", callback=_version, is_eager=True, help="Show the version.")
    ] = False,
    memory_limit: Annotated[
        str,
        typer.Option(
            help="Most memory that one packed file may take, such as 8GB; a quarter of this "
            "machine's by default. Also: JOINTZ_MEMORY_LIMIT."
        ),
    ] = "",
    debug: Debug = False,
) -> None:
    """Estimate stiffness (K), damping (B) and inertia (J) of a joint from recordings of pushes.

    What the data do not decide is called undecided.

    Start with: jointz demo. Your own files: jointz inspect FILE
    """
    del version, debug
    note_command(context.invoked_subcommand)
    if memory_limit:
        os.environ[VARIABLE] = memory_limit  # workers inherit it
        checked_memory_limit()


def _first_argument(arguments: Sequence[str]) -> str:
    """Return what the arguments begin with, but for options of ``jointz`` itself."""
    rest = iter(arguments)
    for argument in rest:
        if argument == "--memory-limit":
            next(rest, "")
        elif argument != "--debug" and not argument.startswith("--memory-limit="):
            return argument
    return ""


def command_line(arguments: Sequence[str] = ()) -> typer.Typer:
    """Return the commands; only the one that the arguments begin with if there is one."""
    named = _first_argument(arguments)
    app = Commands(
        name="jointz",
        no_args_is_help=True,
        pretty_exceptions_enable=False,
        rich_markup_mode=None,
        add_completion=False,
    )
    app.callback()(_jointz)
    for name in [named] if named in _COMMANDS else _COMMANDS:
        place, sentence = _COMMANDS[name]
        module, attribute = place.split(":")
        command = getattr(import_module(module), attribute)
        if isinstance(command, typer.Typer):
            app.add_typer(command, name=name, short_help=sentence)
        else:
            app.command(name, short_help=sentence)(command)
    return app


def run_command_line() -> int:
    """Run the command line and return its exit status; errors become one message."""
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, io.TextIOWrapper):
            stream.reconfigure(errors="backslashreplace")  # a terminal may lack a letter of a name
    if replacement := _REPLACED.get(_first_argument(sys.argv[1:])):
        _print_error("UsageError", replacement)
        return EXIT_BAD_INPUT
    app = command_line(sys.argv[1:])
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
    _print_error(kind, message)
    return status


def _print_error(kind: str, message: str) -> None:
    if "--json" in sys.argv:
        emit_error(kind, message)
    sys.stderr.write(f"jointz: {message}\n")


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
