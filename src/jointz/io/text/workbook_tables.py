"""Search for the tables of a sheet: names, units and samples among other text.

A table is a row of names, perhaps a row of units, and samples to the end of the sheet. Several
columns of time in one table each begin a group of their own. What cannot be told is an error
with the address of its cell.
"""

import datetime as dt
import re
import sys
from collections import Counter
from collections.abc import Mapping, Sequence, Set
from dataclasses import dataclass
from typing import Any, NoReturn

import numpy as np

from jointz.core.acquisition import Signal, SignalGroup
from jointz.core.errors import DataError
from jointz.io.formats.losses import NOTE, text_array
from jointz.io.text.column_names import (
    NO_UNIT,
    is_time,
    is_unit,
    seconds_of_one,
    unit_in_name,
    with_clock,
)

_COMMA_NUMBER = re.compile(r"\s*[+-]?(\d{1,3}(\.\d{3})+|\d+),\d+([eE][+-]?\d+)?\s*")
_POINT_NUMBER = re.compile(r"\s*[+-]?(\d+\.\d*|\.\d+|\d+)([eE][+-]?\d+)?\s*")
_MOST_HEADER_ROWS = 200
_DATES = (dt.date, dt.time, dt.timedelta)
_DATE_NOTE = NOTE + "dates and times, written as ISO 8601"
#: Of all numbers in double precision, in which spreadsheet programs calculate.
_LARGEST = sys.float_info.max
_MISSING = ("NA", "NaN", "nan", "N/A", "n/a")


@dataclass(frozen=True, slots=True)
class Sheet:
    """A sheet as openpyxl read it, and how to speak of its cells."""

    file: str  # name of the file, for messages
    title: str  # title of the sheet, for messages and names of groups
    rows: list[tuple[Any, ...]]  # values of the cells, in rows of equal width
    formulas: frozenset[tuple[int, int]]  # (row, column) of formulas without a stored value, from 0
    # (first row, first column, last row, last column) of merged cells, from 0
    merged: tuple[tuple[int, int, int, int], ...]

    def refuse(self, row: int, column: int, message: str) -> NoReturn:
        """Raise the error about a cell."""
        where = f"{self.title}!{letters(column)}{row + 1}"
        raise DataError(f"{self.file}, {where}: {message}", path=self.file, row=row + 1)


@dataclass(frozen=True, slots=True)
class Table:
    """Position of a table in its sheet, rows and columns from 0."""

    names_row: int
    units_row: int | None  # row of units, None where there is none
    first_row: int  # row of the first sample
    columns: tuple[int, ...]  # columns with a name
    aligned: bool = False  # whether a column that ends early lacks its last samples


def letters(column: int) -> str:
    """Return the letters of a column, counted from 0."""
    from openpyxl.utils import get_column_letter

    return str(get_column_letter(column + 1))


def groups_of(sheet: Sheet, *, of_jointz: bool = False) -> tuple[list[SignalGroup], dict[str, str]]:
    """Return the groups of a sheet, and its prose and what was read how as metadata.

    Tables ``of_jointz``, of earlier versions, have names in row 1 and units in row 2.
    """
    names_of_jointz = tuple(_filled(sheet, 0)) if of_jointz else ()
    own = Table(0, 1, 2, names_of_jointz, aligned=True) if names_of_jointz else None
    table = own or _find_table(sheet)
    last = len(sheet.rows) if table is None else table.names_row
    prose = {
        row: " | ".join(str(sheet.rows[row][k]) for k in _filled(sheet, row)) for row in range(last)
    }
    metadata = {f"{sheet.title}.row {row + 1}": text for row, text in prose.items() if text}
    if table is None:
        return [], metadata
    for first_row, first_column, last_row, _ in sheet.merged:
        if last_row >= table.first_row:
            sheet.refuse(
                max(first_row, table.first_row),
                first_column,
                "expected one sample a cell, found merged cells. Unmerge them.",
            )
    _refuse_names_above(sheet, table)
    names = _names(sheet, table)
    clocks = [k for k in table.columns if _is_clock(sheet, table, k, names[k])]
    blocks = _blocks(table.columns, clocks)
    groups = []
    for block in blocks:
        name = sheet.title if len(blocks) == 1 else f"{sheet.title}!{letters(block[0])}"
        own_clocks = [k for k in clocks if k in block]
        group, notes = _group(sheet, table, name, ({k: names[k] for k in block}, own_clocks))
        groups.append(group)
        metadata |= notes
    return groups, metadata


