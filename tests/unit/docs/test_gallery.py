"""The gallery, the traps and the reference: what is public is described, and shown at work."""

import ast
import importlib
import inspect
import re
from pathlib import Path
from types import ModuleType
from typing import Any

import jointz
from jointz.core import errors

ROOT = Path(__file__).parents[3]
DOCS = ROOT / "docs"
GALLERY = sorted((ROOT / "examples" / "gallery").glob("*.py"))
TRAPS = sorted((ROOT / "examples" / "traps").glob("*.py"))
SCRIPTS = [*GALLERY, *TRAPS]
REFERENCE = (DOCS / "reference.md").read_text(encoding="utf-8")
#: Sections whose classes are met by what returns or raises them, not by their names.
MET_OTHERWISE = ("Results", "Errors")
#: Packages of jointz that are public beside its own names.
ROOMS = ("reference", "stats", "rig.testing")
#: What no script can run here: opensourceleg wants an older numpy, a method belongs to a package
#: that registers it. docs/devices.md and docs/methods.md show these.
ON_A_PAGE = {
    "jointz.identify.regression.cell_estimator.CellMethod",
    "jointz.identify.regression.cell_regressions.unbounded",
    "jointz.rig.devices.opensourceleg_actuator.as_opensourceleg",
    "jointz.rig.session.rigs.opensourceleg_rig.simulated_opensourceleg_actuator",
}
_FENCE = re.compile(r"^```python[^\n]*\n(.*?)^```", re.DOTALL | re.MULTILINE)


def sections() -> dict[str, list[str]]:
    """Return heading of the reference -> full names under it."""
    found = {}
    for part in REFERENCE.split("\n## ")[1:]:
        heading, _, body = part.partition("\n")
        blocks = re.findall(r"autosummary::\n(.*?)^```", body, re.DOTALL | re.MULTILINE)
        names = [line.strip() for block in blocks for line in block.splitlines()]
        found[heading] = [f"jointz.{n}" for n in names if n and not n.startswith(":")]
    return found


SECTIONS = sections()
LISTED = [name for names in SECTIONS.values() for name in names]


def resolved(name: str) -> Any:
    module, _, own = name.rpartition(".")
    owner = importlib.import_module(module)
    return getattr(owner, own) if hasattr(owner, own) else importlib.import_module(name)


def is_callable_of_ours(thing: Any) -> bool:
    return inspect.isclass(thing) or inspect.isfunction(thing)


def dotted(node: ast.AST) -> str:
    if isinstance(node, ast.Attribute):
        return f"{dotted(node.value)}.{node.attr}"
    return node.id if isinstance(node, ast.Name) else ""


def used_in(source: str) -> set[str]:
    """Return the full names of what a source uses of jointz."""
    names = set()
    for node in ast.walk(ast.parse(source)):
        if isinstance(node, ast.ImportFrom) and (node.module or "").startswith("jointz"):
            names |= {f"{node.module}.{alias.name}" for alias in node.names}
        elif isinstance(node, ast.Attribute) and dotted(node).startswith("jointz."):
            names.add(dotted(node))
    return names


PAGES = [ROOT / "README.md", *sorted(DOCS.glob("*.md"))]
BLOCKS = [block for page in PAGES for block in _FENCE.findall(page.read_text(encoding="utf-8"))]
SHOWN = {name for script in SCRIPTS for name in used_in(script.read_text(encoding="utf-8"))}
ON_PAGES = {name for source in BLOCKS for name in used_in(source)}


def face(module: ModuleType) -> list[str]:
    """Return what a module offers; without ``__all__`` the functions that are its own."""
    if hasattr(module, "__all__"):
        return [n for n in module.__all__ if not inspect.ismodule(getattr(module, n))]
    own = inspect.getmembers(module, inspect.isfunction)
    return [name for name, thing in own if thing.__module__ == module.__name__]


def public_names() -> list[str]:
    rooms = {"jointz": jointz}
    rooms |= {f"jointz.{n}": importlib.import_module(f"jointz.{n}") for n in ROOMS}
    return [
        f"{room}.{name}"
        for room, module in rooms.items()
        for name in face(module)
        if not name.startswith("_")
    ]


def same(name: str) -> set[str]:
    """Return the names in the reference of the same thing."""
    thing = resolved(name)
    return {other for other in LISTED if resolved(other) is thing}


# --- reference --------------------------------------------------------------------------------


def test_every_public_name_stands_in_the_reference():
    assert set(public_names()) - set(LISTED) == set(), "add it to docs/reference.md"


def test_every_error_stands_in_the_reference():
    kinds = inspect.getmembers(errors, inspect.isclass)
    public = {n for n, kind in kinds if issubclass(kind, errors.JointzError) and n[0] != "_"}

    assert {f"jointz.core.errors.{name}" for name in public} == set(SECTIONS["Errors"])


def test_whatever_is_in_the_reference_is_shown_at_work_in_a_script():
    shown, on_pages = ([resolved(name) for name in names] for names in (SHOWN, ON_PAGES))
    names = [n for heading, own in SECTIONS.items() if heading not in MET_OTHERWISE for n in own]
    hidden = [n for n in names if resolved(n) not in (on_pages if n in ON_A_PAGE else shown)]

    assert hidden == [], "use it in a script of examples/gallery"


def test_what_examples_import_is_in_the_reference():
    used = [name for name in SHOWN | ON_PAGES if is_callable_of_ours(resolved(name))]

    assert [name for name in used if not same(name)] == [], "add it to docs/reference.md"


# --- scripts ----------------------------------------------------------------------------------
