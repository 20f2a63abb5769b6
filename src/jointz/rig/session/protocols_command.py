"""``jointz protocols``: the experiments that come with jointz, and the user's own."""

from typing import TYPE_CHECKING, Annotated, Any

import typer

from jointz.terminal.options import Commands, Debug, Json, Printing, Quiet
from jointz.terminal.output import EXIT_BAD_INPUT, emit, emit_json, emit_table

if TYPE_CHECKING:
    from jointz.core.protocols.protocol import Protocol

protocols = Commands(
    invoke_without_command=True,
    rich_markup_mode=None,
    help="Show the experiments that come with jointz, check your own; alone it lists them.",
)


@protocols.callback()
def _protocols(
    context: typer.Context,
    as_json: Json = False,
    quiet: Quiet = False,
    debug: Debug = False,
) -> None:
    """Show the experiments that come with jointz, check your own; alone it lists them."""
    if context.invoked_subcommand is None:
        list_protocols(Printing(as_json, quiet, debug))
    elif as_json or quiet:
        raise typer.BadParameter("give --json and --quiet after the command, not before it.")


@protocols.command("list")
def list_protocols(printing: Printing = Printing()) -> None:
    """List the experiments that come with jointz.

    Example: jointz protocols list
    """
    from jointz.io.protocols import builtin_protocols, load_protocol

    about = [_about(load_protocol(name)) for name in builtin_protocols()]
    if printing.as_json:
        emit_json({"status": "ok", "protocols": about})
    elif not printing.quiet:
        rows = [
            [
                entry["name"],
                entry["section"],
                str(entry["participants"]),
                str(entry["pulses"]),
                f"{entry['expected_duration_s'] / 60:.0f} min",
                entry["title"],
            ]
            for entry in about
        ]
        header = ["protocol", "section", "people or loads", "pulses each", "each takes", "title"]
        emit_table(rows, header)


@protocols.command("show")
def show(
    name: Annotated[str, typer.Argument(help="A built-in protocol, or a protocol file.")],
    printing: Printing = Printing(),
) -> None:
    """Print a protocol as TOML, to read or to start your own from.

    Comments above it say how long it takes and draw its pulses; --quiet leaves them out.

    Example: jointz protocols show walking
    """
    from jointz.io.protocols import load_protocol, protocol_text

    protocol, text = load_protocol(name), protocol_text(name)
    if printing.as_json:
        content = protocol.model_dump(mode="json", exclude_none=True)
        emit_json({"status": "ok", **_about(protocol), "protocol": content, "text": text})
        return
    if not printing.quiet:
        from textwrap import wrap

        from jointz.rig.session.pulse_drawing import drawn_pulses

        for line in wrap(f"{protocol.name}: {_told(protocol)}", 96):
            emit(f"# {line}")
        for line in drawn_pulses(protocol):
            emit(f"#   {line}".rstrip())
    emit(text.rstrip("\n"))


@protocols.command("check")
def check(
    file: Annotated[str, typer.Argument(help="A protocol file, or a built-in protocol.")],
    printing: Printing = Printing(),
) -> None:
    """Check a protocol and report every problem at once.

    Exit status: 0 no problem, 2 problems, each with the full path of its key. Limits
    looser than the device's own are refused when it is run.

    Example: jointz protocols check my-protocol.toml
    """
    from jointz.core.errors import ProtocolError
    from jointz.io.protocols import load_protocol

    try:
        protocol = load_protocol(file)
    except ProtocolError as exc:
        if not printing.as_json:
            raise
        report = {"status": "error", "error": "ProtocolError", "message": str(exc)}
        emit_json({**report, "problems": list(exc.problems)})
        raise typer.Exit(EXIT_BAD_INPUT) from exc
    if printing.as_json:
        emit_json({"status": "ok", **_about(protocol), "problems": []})
    elif not printing.quiet:
        emit(f"{file}: no problems. {_told(protocol)}")


def _about(protocol: "Protocol") -> dict[str, Any]:
    return {
        "name": protocol.name,
        "title": protocol.title,
        "section": protocol.section,
        "kind": protocol.kind,
        "participants": protocol.cases,
        "conditions": [condition.name for condition in protocol.conditions],
        "pulses": _pulses(protocol),
        "expected_duration_s": round(protocol.expected_duration_s, 3),
    }


def _pulses(protocol: "Protocol") -> int:
    return sum(c.trials * c.perturbations.total for c in protocol.conditions if c.perturbations)


def _told(protocol: "Protocol") -> str:
    count, each = len(protocol.conditions), "load" if protocol.cases_are_loads else "participant"
    people = protocol.cases
    return (
        f"{count} condition{'s' if count != 1 else ''} and {_pulses(protocol)} pulses take about "
        f"{protocol.expected_duration_s / 60:.0f} min a {each}; {people} "
        f"{each}{'s' if people != 1 else ''}."
    )
