"""Parquet tables, through pyarrow (the extra ``jointz[parquet]``)."""

from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from jointz.core.errors import DataError
from jointz.core.study import FilesSpec
from jointz.io.registry import (
    RawTable,
    TableRequest,
    damaged,
    file_sha256,
    label_column,
    missing_columns,
    number_column,
    register_reader,
)

_UNIT_KEYS = (b"units", b"unit")


@register_reader(".parquet")
class ParquetReader:
    """Reads parquet; the unit of a column is its field's metadata ``units`` or ``unit``."""

    def read(self, path: Path, request: TableRequest) -> RawTable:
        """Return the wanted columns; nulls become NaN, or "" in labels.

        Parameters
        ----------
        path : pathlib.Path
            The file.
        request : TableRequest
            What is wanted of it.

        Raises
        ------
        DataError
            When pyarrow is missing, the file is damaged, or a column is not there.
        """
        arrow = arrow_for(path)
        try:
            with arrow.parquet.ParquetFile(path) as file:
                schema = file.schema_arrow
                names = [str(c) for c in request.columns]
                missing = [name for name in names if name not in schema.names]
                if missing:
                    raise missing_columns(path, missing, schema.names)
                table = file.read(columns=names)
        except (arrow.ArrowException, OSError, UnicodeDecodeError) as exc:
            raise damaged(path, exc) from exc
        columns = {}
        for c in map(str, request.numeric):
            columns[c] = number_column(path, c, arrow_numbers(arrow, table.column(c)))
        for c in map(str, request.labels):
            texts = np.array(table.column(c).to_pylist(), dtype=object)
            columns[c] = label_column(path, c, texts)
        units = {n: unit for n in columns if (unit := field_unit(schema.field(n)))}
        return RawTable(columns, units, file_sha256(path))

    def list_columns(self, path: Path, files: FilesSpec) -> list[str] | None:  # noqa: ARG002
        """Return the names in the file's schema.

        Parameters
        ----------
        path : pathlib.Path
            The file.
        files : FilesSpec
            Not used: a parquet file describes itself.
        """
        arrow = arrow_for(path)
        try:
            return list(arrow.parquet.read_schema(path).names)
        except (arrow.ArrowException, OSError, UnicodeDecodeError) as exc:
            raise damaged(path, exc) from exc


def write_estimates(estimates: pd.DataFrame, covariance: pd.DataFrame, path: Path) -> bool:
    """Write estimates as Parquet, each with its covariances beside it.

    Parameters
    ----------
    estimates : pandas.DataFrame
        Columns of ``estimates.csv``.
    covariance : pandas.DataFrame
        Columns of ``covariance.csv``; may be empty.
    path : pathlib.Path
        The file.

    Returns
    -------
    bool
        False where pyarrow is not installed: the csv files hold the same.
    """
    try:
        import pyarrow  # noqa: F401 - only whether it is there
    except ImportError:
        return False
    keys = ["participant", "timing_point", "parameter"]
    together = estimates.merge(covariance, on=keys, how="left", validate="one_to_one")
    together.to_parquet(path, engine="pyarrow", index=False, compression="zstd")
    return True


def arrow_for(path: Path) -> Any:
    """Return pyarrow, with its parquet module loaded.

    Parameters
    ----------
    path : pathlib.Path
        The file it is needed for, for the message.

    Raises
    ------
    DataError
        When it is not installed.
    """
    try:
        import pyarrow as pa
        import pyarrow.parquet
    except ImportError as exc:
        raise DataError(
            f"{path.name}: parquet files need pyarrow. Install it: pip install 'jointz[parquet]'.",
            path=str(path),
        ) from exc
    return pa


def arrow_numbers(arrow: Any, column: Any) -> np.ndarray:
    """Return a column of numbers or booleans as float64, null as NaN; others as they are.

    Parameters
    ----------
    arrow : module
        pyarrow.
    column : pyarrow.ChunkedArray
        The column.
    """
    kind = arrow.types
    plain = kind.is_integer(column.type) or kind.is_boolean(column.type)
    if plain or kind.is_floating(column.type) or kind.is_decimal(column.type):
        column = column.cast(arrow.float64(), safe=False)
    values: np.ndarray = column.to_numpy()
    return values


def field_unit(field: Any) -> str:
    """Return the unit that a field's metadata state, else "".

    Parameters
    ----------
    field : pyarrow.Field
        The field.
    """
    metadata = field.metadata or {}
    return next((metadata[k].decode() for k in _UNIT_KEYS if k in metadata), "")
