"""Workbook that jointz writes: one sheet per group, and the sheet ``jointz`` for the rest.

A group's sheet has names in row 1, units in row 2 and samples from row 3, with the clock in
column A where there is one. A sheet that was changed in a spreadsheet program no longer fits
what the sheet ``jointz`` says: that is an error with the address of the cell. That sheet has
the rows::

    group     sheet  name  samples  clock (rate, stamps, none)  rate_hz  start_s
    signal    sheet  name  unit  kind (number, text)  description
    event     time_s  duration_s  label
    metadata  key  value
"""

import re
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from jointz.core.acquisition import Acquisition, Event, Signal, SignalGroup
from jointz.io.formats.losses import text_array
from jointz.io.text.column_names import READING, clock_column, unique_names
from jointz.io.text.side_information import first_other_time
from jointz.io.text.workbook_tables import LARGEST, Sheet

OWN_SHEET = "jointz"
#: Rows of a sheet.
MOST_ROWS = 1_048_576
_HEAD = 2
_CLOCKS = ("rate", "stamps", "none")
_UNDO = "Undo the change, or delete the sheet 'jointz' to have the tables read as they stand."
_NOT_IN_TITLES = re.compile(r"[\[\]:*?/\\]|[^\x20-\x7e\xa0-\ud7ff]")
_CONTROL = re.compile(r"[\x00-\x08\x0b-\x1f\ud800-\udfff\ufffe\uffff]|_x[0-9A-Fa-f]{4}_")
_LONGEST_TITLE = 31
_LONGEST_CELL = 32_767


def fits(text: str) -> bool:
    """Whether a cell can hold a text as it is."""
    return len(text) <= _LONGEST_CELL and _CONTROL.search(text) is None


def put_acquisition(book: Any, content: Acquisition, *, most_rows: int) -> None:
    """Put all of a content into an empty workbook of openpyxl."""
    titles = _titles([group.name for group in content.groups])
    for title, group in zip(titles, content.groups, strict=True):
        _put_group(book.create_sheet(title), group, content, most_rows)
    own_sheet = book.create_sheet(OWN_SHEET)
    for title, group in zip(titles, content.groups, strict=True):
        for row in _own_rows(title, group, min(group.n_samples, most_rows)):
            own_sheet.append([_cell(own_sheet, value) for value in row])
    for event in content.events:
        row = ("event", repr(event.time_s), repr(event.duration_s), f"'{event.label}")
        own_sheet.append([_cell(own_sheet, value) for value in row])
    for key, value in content.metadata.items():
        own_sheet.append([_cell(own_sheet, word) for word in ("metadata", f"'{key}", f"'{value}")])


def own_acquisition(sheets: Sequence[Sheet]) -> Acquisition:
    """Return what :func:`put_acquisition` wrote."""
    by_title = {sheet.title: sheet for sheet in sheets[:-1]}
    own_sheet = sheets[-1]
    rows = [[cell for cell in row if cell is not None] for row in own_sheet.rows]
    groups = []
    for k, row in enumerate(rows):
        if row[:1] != ["group"]:
            continue
        _, title, name, n, clock, rate, start = row
        sheet = by_title.pop(title[1:], None)
        if sheet is None:
            own_sheet.refuse(k, 1, f"there is no sheet '{title[1:]}' of this name. {_UNDO}")
        signal_rows = [row[2:] for row in rows if row[0] == "signal" and row[1] == title]
        if clock not in _CLOCKS:
            own_sheet.refuse(
                k, 4, f"expected one of {', '.join(_CLOCKS)}, found '{clock}'. {_UNDO}"
            )
        table = _OwnTable(sheet, _count(own_sheet, k, str(n)), clock, float(rate), float(start))
        groups.append(_group(table, _word(name), signal_rows))
    metadata = {_word(row[1]): _word(row[2]) for row in rows if row[0] == "metadata"}
    if by_title:
        metadata[f"{READING}sheets"] = f"not read, not of jointz: {', '.join(by_title)}"
    return Acquisition(
        tuple(groups),
        tuple(
            Event(float(row[1]), _word(row[3]), float(row[2])) for row in rows if row[0] == "event"
        ),
        metadata,
    )


def _count(sheet: Sheet, row: int, n: str) -> int:
    if not n.isdecimal() or len(n) > len(str(MOST_ROWS)) or int(n) > MOST_ROWS:
        expected = f"expected how many samples there are, up to {MOST_ROWS}"
        sheet.refuse(row, 3, f"{expected}, found '{n[:40]}'. {_UNDO}")
    return int(n)


def _put_group(sheet: Any, group: SignalGroup, content: Acquisition, most_rows: int) -> None:
    time = group.times_s()
    names = [signal.name for signal in group.signals]
    units = [signal.unit for signal in group.signals]
    columns: list[Sequence[Any]] = [
        list(map(str, s.values)) if s.is_text else _finite(s.values) for s in group.signals
    ]
    if time is not None:
        names.insert(0, clock_column(group, content.metadata))
        units.insert(0, "s")
        columns.insert(0, _finite(time))
    sheet.append([_cell(sheet, name) for name in names])
    sheet.append([_cell(sheet, unit) for unit in units])
    for k in range(min(group.n_samples, most_rows)):
        sheet.append([_cell(sheet, column[k]) for column in columns])


def _finite(values: np.ndarray) -> list[float | None]:
    return [value if np.isfinite(value) else None for value in values.tolist()]