def _find_table(sheet: Sheet) -> Table | None:
    """Find the row of names under which most columns hold numbers."""
    rows = range(min(len(sheet.rows), _MOST_HEADER_ROWS))
    candidates = filter(None, (_table_at(sheet, row) for row in rows))
    return max(candidates, key=lambda table: _n_numbers(sheet, table), default=None)


def _table_at(sheet: Sheet, row: int) -> Table | None:
    """Return the table whose names stand in a row, None where they cannot."""
    names = _filled(sheet, row)
    if not names or not all(isinstance(sheet.rows[row][k], str) for k in names):
        return None
    if any(_looks_like_number(sheet.rows[row][k]) for k in names):
        return None
    units = row + 1 if _is_units(sheet, row + 1) else None
    first = row + 1 if units is None else row + 2
    if first >= len(sheet.rows):
        return None
    filled = _filled(sheet, first)
    numbers = [k for k in filled if _looks_like_number(sheet.rows[first][k])]
    numbers += [k for r, k in sheet.formulas if r == first]
    if not numbers or not set(numbers) <= set(names):
        return None
    return Table(row, units, first, tuple(names))


def _n_numbers(sheet: Sheet, table: Table) -> int:
    row = sheet.rows[table.first_row]
    return sum(_looks_like_number(row[k]) for k in table.columns)


def _filled(sheet: Sheet, row: int) -> list[int]:
    if row >= len(sheet.rows):
        return []
    return [k for k, value in enumerate(sheet.rows[row]) if not _is_empty(value)]


def _is_empty(value: Any) -> bool:
    return value is None or (isinstance(value, str) and not value.strip())


def _looks_like_number(value: Any) -> bool:
    if isinstance(value, str):
        return bool(_COMMA_NUMBER.fullmatch(value) or _POINT_NUMBER.fullmatch(value))
    return isinstance(value, int | float | dt.date | dt.time | dt.timedelta)


def _is_units(sheet: Sheet, row: int) -> bool:
    """Whether a row holds units: all its cells are text, and half of them can be read as units."""
    cells = [sheet.rows[row][k] for k in _filled(sheet, row)]
    if not cells or not all(isinstance(cell, str) for cell in cells):
        return False
    units = [_bare_unit(cell) for cell in cells]
    return 2 * sum(is_unit(unit) for unit in units) >= len(units)


def _bare_unit(cell: str) -> str:
    return cell.strip().strip("[]()").strip()


def _names(sheet: Sheet, table: Table) -> dict[int, str]:
    """Return the name of every column of the table; what stands over several goes before them."""
    row = sheet.rows[table.names_row]
    names = {k: str(row[k]).strip() for k in table.columns}
    samples = sheet.rows[table.first_row :]
    for k in range(len(row)):
        if k not in names and any(cells[k] is not None for cells in samples):
            sheet.refuse(
                table.names_row, k, "samples stand under it, and it is empty. Name the column."
            )
    over = _heads(sheet, table)
    counts = Counter(names.values())
    return {
        k: f"{over[k]} {name}" if counts[name] > 1 and k in over and not is_time(name) else name
        for k, name in names.items()
    }


def _heads(sheet: Sheet, table: Table) -> dict[int, str]:
    """Return what stands in merged cells right over the names."""
    above = table.names_row - 1
    return {
        k: str(sheet.rows[first_row][first]).strip()
        for first_row, first, last_row, last in sheet.merged
        if last_row == above and not _is_empty(sheet.rows[first_row][first])
        for k in range(first, last + 1)
    }


