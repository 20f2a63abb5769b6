"""The workbook that jointz writes: a sheet a group, and the sheet ``jointz`` for the rest.

A group's sheet has names in row 1, units in row 2 and samples from row 3, with the clock in
column A where there is one. Rows of the sheet ``jointz``::

    group     sheet  name  samples  clock (rate, stamps, none)  rate_hz  start_s
    signal    sheet  name  unit  kind (number, text)  description
    event     time_s  duration_s  label
    metadata  key  value
"""

import re
from collections.abc import Sequence
from typing import Any

import numpy as np

from jointz.core.acquisition import Acquisition, Event, Signal, SignalGroup
from jointz.io.column_names import clock_column, unique_names
from jointz.io.workbook_tables import Sheet

OWN_SHEET = "jointz"
_NOT_IN_TITLES = re.compile(r"[\[\]:*?/\\]|[^\x20-\x7e\xa0-\ud7ff]")
_CONTROL = re.compile(r"[\x00-\x08\x0b-\x1f\ud800-\udfff\ufffe\uffff]|_x[0-9A-Fa-f]{4}_")
_LONGEST_TITLE = 31
_LONGEST_CELL = 32_767


def fits(text: str) -> bool:
    """Whether a cell can hold a text as it is.

    Parameters
    ----------
    text : str
        The text.
    """
    return len(text) <= _LONGEST_CELL and _CONTROL.search(text) is None


def put_acquisition(book: Any, content: Acquisition, *, most_rows: int) -> None:
    """Put all of a content into an empty workbook of openpyxl.

    Parameters
    ----------
    book : openpyxl.Workbook
        In its mode of writing only; it is filled.
    content : Acquisition
        What to write.
    most_rows : int
        Samples that a sheet holds; later ones are left out.
    """
    titles = _titles([group.name for group in content.groups])
    for title, group in zip(titles, content.groups, strict=True):
        _put_group(book.create_sheet(title), group, content, most_rows)
    own = book.create_sheet(OWN_SHEET)
    for title, group in zip(titles, content.groups, strict=True):
        for row in _own_rows(title, group):
            own.append([_cell(own, value) for value in row])
    for event in content.events:
        row = ("event", repr(event.time_s), repr(event.duration_s), f"'{event.label}")
        own.append([_cell(own, value) for value in row])
    for key, value in content.metadata.items():
        own.append([_cell(own, word) for word in ("metadata", f"'{key}", f"'{value}")])


def own_acquisition(sheets: Sequence[Sheet]) -> Acquisition:
    """Return what :func:`put_acquisition` wrote.

    Parameters
    ----------
    sheets : sequence of Sheet
        The sheets; the last is ``jointz``.

    Raises
    ------
    ValueError
        When the sheets are not what that sheet says.
    """
    by_title = {sheet.title: sheet for sheet in sheets}
    rows = [[cell for cell in row if cell is not None] for row in sheets[-1].rows]
    groups = []
    for _, title, name, n, clock, rate, start in (row for row in rows if row[0] == "group"):
        told = [row[2:] for row in rows if row[0] == "signal" and row[1] == title]
        groups.append(
            _group(
                by_title[title[1:]], _word(name), (int(n), clock, float(rate), float(start)), told
            )
        )
    return Acquisition(
        tuple(groups),
        tuple(
            Event(float(row[1]), _word(row[3]), float(row[2])) for row in rows if row[0] == "event"
        ),
        {_word(row[1]): _word(row[2]) for row in rows if row[0] == "metadata"},
    )


def _put_group(sheet: Any, group: SignalGroup, content: Acquisition, most_rows: int) -> None:
    time = group.times_s()
    names = [signal.name for signal in group.signals]
    units = [signal.unit for signal in group.signals]
    columns: list[Sequence[Any]] = [_samples(signal) for signal in group.signals]
    if time is not None:
        names.insert(0, clock_column(group, content.metadata))
        units.insert(0, "s")
        columns.insert(0, time.tolist())
    sheet.append([_cell(sheet, name) for name in names])
    sheet.append([_cell(sheet, unit) for unit in units])
    for k in range(min(group.n_samples, most_rows)):
        sheet.append([_cell(sheet, column[k]) for column in columns])


def _samples(signal: Signal) -> list[Any]:
    if signal.is_text:
        return [str(text) for text in signal.values]
    return [value if np.isfinite(value) else None for value in signal.values.tolist()]


def _own_rows(title: str, group: SignalGroup) -> list[tuple[Any, ...]]:
    """Return the rows about a group; ``'`` before a text keeps empty ones."""
    clock = "none" if group.time_s is None else "stamps"
    clock = clock if group.rate_hz is None else "rate"
    rate = repr(group.rate_hz or 0.0)
    head = ("group", f"'{title}", f"'{group.name}", str(group.n_samples), clock, rate)
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
        cell.value = _CONTROL.sub(" ", value)[:_LONGEST_CELL]
        cell.data_type = "s"
    else:  # openpyxl writes 16 digits of a number, a double has 17
        cell.value = repr(value)
        cell.data_type = "n"
    return cell


def _titles(names: Sequence[str]) -> list[str]:
    """Return titles that a workbook takes; Excel holds capitals for the same letters."""
    plain = [_NOT_IN_TITLES.sub("_", name).strip("' ")[: _LONGEST_TITLE - 6] for name in names]
    words = [word if word and word.lower() != OWN_SHEET else f"{word or 'data'}_" for word in plain]
    low = unique_names([word.lower() for word in words])
    return [word + new[len(word) :] for word, new in zip(words, low, strict=True)]


def _group(
    sheet: Sheet, name: str, clock: tuple[int, str, float, float], told: Sequence[Sequence[Any]]
) -> SignalGroup:
    n, kind, rate, start = clock
    rows = sheet.rows[2 : 2 + n]
    rows = [*rows, *[(None,) * len(sheet.rows[0])] * (n - len(rows))]  # empty ones at the end
    shift = 0 if kind == "none" else 1
    signals = tuple(
        Signal(
            _word(own[0]),
            _values([row[k + shift] for row in rows], own[2]),
            _word(own[1]),
            _word(own[3]),
        )
        for k, own in enumerate(told)
    )
    return SignalGroup(
        name,
        signals,
        rate if kind == "rate" else None,
        start,
        _values([row[0] for row in rows], "number") if kind == "stamps" else None,
    )


def _values(cells: Sequence[Any], kind: str) -> np.ndarray:
    if kind == "number":
        return np.array([np.nan if c is None else float(c) for c in cells], dtype=np.float64)
    texts = np.empty(len(cells), dtype=object)
    texts[:] = ["" if cell is None else str(cell) for cell in cells]
    return texts


def _word(cell: str) -> str:
    return cell[1:]