def _own_rows(title: str, group: SignalGroup, n: int) -> list[tuple[Any, ...]]:
    """Return the rows about a group; ``'`` before a text keeps empty ones."""
    clock = "none" if group.time_s is None else "stamps"
    clock = clock if group.rate_hz is None else "rate"
    rate = repr(group.rate_hz or 0.0)
    head = ("group", f"'{title}", f"'{group.name}", str(n), clock, rate)
    rows: list[tuple[Any, ...]] = [(*head, repr(group.start_s))]
    for s in group.signals:
        kind = "text" if s.is_text else "number"
        rows.append(("signal", f"'{title}", f"'{s.name}", f"'{s.unit}", kind, f"'{s.description}"))
    return rows


def _cell(sheet: Any, value: Any) -> Any:
    """Return a cell; a text stays a text, also one that begins like a formula."""
    exact = not isinstance(value, float) or float(f"{value:.16g}") == value
    if not isinstance(value, str) and exact:
        return value
    from openpyxl.cell import WriteOnlyCell

    cell = WriteOnlyCell(sheet)
    if isinstance(value, str):
        cell.value = _held(value)
        cell.data_type = "s"
    else:  # openpyxl writes 16 digits of a number, a double has 17
        cell.value = repr(value)
        cell.data_type = "n"
    return cell


def _held(text: str) -> str:
    """Return what a cell holds of a text."""
    return _CONTROL.sub(" ", text)[:_LONGEST_CELL]


def _titles(names: Sequence[str]) -> list[str]:
    """Return titles that a workbook takes; Excel holds capitals for the same letters."""
    plain = [_NOT_IN_TITLES.sub("_", name).strip("' ")[: _LONGEST_TITLE - 6] for name in names]
    words = [word if word and word.lower() != OWN_SHEET else f"{word or 'data'}_" for word in plain]
    low = unique_names([word.lower() for word in words])
    return [word + new[len(word) :] for word, new in zip(words, low, strict=True)]


@dataclass(frozen=True, slots=True)
class _OwnTable:
    """A group's sheet, and what the sheet ``jointz`` says of its clock."""

    sheet: Sheet
    n: int  # number of samples
    kind: str  # kind of its clock: ``none``, ``stamps`` or ``rate``
    rate_hz: float  # 0 without a rate
    start_s: float  # time of the first sample on a clock of kind ``rate``

    @property
    def shift(self) -> int:
        """Columns of time before the signals."""
        return 0 if self.kind == "none" else 1

    def cells(self, column: int) -> list[Any]:
        """Return the samples of a column; empty ones at the end are no rows."""
        rows = self.sheet.rows[_HEAD : _HEAD + self.n]
        return [
            *(row[column] if column < len(row) else None for row in rows),
            *[None] * (self.n - len(rows)),
        ]


def _group(table: _OwnTable, name: str, signal_rows: Sequence[Sequence[Any]]) -> SignalGroup:
    _check_shape(table, [_word(row[0]) for row in signal_rows])
    signals = tuple(
        Signal(_word(row[0]), _values(table, k + table.shift, row[2]), _word(row[1]), _word(row[3]))
        for k, row in enumerate(signal_rows)
    )
    times = _times(table) if table.shift else None
    return SignalGroup(
        name,
        signals,
        table.rate_hz if table.kind == "rate" else None,
        table.start_s,
        times if table.kind == "stamps" else None,
    )


def _check_shape(table: _OwnTable, names: Sequence[str]) -> None:
    """Refuse columns and rows that came, went or moved, and formulas without a value."""
    sheet = table.sheet
    row = list(sheet.rows[0][table.shift :]) if sheet.rows else []
    expected_row = [_held(name) for name in names]
    for k in range(max(len(row), len(expected_row))):
        found = str(row[k]) if k < len(row) and row[k] is not None else ""
        expected = expected_row[k] if k < len(expected_row) else ""
        if found != expected:
            said = f"expected the name '{expected}', found '{found}'; a column was changed. {_UNDO}"
            sheet.refuse(0, k + table.shift, said)
    for r in range(_HEAD + table.n, len(sheet.rows)):
        for k, cell in enumerate(sheet.rows[r]):
            if cell not in (None, ""):
                sheet.refuse(r, k, f"the table has {table.n} samples; this row was added. {_UNDO}")
    for r, k in sorted(sheet.formulas):
        sheet.refuse(r, k, f"a formula without a value. Put a number in its place. {_UNDO}")


def _times(table: _OwnTable) -> np.ndarray:
    """Return the column of time; with a rate it says nothing else than the rate does."""
    rows = table.sheet.rows
    times = _values(table, 0, "number")
    for i in np.flatnonzero(np.isnan(times)).tolist():
        empty = _HEAD + i >= len(rows) or all(cell in (None, "") for cell in rows[_HEAD + i])
        if empty or table.kind == "rate":
            message = (
                f"expected sample {i + 1} of {table.n}, found no time; a row was deleted. {_UNDO}"
            )
            table.sheet.refuse(_HEAD + i, 0, message)
    if table.kind == "rate":
        at = first_other_time(times, table.rate_hz, table.start_s)
        if at is not None:
            message = (
                f"the rate is {table.rate_hz:g} Hz, and this time was changed to {times[at]:.9g}"
            )
            table.sheet.refuse(_HEAD + at, 0, f"{message}. {_UNDO}")
    return times


def _values(table: _OwnTable, column: int, kind: str) -> np.ndarray:
    cells = table.cells(column)
    if kind == "number":
        for i, cell in enumerate(cells):
            if cell is not None and not _is_number(cell):
                message = f"expected a number, found '{str(cell)[:40]}'. Correct or empty it."
                table.sheet.refuse(_HEAD + i, column, message)
        return np.array([np.nan if c is None else float(c) for c in cells], dtype=np.float64)
    return text_array("" if cell is None else str(cell) for cell in cells)


def _is_number(cell: Any) -> bool:
    return isinstance(cell, int | float) and not isinstance(cell, bool) and abs(cell) <= LARGEST


def _word(cell: str) -> str:
    return cell[1:]
