"""``jointz console``: the page of the operator beside the treadmill."""

import os
import sys
from pathlib import Path
from typing import Annotated

import typer

from jointz.rig.session.command import CalibrationOption, RigOptions
from jointz.terminal.exit_status import EXIT_STOPPED
from jointz.terminal.options import Printing
from jointz.terminal.output import emit, emit_error, emit_json

DEFAULT_PORT = 8700


def console(
    protocol: Annotated[
        str | None,
        typer.Argument(help="A built-in protocol, or a protocol file; none to watch only."),
    ] = None,
    out: Annotated[Path, typer.Option(help="The study's folder.")] = Path("study"),
    rig: RigOptions = RigOptions(),
    participants: Annotated[
        int | None,
        typer.Option(min=1, help="Number of people; by default that of --config or the protocol."),
    ] = None,
    seed: Annotated[int | None, typer.Option(min=0, help="Seed of plan and simulation.")] = None,
    resume: Annotated[
        bool, typer.Option("--resume", help="Continue a run, or find the running one.")
    ] = False,
    live: Annotated[
        bool | None,
        typer.Option(
            "--live/--no-live",
            help="Estimate while the session runs (default: on a machine of three or more cores).",
        ),
    ] = None,
    calibration: CalibrationOption = None,
    port: Annotated[
        int, typer.Option(min=0, max=65535, help="Port of the page; 0 for any.")
    ] = DEFAULT_PORT,
    listen: Annotated[str, typer.Option(help="Address to listen on.")] = "127.0.0.1",
    printing: Printing = Printing(),
) -> None:
    """Run an experiment from a page: watch the device, start, pause and stop the session.

    The session runs in a process of its own. Without the page it goes on or stops, as the protocol
    says; a session that nobody has started ends with the page. Ctrl-C closes the page. The
    emergency stop in the wearer's hand is independent of it. On Linux only.
    Needs the extra: pip install "jointz[app]".

    Example: jointz console walking --out study --participants 2 --seed 1
    """
    from jointz.rig.console.console_app import open_console

    def announce(address: str) -> None:
        if printing.as_json:
            emit_json({"status": "serving", "address": address})
        else:  # also with --quiet: nobody can open the page without its token
            emit(f"Console: {address}")

    left = open_console(
        out,
        _arguments(
            protocol,
            out,
            rig,
            participants=participants,
            seed=seed,
            live=True if live is None and (os.cpu_count() or 1) >= _LEAST_CORES else live,
            calibration=calibration,
        ),
        resume=resume,
        host=listen,
        port=port,
        announce=announce,
    )
    if printing.as_json:
        emit_error("KeyboardInterrupt", left)
    sys.stderr.write(f"jointz: {left}\n")
    sys.exit(EXIT_STOPPED)  # not by typer, which has its own message for Ctrl-C


#: The loop and everything else of a session take one each; of two, an estimate makes it miss slots.
_LEAST_CORES = 3


def _arguments(
    protocol: str | None,
    out: Path,
    rig: RigOptions,
    *,
    participants: int | None,
    seed: int | None,
    live: bool | None,
    calibration: Path | None,
) -> list[str]:
    """Return the arguments of ``jointz run``; none to watch only."""
    if protocol is None:
        return []
    from jointz.io.calibration_file import read_calibration
    from jointz.io.protocols import load_protocol

    # Problems of files are reported here, not on the page.
    plan = load_protocol(protocol)
    known = None if calibration is None else read_calibration(calibration)
    if rig.config is not None:
        from jointz.rig.session.rigs.hardware_rig import read_hardware, refuse_with_devices

        refuse_with_devices(device=rig.device, preset=rig.preset, clock="real", workers=1)
        read_hardware(rig.config, plan, participants=participants, known=known)
    options = {"--config": rig.config, "--device": rig.device, "--preset": rig.preset,
               "--participants": participants, "--seed": seed,
               "--calibration": calibration}  # fmt: skip
    arguments = [protocol, "--out", str(out), "--clock", "real", "--attended", "--quiet"]
    if live is not None and plan.kind == "walking":
        arguments.append("--live" if live else "--no-live")
    for name, value in options.items():
        if value is not None:
            arguments += [name, str(value)]
    return arguments
