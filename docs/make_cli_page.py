"""Write cli.md out of the commands themselves: ``python docs/make_cli_page.py``.

A test compares the page with what this makes, so it cannot fall behind.
"""

import inspect
import textwrap
import typing
from collections.abc import Iterator
from enum import Enum
from pathlib import Path
from typing import Any

import typer

from jointz.cli.command_line import command_line

PAGE = Path(__file__).parent / "cli.md"

_HEAD = """\
# Commands

<!-- Made by docs/make_cli_page.py; do not edit. -->

Results go to stdout, progress and errors to stderr. With `--json` stdout holds one JSON object and
nothing else; an error is then an object with `"status": "error"`, `error` and `message`.

| exit status | meaning |
|---|---|
| 0 | done; of an analysis or a fit: at least one estimate is available |
| 1 | every estimate failed or is undecided; results could not be written; all workers were lost |
| 2 | the input cannot be trusted, an option is wrong, or the output folder must be kept |
| 3 | a device failed, or the safety gate tripped |
| 70 | a bug in jointz; `--debug` shows where |
| 130 | stopped by Ctrl-C, SIGTERM or SIGHUP; nothing half-written is left behind |

A stop takes effect from about 0.1 s after the start; Python itself handles an earlier one and
prints a traceback. While the command cleans up, further stops change nothing, and so do stops
after the last result. Only a Ctrl-C later than 10 s after the first ends a clean-up that hangs, at
once and with status 130; what is half-written then stays, under a name with `partial`. A signal
that is ignored from the start, as by `nohup` or in a script's background job, stays ignored.
"""


def page() -> str:
    """Return the text of cli.md."""
    return "\n".join([_HEAD, *_sections("jointz", typer.main.get_command(command_line()))])


def commands(name: str, command: Any) -> Iterator[tuple[str, Any]]:
    """Yield every command with its full name, groups before what they hold."""
    yield name, command
    for own, inner in getattr(command, "commands", {}).items():
        yield from commands(f"{name} {own}", inner)


def _sections(name: str, root: Any) -> Iterator[str]:
    for full_name, command in commands(name, root):
        told = inspect.cleandoc(command.help or "")
        told, _, example = told.partition("Example: ")
        yield f"## {full_name}\n\n{_paragraphs(told)}\n"
        if example:
            yield f"```bash\n{' '.join(example.split())}\n```\n"
        rows = [_row(p, _choices(command)) for p in command.params if p.help and not p.hidden]
        if rows:
            yield "\n".join(["| argument | default | meaning |", "|---|---|---|", *rows, ""])


def _paragraphs(text: str) -> str:
    parts = [" ".join(part.split()) for part in text.strip().split("\n\n")]
    return "\n\n".join(textwrap.fill(part, 100) for part in parts)


def _choices(command: Any) -> dict[str, list[str]]:
    """Return the choices of every parameter that has a fixed set of them."""
    found = {}
    for name, parameter in inspect.signature(command.callback).parameters.items():
        hint = next(iter(typing.get_args(parameter.annotation)), None)  # Annotated[hint, option]
        for kind in (hint, *typing.get_args(hint)):
            if isinstance(kind, type) and issubclass(kind, Enum):
                found[name] = [str(member.value) for member in kind]
            elif typing.get_origin(kind) is typing.Literal:
                found[name] = list(typing.get_args(kind))
    return found


def _row(parameter: Any, choices: dict[str, list[str]]) -> str:
    option = parameter.param_type_name == "option"
    name = (
        ", ".join(filter(str.strip, [*parameter.opts, *parameter.secondary_opts]))
        if option
        else parameter.metavar or parameter.name.upper()
    )
    meaning = parameter.help
    if len(choices.get(parameter.name, [])) > 1:
        meaning += f" One of {', '.join(f'`{c}`' for c in choices[parameter.name])}."
    return f"| `{name}` | {_default(parameter)} | {meaning} |"


def _default(parameter: Any) -> str:
    if parameter.required:
        return "required"
    default = parameter.default
    if getattr(parameter, "is_flag", False) or default is None:
        return ""
    return f"`{default.value if isinstance(default, Enum) else default}`"


if __name__ == "__main__":
    PAGE.write_text(page(), encoding="utf-8")
