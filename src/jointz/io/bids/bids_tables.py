"""Names, tables and sidecars of BIDS folders, checked for damage."""

import math
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from jointz.core.errors import DataError

#: What BIDS writes where there is no value.
NOTHING = "n/a"
_ENTITY = re.compile(r"([a-zA-Z]+)-([a-zA-Z0-9+]+)")
_NOT_LABEL = re.compile(r"[^A-Za-z0-9]")


def label_of(text: str) -> str:
    """Return a text as a label: letters and digits alone."""
    return _NOT_LABEL.sub("", text)


def entities_of(name: str) -> dict[str, str]:
    """Return the entities of a file's name, in their order."""
    parts = name.split(".")[0].split("_")
    entities = [_ENTITY.fullmatch(part) for part in parts]
    return {match[1]: match[2] for match in entities if match}


@dataclass(frozen=True, slots=True)
class Table:
    """A table with a header."""

    rows: list[dict[str, str]]  # column -> cell, for each row; "" for ``n/a``
    end_note: str  # note on a last line without a line end; "" otherwise


def read_tsv(path: Path, required: Sequence[str], *, whole: bool = False) -> Table:
    """Read a table with a header."""
    text = _text(path)
    lines = _lines(path, text, whole=whole)
    names = [name.strip() for name in lines[0].split("\t")]
    missing = [name for name in required if name not in names]
    if missing:
        raise _bad(
            path,
            f"expected the column(s) {', '.join(missing)}, found {', '.join(names)}. Correct the "
            "header.",
        )
    if len(set(names)) < len(names):
        raise _bad(path, "row 1: a name stands over more than one column. Rename one.")
    rows = []
    for row, line in enumerate(lines[1:], start=2):
        cells = line.split("\t")
        if len(cells) != len(names):
            raise _wrong_width(path, row, len(cells), len(names))
        values = ("" if cell.strip() == NOTHING else cell.strip() for cell in cells)
        rows.append(dict(zip(names, values, strict=True)))
    return Table(rows, _end_note(path, text))


def _end_note(path: Path, text: str) -> str:
    if text.endswith("\n"):
        return ""
    cell = re.split(r"[\t\n]", text)[-1].strip()
    return f"{path.name}: the last line has no end; its last cell, '{cell[:40]}', may be cut off."


def read_samples(path: Path, n_columns: int, *, named_in: str) -> np.ndarray:
    """Read a table of numbers without a header, ``n/a`` as NaN."""
    rows = []
    for row, line in enumerate(_lines(path, _text(path), whole=True), start=1):
        cells = line.split("\t")
        if len(cells) != n_columns:
            raise _wrong_width(path, row, len(cells), n_columns, named_in=named_in)
        try:
            rows.append([math.nan if cell == NOTHING else float(cell) for cell in cells])
        except ValueError:
            raise _no_number(path, row, cells) from None
    samples = np.array(rows, dtype=np.float64)
    endless = np.argwhere(np.isinf(samples))
    if endless.size:
        row, column = (int(k) + 1 for k in endless[0])
        raise _bad(path, "expected a number or n/a, found infinity. Correct the cell.", row, column)
    return samples


def number(path: Path, content: Mapping[str, Any], key: str) -> float:
    """Return a positive number of a sidecar."""
    value = content.get(key)
    good = isinstance(value, int | float) and not isinstance(value, bool)
    if not good or not math.isfinite(float(value or 0)) or float(value or 0) <= 0:
        raise _bad(path, f"key '{key}': expected a number above 0, found {value!r}. Correct it.")
    return float(value)  # type: ignore[arg-type]  # it is a number, see above


def cell_number(
    path: Path, row: int, name: str, cell: str, *, default: float | None = None
) -> float:
    """Return the number of a cell, a default where it is empty."""
    if not cell and default is not None:
        return default
    try:
        value = float(cell)
    except ValueError:
        value = math.nan
    if not math.isfinite(value):
        raise _bad(
            path,
            f"column '{name}': expected a number, found '{cell or NOTHING}'. Correct the cell.",
            row,
        )
    return value


def _lines(path: Path, text: str, *, whole: bool) -> list[str]:
    text = text.replace("\r\n", "\n")
    if not text.strip():
        raise _bad(path, "is empty. Copy it again.")
    lines = text.removesuffix("\n").split("\n")
    rest = lines[-1].split("\t")[-1].strip() if len(lines) > 1 else ""
    if not text.endswith("\n") and (whole or not rest):
        raise _bad(
            path,
            "the last line does not end: the file may be cut off. Copy it again, or add the end "
            "of the line where it is whole.",
            len(lines),
        )
    return lines


def _text(path: Path) -> str:
    try:
        return path.read_bytes().decode("utf-8-sig")
    except UnicodeDecodeError as exc:
        raise _bad(path, f"expected UTF-8 text ({exc.reason}). Save it as UTF-8.") from exc
    except OSError as exc:
        why = exc.strerror or exc
        raise _bad(path, f"cannot be read ({why}). Bring the file, or correct its name.") from exc


def _wrong_width(
    path: Path, row: int, found: int, expected: int, *, named_in: str = ""
) -> DataError:
    source = f" ({named_in} names {expected} channels)" if named_in else ""
    return _bad(
        path,
        f"expected {expected} values between tabs, found {found}{source}. Correct the row, or copy "
        "the file again.",
        row,
    )


def _no_number(path: Path, row: int, cells: Sequence[str]) -> DataError:
    for column, cell in enumerate(cells, start=1):
        try:
            float(cell if cell != NOTHING else "0")
        except ValueError:
            shown = cell[:40]
            message = f"expected a number or n/a, found '{shown}'. Correct the cell."
            return _bad(path, message, row, column)
    return _bad(path, "cannot be read. Correct the row.", row)


def _bad(path: Path, message: str, row: int | None = None, column: int | None = None) -> DataError:
    where = path.name
    where += f", row {row}" if row is not None else ""
    where += f", column {column}" if column is not None else ""
    return DataError(f"{where}: {message}", path=str(path), row=row)
