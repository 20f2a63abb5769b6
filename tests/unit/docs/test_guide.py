"""The guide says what the source does: ranges, priorities, options, figures, words."""

import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import typer

from jointz.cli.command_line import command_line
from jointz.core.gait_phases import PHASES, TIMING_POINTS

ROOT = Path(__file__).parents[3]
#: Options that every command has.
_USUAL = {"--json", "--quiet", "--debug", "--help"}
_COMMANDS = typer.main.get_command(command_line()).commands


def text(name: str) -> str:
    return (ROOT / name).read_text(encoding="utf-8")


def cells(page: str) -> Iterator[list[str]]:
    """Yield the cells of every row of the tables of a page."""
    for line in text(page).splitlines():
        if line.startswith("| ") and not line.startswith("|---"):
            yield [cell.strip() for cell in line.strip("|").split("|")]


def test_the_phases_of_the_glossary_are_those_of_the_code():
    rows = {r[0].strip("`"): r[2:] for r in cells("docs/glossary.md") if r[0].startswith("`")}

    assert rows == {
        name: [f"{low:g} to {high:g}", f"{TIMING_POINTS[name]:g}" if name in TIMING_POINTS else ""]
        for name, (low, high) in PHASES.items()
    }


def test_every_command_has_a_page_among_the_how_tos():
    rows = [row[0] for row in cells("docs/howto.md") if row[0].startswith("`jointz ")]

    assert sorted(row.strip("`").removeprefix("jointz ") for row in rows) == sorted(_COMMANDS)


def _options(command: Any) -> set[str]:
    shown = [p for p in command.params if p.param_type_name == "option" and not p.hidden]
    return {name for parameter in shown for name in parameter.opts} - _USUAL


def test_every_option_of_run_is_described_on_its_page():
    described = {
        option for row in cells("docs/run.md") for option in re.findall(r"`(--[\w-]+)`", row[0])
    }
    assert described == _options(_COMMANDS["run"])
