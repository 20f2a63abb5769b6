"""Options that several commands share."""

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, is_dataclass
from functools import wraps
from inspect import Parameter, Signature, signature
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
        help="Dask cluster that does it: tcp://host:port of a lab's, or local to start one. Its "
        "workers must see the folder."
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

    @wraps(command)
    def run(**values: Any) -> None:
        command(**_grouped(own, values))

    run.__signature__ = own.replace(parameters=list(_single(own)))  # type: ignore[attr-defined]
    return run


def _single(own: Signature) -> Iterator[Parameter]:
    for parameter in own.parameters.values():
        kind = parameter.annotation
        yield from _single(signature(kind)) if _is_group(kind) else [parameter]


def _grouped(own: Signature, values: Mapping[str, Any]) -> dict[str, Any]:
    kinds = {name: parameter.annotation for name, parameter in own.parameters.items()}
    return {
        name: kind(**_grouped(signature(kind), values)) if _is_group(kind) else values[name]
        for name, kind in kinds.items()
    }


def _is_group(annotation: Any) -> bool:
    return is_dataclass(annotation)
