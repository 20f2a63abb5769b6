"""Figures and pages of chapters: one HTML page that needs nothing else."""

import re
from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from typing import TYPE_CHECKING, Any, Final

import numpy as np
from jinja2 import ChoiceLoader, Environment, PackageLoader, StrictUndefined

from jointz.core.channels import pretty_unit
from jointz.report.html_page import inline_svg
from jointz.report.style import to_svg
from jointz.results.figure_style import figure_style
from reproduction.chapter_tables import table_cells
from reproduction.reproduction_result import Reproduction
from reproduction.reproduction_tables import ClaimTable, Table, tally, tally_text, texts

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

#: More points than these no page shows and no printer prints.
MOST_POINTS: Final = 3000

#: Figure -> the curve it shows, and what draws it.
Drawings = Mapping[str, tuple[str, "Callable[[Any], Figure]"]]
_ROMAN: Final = {2: "II", 3: "III", 4: "IV"}
#: What the text says against itself, and what simulated people would have led to.
_NOT_COUNTED: Final = ("audit", "simulated_statistics")

_Row = dict[str, Any]


def render_chapter(reproduction: Reproduction, figures: Mapping[str, str]) -> str:
    """Write a chapter printed beside ours as one HTML page with its figures and styles inside."""
    title = f"{_heading(reproduction)}: {reproduction.title}"
    return _page(title, [(reproduction, figures)])


def render_validation(chapters: Sequence[tuple[Reproduction, Mapping[str, str]]]) -> str:
    """Write several chapters as one page."""
    return _page("Validation: the dissertation again", chapters)


def _page(title: str, chapters: Sequence[tuple[Reproduction, Mapping[str, str]]]) -> str:
    environment = Environment(
        loader=ChoiceLoader([PackageLoader("reproduction"), PackageLoader("jointz.report")]),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    environment.filters["unit"] = pretty_unit
    return environment.get_template("chapter.html.j2").render(
        title=title,
        about=_about(chapters[0][0].provenance),
        chapters=[_chapter(reproduction, figures) for reproduction, figures in chapters],
        evidence_counts=_evidence([reproduction for reproduction, _ in chapters]),
    )


def _evidence(chapters: Sequence[Reproduction]) -> _Row:
    """Return sentence, rule and rows of the table at the top: what agreement is worth."""
    total = tally(table for one in chapters for table in one.tables)
    rows = [(f"Chapter {_ROMAN.get(one.chapter, one.chapter)}", one.evidence) for one in chapters]
    return {
        "sentence": tally_text(total),
        "rule": texts()["evidence"]["rule"],
        "kinds": tuple(total),
        "rows": [*rows, ("All", total)] if len(rows) > 1 else rows,
    }


def _chapter(reproduction: Reproduction, figures: Mapping[str, str]) -> _Row:
    placed = _figures(figures)
    sections = [_section(reproduction.chapter, table, placed) for table in reproduction.tables]
    shown = {figure["name"] for section in sections for figure in section["figures"]}
    return {
        "number": reproduction.chapter,
        "heading": _heading(reproduction),
        "title": reproduction.title,
        "lead": texts()["lead"]["text"],
        "facts": _facts(reproduction),
        "sections": sections,
        "loose": [figure for name, figure in placed.items() if name not in shown],
        "notes": reproduction.notes,
        "provenance": _flat(reproduction.provenance),
    }


def _heading(reproduction: Reproduction) -> str:
    return f"Chapter {_ROMAN.get(reproduction.chapter, str(reproduction.chapter))} again"


def _about(provenance: Mapping[str, Any]) -> list[str]:
    version = provenance.get("jointz")
    about = [provenance.get("created"), f"jointz {version}" if version else None]
    return ["simulated", *(str(text) for text in about if text)]


def _facts(reproduction: Reproduction) -> list[tuple[str, str]]:
    """Return the numbers at the top of a chapter."""
    rows = [row for table in reproduction.compared for row in table.rows]
    checked = [held for row in rows if (held := row.holds_truth) is not None]
    text = "intervals of the recommended method hold the truth of the simulation"
    facts = [(f"{sum(checked)} of {len(checked)}", text)] if checked else []
    claims = [t for t in reproduction.tables if isinstance(t, ClaimTable)]
    judged = [table for table in claims if table.name not in _NOT_COUNTED]
    told = Counter(c.verdict for t in judged for c in t.rows if c.evidence != "not judged")
    return [*facts, *((str(n), f"printed statements {verdict}") for verdict, n in told.items())]


def _figures(figures: Mapping[str, str]) -> dict[str, _Row]:
    return {
        name: {
            **text,
            "name": name,
            "svg": inline_svg(figures[name], name, f"Figure {text['number']}"),
        }
        for name, text in texts()["figures"].items()
        if name in figures
    }


def _section(chapter: int, table: Table, figures: Mapping[str, _Row]) -> _Row:
    kind, cells = table_cells(table)
    return {
        "id": f"table-{chapter}-" + re.sub(r"\W", "-", table.name),
        "title": table.title,
        "caption": table.caption,
        "kind": kind,
        "table": {"folded": False, **cells},
        "figures": [figure for figure in figures.values() if figure["table"] == table.name],
    }


def _flat(provenance: Mapping[str, Any]) -> list[tuple[str, str]]:
    """Return names and texts; what is nested becomes one line."""
    return [(name.replace("_", " "), _text(value)) for name, value in provenance.items()]


def _text(value: Any) -> str:
    if isinstance(value, Mapping):
        return ", ".join(f"{name} {_text(one)}" for name, one in value.items())
    if isinstance(value, list | tuple):
        return ", ".join(_text(one) for one in value)
    return str(value)


# --- figures -------------------------------------------------------------------------------------


def draw_figures(drawings: Drawings, curves: Mapping[str, Any]) -> dict[str, str]:
    """Draw the figures whose curves are there."""
    with figure_style():
        return {
            name: to_svg(draw(curves[curve]))
            for name, (curve, draw) in drawings.items()
            if curves.get(curve)
        }


def numbers(values: Sequence[float | None] | np.ndarray | float | None) -> np.ndarray:
    """Return plain values as an array, NaN where there is none."""
    return np.asarray(values, dtype=float)


def every(size: int, *, most: int = MOST_POINTS) -> slice:
    """Return which samples to draw of a long record."""
    return slice(None, None, max(1, -(-size // most)))


def mark(
    axes: "Axes", at: float, bar: Sequence[float | None] | np.ndarray, colour: str, **look: Any
) -> None:
    """Draw a value with its bar, low to high; nothing where there is no value."""
    value, low, high = numbers(bar)
    if not np.isfinite(value):
        return
    if np.isfinite(low) and np.isfinite(high):
        axes.vlines(at, low, high, colors=colour, linewidth=look.pop("bar_width", 1.0), zorder=2)
    look.pop("bar_width", None)
    style: dict[str, Any] = {"color": colour, "linestyle": "none", "zorder": 3}
    axes.plot(at, value, **style | look)
