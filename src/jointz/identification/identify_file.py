"""Identify one recording that stands in a file by itself."""

from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any, TypeVar

import numpy as np
import xarray as xr

from jointz.core.errors import DataError
from jointz.core.study import FilesSpec
from jointz.io.formats.columns import check_samples
from jointz.io.formats.registry import list_columns, read_table
from jointz.io.text.column_arguments import SI_UNITS, Column, parse_column
from jointz.io.text.units import conversion

FitT = TypeVar("FitT")


def identify_file(
    identify: Callable[..., FitT],
    file: Path,
    columns: Mapping[str, str],
    *,
    files: Mapping[str, Any] | None = None,
    rate_hz: float | None = None,
    needs_clock: bool = True,
    **settings: Any,
) -> tuple[FitT, dict[str, Column]]:
    """Fit the columns of a file; return the fit and the columns as they were understood."""
    if "time" in columns and rate_hz is not None and not needs_clock:
        raise DataError("Give --time COL[:unit] or --rate HZ or neither, not both.")
    if needs_clock and ("time" in columns) == (rate_hz is not None):
        raise DataError("Give either --time COL[:unit] or --rate HZ, one of them.")
    recording, parsed = _read(file, columns, files)
    with _located_errors(file, parsed):
        return identify(recording, rate_hz=rate_hz, **settings), parsed


def _read(
    file: Path, columns: Mapping[str, str], files: Mapping[str, Any] | None
) -> tuple[xr.Dataset, dict[str, Column]]:
    """Return the columns of a file under the names of their channels, in SI."""
    layout = FilesSpec.model_validate(files or {})
    names = list_columns(file, layout) if file.is_file() else None
    parsed = {channel: parse_column(text, channel, names) for channel, text in columns.items()}
    keys = {channel: _key(column, layout) for channel, column in parsed.items()}
    table = read_table(file, numeric=list(keys.values()), files=layout)
    check_samples(file, table)
    signals = {}
    for channel, column in parsed.items():
        factor, offset = conversion(column.unit, SI_UNITS[channel])
        values = np.asarray(table.columns[str(keys[channel])], dtype=float)
        signals[channel] = ("sample", factor * values + offset)
    attributes = {"first_row": table.first_row, "sha256": table.sha256}
    return xr.Dataset(signals, attrs=attributes), parsed


@contextmanager
def _located_errors(file: Path, columns: Mapping[str, Column]) -> Iterator[None]:
    """Name the file and the column in errors of the samples."""
    try:
        yield
    except DataError as exc:
        where, channel = file.name, exc.channel
        if (column := columns.get(channel or "")) is not None:
            channel = column.name
            where += f", column '{channel}'"
        raise DataError(f"{where}: {exc}", path=str(file), channel=channel, row=exc.row) from exc


def _key(column: Column, layout: FilesSpec) -> str | int:
    """Return how the readers know a column: by its name, or by number without a header."""
    if layout.header:
        return column.name
    if not column.name.isdecimal():
        raise DataError(f"{column.name}: without a header a column is a number, from 1.")
    return int(column.name)
