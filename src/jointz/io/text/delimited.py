"""Text tables: comma, tab or otherwise delimited, in any encoding, plain or gzip.

pandas parses the file at its own speed. Beside it, in a thread, one pass over the bytes
hashes the file and checks that its delimiters and line ends repeat with the
period of the header, because pandas fills short rows and cuts long ones without
a word. Only where one of the two finds something is the file read again, row by
row, to say which row it is and what is wrong with it.
"""

import csv
import gzip
import hashlib
import io
import re
import warnings
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from dataclasses import dataclass, replace
from pathlib import Path
from typing import IO, Any, NoReturn, cast

import numpy as np
import pandas as pd

from jointz.core.errors import DataError
from jointz.core.grouping import by_key
from jointz.core.study import FilesSpec
from jointz.io.formats.columns import (
    RawTable,
    TableRequest,
    damage_errors,
    file_error,
    label_column,
    missing_columns,
)
from jointz.io.formats.memory_limit import NUMBER_BYTES, OBJECT_BYTES, check_unpacked
from jointz.io.text.text_bytes import (
    DECOMPRESSION_ERRORS,
    UTF8,
    is_compressed,
    not_decoded,
    open_text_bytes,
    reading_errors,
    recoded,
    stated_encoding,
)

_BOM = b"\xef\xbb\xbf"
_BLOCK_BYTES = 1 << 18
_FIRST_BYTES = 1 << 16
_LONGEST_LINE_BYTES = 1 << 20
_ROWS_FOR_A_CUSTOM = 8  # rows that must agree before a shorter last number is called cut
#: Cells that stand for a sample that is missing.
MISSING_TEXT = ("", "NA", "NaN", "nan", "NAN", "-nan", "n/a", "N/A", "#N/A", "#NV", "NULL", "null")
_NUMBER = re.compile(r"[+-]?(\d+\.?\d*|\.\d+)([eE][+-]?\d+)?\s*|[+-]?inf(inity)?", re.IGNORECASE)
_DIGITS = re.compile(r"[+-]?\d+(?:\.(?P<decimals>\d+))?(?:[eE][+-]?(?P<exponent>\d+))?")
_OTHER_DECIMAL = str.maketrans(".,", ",.")


@dataclass(frozen=True, slots=True)
class _Layout:
    """Layout of a file, from its first lines."""

    path: Path
    encoding: str
    delimiter: str
    decimal: str
    head: tuple[bytes, ...]  # the lines before the first sample
    start_byte: int  # offset of the first sample, after a byte order mark
    names: tuple[str, ...]  # one for each column; numbers from 1 without a header
    named: bool  # whether the file has a header
    as_written: bool = False  # as in :class:`TableRequest`
    missing: tuple[str, ...] = MISSING_TEXT  # cells that stand for a sample that is missing

    @property
    def first_row(self) -> int:
        return len(self.head) + 1

    def error(
        self, message: str, *, row: int | None = None, channel: str | None = None
    ) -> DataError:
        return file_error(self.path, message, row=row, channel=channel)


@dataclass(frozen=True, slots=True)
class _Scan:
    """Result of the pass over the bytes."""

    sha256: str
    regular: bool  # whether every row has as many delimiters as the header
    n_rows: int  # number of rows, without empty ones at the end; valid only if ``regular``
    terminated: bool  # whether the last line has a line end
    last_lines: tuple[str, ...]  # last whole lines of the file


def read_delimited(path: Path, request: TableRequest) -> RawTable:
    """Return the requested columns, by name, or by number where there is no header."""
    layout = replace(_layout(path, request.files), as_written=request.as_written)
    positions = _positions(layout, request)
    numeric = sorted({positions[c] for c in request.numeric})
    labels = sorted({positions[c] for c in request.labels})
    with ThreadPoolExecutor(max_workers=1) as pool:
        scanning = pool.submit(_scan, layout, len(labels))
        if is_compressed(path):
            scanning.result()  # refuses what unpacks to too much, before pandas holds it
        parsed = _parse(layout, numeric=numeric, labels=labels)
        scan = scanning.result()
    frame = _trusted(layout, numeric, parsed, scan)
    # No copies: the columns are the frame's own, and nobody writes to them.
    columns = {str(c): frame[positions[c]].to_numpy(np.float64) for c in request.numeric}
    for c in request.labels:
        texts = frame[positions[c]].to_numpy(dtype=object)
        columns[str(c)] = label_column(path, str(c), texts, as_written=request.as_written)
    return RawTable(columns, {}, scan.sha256, layout.first_row)