def _refuse_names_above(sheet: Sheet, table: Table) -> None:
    """Refuse names that look like the units of names right above them."""
    above = table.names_row - 1
    if above < 0 or table.units_row is not None or _filled(sheet, above) != list(table.columns):
        return
    upper, lower = ([str(sheet.rows[r][k]) for k in table.columns] for r in (above, above + 1))
    if not all(isinstance(sheet.rows[above][k], str) for k in table.columns):
        return
    units = any(is_unit(_bare_unit(cell)) for cell in lower)
    if units or (any(map(is_time, upper)) and not any(map(is_time, lower))):
        sheet.refuse(
            above,
            table.columns[0],
            f"two full rows of texts stand over the numbers, '{upper[0]}' and '{lower[0]}'; which "
            "are the names, cannot be told. Correct the units under them, or empty a row between.",
        )


def _is_clock(sheet: Sheet, table: Table, column: int, name: str) -> bool:
    """Whether a column holds times: ``T [Nm]`` is a torque, and a date is a text."""
    unit = _unit(sheet, table, column, name)
    if not is_time(name) or seconds_of_one(Signal(name, np.empty(0), unit)) is None:
        return False
    cells = [row[column] for row in sheet.rows[table.first_row :]]
    filled = [cell for cell in cells if _kind(cell) != "empty"]
    return not filled or any(_kind(c) != "date" and _looks_like_number(c) for c in filled)


def _blocks(columns: Sequence[int], clocks: Sequence[int]) -> list[list[int]]:
    """Return the columns of each group: where there are several times, each begins one."""
    if len(clocks) < 2 or clocks[0] != columns[0]:
        return [list(columns)]
    ends = [*clocks[1:], max(columns) + 1]
    return [
        [k for k in columns if start <= k < end] for start, end in zip(clocks, ends, strict=True)
    ]


def _group(
    sheet: Sheet, table: Table, name: str, columns: tuple[Mapping[int, str], Sequence[int]]
) -> tuple[SignalGroup, dict[str, str]]:
    names, clocks = columns
    ends = {k: _end(sheet, table, k) for k in names}
    n = ends[clocks[0]] if clocks else max(ends.values())
    for k, end in ends.items():
        if end == n or (end < n and (clocks or table.aligned)):
            continue
        if clocks:
            sheet.refuse(
                end - 1,
                k,
                f"'{names[k]}' has a sample, and '{names[clocks[0]]}' no time for it. Complete the "
                "column of time, or give this column its own.",
            )
        sheet.refuse(
            end,
            k,
            f"'{names[k]}' ends here, other columns go on to row {n}, and no column of time "
            "aligns them. Give a column of time, or put columns of other length on other sheets.",
        )
    _refuse_twice(sheet, table, names)
    signals = {
        k: _signal(sheet, table, k, name=names[k], rows=range(table.first_row, n)) for k in names
    }
    for k in clocks[:1]:
        if not (table.aligned or signals[k].is_text) and np.isnan(signals[k].values).any():
            at = table.first_row + int(np.flatnonzero(np.isnan(signals[k].values))[0])
            sheet.refuse(at, k, "expected a time stamp, found an empty cell. Fill it in.")
    for k in clocks[1:]:
        if not _same_times(signals[clocks[0]], signals[k]):
            sheet.refuse(
                table.names_row,
                k,
                f"'{names[k]}' holds other times than '{names[clocks[0]]}', and which columns "
                "belong to it cannot be told. Put a column of time before all others, or each "
                "table on a sheet of its own.",
            )
    return with_clock(name, list(signals.values()), row=table.first_row + 1)


