"""Cells of a chapter's tables: what the page and the terminal both show."""

import math
from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from functools import partial
from typing import Any, Final

from jointz.report.wording import DASH, MINUS, format_number
from jointz.reproduction.reproduction_tables import Claim, Compared, ParticipantGrid

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
    outside = key == "truth" and holds_truth(row) is False
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


def holds_truth(row: Compared) -> bool | None:
    """Return whether the interval of a row holds its truth, None where it lacks either."""
    if row.truth is None or row.recommended_low is None or row.recommended_high is None:
        return None
    return row.recommended_low <= row.truth <= row.recommended_high


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
