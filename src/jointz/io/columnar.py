"""Parquet tables, through pyarrow (the extra ``jointz[parquet]``)."""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from jointz.core.errors import DataError
from jointz.core.study import FilesSpec
from jointz.io.memory_limit import NUMBER_BYTES, check_unpacked
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
        names = [str(c) for c in request.columns]
        available = self.list_columns(path, request.files) or []
        missing = [name for name in names if name not in available]
        if missing:
            raise missing_columns(path, missing, available)
        try:
            schema, table = read_columns(arrow, path, names)
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


def read_columns(arrow: Any, path: Path, names: Sequence[str] | None = None) -> tuple[Any, Any]:
    """Return the schema of a file, and a table of the named columns, else of all of known kinds.

    Parameters
    ----------
    arrow : module
        pyarrow.
    path : pathlib.Path
        The file.
    names : sequence of str, optional
        Columns that are there.

    Raises
    ------
    DataError
        When they take more memory than the limit, or one holds lists or the like.
    """
    schema = arrow.parquet.read_schema(path)
    if names is None:
        names = [field.name for field in schema if _is_flat(arrow.types, field.type)]
    for field in schema:
        if field.name in names and not _is_flat(arrow.types, field.type):
            raise DataError(
                f"{path.name}, column '{field.name}': expected numbers, times or text, found "
                f"{field.type}. Choose another column, or export it as one of these.",
                path=str(path),
                channel=field.name,
            )
    texts = [f.name for f in schema if f.name in names and _is_text(arrow.types, f.type)]
    # A text that a dictionary names a million times is held once until its size is known.
    with arrow.parquet.ParquetFile(path, read_dictionary=texts) as file:
        check_unpacked(path, declared_bytes(file.metadata, names))
        total, batches = 0, []
        for batch in file.iter_batches(columns=list(names)):
            total += sum(_column_bytes(arrow, column) for column in batch.columns)
            check_unpacked(path, total)
            batches.append(batch)
        coded = file.schema_arrow
    wanted = arrow.schema([coded.field(n) for n in dict.fromkeys(names)], metadata=coded.metadata)
    table = arrow.Table.from_batches(batches, schema=batches[0].schema if batches else wanted)
    return schema, table.cast(arrow.schema([schema.field(n) for n in table.column_names]))


def _is_text(kind: Any, column_type: Any) -> bool:
    return any(
        is_it(column_type) for is_it in (kind.is_string, kind.is_large_string, kind.is_binary)
    )


def _is_flat(kind: Any, column_type: Any) -> bool:
    """Return whether a column holds numbers, times or text; other kinds are refused."""
    if kind.is_dictionary(column_type):
        column_type = column_type.value_type
    known = (kind.is_primitive, kind.is_decimal, kind.is_null)
    return _is_text(kind, column_type) or any(is_it(column_type) for is_it in known)


def declared_bytes(metadata: Any, names: Sequence[str] | None = None) -> int:
    """Return what columns take in memory by what a file says of itself.

    Parameters
    ----------
    metadata : pyarrow.parquet.FileMetaData
        Of the file.
    names : sequence of str, optional
        Which columns; all by default.
    """
    groups = [metadata.row_group(k) for k in range(metadata.num_row_groups)]
    columns = [group.column(k) for group in groups for k in range(group.num_columns)]
    return sum(
        max(NUMBER_BYTES * column.num_values, column.total_uncompressed_size)
        for column in columns
        if names is None or column.path_in_schema.partition(".")[0] in names
    )


def _column_bytes(arrow: Any, column: Any) -> int:
    if not arrow.types.is_dictionary(column.type):
        return int(column.nbytes)
    import pyarrow.compute as compute

    lengths = compute.binary_length(column.dictionary).take(column.indices)
    return NUMBER_BYTES * len(column) + int(compute.sum(lengths).as_py() or 0)


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
    keys = ["participant", "session", "side", "timing_point", "parameter"]
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