def list_delimited(path: Path, files: FilesSpec) -> list[str]:
    """Return the names in the header, or numbers from 1 where there is none."""
    layout = _layout(path, files)
    if _holds_numbers(layout) and not all(name.isdigit() for name in layout.names):
        _refuse_header_of_numbers(layout)
    return list(layout.names)


def default_delimiter(path: Path) -> str:
    """Return the delimiter that a file's suffix says."""
    return "\t" if path.name.lower().endswith((".tsv", ".tsv.gz")) else ","


def stray_cells(path: Path, request: TableRequest) -> dict[str | int, str]:
    """Return the columns that hold a cell which is no number, with a message about the first."""
    layout = replace(_layout(path, request.files), as_written=request.as_written)
    left = {position: c for c, position in _positions(layout, request).items()}
    found: dict[str | int, str] = {}
    for row, cells in _records(layout):
        for position in [k for k in left if k < len(cells)]:
            try:
                _check_cell(layout, row, layout.names[position], cells[position])
            except DataError as exc:
                found[left.pop(position)] = str(exc)
    return found


# --- the first lines --------------------------------------------------------------------------


def is_number(cell: str, decimal: str = ".") -> bool:
    """Return whether a cell holds a number."""
    return bool(_NUMBER.fullmatch(as_written_with_point(cell, decimal)))


def as_written_with_point(cell: str, decimal: str) -> str:
    """Return a cell with a point where its decimal sign stands, and the other way round."""
    return cell if decimal == "." else cell.translate(_OTHER_DECIMAL)


def decompressed_text(path: Path, n_lines: int, encoding: str | None = None) -> list[str]:
    """Return the first lines of a text file, without their ends."""
    with damage_errors(path, OSError):
        encoding = stated_encoding(path, encoding)
        with reading_errors(path), open_text_bytes(path, encoding) as stream:
            lines = [stream.readline(_LONGEST_LINE_BYTES) for _ in range(n_lines)]
    filled = [line for line in lines if line]
    if not filled:
        raise file_error(path, "is empty. Name another file, or export it again.")
    return [text.rstrip("\r\n") for text in _decoded(path, filled)]


def check_signs(path: Path, delimiter: str, decimal: str, *, is_quoted: bool = False) -> None:
    """Refuse signs by which no table can be taken apart; quotes can hold a delimiter."""
    if len(delimiter) != 1 or not delimiter.isascii() or delimiter in '"\r\n':
        tab = " A tab is written $'\\t' in most shells." if delimiter == "\\t" else ""
        raise DataError(f"[files] delimiter: expected one ASCII character, got {delimiter!r}.{tab}")
    if delimiter == decimal and not is_quoted:
        raise file_error(
            path,
            f"'{delimiter}' cannot be both delimiter and decimal sign. Set [files] delimiter, "
            'most likely ";".',
        )


def _layout(path: Path, files: FilesSpec) -> _Layout:
    delimiter = files.delimiter or default_delimiter(path)
    n_head = files.skip_rows + files.header
    encoding = stated_encoding(path, files.encoding)
    with reading_errors(path), open_text_bytes(path, encoding) as stream:
        lines = [stream.readline(_LONGEST_LINE_BYTES) for _ in range(n_head + 1)]
    check_signs(path, delimiter, files.decimal, is_quoted=b'"' in lines[-1])
    start_byte = sum(len(line) for line in lines[:-1])
    text = _decoded(path, lines[n_head - 1 : n_head + 1] if files.header else lines[-1:])
    if not text[-1].strip("\r\n"):
        what = "has only a header" if any(lines) else "is empty"
        todo = ", or correct [files] skip_rows" if files.skip_rows else ""
        raise file_error(path, f"{what}, no samples under row {n_head}. Name another file{todo}.")
    cells = _first_cells(path, text[0], delimiter, row=n_head if files.header else n_head + 1)
    names = [c.strip() for c in cells] if files.header else range(1, len(cells) + 1)
    head = tuple(lines[:-1])
    bom = len(_BOM) if n_head == 0 and lines[0].startswith(_BOM) else 0
    signs = (encoding, delimiter, files.decimal)
    layout = _Layout(path, *signs, head, start_byte + bom, tuple(map(str, names)), files.header)
    return replace(layout, missing=(*MISSING_TEXT, *files.missing))


def _first_cells(path: Path, line: str, delimiter: str, *, row: int) -> list[str]:
    """Return the cells of the header, or of the first row of a file without one."""
    try:
        return next(csv.reader([line], delimiter=delimiter, skipinitialspace=True), [])
    except csv.Error as exc:
        raise file_error(
            path,
            f"the row cannot be split into columns at '{delimiter}' ({exc}). Set [files] delimiter "
            "to the sign between the columns, or save it as csv in another program.",
            row=row,
        ) from exc


