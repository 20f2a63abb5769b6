"""Identification of a single recording file."""

from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any, TypeVar

from jointz.core.errors import DataError
from jointz.io.one_recording import read_channels
from jointz.io.text.column_arguments import Column

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
    recording, parsed = read_channels(file, columns, files)
    with _located_errors(file, parsed):
        return identify(recording, rate_hz=rate_hz, **settings), parsed


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
