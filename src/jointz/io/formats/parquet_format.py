"""Parquet tables in and out, through pyarrow (the extra ``jointz[parquet]``)."""

import io
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from jointz.core.acquisition import Acquisition, Signal
from jointz.core.errors import DataError
from jointz.core.study import FilesSpec
from jointz.io.formats.columns import (
    RawTable,
    TableRequest,
    damaged,
    file_error,
    make_table,
    missing_columns,
)
from jointz.io.formats.losses import (
    NOTE,
    first_group,
    is_plain,
    listed,
    lost_groups,
    lost_letters,
    plainly,
)
from jointz.io.formats.memory_limit import NUMBER_BYTES, check_unpacked
from jointz.io.text.column_names import (
    READING,
    clock_column,
    unique_names,
    unit_in_name,
    with_clock,
)
from jointz.io.text.side_information import SideInformation, filled, read_beside, written_beside

_UNIT_KEYS = (b"units", b"unit")
_SIDE = b"jointz"
_CHANGED = (
    "the table is not the one that jointz wrote, and was read as any other: rate, events and "
    "metadata beside it belong to what it was"
)
_DATES = NOTE + "dates and times, written as ISO 8601"


class ParquetFormat:
    """Reads any flat table; writes one group, the rest as one line of JSON in the metadata.

    The unit of a column is its field's metadata ``units`` or ``unit``.
    """

    name = "parquet"

    def read(self, path: Path, files: FilesSpec) -> Acquisition:  # noqa: ARG002
        """Return all columns of numbers, text and dates; nulls become NaN or ""."""
        arrow = _arrow(path)
        try:
            return _content(arrow, path)
        except DataError:
            raise
        except (arrow.ArrowException, OSError, ValueError) as exc:
            raise damaged(path, exc) from exc

    def read_columns(self, path: Path, request: TableRequest) -> RawTable:
        """Return the requested columns; nulls become NaN, or "" in labels."""
        arrow = _arrow(path)
        names = [str(c) for c in request.columns]
        available = self.list_columns(path, request.files)
        missing = [name for name in names if name not in available]
        if missing:
            raise missing_columns(path, missing, available)
        try:
            schema, table = _read_columns(arrow, path, names)
        except (arrow.ArrowException, OSError, UnicodeDecodeError) as exc:
            raise damaged(path, exc) from exc
        return make_table(
            path,
            request,
            lambda c: _numbers(arrow, table.column(c)),
            {name: unit for name in names if (unit := _unit(schema.field(name)))},
            labels=lambda c: np.array(table.column(c).to_pylist(), dtype=object),
        )

    def list_columns(self, path: Path, files: FilesSpec) -> list[str]:  # noqa: ARG002
        """Return the names in the file's schema."""
        arrow = _arrow(path)
        try:
            return list(arrow.parquet.read_schema(path).names)
        except (arrow.ArrowException, OSError, UnicodeDecodeError) as exc:
            raise damaged(path, exc) from exc

    def losses(self, content: Acquisition) -> list[str]:
        """Name what one table cannot hold: other groups, NUL and half letters."""
        group = first_group(content)
        odd = [s.name for s in group.signals if not is_plain(s.name + s.unit + s.description)]
        lost = lost_groups(content) + lost_letters([group])
        if odd:
            lost.append(f"It cannot hold the names of {listed(map(repr, odd))} as they are.")
        return lost

    def encode(self, content: Acquisition, path: Path) -> bytes:
        """Return the first group; a clock stands as the first column."""
        arrow = _arrow(path)
        group = first_group(content)
        names = unique_names([plainly(signal.name) for signal in group.signals])
        fields = [_field(arrow, n, s) for n, s in zip(names, group.signals, strict=True)]
        columns = [_column(arrow, signal) for signal in group.signals]
        time = group.times_s()
        if time is not None:
            name = plainly(clock_column(group, content.metadata))
            fields.insert(0, arrow.field(name, arrow.float64(), metadata={"units": "s"}))
            columns.insert(0, arrow.array(time))
        beside = {
            _SIDE: written_beside(content, group),
            "jointz_clock": "" if time is None else fields[0].name,
        }
        table = arrow.Table.from_arrays(columns, schema=arrow.schema(fields, metadata=beside))
        stream = io.BytesIO()
        arrow.parquet.write_table(table, stream, compression="zstd")
        return stream.getvalue()


def _arrow(path: Path) -> Any:
    """Return pyarrow, with its parquet module loaded."""
    try:
        import pyarrow as pa
        import pyarrow.parquet
    except ImportError as exc:
        raise file_error(
            path, "parquet files need pyarrow. Install it: pip install 'jointz[parquet]'."
        ) from exc
    return pa


