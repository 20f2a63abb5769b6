"""Columns of a file as numbers and labels, and the errors of reading them."""

import difflib
import hashlib
import re
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from jointz.core.errors import DataError
from jointz.core.study import FilesSpec

_MOST_NAMES = 40
#: Of a sample: far above nanoseconds since 1970; its eighth power still fits into a float.
LARGEST_SAMPLE = 1e30
_FLOAT_TEXT = re.compile(r"[+-]?(\d+\.\d*|\.\d+|\d+(?=[eE]))([eE][+-]?\d+)?")


@dataclass(frozen=True, slots=True)
class TableRequest:
    """Columns requested of a file."""

    numeric: tuple[str | int, ...]  # columns of numbers
    labels: tuple[str | int, ...] = ()  # columns of text
    # layout of a text file; other formats ignore it
    files: FilesSpec = field(default_factory=FilesSpec)
    # whether a text file is read without a study: labels are not rewritten, only an empty cell is
    # missing, and messages advise nothing about a study
    as_written: bool = False
    from_zero: bool = False  # whether column numbers count from 0, because one of the study's is 0
    # whether columns may have clocks of their own, which the file knows
    several_clocks: bool = False

    @property
    def columns(self) -> tuple[str | int, ...]:
        """Every wanted column once, in the order asked for."""
        return tuple(dict.fromkeys((*self.numeric, *self.labels)))


@dataclass(frozen=True, slots=True)
class RawTable:
    """Columns as they stand in a file, before units and signs are looked at."""

    # column, spelled as requested -> float64, NaN if missing; of labels str objects, "" if missing
    columns: Mapping[str, np.ndarray]
    units: Mapping[str, str]  # column -> unit stated by the file
    sha256: str  # hash of the file's bytes
    # row of the first sample in a text file, from 1 with header and skipped rows; 1 for other
    # formats
    first_row: int = 1
    # processing steps before, as stored in a recording of jointz
    history: tuple[dict[str, Any], ...] = ()
    # column -> times of its samples, s, where the file knows them; the same array for one clock
    clocks: Mapping[str, np.ndarray] = field(default_factory=dict)


def make_table(
    path: Path,
    request: TableRequest,
    values: Callable[[str], np.ndarray],
    units: Mapping[str, str],
    *,
    labels: Callable[[str], np.ndarray] | None = None,
    as_written: bool = False,
    history: tuple[dict[str, Any], ...] = (),
    clocks: Mapping[str, np.ndarray] | None = None,
) -> RawTable:
    """Return a table of typed columns, given the values and labels of a column by its name."""
    columns = {c: number_column(path, c, values(c)) for c in map(str, request.numeric)}
    for c in map(str, request.labels):
        columns[c] = label_column(path, c, (labels or values)(c), as_written=as_written)
    return RawTable(columns, units, file_sha256(path), history=history, clocks=clocks or {})


def check_samples(path: Path, table: RawTable) -> None:
    """Refuse a finite number whose powers no longer fit into a float."""
    for name, values in table.columns.items():
        if values.dtype.kind != "f" or not values.size:
            continue
        # NaN and numbers too large alike fail this comparison, which needs no array.
        if values.min() >= -LARGEST_SAMPLE and values.max() <= LARGEST_SAMPLE:
            continue
        absurd = np.isfinite(values) & (np.abs(values) > LARGEST_SAMPLE)
        if absurd.any():
            at = int(np.argmax(absurd))
            raise file_error(
                path,
                f"{values[at]:.4g} is no possible reading ({int(absurd.sum())} such). Correct the "
                "cell or leave it empty.",
                row=table.first_row + at,
                channel=name,
            )


def file_sha256(path: Path) -> str:
    """Return the SHA-256 of a file's bytes, in hexadecimal."""
    with path.open("rb") as stream:
        return hashlib.file_digest(stream, "sha256").hexdigest()


def file_error(
    path: Path, message: str, *, row: int | None = None, channel: str | None = None
) -> DataError:
    """Return the error about a file, one of its rows or one of its columns."""
    where = path.name + (f", row {row}" if row is not None else "")
    where += f", column '{channel}'" if channel is not None else ""
    return DataError(f"{where}: {message}", path=str(path), channel=channel, row=row)


def damaged(path: Path, cause: Exception) -> DataError:
    """Make the error for a file that a format's own library could not read."""
    reason = f"{type(cause).__name__}: {cause}".strip().rstrip(".")
    return file_error(
        path,
        f"cannot be read as a {path.suffix} file; it is cut off, damaged or of another kind "
        f"({reason}). Copy it again, or save it as csv where it was made.",
    )


@contextmanager
def damage_errors(path: Path, *errors: type[Exception]) -> Iterator[None]:
    """Raise errors of a format's own library as errors about the file."""
    try:
        yield
    except DataError:
        raise
    except errors as exc:
        raise damaged(path, exc) from exc


def missing_columns(
    path: Path, missing: Sequence[str], available: Sequence[str], hint: str = ""
) -> DataError:
    """Make the error that names every missing column and those there are."""
    close = {name: difflib.get_close_matches(name, available, n=1) for name in missing}
    guesses = [f"'{names[0]}' for '{name}'" for name, names in close.items() if names]
    shown = ", ".join(available[:_MOST_NAMES]) or "no column"
    more = len(available) - _MOST_NAMES
    parts = [
        f"{path.name}: no column {', '.join(repr(m) for m in missing)}.",
        f"The file has: {shown}{f' and {more} more' if more > 0 else ''}.",
        f"Did you mean {', '.join(guesses)}?" if guesses else "",
        hint or "Correct the column's name.",
    ]
    return DataError(" ".join(p for p in parts if p), path=str(path), channel=missing[0])


def number_column(path: Path, name: str, values: np.ndarray) -> np.ndarray:
    """Return a column of a typed format as (n,) float64."""
    _check_series(path, name, values)
    if values.dtype.kind not in "fiub":
        kinds = {"c": "complex numbers", "M": "dates", "m": "durations"}
        kind = kinds.get(values.dtype.kind, "text")
        raise file_error(
            path, f"expected numbers, found {kind}. Choose a numeric column.", channel=name
        )
    return values.astype(np.float64, copy=False)


def label_column(
    path: Path, name: str, values: np.ndarray, *, as_written: bool = False
) -> np.ndarray:
    """Return a column as (n,) str objects; 1.0 becomes "1", a missing value ""."""
    _check_series(path, name, values)
    codes, distinct = pd.factorize(values)
    write = _text if as_written else _label
    texts = np.array([*(write(v) for v in distinct), ""], dtype=object)
    return texts[codes]  # the code of a missing value is -1


def _text(value: Any) -> str:
    if isinstance(value, bytes):
        value = value.decode("utf-8", errors="replace")
    return str(value).strip()


def _label(value: Any) -> str:
    text = _text(value)
    if not _FLOAT_TEXT.fullmatch(text):
        return text
    number = float(text)
    return str(int(number)) if number.is_integer() else repr(number)


def _check_series(path: Path, name: str, values: np.ndarray) -> None:
    if values.ndim != 1:
        raise file_error(
            path,
            f"expected one series of samples, found an array of shape {values.shape}. Choose a "
            "column that is a vector.",
            channel=name,
        )
