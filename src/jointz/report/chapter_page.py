"""A chapter printed beside ours: one HTML page that needs nothing else."""

import math
import re
from collections.abc import Callable, Mapping, Sequence
from functools import partial
from typing import Any, Final

from jinja2 import Environment, PackageLoader, StrictUndefined

from jointz.core.reproduction import Compared, ComparedTable, Reproduction
from jointz.report.page import inline_svg
from jointz.report.wording import DASH, MINUS, format_integer, format_number, pretty_unit

_ROMAN: Final = {2: "II", 3: "III", 4: "IV"}
_COLUMNS: Final = (
    ("printed", "Printed"),
    ("dissertation", "Dissertation\N{RIGHT SINGLE QUOTATION MARK}s method"),
    ("recommended", "Recommended method"),
    ("truth", "Truth"),
)
#: Table -> the figure that shows it.
_FIGURE_OF_TABLE: Final = {
    "bandwidth": "figure_2_5",
    "intrinsic": "figure_intrinsic",
    "pairs": "figure_2_6",
    "mechanisms": "figure_mechanisms",
    "torque_models": "figure_3_3",
    "chirp": "figure_3_4",
    "static": "figure_3_5",
    "perturbation": "figure_3_6",
}
#: Figure -> number (a letter where the dissertation has none) and what is seen.
_CAPTIONS: Final = {
    "figure_2_5": (
        "2.5",
        "Closed-loop gain of the torque loop at two amplitudes, over its gain at low frequency, "
        "and the coherence of command and torque. Dots with bars: where the gain has fallen by 3 "
        "dB from that, with 95 % interval; crosses: the "
        "same read off a Blackman-Tukey spectrum of 30 lags (dashed); open triangles: printed. "
        "Bandwidths closer than the resolution of a spectrum cannot be told apart by it.",
    ),
    "figure_intrinsic": (
        "2.A",
        "Intrinsic impedance of the exoskeleton, output free: measured frequency response (dots) "
        "and the second-order model with the recommended estimates (line). The dissertation made "
        "this comparison (2.2.2) and did not print it.",
    ),
    "figure_2_6": (
        "2.6",
        "Stiffness, damping and inertia of every load, trajectories A to E from light to dark. "
        "Circles: dissertation's method, mean and standard deviation over pulses; diamonds: "
        "recommended method with its 95 % interval; grey lines: truth. In stiffness and inertia "
        "every panel spans the same percentage of its truth, in damping the same range.",
    ),
    "figure_mechanisms": (
        "2.B",
        "What each mechanism alone does to the dissertation's method: mean error over cases 1 to "
        "4. Several make inertia alone as low as printed; the text above says which make both "
        "printed averages.",
    ),
    "figure_3_3": (
        "3.3",
        "Torque of the three models against the torque sensor (above), and what is left (below), "
        "by direction of motion. Friction that a model lacks splits its remainder by direction.",
    ),
    "figure_3_4": (
        "3.4",
        "Torque sensor and torque model 3.3 during the four chirps: a stretch of each, and the RMS "
        "error over the whole chirp.",
    ),
    "figure_3_5": (
        "3.5",
        "Torque against deflection with the output locked, by the sensor and by the model, and the "
        "line fitted to each (left); the same less the line of the sensor (right).",
    ),
    "figure_3_6": (
        "3.6",
        "Stiffness of the springs while the position motor moves them, printed (open) beside ours "
        "(filled). Bars: standard deviation over pulses; of the recommended estimate the 95 % "
        "interval. Grey line: truth.",
    ),
}
#: Longer tables are folded up below their figure.
_LONGEST_OPEN: Final = 30
_FEWEST_DIGITS: Final = 2
_MOST_DIGITS: Final = 5
_SMALL_SHARE: Final = 0.1
_ALMOST_ALL_PCT: Final = 99.0
_PLUS_MINUS: Final = "\N{PLUS-MINUS SIGN}"

_Row = dict[str, Any]


