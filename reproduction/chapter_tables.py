"""Cells of a chapter's tables, for the page and for the terminal."""

import math
from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from functools import partial
from typing import Any, Final

from jointz.core.channels import pretty_unit
from jointz.report.wording import DASH, MINUS, format_number
from reproduction.reproduction_tables import (
    Claim,
    ClaimTable,
    Compared,
    ComparedTable,
    ParticipantGrid,
    Table,
)

_COLUMNS: Final = (
    ("printed", "Printed"),
    ("dissertation", "Dissertation\N{RIGHT SINGLE QUOTATION MARK}s method"),
    ("recommended", "Recommended method"),
    ("truth", "Truth"),
)
#: Longer tables are folded up below their figure.
_LONGEST_OPEN: Final = 30
_FEWEST_DIGITS: Final = 2
_MOST_DIGITS: Final = 5
_SMALL_SHARE: Final = 0.1
_ALMOST_ALL_PCT: Final = 99.0
_GAP: Final = "  "
_PLUS_MINUS: Final = "\N{PLUS-MINUS SIGN}"

#: Verdict -> how it is marked; others are open.
_BADGES: Final[Mapping[str, str]] = {
    "reproduced": "held",
    "not reproduced": "not-held",
    "not shown": "not-held",
    "only with replicates as people": "replicates",
    "contradiction": "not-held",
    "not possible": "not-held",
}

_Row = dict[str, Any]


def compared_cells(rows: Sequence[Compared]) -> _Row:
    """Return the columns that hold something, and the text of every cell."""
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
        "judged": any(row.evidence != "not judged" for row in rows),
        "folded": len(rows) > _LONGEST_OPEN,
        "rows": [
            {
                "quantity": row.quantity,
                "unit": row.unit,
                "note": row.note,
                "row": row,
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
    """Return the text of a value, and what stands after it: an SD or an interval."""
    value: float | None = getattr(row, key)
    low, high = row.recommended_low, row.recommended_high
    half = None if low is None or high is None else 0.5 * (high - low)
    sd = {"printed": row.printed_sd, "dissertation": row.dissertation_sd}.get(key)
    width = {
        "dissertation": half if sd is None else sd,
        "recommended": half,
        "truth": row.dissertation_sd if half is None else half,
    }
    text = spread = ""
    if value is not None:
        write: Callable[[float], str] = _as_printed
        if key != "printed":
            write = _writer(value, width[key], scales[row.unit])
        text = write(value)
        if sd is not None:
            spread = f"{_PLUS_MINUS} {write(sd)}"
        elif key == "recommended" and low is not None and high is not None:
            spread = f"[{write(low)}, {write(high)}]"
    outside = key == "truth" and row.holds_truth is False
    return {"value": text or DASH, "spread": spread, "empty": value is None, "outside": outside}


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


def claim_cells(rows: Sequence[Claim]) -> _Row:
    """Return what a table of statements shows."""
    return {
        "rows": [{"claim": row, "badge": _BADGES.get(row.verdict, "open")} for row in rows],
        "counts": Counter(row.verdict for row in rows),
        "remarked": any(row.remark for row in rows),
        "folded": len(rows) > _LONGEST_OPEN,
    }


def grid_cells(grid: ParticipantGrid) -> _Row:
    """Return what a table of timing points by participants shows."""
    return {
        "participants": grid.participants,
        "unit": grid.unit,
        "blocks": [
            {
                "label": block.label,
                "rows": [
                    {
                        "point": point,
                        "cells": [_grid_cell(value, block.label) for value in row],
                        "average": _grid_cell(block.average[point], block.label),
                    }
                    for point, row in block.cells.items()
                ],
            }
            for block in grid.blocks
        ],
    }


def _grid_cell(value: float | None, label: str) -> str:
    if value is None:
        return DASH
    return _as_printed(value) if label == "printed" else _writer(value, None, 0.0)(value)


def table_cells(table: Table) -> tuple[str, _Row]:
    """Return the kind of a table and its cells."""
    if isinstance(table, ComparedTable):
        return "compared", compared_cells(table.rows)
    if isinstance(table, ClaimTable):
        return "claims", claim_cells(table.rows)
    return "grid", grid_cells(table)


# --- terminal ------------------------------------------------------------------------------------


def table_lines(table: Table) -> list[str]:
    """Return a table as lines of text; a long one is left to its file."""
    _, cells = table_cells(table)
    if isinstance(table, ParticipantGrid):
        lines = [f"{table.title}, {pretty_unit(table.unit)}"]
        for block in cells["blocks"]:
            rows = [[block["label"], *table.participants, "Average"]]
            rows += [[row["point"], *row["cells"], row["average"]] for row in block["rows"]]
            lines += _aligned(rows)
        return lines
    if cells["folded"]:
        counts = ", ".join(f"{n} {verdict}" for verdict, n in cells.get("counts", {}).items())
        return [
            table.title,
            f"{_GAP}{counts or f'{len(table.rows)} rows'}: tables/{table.name}.csv",
        ]
    if isinstance(table, ClaimTable):
        rows = [["Where", "Statement", "Printed", "Here", "Verdict"]]
        rows += [[r.where, r.claim, r.printed, r.ours, r.verdict] for r in table.rows]
        return [table.title, *_aligned(rows)]
    head = ["Quantity", "Unit", *(column["head"] for column in cells["columns"]), "Note"]
    rows = [head, *(_texts(row, cells["columns"]) for row in cells["rows"])]
    return [table.title, *_aligned(rows if cells["noted"] else [row[:-1] for row in rows])]


def _texts(row: _Row, columns: Sequence[_Row]) -> list[str]:
    texts = [row["quantity"], pretty_unit(row["unit"])]
    for column in columns:
        cell = row["cells"][column["key"]]
        outside = " (outside the interval)" if cell["outside"] else ""
        texts.append(f"{cell['value']} {cell['spread']}".rstrip() + outside)
    return [*texts, row["note"]]


def _aligned(rows: Sequence[Sequence[str]]) -> list[str]:
    """Return rows with columns of equal width, without letters that terminals often lack."""
    widths = [max(map(len, column)) for column in zip(*rows, strict=True)]
    padded = (map(str.ljust, row, widths) for row in rows)
    lines = (_GAP + _GAP.join(row).rstrip() for row in padded)
    return [
        line.replace(MINUS, "-").replace("\N{RIGHT SINGLE QUOTATION MARK}", "'") for line in lines
    ]
