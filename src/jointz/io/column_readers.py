"""Tables out of files of any format: one door, readers behind it by suffix.

A reader is registered for its suffixes and loaded when a file needs it, so that
looking at a CSV file costs nothing of netCDF, MATLAB or parquet.
"""

import difflib
import hashlib
import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from importlib import import_module
from pathlib import Path
from typing import Any, Protocol, TypeVar

import numpy as np
import pandas as pd

from jointz.core.errors import DataError
from jointz.core.study import FilesSpec

#: Where the readers of jointz live; the module registers them when it is loaded.
_HOMES: Mapping[str, str] = {
    **dict.fromkeys(
        (".csv", ".csv.gz", ".tsv", ".tsv.gz", ".txt", ".txt.gz"), "jointz.io.text.delimited"
    ),
    ".parquet": "jointz.io.formats.columnar",
    ".nc": "jointz.io.formats.netcdf_recording",
    ".mat": "jointz.io.formats.matlab_columns",
    **dict.fromkeys(
        (".c3d", ".xdf", ".mot", ".sto", ".xlsx"), "jointz.io.formats.acquisition_tables"
    ),
}
_MOST_NAMES = 40
#: Of a sample: far above nanoseconds since 1970; its eighth power still fits into a float.
LARGEST_SAMPLE = 1e30
_FLOAT_TEXT = re.compile(r"[+-]?(\d+\.\d*|\.\d+|\d+(?=[eE]))([eE][+-]?\d+)?")


@dataclass(frozen=True, slots=True)
class TableRequest:
    """What is wanted of a file."""

    numeric: tuple[str | int, ...]  # columns that hold numbers, and columns that hold text
    labels: tuple[str | int, ...] = ()
    # how text files are laid out; other formats ignore it
    files: FilesSpec = field(default_factory=FilesSpec)
    # whether a text file stands for itself, without a study: its labels are not rewritten, only an
    # empty cell is missing, and nothing is advised that a study would have to say
    as_written: bool = False
    # whether numbers of columns count from 0, as where one that is not wanted here is 0
    from_zero: bool = False

    @property
    def columns(self) -> tuple[str | int, ...]:
        """Every wanted column once, in the order asked for."""
        return tuple(dict.fromkeys((*self.numeric, *self.labels)))


@dataclass(frozen=True, slots=True)
class RawTable:
    """Columns as they stand in a file, before units and signs are looked at."""

    # column, spelled as asked for, -> float64 (NaN: missing), or str objects for label columns ("":
    # missing)
    columns: Mapping[str, np.ndarray]
    units: Mapping[str, str]  # the units that the file itself states
    sha256: str  # hash of the file's bytes
    # row of a text file that holds the first sample, counted from 1 with header and skipped rows; 1
    # for other formats
    first_row: int = 1
    history: tuple[dict[str, Any], ...] = ()  # what was done before, as a recording of jointz says


class Reader(Protocol):
    """What a file format has to offer."""

    def read(self, path: Path, request: TableRequest) -> RawTable:
        """Return the wanted columns."""

    def list_columns(self, path: Path, files: FilesSpec) -> list[str] | None:
        """Return the names of the columns, None where that means reading the file."""


_R = TypeVar("_R", bound=Reader)

_READERS: dict[str, Reader] = {}


def register_reader(*suffixes: str) -> Callable[[type[_R]], type[_R]]:
    """Register a reader class for files with these suffixes."""

    def register(reader: type[_R]) -> type[_R]:
        _READERS.update(dict.fromkeys(suffixes, reader()))
        return reader

    return register


