"""Every name of the reference, every command and every option is documented."""

import importlib
import inspect
import re
from collections.abc import Iterator
from enum import Enum
from pathlib import Path
from typing import Any

import typer
from pydantic import BaseModel

from jointz.cli.command_line import command_line


def reference() -> Iterator[tuple[str, Any]]:
    """Yield every name that the reference page lists, and what it is."""
    page = (Path(__file__).parents[3] / "docs" / "reference.md").read_text()
    for name in re.findall(r"^   ([a-z][\w.]*)$", page, re.MULTILINE):
        owner, _, own = f"jointz.{name}".rpartition(".")
        yield name, getattr(importlib.import_module(owner), own)


REFERENCE = {n: t for n, t in reference() if n != "rig.testing.Signal"}  # a type
#: Those that say themselves how they are made; fields of a study are described on their own page.
CALLED = {
    n: t
    for n, t in REFERENCE.items()
    if not inspect.isclass(t) or ("__init__" in vars(t) and not issubclass(t, BaseModel | Enum))
}


def described(doc: str) -> set[str]:
    """Return the names that a numpydoc Parameters section describes."""
    section = re.search(
        r"^Parameters\n-+\n(.*?)(?=^\w[\w ]*\n-+\n|\Z)", doc, re.DOTALL | re.MULTILINE
    )
    heads = re.findall(r"^(\S[^\n]*?)(?: :[^\n]*)?$", section[1] if section else "", re.MULTILINE)
    return {name.strip().lstrip("*") for head in heads for name in head.split(",")}


def arguments(function: Any) -> list[str]:
    return [n for n in inspect.signature(function).parameters if n not in ("self", "cls")]


def commands(name: str, command: Any) -> Iterator[tuple[str, Any]]:
    yield name, command
    for own, inner in getattr(command, "commands", {}).items():
        yield from commands(f"{name} {own}", inner)


COMMANDS = dict(commands("jointz", typer.main.get_command(command_line())))


def test_every_public_name_has_a_docstring():
    docs = {n: vars(t).get("__doc__") or inspect.getdoc(t) or "" for n, t in REFERENCE.items()}

    assert len(docs) > 60
    # What dataclasses write themselves is no docstring.
    own = [n for n, doc in docs.items() if not doc or doc.startswith(f"{n.rpartition('.')[2]}(")]
    assert own == []


def test_every_argument_is_described():
    undescribed = {
        name: [a for a in arguments(thing) if a not in described(inspect.getdoc(thing) or "")]
        for name, thing in CALLED.items()
    }

    assert {name: found for name, found in undescribed.items() if found} == {}


def test_every_command_and_option_has_help():
    parameters = [(name, p) for name, command in COMMANDS.items() for p in command.params]
    shown = [(name, p) for name, p in parameters if not getattr(p, "hidden", False)]

    assert [name for name, command in COMMANDS.items() if not command.help] == []
    assert [(name, p.name) for name, p in shown if p.name != "help" and not p.help] == []