def _read_columns(arrow: Any, path: Path, names: Sequence[str] | None = None) -> tuple[Any, Any]:
    """Return the schema of a file, and a table of the named columns, else of all of known kinds."""
    schema = arrow.parquet.read_schema(path)
    if names is None:
        names = [field.name for field in schema if _is_flat(arrow.types, field.type)]
    for field in schema:
        if field.name in names and not _is_flat(arrow.types, field.type):
            raise file_error(
                path,
                f"expected numbers, times or text, found {field.type}. Choose another column, or "
                "export it as one of these.",
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
    selection = arrow.schema(
        [coded.field(n) for n in dict.fromkeys(names)], metadata=coded.metadata
    )
    table = arrow.Table.from_batches(batches, schema=batches[0].schema if batches else selection)
    return schema, table.cast(arrow.schema([schema.field(n) for n in table.column_names]))


def _is_text(kind: Any, column_type: Any) -> bool:
    return any(
        is_it(column_type) for is_it in (kind.is_string, kind.is_large_string, kind.is_binary)
    )


def _is_flat(kind: Any, column_type: Any) -> bool:
    """Whether a column is of a kind whose size is known before it is read, or while it is."""
    if kind.is_dictionary(column_type):
        column_type = column_type.value_type
    known = (kind.is_primitive, kind.is_decimal, kind.is_null)
    return _is_text(kind, column_type) or any(is_it(column_type) for is_it in known)


def declared_bytes(metadata: Any, names: Sequence[str] | None = None) -> int:
    """Return what columns take in memory by what a file says of itself."""
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


def _content(arrow: Any, path: Path) -> Acquisition:
    names = arrow.parquet.read_schema(path).names
    twice = sorted({name for name in names if names.count(name) > 1})
    if twice:
        raise DataError(
            f"{path.name}: two columns are named '{twice[0]}'. Rename one and export it again.",
            path=str(path),
            channel=twice[0],
        )
    schema, table = _read_columns(arrow, path)
    signals, left_out = [], []
    for name in names:
        flat = name in table.column_names
        signal = _signal(arrow, table.column(name), schema.field(name)) if flat else None
        if signal is None:
            left_out.append(f"{name} ({schema.field(name).type})")
        else:
            signals.append(signal)
    metadata = schema.metadata or {}
    changed = ""
    if _SIDE in metadata:
        side = read_beside(metadata[_SIDE].decode())
        try:
            return _jointz_content(side, metadata.get(b"jointz_clock", b"").decode(), signals)
        except ValueError as exc:
            changed = str(exc)
    group, notes = with_clock("", signals)
    if changed:
        notes[f"{READING}jointz"] = f"{_CHANGED} ({changed})"
    if left_out:
        notes[f"{READING}left_out"] = f"columns of other kinds: {listed(left_out)}"
    return Acquisition((group,), (), notes)


def _jointz_content(side: SideInformation, clock: str, signals: Sequence[Signal]) -> Acquisition:
    """Return what jointz wrote."""
    time = next((s.values for s in signals if clock and s.name == clock), None)
    columns = {s.name: s.values for s in signals if not clock or s.name != clock}
    labels = unique_names([plainly(signal.name) for signal in side.group.signals])
    content = filled(side, columns, time, labels=labels)
    (group,) = content.groups
    named = tuple(replace(s, column=n) for s, n in zip(group.signals, labels, strict=True))
    return replace(content, groups=(replace(group, signals=named, time_column=clock),))


def _signal(arrow: Any, column: Any, field: Any) -> Signal | None:
    """Return a column as a signal, None where it is nested or of a kind that has no samples."""
    kind = arrow.types
    unit = _unit(field) or unit_in_name(field.name)
    description = (field.metadata or {}).get(b"description", b"").decode()
    if kind.is_dictionary(column.type):
        column = column.cast(column.type.value_type)
    if kind.is_temporal(column.type):
        column, description = column.cast(arrow.string()), description or _DATES
    if kind.is_string(column.type) or kind.is_large_string(column.type):
        texts = np.array(column.fill_null("").to_pylist(), dtype=object)
        return Signal(field.name, texts, unit, description)
    if kind.is_null(column.type):
        return Signal(field.name, np.full(len(column), np.nan), unit, description)
    values = _numbers(arrow, column)
    if values.dtype.kind != "f":
        return None
    return Signal(field.name, values.astype(np.float64), unit, description)


def _field(arrow: Any, name: str, signal: Signal) -> Any:
    attributes = {"units": plainly(signal.unit), "description": plainly(signal.description)}
    kind = arrow.string() if signal.is_text else arrow.float64()
    return arrow.field(name, kind, metadata={key: text for key, text in attributes.items() if text})


def _column(arrow: Any, signal: Signal) -> Any:
    if signal.is_text:
        return arrow.array([plainly(str(text)) for text in signal.values], arrow.string())
    return arrow.array(signal.values, arrow.float64(), from_pandas=False)


def _numbers(arrow: Any, column: Any) -> np.ndarray:
    """Return a column of numbers or booleans as float64, null as NaN; others as they are."""
    kind = arrow.types
    plain = kind.is_integer(column.type) or kind.is_boolean(column.type)
    if plain or kind.is_floating(column.type) or kind.is_decimal(column.type):
        column = column.cast(arrow.float64(), safe=False)
    values: np.ndarray = column.to_numpy()
    return values


def _unit(field: Any) -> str:
    """Return the unit that a field's metadata state, else ""."""
    metadata = field.metadata or {}
    return next((metadata[k].decode() for k in _UNIT_KEYS if k in metadata), "")
