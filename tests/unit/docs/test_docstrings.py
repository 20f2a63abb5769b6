"""Every public name is documented, every argument named; every command and option too."""

import importlib
import inspect
import pkgutil
import re
from collections.abc import Iterator
from enum import Enum
from pathlib import Path
from typing import Any

import pytest
import typer
from pydantic import BaseModel

import jointz
from jointz.cli.command_line import app

PAGE = Path(__file__).parents[3] / "docs" / "cli.md"


def public_objects() -> Iterator[tuple[str, Any]]:
    for info in pkgutil.walk_packages(jointz.__path__, "jointz."):
        module = importlib.import_module(info.name)
        yield info.name, module
        if not info.name.startswith("jointz.cli"):  # their help is checked below
            yield from _inside(module)


def _inside(module: Any) -> Iterator[tuple[str, Any]]:
    for name, thing in vars(module).items():
        own = getattr(thing, "__module__", "") == module.__name__
        if name.startswith("_") or not own or not (inspect.isclass(thing) or _is_function(thing)):
            continue
        yield f"{module.__name__}.{name}", thing
        if inspect.isclass(thing):
            yield from _methods(f"{module.__name__}.{name}", thing)


def _methods(owner: str, cls: type) -> Iterator[tuple[str, Any]]:
    for name, member in vars(cls).items():
        plain = getattr(member, "__func__", member)  # out of a classmethod
        if not name.startswith("_") and inspect.isfunction(plain):
            yield f"{owner}.{name}", plain
        elif not name.startswith("_") and isinstance(member, property) and member.fget:
            yield f"{owner}.{name}", member.fget


def _is_function(thing: Any) -> bool:
    return inspect.isfunction(thing) or inspect.isfunction(getattr(thing, "py_func", None))


OBJECTS = dict(public_objects())
FUNCTIONS = {n: t for n, t in OBJECTS.items() if not (inspect.ismodule(t) or inspect.isclass(t))}
#: Those that say themselves how they are made; fields of a study are described on their own page.
CLASSES = {
    n: t
    for n, t in OBJECTS.items()
    if inspect.isclass(t)
    and "__init__" in vars(t)
    and not issubclass(t, BaseModel | Enum)
    and not getattr(t, "_is_protocol", False)
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


REFERENCE = set(re.findall(r"\w+", (Path(__file__).parents[3] / "docs/reference.md").read_text()))
COMMANDS = dict(commands("jointz", typer.main.get_command(app)))


def test_the_walk_finds_the_package():
    assert "jointz.identify.series.joint.identify_joint" in FUNCTIONS
    assert "jointz.core.study.StudySpec.participant" in FUNCTIONS
    assert len(FUNCTIONS) > 100


@pytest.mark.parametrize("name", OBJECTS)
def test_every_public_name_has_a_docstring(name):
    doc = vars(OBJECTS[name]).get("__doc__") if inspect.isclass(OBJECTS[name]) else None
    doc = doc or inspect.getdoc(OBJECTS[name])

    assert doc
    # What dataclasses write themselves is no docstring.
    assert not doc.startswith(f"{name.rpartition('.')[2]}(")


@pytest.mark.parametrize("name", [*FUNCTIONS, *CLASSES])
def test_every_argument_is_described(name):
    doc = inspect.getdoc(OBJECTS[name]) or ""
    if "Parameters\n---" not in doc and name.rpartition(".")[2] not in REFERENCE:
        return  # a name that no page lists may explain itself

    assert [a for a in arguments(OBJECTS[name]) if a not in described(doc)] == []


def test_an_argument_that_is_not_described_would_be_noticed():
    parameters = "Parameters\n----------\na, b : int\n    Two.\n*rest : str\n    More.\n"

    doc = f"Do it.\n\n{parameters}\nNotes\n-----\nc : no"

    assert described(doc) == {"a", "b", "rest"}


@pytest.mark.parametrize("name", COMMANDS)
def test_every_command_has_help_and_stands_on_the_page(name):
    assert COMMANDS[name].help
    assert f"\n## {name}\n" in PAGE.read_text()


@pytest.mark.parametrize("name", COMMANDS)
def test_every_option_has_help_and_stands_on_the_page(name):
    section = PAGE.read_text().split(f"\n## {name}\n", 1)[1].split("\n## ", 1)[0]

    for parameter in COMMANDS[name].params:
        if parameter.name == "help" or getattr(parameter, "hidden", False):
            continue
        assert parameter.help
        option = parameter.param_type_name == "option"
        called = parameter.metavar or parameter.name.upper()  # as --help calls it
        assert f"| `{', '.join(parameter.opts) if option else called}` |" in section


@pytest.mark.parametrize("name", [n for n, c in COMMANDS.items() if not hasattr(c, "commands")])
def test_every_command_shows_an_example(name):
    assert f"Example: {name}" in " ".join(COMMANDS[name].help.split())
