"""Workbooks (.xlsx) as laboratories record into them, through openpyxl (``jointz[formats]``)."""

import lzma
import struct
import warnings
import zipfile
import zlib
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import IO, Any
from xml.parsers import expat

from jointz.core.acquisition import Acquisition, SignalGroup
from jointz.core.errors import DataError, install_advice
from jointz.core.study import FilesSpec
from jointz.io.formats.columns import damage_errors, file_error
from jointz.io.formats.group_format import GroupFormat
from jointz.io.formats.memory_limit import check_unpacked
from jointz.io.text.column_names import READING
from jointz.io.text.workbook_tables import Sheet, groups_of, letters

#: What a damaged workbook makes zipfile, the XML parser and openpyxl raise.
_LIBRARY_ERRORS = (
    *(OSError, ValueError, TypeError, KeyError, IndexError, AttributeError, SyntaxError),
    *(EOFError, MemoryError, OverflowError, RuntimeError, ArithmeticError, AssertionError),
    *(zipfile.BadZipFile, zlib.error, lzma.LZMAError, struct.error),
)
_BLOCK_BYTES = 1 << 16
_ELEMENT_BYTES = 700  # of one element of XML in memory; a cell with a value is two
_PART_BYTES = 10  # at least, of one byte of a part: 600 MB of it take a minute to read, too
_ROWS_OF_NOTES = 8  # a sheet of fewer may hold what no table does
_MOST_ROWS = 1_048_576
_MOST_COLUMNS = 16_384
_LONGEST_TEXT = 32_767  # of a cell, in every program that writes workbooks
_MOST_CELLS = 30_000_000  # of a rectangle around all that is filled in: what a table can be
#: Last sheet, in which earlier versions of jointz kept what the tables have no place for.
_EARLIER = "jointz"
_LEFT_OUT = "events, metadata and descriptions of the sheet 'jointz' are left out"


class WorkbookFormat(GroupFormat):
    """Reads the tables of all visible sheets."""

    name = "workbook .xlsx"

    def read(self, path: Path, files: FilesSpec) -> Acquisition:  # noqa: ARG002
        """Return a group a sheet, or a group a column of time; formulas by their values."""
        sheets, hidden = _sheets(path)
        groups: list[SignalGroup] = []
        metadata: dict[str, str] = {}
        earlier = _titles_of_jointz(sheets)
        if earlier:
            sheets.pop()
            metadata[f"{READING}jointz"] = _LEFT_OUT
        for sheet in sheets:
            try:
                tables, notes = groups_of(sheet, of_jointz=sheet.title in earlier)
            except DataError as exc:
                if len(sheet.rows) > _ROWS_OF_NOTES or len(sheets) == 1:
                    raise
                tables, notes = [], {f"{READING}sheet.{sheet.title}": f"no table, left out: {exc}"}
            groups += tables
            metadata |= notes
        if hidden:
            metadata[f"{READING}hidden_sheets"] = f"not read: {', '.join(hidden)}"
        if not groups:
            titles = ", ".join(sheet.title for sheet in sheets) or "none visible"
            raise file_error(
                path,
                "expected a row of names with numbers under it, found none on its sheets "
                f"({titles}). Put names over the columns.",
            )
        return Acquisition(tuple(groups), (), metadata)


def _titles_of_jointz(sheets: Sequence[Sheet]) -> set[str]:
    """Return the titles of the tables in a workbook of an earlier version of jointz."""
    if not sheets or sheets[-1].title != _EARLIER:
        return set()
    titles = [str(row[1]) for row in sheets[-1].rows if row[0] == "group" and len(row) > 1]
    return {title[1:] for title in titles if title.startswith("'")}


def _openpyxl(path: Path) -> Any:
    try:
        import openpyxl
    except ImportError as exc:
        raise file_error(path, f"workbooks need openpyxl. {install_advice('formats')}") from exc
    return openpyxl


