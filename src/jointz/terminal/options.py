"""Options that several commands share."""

from collections.abc import Callable
from dataclasses import dataclass, fields, is_dataclass
from functools import wraps
from inspect import Parameter, signature
from typing import Annotated, Any

import typer

Json = Annotated[
    bool, typer.Option("--json", help="Print one JSON object on stdout and nothing else.")
]
Quiet = Annotated[bool, typer.Option("--quiet", help="Print nothing but errors.")]
Debug = Annotated[
    bool, typer.Option("--debug", help="Show the traceback of an error, for a bug report.")
]
SchedulerOption = Annotated[
    str | None,
    typer.Option(
        "--scheduler",
        help="Dask cluster that does it: tcp://host:port of a lab's, or local to start one. Its "
        "workers must see the folder.",
    ),
]


@dataclass(frozen=True, slots=True)
class Printing:
    """Options of every command about what it prints; the command line itself reads ``debug``."""

    as_json: Json = False
    quiet: Quiet = False
    debug: Debug = False


class Commands(typer.Typer):
    """Commands with groups of options: a parameter that is a dataclass has an option a field."""

    def command(self, *args: Any, **kwargs: Any) -> Callable[[Any], Any]:
        """Register a command, as :meth:`typer.Typer.command` does."""
        register = super().command(*args, **kwargs)

        def add(command: Callable[..., None]) -> Callable[..., None]:
            register(_with_single_options(command))
            return command

        return add


def _with_single_options(command: Callable[..., None]) -> Callable[..., None]:
    """Return a command that takes each option of its groups by itself."""
    own = signature(command, eval_str=True)
    parameters = own.parameters.items()
    groups: dict[str, Any] = {
        name: p.annotation for name, p in parameters if is_dataclass(p.annotation)
    }

    @wraps(command)
    def run(**values: Any) -> None:
        for name, group in groups.items():
            values[name] = group(**{f.name: values.pop(f.name) for f in fields(group)})
        command(**values)

    options: list[Parameter] = []
    for name, parameter in parameters:
        group = groups.get(name)
        options += signature(group).parameters.values() if group else [parameter]
    run.__signature__ = own.replace(parameters=options)  # type: ignore[attr-defined]
    return run