def _same_times(one: Signal, other: Signal) -> bool:
    if one.is_text or other.is_text:
        return False
    factors = [float(seconds_of_one(signal) or 1.0) for signal in (one, other)]
    return np.allclose(factors[0] * one.values, factors[1] * other.values, rtol=1e-9, atol=1e-9)


def _refuse_twice(sheet: Sheet, table: Table, names: Mapping[int, str]) -> None:
    first_column: dict[str, int] = {}
    for k, name in names.items():
        if name in first_column:
            sheet.refuse(
                table.names_row,
                k,
                f"the name '{name}' stands over column {letters(first_column[name])} too. "
                "Rename one.",
            )
        first_column[name] = k


def _end(sheet: Sheet, table: Table, column: int) -> int:
    """Return the row after the last one that holds something in a column."""
    rows = range(len(sheet.rows) - 1, table.first_row - 1, -1)
    filled = (
        r for r in rows if not _is_empty(sheet.rows[r][column]) or (r, column) in sheet.formulas
    )
    return next(filled, table.first_row - 1) + 1


def _signal(sheet: Sheet, table: Table, column: int, *, name: str, rows: range) -> Signal:
    cells = [sheet.rows[r][column] for r in rows]
    for r in rows:
        if (r, column) in sheet.formulas:
            sheet.refuse(
                r,
                column,
                "a formula without a value: the program that wrote it did not calculate. Open the "
                "workbook in a spreadsheet program and save it.",
            )
    unit = _unit(sheet, table, column, name)
    kinds = [_kind(cell) for cell in cells]
    kind = "text" if "text" in kinds else next((k for k in kinds if k != "empty"), "number")
    kinds_of_column = frozenset(kinds)
    for r, cell, found in zip(rows, cells, kinds, strict=True):
        _check_kind(sheet, r, column, (cell, found, kinds_of_column))
    if kind == "number":
        values = [np.nan if _kind(c) == "empty" else float(c) for c in cells]
        return Signal(name, np.array(values, dtype=np.float64), unit)
    texts = [
        "" if c is None else c.isoformat() if hasattr(c, "isoformat") else str(c) for c in cells
    ]
    return Signal(name, text_array(texts), unit, _DATE_NOTE if kind == "date" else "")


def _unit(sheet: Sheet, table: Table, column: int, name: str) -> str:
    """Return the unit of a column, from the row of units or its name."""
    if table.units_row is None or _is_empty(sheet.rows[table.units_row][column]):
        return unit_in_name(name)
    stated = _bare_unit(str(sheet.rows[table.units_row][column]))
    return "" if stated.lower() in NO_UNIT[1:] and stated != "1" else stated


def _kind(cell: Any) -> str:
    if _is_empty(cell) or (isinstance(cell, str) and cell.strip() in _MISSING):
        return "empty"
    if isinstance(cell, _DATES):
        return "date"
    return "text" if isinstance(cell, str) else "number"


def _is_error(text: str) -> bool:
    return text.startswith("#") and text.endswith(("!", "?", "A"))


def _check_kind(sheet: Sheet, row: int, column: int, cell: tuple[Any, str, Set[str]]) -> None:
    """Refuse text among numbers, numbers written as text, and errors of formulas."""
    value, kind, kinds = cell
    if kind == "text":
        if _is_error(value):
            sheet.refuse(row, column, f"the error {value} of a formula. Correct it or empty it.")
        if _COMMA_NUMBER.fullmatch(value):
            sheet.refuse(
                row,
                column,
                f"expected a number, found the text '{value}' with a decimal comma. Turn the "
                "column into numbers in the spreadsheet program.",
            )
        if "number" in kinds or "date" in kinds:
            sheet.refuse(
                row, column, f"expected a number, found the text '{value}'. Correct or empty it."
            )
    elif kind == "date" and "number" in kinds:
        sheet.refuse(row, column, f"expected a number, found the date {value}. Correct it.")
    elif kind == "number" and abs(value) > _LARGEST:
        sheet.refuse(row, column, "the number is larger than any that a cell holds. Correct it.")