def render_chapter(reproduction: Reproduction, figures: Mapping[str, str]) -> str:
    """Write a chapter printed beside ours as one HTML page with its figures and styles inside.

    Parameters
    ----------
    reproduction : Reproduction
        The chapter.
    figures : mapping of str to str
        Name -> SVG text, as :func:`jointz.report.chapter2_figures.draw_chapter2` and
        :func:`jointz.report.chapter3_figures.draw_chapter3` return them. A figure stands with
        its table; one whose table is not there stands behind the tables; figures of other names
        have no place on the page.

    Returns
    -------
    str
        HTML that needs no network, no fonts and no script.

    Examples
    --------
    >>> page = render_chapter(Reproduction(2, "The exoskeleton on its bench", ()), {})
    >>> "Chapter II again: The exoskeleton on its bench</h1>" in page
    True
    """
    environment = Environment(
        loader=PackageLoader("jointz.report"),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    environment.filters["unit"] = pretty_unit
    placed = _figures(figures)
    sections = [_section(table, placed) for table in reproduction.tables]
    shown = {section["figure"]["name"] for section in sections if section["figure"]}
    return environment.get_template("chapter.html.j2").render(
        heading=f"Chapter {_roman(reproduction.chapter)} again",
        title=reproduction.title,
        about=_about(reproduction.provenance),
        lead=_lead(reproduction.chapter),
        facts=_facts([row for table in reproduction.tables for row in table.rows]),
        sections=sections,
        loose=[one for name, one in placed.items() if name not in shown],
        notes=reproduction.notes,
        provenance=_flat(reproduction.provenance),
    )


def _roman(chapter: int) -> str:
    return _ROMAN.get(chapter, str(chapter))


def _lead(chapter: int) -> str:
    return (
        f"The experiments of chapter {_roman(chapter)} of the dissertation, run on a simulated "
        "bench by their protocols. Every printed number (left, on paper) stands beside two of "
        "ours: by the method of the dissertation, and by the recommended one. "
        f"{_PLUS_MINUS} stands before a standard deviation, brackets hold a 95 % interval; the "
        "truth is that of the simulation. A number of ours that resembles a printed one shows "
        "that the simulated bench is enough to make it, not that the real bench made it so."
    )


def _about(provenance: Mapping[str, Any]) -> list[str]:
    version = provenance.get("jointz")
    about = [provenance.get("created"), f"jointz {version}" if version else None]
    return ["simulated bench", *(str(text) for text in about if text)]


def _facts(rows: Sequence[Compared]) -> list[tuple[str, str]]:
    """Return the numbers at the top of the page."""
    printed = sum(
        row.printed is not None and (row.dissertation is not None or row.recommended is not None)
        for row in rows
    )
    facts = [(format_integer(printed), "printed numbers beside ours")] if printed else []
    checked = [held for row in rows if (held := _holds_truth(row)) is not None]
    if checked:
        text = "intervals of the recommended method hold the truth of the simulation"
        facts.append((f"{sum(checked)} of {len(checked)}", text))
    return facts


def _holds_truth(row: Compared) -> bool | None:
    if row.truth is None or row.recommended_low is None or row.recommended_high is None:
        return None
    return row.recommended_low <= row.truth <= row.recommended_high


def _figures(figures: Mapping[str, str]) -> dict[str, _Row]:
    return {
        name: {
            "name": name,
            "svg": inline_svg(figures[name], name, f"Figure {number}"),
            "number": number,
            "caption": caption,
        }
        for name, (number, caption) in _CAPTIONS.items()
        if name in figures
    }


def _section(table: ComparedTable, figures: Mapping[str, _Row]) -> _Row:
    return {
        "id": "table-" + re.sub(r"\W", "-", table.name),
        "title": table.title,
        "caption": table.caption,
        "table": compared_cells(table.rows),
        "figure": figures.get(_FIGURE_OF_TABLE.get(table.name, "")),
    }


def compared_cells(rows: Sequence[Compared]) -> _Row:
    """Return the columns that hold something, and the text of every cell.

    Parameters
    ----------
    rows : sequence of Compared
        Of a table.

    Returns
    -------
    dict
        ``columns`` (``key``, ``head``), ``unit`` where all rows share one, ``noted``, ``folded``
        and ``rows`` (``quantity``, ``unit``, ``note``, ``cells``: column -> ``value``, ``spread``).
    """
    units = {row.unit for row in rows}
    scales = {unit: _scale([row for row in rows if row.unit == unit]) for unit in units}
    columns = [
        {"key": key, "head": head}
        for key, head in _COLUMNS
        if any(getattr(row, key) is not None for row in rows)
    ]
    return {
        "columns": columns,
        "unit": units.pop() if len(units) == 1 else "",
        "noted": any(row.note for row in rows),
        "folded": len(rows) > _LONGEST_OPEN,
        "rows": [
            {
                "quantity": row.quantity,
                "unit": row.unit,
                "note": row.note,
                "cells": {column["key"]: _cell(row, column["key"], scales) for column in columns},
            }
            for row in rows
        ],
    }


def _scale(rows: Sequence[Compared]) -> float:
    """Return the size below which a number is small beside the others of its unit."""
    values = [abs(v) for row in rows for v in (row.dissertation, row.recommended) if v is not None]
    return _SMALL_SHARE * max((v for v in values if math.isfinite(v)), default=0.0)


def _cell(row: Compared, key: str, scales: Mapping[str, float]) -> _Row:
    value: float | None = getattr(row, key)
    text = spread = ""
    if value is not None:
        text, spread = _CELLS[key](row, value, scales[row.unit])
    outside = key == "truth" and _holds_truth(row) is False
    return {"value": text or DASH, "spread": spread, "empty": value is None, "outside": outside}


def _printed_cell(row: Compared, value: float, _: float) -> tuple[str, str]:
    sd = row.printed_sd
    return _as_printed(value), "" if sd is None else f"{_PLUS_MINUS} {_as_printed(sd)}"


def _dissertation_cell(row: Compared, value: float, scale: float) -> tuple[str, str]:
    sd = row.dissertation_sd
    write = _writer(value, _half_width(row) if sd is None else sd, scale)
    return write(value), "" if sd is None else f"{_PLUS_MINUS} {write(sd)}"


def _recommended_cell(row: Compared, value: float, scale: float) -> tuple[str, str]:
    write = _writer(value, _half_width(row), scale)
    low, high = row.recommended_low, row.recommended_high
    return write(value), "" if low is None or high is None else f"[{write(low)}, {write(high)}]"


def _truth_cell(row: Compared, value: float, scale: float) -> tuple[str, str]:
    half = _half_width(row)
    return _writer(value, row.dissertation_sd if half is None else half, scale)(value), ""


def _half_width(row: Compared) -> float | None:
    if row.recommended_low is None or row.recommended_high is None:
        return None
    return 0.5 * (row.recommended_high - row.recommended_low)


def _as_printed(value: float) -> str:
    """Write a number with the digits it was printed with, but for zeros at its end."""
    text = f"{value:.6g}"
    if not math.isfinite(value):
        return DASH
    return format_number(value) if "e" in text else text.replace("-", MINUS)


def _writer(value: float, spread: float | None, scale: float) -> Callable[[float], str]:
    """Return what writes numbers with two digits of their spread, three of the value without."""
    largest = max(abs(value), abs(spread or 0.0))
    if not math.isfinite(largest) or (not spread and value == round(value)):
        return _as_printed
    if spread:
        digits = 2 + _exponent(largest) - _exponent(spread)
        digits = min(max(digits, _FEWEST_DIGITS), _MOST_DIGITS)
    else:
        largest = max(largest, scale)
        digits = 4 if _ALMOST_ALL_PCT < value < 100.0 else 3  # a VAF of 99.98 % is not 100 %
    return partial(format_number, like=largest, digits=digits)


def _exponent(value: float) -> int:
    return math.floor(math.log10(abs(value)))


_CELLS: Final[Mapping[str, Callable[[Compared, float, float], tuple[str, str]]]] = {
    "printed": _printed_cell,
    "dissertation": _dissertation_cell,
    "recommended": _recommended_cell,
    "truth": _truth_cell,
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