def read_table(
    path: Path,
    *,
    numeric: Sequence[str | int],
    labels: Sequence[str | int] = (),
    files: FilesSpec,
    as_written: bool = False,
    from_zero: bool = False,
) -> RawTable:
    """Read columns of a file; the file is never modified."""
    reader = _reader_of(path)
    request = TableRequest(tuple(numeric), tuple(labels), files, as_written, from_zero)
    both = {str(c) for c in numeric} & {str(c) for c in labels}
    if both:
        raise DataError(
            f"{path.name}: column '{min(both)}' is asked for both as numbers and as labels. "
            "Use it for one of them.",
            path=str(path),
        )
    try:
        table = reader.read(path, request)
    except OSError as exc:
        raise damaged(path, exc) from exc
    lengths = {name: len(values) for name, values in table.columns.items()}
    if len(set(lengths.values())) > 1:
        raise DataError(
            f"{path.name}: columns differ in length: {lengths}. "
            "Choose columns that were sampled together.",
            path=str(path),
        )
    return table


def check_samples(path: Path, table: RawTable) -> None:
    """Refuse a finite number whose powers no longer fit into a float."""
    for name, values in table.columns.items():
        if values.dtype.kind != "f":
            continue
        absurd = np.isfinite(values) & (np.abs(values) > LARGEST_SAMPLE)
        if absurd.any():
            at = int(np.argmax(absurd))
            raise DataError(
                f"{path.name}, row {table.first_row + at}, column '{name}': {values[at]:.4g} is no "
                f"possible reading ({int(absurd.sum())} such). Correct the cell or leave it empty.",
                path=str(path),
                channel=name,
                row=table.first_row + at,
            )


def list_columns(path: Path, files: FilesSpec) -> list[str] | None:
    """List the columns of a file without reading its samples."""
    reader = _reader_of(path)
    try:
        return reader.list_columns(path, files)
    except OSError as exc:
        raise damaged(path, exc) from exc


def file_sha256(path: Path) -> str:
    """Return the SHA-256 of a file's bytes, in hexadecimal."""
    with path.open("rb") as stream:
        return hashlib.file_digest(stream, "sha256").hexdigest()


def damaged(path: Path, cause: Exception) -> DataError:
    """Make the error for a file that a format's own library could not read."""
    reason = f"{type(cause).__name__}: {cause}".strip().rstrip(".")
    return DataError(
        f"{path.name}: cannot be read as a {path.suffix} file; it is cut off, damaged or of "
        f"another kind ({reason}). Copy or export it again.",
        path=str(path),
    )


def missing_columns(
    path: Path, missing: Sequence[str], available: Sequence[str], hint: str = ""
) -> DataError:
    """Make the error that names every missing column and those there are."""
    close = {name: difflib.get_close_matches(name, available, n=1) for name in missing}
    guesses = [f"'{found[0]}' for '{name}'" for name, found in close.items() if found]
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
        raise DataError(
            f"{path.name}, column '{name}': expected numbers, found {_kind(values)}. "
            "Choose a numeric column.",
            path=str(path),
            channel=name,
        )
    return values.astype(np.float64, copy=False)


def label_column(
    path: Path, name: str, values: np.ndarray, *, as_written: bool = False
) -> np.ndarray:
    """Return a column as (n,) str objects; 1.0 becomes "1", a missing value ""."""
    _check_series(path, name, values)
    codes, found = pd.factorize(values)
    write = _text if as_written else _label
    texts = np.array([*(write(v) for v in found), ""], dtype=object)
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
        raise DataError(
            f"{path.name}, column '{name}': expected one series of samples, found an array of "
            f"shape {values.shape}. Choose a column that is a vector.",
            path=str(path),
            channel=name,
        )


def _kind(values: np.ndarray) -> str:
    kinds = {"c": "complex numbers", "M": "dates", "m": "durations"}
    return kinds.get(values.dtype.kind, "text")


def _reader_of(path: Path) -> Reader:
    name = path.name.lower()
    known = sorted({*_HOMES, *_READERS})
    fitting = [suffix for suffix in known if name.endswith(suffix)]
    if not fitting:
        raise DataError(
            f"{path.name}: no reader for this kind of file; expected one of {', '.join(known)}. "
            "Convert the file, or correct its suffix.",
            path=str(path),
        )
    if not path.is_file():
        raise DataError(
            f"{path}: no such file. Correct the name or bring the file.", path=str(path)
        )
    suffix = max(fitting, key=len)
    if suffix not in _READERS:
        import_module(_HOMES[suffix])
    return _READERS[suffix]