def _sheets(path: Path) -> tuple[list[Sheet], list[str]]:
    """Return the visible sheets, and the titles of the hidden ones."""
    openpyxl = _openpyxl(path)
    with damage_errors(path, *_LIBRARY_ERRORS), warnings.catch_warnings():
        warnings.simplefilter("ignore")  # styles and extensions it does not know
        _check_parts(path)
        with path.open("rb") as stream:
            values = openpyxl.load_workbook(stream, data_only=True)
        with path.open("rb") as stream:
            formulas = openpyxl.load_workbook(stream)
        visible = [s for s in values.worksheets if s.sheet_state == "visible"]
        titles = {sheet.title for sheet in visible}
        hidden = [s.title for s in values.worksheets if s.title not in titles]
        return [_sheet(path, s, formulas[s.title]) for s in visible], hidden


def _check_parts(path: Path) -> None:
    """Refuse a damaged part of the file: openpyxl leaves out sheets that it cannot find."""
    total = 0
    with zipfile.ZipFile(path) as parts:
        # What a part holds beyond its declared size is never read: its checksum is then wrong.
        declared = sum(part.file_size for part in parts.infolist())
        check_unpacked(path, _PART_BYTES * declared)
        for part in parts.infolist():
            with parts.open(part) as stream:
                for n_elements in _counted_elements(stream):
                    total += n_elements
                    check_unpacked(path, _ELEMENT_BYTES * total)


def _counted_elements(stream: IO[bytes]) -> Iterator[int]:
    """Yield how many elements a part has, block by block; of merged ranges each cell is one."""
    counted = [0]

    def count(tag: str, attributes: dict[str, str]) -> None:
        counted[0] += 1
        if tag.rpartition(":")[2] in ("mergeCell", "hyperlink"):
            counted[0] += _cells_of(attributes.get("ref", ""))

    parser = expat.ParserCreate()
    parser.StartElementHandler = count
    is_xml = True
    while block := stream.read(_BLOCK_BYTES):
        try:
            parser.Parse(block if is_xml else b"")
        except expat.ExpatError:  # an image; what is wrong with a sheet openpyxl says
            is_xml = False
        yield counted[0]
        counted[0] = 0


def _cells_of(ref: str) -> int:
    from openpyxl.utils import range_boundaries

    try:
        left, top, right, bottom = range_boundaries(ref)
    except (ValueError, TypeError):
        return 1
    last = right or _MOST_COLUMNS, bottom or _MOST_ROWS
    return (last[0] - (left or 1) + 1) * (last[1] - (top or 1) + 1)


def _sheet(path: Path, values: Any, formulas: Any) -> Sheet:
    # The cells that there are: a stray one in the last corner makes a rectangle of 1.7e10.
    filled = {at: c.value for at, c in values._cells.items() if c.value is not None}
    for (row, column), value in filled.items():
        if isinstance(value, str) and len(value) > _LONGEST_TEXT:
            raise DataError(
                f"{path.name}, {values.title}!{letters(column - 1)}{row}: expected a text of at "
                f"most {_LONGEST_TEXT} characters, found {len(value)}. Shorten it.",
                path=str(path),
            )
    unknown = {at for at, c in formulas._cells.items() if c.data_type == "f" and at not in filled}
    used = filled.keys() | unknown
    n_rows = max((row for row, _ in used), default=0)
    width = max((column for _, column in used), default=1)
    if n_rows * width > _MOST_CELLS:
        row, column = max(used)
        raise DataError(
            f"{path.name}, {values.title}!{letters(column - 1)}{row}: cells are filled in as far "
            f"as here, {n_rows} rows and {width} columns; expected a table of at most "
            f"{_MOST_CELLS:,} cells. Empty what stands apart.",
            path=str(path),
        )
    rows: list[list[Any]] = [[None] * width for _ in range(n_rows)]
    for (row, column), value in filled.items():
        rows[row - 1][column - 1] = value
    merged = tuple(
        (r.min_row - 1, r.min_col - 1, r.max_row - 1, r.max_col - 1)
        for r in values.merged_cells.ranges
    )
    open_formulas = frozenset((row - 1, column - 1) for row, column in unknown)
    return Sheet(path.name, values.title, [tuple(row) for row in rows], open_formulas, merged)
