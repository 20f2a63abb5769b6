"""Reader of a user's table for the mixed model, with blank cells as missing values."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pandas as pd

from jointz.core.errors import DataError
from jointz.core.study import FilesSpec
from jointz.io.formats.columns import RawTable, check_samples
from jointz.io.formats.registry import list_columns, read_table

_DELIMITERS = (",", ";", "\t")
_TEXT = (".csv", ".csv.gz", ".tsv", ".tsv.gz", ".txt", ".txt.gz")


def read_responses(
    file: Path, *, responses: Sequence[str], within: str, participant: str
) -> pd.DataFrame:
    """Read the columns of a mixed model."""
    names = [*responses, within, participant]
    if len(set(names)) < len(names):
        raise DataError(
            f"{file.name}: expected different columns, got {', '.join(names)}. Name each column "
            "once."
        )
    labels = (within, participant)
    delimiter = _delimiter(file, names)
    try:
        files = FilesSpec(delimiter=delimiter)
        table = _read(file, responses, labels, files)
    except DataError as exc:
        if delimiter != ";":
            raise
        try:  # with semicolons between columns, commas may be decimal signs
            files = FilesSpec(delimiter=delimiter, decimal=",")
            table = _read(file, responses, labels, files)
        except DataError:
            raise exc from None
    columns = dict(table.columns)
    for name in labels:
        columns[name] = np.array([text or None for text in columns[name]], dtype=object)
    return pd.DataFrame(columns)[names]


def _read(
    file: Path, responses: Sequence[str], labels: Sequence[str], files: FilesSpec
) -> RawTable:
    table = read_table(file, numeric=responses, labels=labels, files=files, as_written=True)
    check_samples(file, table)
    return table


def _delimiter(file: Path, names: Sequence[str]) -> str | None:
    """Return the delimiter that finds most of the names."""
    if not file.name.lower().endswith(_TEXT) or not file.is_file():
        return None
    matches = {}
    for delimiter in _DELIMITERS:
        try:
            columns = list_columns(file, FilesSpec(delimiter=delimiter)) or []
        except DataError:  # several numbers instead of names: reported when it is read
            columns = ["", ""]
        matches[delimiter] = (len({*names} & {*columns}), len(columns))
    return max(_DELIMITERS, key=matches.__getitem__)