def _decoded(path: Path, lines: list[bytes]) -> list[str]:
    for line in lines:
        if len(line) == _LONGEST_LINE_BYTES or b"\r" in line.rstrip(b"\r\n"):
            raise file_error(
                path,
                "its first lines do not end as lines of text do. Is it a text table? Save it "
                "with Unix or Windows line ends in a text editor.",
            )
    try:
        return [line.decode("utf-8-sig") for line in lines]
    except UnicodeDecodeError as exc:
        raise not_decoded(path, exc) from exc


def _holds_numbers(layout: _Layout) -> bool:
    return layout.named and bool(layout.names) and all(map(_NUMBER.fullmatch, layout.names))


def _refuse_header_of_numbers(layout: _Layout) -> NoReturn:
    todo = (
        "If the file has no header, set [files] header = false (jointz identify: --no-header) and "
        "give columns by number."
    )
    if layout.as_written:
        todo = "Write the names of the columns above them."
    raise layout.error(
        f"expected a header, found numbers ({', '.join(layout.names[:4])}). {todo}",
        row=layout.first_row - 1,
    )


def _positions(layout: _Layout, request: TableRequest) -> dict[str | int, int]:
    """Find where the wanted columns stand, counted from 0; all missing ones in one message."""
    numbers = {c: _number_of(layout, c) for c in request.columns}
    places = by_key((own, at) for at, own in enumerate(layout.names))
    base = 0 if request.from_zero or 0 in numbers.values() else 1
    positions: dict[str | int, int] = {}
    missing = []
    for column, number in numbers.items():
        if number is not None and 0 <= number - base < len(layout.names):
            positions[column] = number - base
        elif number is None and (name := str(column).strip()) in places:
            _refuse_duplicate(layout, name, places[name])
            positions[column] = places[name][0]
        else:
            missing.append(str(column))
    if _holds_numbers(layout) and (missing or None not in numbers.values()):
        _refuse_header_of_numbers(layout)
    if missing:
        raise missing_columns(layout.path, missing, layout.names, _missing_hint(layout))
    return positions


def _number_of(layout: _Layout, column: str | int) -> int | None:
    if isinstance(column, int):
        return column
    return int(column) if not layout.named and column.isdecimal() else None


def _refuse_duplicate(layout: _Layout, name: str, places: list[int]) -> None:
    if len(places) > 1:
        at = [str(place + 1) for place in places]
        todo = (
            "Rename one, or leave the names out and give columns by number: [files] skip_rows and "
            "header = false (jointz identify: --skip-rows and --no-header)."
        )
        if layout.as_written:
            todo = "Rename or remove one."
        raise layout.error(
            f"the name '{name}' stands over columns {' and '.join(at)}. {todo}",
            row=layout.first_row - 1,
        )


def _missing_hint(layout: _Layout) -> str:
    if layout.as_written:
        return ""
    if not layout.named:
        return "The file is read without a header: give columns by number."
    header = layout.head[-1].decode("utf-8-sig")
    for mark, written in ((";", ";"), ("\t", "\\t"), (",", ",")):
        if mark in header and mark != layout.delimiter:
            return (
                f"The header contains '{written}': set [files] delimiter = \"{written}\" (jointz "
                "identify: --delimiter)."
            )
    return ""


# --- the fast path ----------------------------------------------------------------------------


def _parse(
    layout: _Layout, *, numeric: list[int], labels: list[int]
) -> tuple[pd.DataFrame | None, Exception | None]:
    """Parse with pandas; a failure is returned, to be explained row by row."""
    columns, n_columns = {*numeric, *labels}, len(layout.names)
    # Some programs write a blank after every number.
    cells = [*layout.missing, *(f"{word} " for word in layout.missing)]
    missing: list[str] | dict[int, list[str]] = cells
    if layout.as_written:
        missing = dict.fromkeys(numeric, cells) | {k: [""] for k in labels}
    options: dict[str, Any] = {
        "sep": layout.delimiter,
        "decimal": layout.decimal,
        "header": None,
        "names": range(n_columns),
        "index_col": False,
        # pandas reads in parallel only without usecols: worth it unless most is thrown away.
        "usecols": sorted(columns) if 2 * len(columns) < n_columns else None,
        "dtype": dict.fromkeys(labels, object) | dict.fromkeys(numeric, np.float64),
        "keep_default_na": False,
        "na_values": missing,
        "skip_blank_lines": False,
        "skipinitialspace": True,
    }
    # Where pandas would count the lines before the samples in another way.
    odd = any(line.count(b'"') % 2 or b"\r" in line.rstrip(b"\r\n") for line in layout.head)
    try:
        with warnings.catch_warnings():
            # About columns nobody asked for, and long rows, which the scan finds.
            warnings.simplefilter("ignore", category=pd.errors.DtypeWarning)
            warnings.simplefilter("ignore", category=pd.errors.ParserWarning)
            if not odd and layout.encoding == UTF8 and not is_compressed(layout.path):
                return pd.read_csv(layout.path, skiprows=len(layout.head), **options), None
            with _open_text(layout) as stream:
                return pd.read_csv(stream, **options), None
    except (ValueError, OverflowError, *DECOMPRESSION_ERRORS) as exc:
        return None, exc


def _scan(layout: _Layout, n_labels: int) -> _Scan:
    """Hash the file and compare its delimiters and line ends with the header's period."""
    period = layout.delimiter.encode() * (len(layout.names) - 1) + b"\n"
    other_bytes = bytes(set(range(256)) - set(period))
    pattern = period * (2 + _BLOCK_BYTES // len(period))
    seen, broken_at, tail, skip = 0, None, b"", layout.start_byte
    digest = hashlib.sha256()
    for block in _blocks(layout, digest):
        body, skip = block[skip:], max(0, skip - len(block))
        signs = body.translate(None, other_bytes)
        phase = seen % len(period)
        if broken_at is None and signs != pattern[phase : phase + len(signs)]:
            expected = pattern[phase : phase + len(signs)]
            broken_at = seen + next(i for i, b in enumerate(signs) if b != expected[i])
        seen += len(signs)
        if is_compressed(layout.path):
            texts = n_labels * seen // len(period)
            check_unpacked(layout.path, NUMBER_BYTES * seen + OBJECT_BYTES * texts)
        tail = body[-_FIRST_BYTES:] if len(body) >= _FIRST_BYTES else (tail + body)[-_FIRST_BYTES:]
    lines = tail.rstrip(b"\r\n")
    ends = tail[len(lines) :].count(b"\n")
    n_separators = seen - max(ends - 1, 0)  # without empty lines at the end
    whole, rest = divmod(n_separators + (ends == 0), len(period))
    return _Scan(
        sha256=digest.hexdigest(),
        regular=rest == 0 and (broken_at is None or broken_at >= n_separators),
        n_rows=whole,
        terminated=ends > 0,
        last_lines=tuple(lines.decode("utf-8", errors="replace").split("\n")[1:]),
    )


def _blocks(layout: _Layout, digest: Any) -> Iterator[bytes]:
    """Yield the decompressed bytes of a file, hashing those on disk."""
    total = 0
    with layout.path.open("rb") as file, reading_errors(layout.path):
        hashed: IO[bytes] = io.BufferedReader(_Hashed(file, digest), _BLOCK_BYTES)
        unpacked = gzip.GzipFile(fileobj=hashed) if is_compressed(layout.path) else hashed
        with hashed, unpacked, recoded(cast("IO[bytes]", unpacked), layout.encoding) as stream:
            while block := stream.read(_BLOCK_BYTES):
                total += len(block)
                if is_compressed(layout.path):
                    check_unpacked(layout.path, total)
                yield block


class _Hashed(io.RawIOBase):
    """A file that hashes what is read of it, once and in order."""

    def __init__(self, file: io.BufferedReader, digest: Any) -> None:
        self._file, self._digest = file, digest

    def readable(self) -> bool:
        return True

    def readinto(self, buffer: Any) -> int:
        count = self._file.readinto(buffer)
        self._digest.update(buffer[:count])
        return count


# --- what is wrong, and where -----------------------------------------------------------------


def _trusted(
    layout: _Layout,
    numeric: list[int],
    parsed: tuple[pd.DataFrame | None, Exception | None],
    scan: _Scan,
) -> pd.DataFrame:
    """Return the parsed rows, or say what is wrong with the file."""
    frame, failure = parsed
    if scan.regular:
        _refuse_cut_number(layout, scan, scan.n_rows)
    # pandas takes True for 1; in a table of people's own, which is short, that is looked for.
    fast = scan.regular and not layout.as_written
    if frame is not None and fast and scan.n_rows <= len(frame):
        return frame[: scan.n_rows]
    n_rows, n_blank = _checked_rows(layout, numeric)
    _refuse_cut_number(layout, scan, n_rows)
    if frame is None or len(frame) != n_rows + n_blank:
        raise layout.error(
            f"cannot be read as a table ({failure or 'line ends inside cells'}). Make it one "
            "line a sample in a text editor, or export it again as plain text."
        ) from failure
    return frame[:n_rows]


def _refuse_cut_number(layout: _Layout, scan: _Scan, n_rows: int) -> None:
    """Refuse a last line without an end whose last number is shorter than all before."""
    if scan.terminated or not scan.last_lines:
        return
    *before, last = (line.rpartition(layout.delimiter)[2].strip() for line in scan.last_lines)
    if last in layout.missing[1:] or (layout.as_written and not last):
        return
    customs = {_n_digits(cell, layout.decimal) for cell in before}
    custom = customs.pop() if len(customs) == 1 and len(before) >= _ROWS_FOR_A_CUSTOM else (0, 0)
    digits = _n_digits(last, layout.decimal)
    if not last or any(a < b for a, b in zip(digits, custom, strict=True)):
        raise _cut_off(layout, n_rows + layout.first_row - 1, f"ends with '{last}'")


def _n_digits(cell: str, decimal: str) -> tuple[int, int]:
    match = _DIGITS.fullmatch(cell.replace(decimal, "."))
    if match is None:
        return (0, 0)
    return len(match["decimals"] or ""), len(match["exponent"] or "")


def _cut_off(layout: _Layout, row: int, found: str) -> DataError:
    return layout.error(
        f"the recording is cut off mid-row: the last row {found}. Copy the file again, or remove "
        "the last row.",
        row=row,
    )


def _checked_rows(layout: _Layout, numeric: list[int]) -> tuple[int, int]:
    """Count rows and empty lines at the end; raise for the first row that is wrong."""
    expected = len(layout.names)
    n_rows = n_blank = 0
    records = _records(layout)
    for row, cells in records:
        if not cells or (expected > 1 and cells == [""]):
            n_blank += 1
            continue
        if n_blank and expected > 1:
            todo = "A file holds one table: remove the row, or what follows if it is another table."
            raise layout.error(f"the row is empty. {todo}", row=row - n_blank)
        n_rows, n_blank = n_rows + n_blank + 1, 0
        if len(cells) != expected:
            raise _wrong_width(layout, row, len(cells), is_last=next(records, None) is None)
        for position in numeric:
            _check_cell(layout, row, layout.names[position], cells[position])
    return n_rows, n_blank


def _records(layout: _Layout) -> Iterator[tuple[int, list[str]]]:
    with reading_errors(layout.path), _open_text(layout) as stream:
        reader = csv.reader(stream, delimiter=layout.delimiter, skipinitialspace=True)
        try:
            for cells in reader:
                yield len(layout.head) + reader.line_num, cells
        except csv.Error as exc:
            row = len(layout.head) + reader.line_num
            raise layout.error(f"the row cannot be read ({exc}).", row=row) from exc
        except UnicodeDecodeError as exc:
            raise not_decoded(layout.path, exc) from exc


def _wrong_width(layout: _Layout, row: int, found: int, *, is_last: bool) -> DataError:
    expected = len(layout.names)
    if found < expected and is_last:
        return _cut_off(layout, row, f"has {found} of {expected} values")
    if found > expected and layout.named and row == layout.first_row:
        return layout.error(
            f"{found} values under {expected} column names. Name column {expected + 1} in the "
            "header, or remove it.",
            row=row,
        )
    return layout.error(f"expected {expected} values, found {found}. Correct the row.", row=row)


def _check_cell(layout: _Layout, row: int, name: str, cell: str) -> None:
    swapped = cell.translate(_OTHER_DECIMAL)
    with_point, other = (cell, swapped) if layout.decimal == "." else (swapped, cell)
    if cell.removesuffix(" ") in layout.missing or _NUMBER.fullmatch(with_point):
        return
    hint = "Correct the cell or leave it empty."
    if _NUMBER.fullmatch(other):
        sign = {".": ",", ",": "."}[layout.decimal]
        hint = (
            f'If the file writes decimals so, set [files] decimal = "{sign}" (jointz identify: '
            f'--decimal "{sign}").'
        )
        if layout.as_written:
            hint = (
                "Write all decimals alike: with points, or with commas where semicolons stand "
                "between the columns."
            )
    raise layout.error(f"expected a number, found '{cell}'. {hint}", row=row, channel=name)


# --- opening ----------------------------------------------------------------------------------


@contextmanager
def _open_text(layout: _Layout) -> Iterator[io.TextIOWrapper]:
    """Open at the first sample."""
    with open_text_bytes(layout.path, layout.encoding) as stream:
        stream.read(layout.start_byte)
        yield io.TextIOWrapper(stream, encoding="utf-8", newline="")
