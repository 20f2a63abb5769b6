"""Parquet tables, read through pyarrow (the extra ``jointz[parquet]``)."""

import json
from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from jointz.core.acquisition import Acquisition, Event, Signal, SignalGroup
from jointz.core.errors import DataError, install_advice
from jointz.core.study import FilesSpec
from jointz.io.formats.columns import (
    RawTable,
    TableRequest,
    damage_errors,
    file_error,
    make_table,
    missing_columns,
)
from jointz.io.formats.losses import NOTE, listed, plainly
from jointz.io.formats.memory_limit import NUMBER_BYTES, OBJECT_BYTES, check_unpacked
from jointz.io.text.column_names import READING, unique_names, unit_in_name, with_clock

_VERSION = 1
_OF_A_SAMPLE = 1e-3  # how far a time may be from that of the rate: as it was rounded


def read_beside(text: str) -> tuple[Acquisition, bool]:
    """Read the line that earlier versions of jointz wrote: all but the samples of one group.

    The second value tells whether time stamps are its clock, instead of a rate or none.
    """
    try:
        content = json.loads(text)
        if content["version"] != _VERSION:
            raise ValueError(
                f"version {content['version']} of the jointz line, expected {_VERSION}"
            )
        events = tuple(Event(float(t), str(name), float(d)) for t, name, d in content["events"])
        metadata = {str(k): str(v) for k, v in content["metadata"].items()}
        return Acquisition((_group(content),), events, metadata), bool(content["stamped"])
    except (KeyError, TypeError, AttributeError, RecursionError, OverflowError) as exc:
        raise ValueError(f"the jointz line is damaged ({type(exc).__name__}: {exc})") from exc


def _group(content: dict[str, Any]) -> SignalGroup:
    kinds = {True: object, False: np.float64}
    signals = tuple(
        Signal(str(name), np.empty(0, kinds[bool(text)]), str(unit), str(description))
        for name, unit, description, text in content["signals"]
    )
    rate = content["rate_hz"]
    return SignalGroup(
        str(content["group"]),
        signals,
        None if rate is None else float(rate),
        float(content["start_s"]),
    )


def _filled(
    group: SignalGroup,
    columns: Mapping[str, np.ndarray],
    stamps: np.ndarray | None,
    *,
    stamped: bool,
) -> SignalGroup:
    """Return a group with the samples of a table, which earlier versions of jointz wrote."""
    names = unique_names([plainly(signal.name) for signal in group.signals])
    if list(columns) != names:
        raise ValueError("the jointz line tells of other columns than the table has")
    kinds = [signal.is_text for signal in group.signals]
    if kinds != [values.dtype.kind == "O" for values in columns.values()]:
        raise ValueError("the jointz line tells of other columns of text than the table has")
    signals = tuple(
        replace(signal, values=values, column=name)
        for signal, (name, values) in zip(group.signals, columns.items(), strict=True)
    )
    _check_clock(group, stamps, stamped=stamped)
    return replace(group, signals=signals, time_s=stamps if stamped else None)


def _check_clock(group: SignalGroup, stamps: np.ndarray | None, *, stamped: bool) -> None:
    """Refuse a column of time that is missing, or that another program changed."""
    rate, start = group.rate_hz, group.start_s
    if not stamped and rate is None:
        if stamps is not None:
            raise ValueError("the jointz line tells of no clock, the table has a column of time")
        return
    if stamps is None:
        raise ValueError("the jointz line tells of a clock, the table has no column of time")
    if stamped or rate is None:
        return
    at = _first_other_time(stamps, rate, start)
    if at is not None:
        raise ValueError(
            f"the jointz line tells of {rate:g} Hz, and sample {at + 1} is at {stamps[at]:.9g} s, "
            f"not at {start + at / rate if rate else np.nan:.9g} s"
        )


def _first_other_time(stamps: np.ndarray, rate_hz: float, start_s: float) -> int | None:
    """Return the first sample that is not where its rate puts it, but for rounding; else None."""
    with np.errstate(all="ignore"):
        times = start_s + np.arange(len(stamps)) / np.float64(rate_hz)
        same = (stamps == times) | (np.isnan(stamps) & np.isnan(times))
        same |= np.abs(stamps - times) * abs(rate_hz) <= _OF_A_SAMPLE
    return None if same.all() else int(np.flatnonzero(~same)[0])


#: Conversion of a piece of a column, such as :func:`_as_numbers`.
_Kind = Callable[[Any, Any], Any]
_BUFFER = 1 << 20  # bytes of a packed column that are read at once
_UNIT_KEYS = (b"units", b"unit")
_SIDE = b"jointz"
_CHANGED = (
    "the table is not the one that jointz wrote, and was read as any other: rate, events and "
    "metadata beside it belong to what it was"
)
_DATES = NOTE + "dates and times, written as ISO 8601"


class ParquetFormat:
    """Reads any flat table, and the line of JSON beside those of earlier versions of jointz.

    The unit of a column is its field's metadata ``units`` or ``unit``.
    """

    name = "parquet"

    def read(self, path: Path, files: FilesSpec) -> Acquisition:  # noqa: ARG002
        """Return all columns of numbers, text and dates; nulls become NaN or ""."""
        arrow = _arrow(path)
        with damage_errors(path, arrow.ArrowException, OSError, ValueError):
            return _content(arrow, path)

    def read_columns(self, path: Path, request: TableRequest) -> RawTable:
        """Return the requested columns; nulls become NaN, or "" in labels."""
        arrow = _arrow(path)
        names = [str(c) for c in request.columns]
        available = self.list_columns(path, request.files)
        missing = [name for name in names if name not in available]
        if missing:
            raise missing_columns(path, missing, available)
        texts = {str(c) for c in request.labels}
        with damage_errors(path, arrow.ArrowException, OSError, ValueError):
            schema = _flat_schema(arrow, path, names)
            kinds = {name: _as_labels if name in texts else _as_numbers for name in names}
            columns = _read_columns(arrow, path, kinds)
        return make_table(
            path,
            request,
            lambda c: columns[c],
            {name: unit for name in names if (unit := _unit(schema.field(name)))},
        )

    def list_columns(self, path: Path, files: FilesSpec) -> list[str]:  # noqa: ARG002
        """Return the names in the file's schema."""
        arrow = _arrow(path)
        with damage_errors(path, arrow.ArrowException, OSError, UnicodeDecodeError):
            return list(arrow.parquet.read_schema(path).names)


def _arrow(path: Path) -> Any:
    """Return pyarrow, with its parquet module loaded."""
    try:
        import pyarrow as pa
        import pyarrow.parquet
    except ImportError as exc:
        raise file_error(path, f"parquet files need pyarrow. {install_advice('parquet')}") from exc
    return pa


def _flat_schema(arrow: Any, path: Path, names: Sequence[str]) -> Any:
    """Return the schema of a file; refuse named columns that are not flat."""
    schema = arrow.parquet.read_schema(path)
    for field in schema:
        if field.name in names and not _is_flat(arrow.types, field.type):
            raise file_error(
                path,
                f"expected numbers, times or text, found {field.type}. Choose another column, or "
                "export it as one of these.",
                channel=field.name,
            )
    return schema


def _read_columns(arrow: Any, path: Path, kinds: Mapping[str, _Kind]) -> dict[str, np.ndarray]:
    """Return columns by name, each converted to its kind.

    They are filled batch by batch: a table beside them would hold everything twice.
    """
    schema = arrow.parquet.read_schema(path)
    # A text that a dictionary names a million times is held once.
    texts = [f.name for f in schema if f.name in kinds and _is_text(arrow.types, f.type)]
    with arrow.parquet.ParquetFile(
        path, read_dictionary=texts, pre_buffer=False, buffer_size=_BUFFER
    ) as file:
        n_rows = file.metadata.num_rows
        declared = _declared_bytes(file.metadata, kinds)
        check_unpacked(path, max(declared, NUMBER_BYTES * n_rows * bool(kinds)))
        columns = {
            name: np.empty(n_rows, _samples(arrow, kind(arrow, _empty(arrow, file, name))).dtype)
            for name, kind in kinds.items()
        }
        at, total = 0, 0
        for batch in file.iter_batches(columns=list(kinds)):
            for name, kind in kinds.items():
                piece = kind(arrow, batch.column(name))
                total += _piece_bytes(arrow, piece)
                check_unpacked(path, total)
                columns[name][at : at + len(piece)] = _samples(arrow, piece)
            at += len(batch)
    return columns


def _empty(arrow: Any, file: Any, name: str) -> Any:
    return arrow.array([], file.schema_arrow.field(name).type)


def _is_text(kind: Any, column_type: Any) -> bool:
    return any(
        is_it(column_type) for is_it in (kind.is_string, kind.is_large_string, kind.is_binary)
    )


def _value_type(kind: Any, column_type: Any) -> Any:
    return column_type.value_type if kind.is_dictionary(column_type) else column_type


def _has_samples(kind: Any, column_type: Any) -> bool:
    """Whether a column holds numbers, times or text."""
    return _is_flat(kind, column_type) and not kind.is_binary(_value_type(kind, column_type))


def _is_flat(kind: Any, column_type: Any) -> bool:
    """Whether a column is of a kind whose size is known before it is read, or while it is."""
    column_type = _value_type(kind, column_type)
    known = (kind.is_primitive, kind.is_decimal, kind.is_null)
    return _is_text(kind, column_type) or any(is_it(column_type) for is_it in known)


def _declared_bytes(metadata: Any, names: Collection[str]) -> int:
    """Return what columns take in memory by what a file says of itself."""
    groups = [metadata.row_group(k) for k in range(metadata.num_row_groups)]
    columns = [group.column(k) for group in groups for k in range(group.num_columns)]
    return sum(
        max(NUMBER_BYTES * column.num_values, column.total_uncompressed_size)
        for column in columns
        if column.path_in_schema.partition(".")[0] in names
    )


def _piece_bytes(arrow: Any, piece: Any) -> int:
    """Return what a piece of a column takes in memory; repeated texts count each time."""
    if not arrow.types.is_dictionary(piece.type):
        return NUMBER_BYTES * len(piece)
    import pyarrow.compute as compute

    n_bytes = NUMBER_BYTES * len(piece) + OBJECT_BYTES * min(len(piece), len(piece.dictionary))
    if not _is_text(arrow.types, piece.type.value_type):
        return n_bytes
    lengths = compute.binary_length(piece.dictionary).take(piece.indices)
    return n_bytes + int(compute.sum(lengths).as_py() or 0)


def _content(arrow: Any, path: Path) -> Acquisition:
    schema = arrow.parquet.read_schema(path)
    names = schema.names
    twice = sorted({name for name in names if names.count(name) > 1})
    if twice:
        message = f"{path.name}: two columns are named '{twice[0]}'. Rename one."
        raise DataError(message, path=str(path), channel=twice[0])
    known = [field.name for field in schema if _has_samples(arrow.types, field.type)]
    columns = _read_columns(arrow, path, dict.fromkeys(known, _as_signal))
    signals = [_signal(arrow, columns[name], schema.field(name)) for name in known]
    left_out = [f"{name} ({schema.field(name).type})" for name in names if name not in columns]
    metadata = schema.metadata or {}
    changed = ""
    if _SIDE in metadata:
        side, stamped = read_beside(metadata[_SIDE].decode())
        clock = metadata.get(b"jointz_clock", b"").decode()
        time = next((s.values for s in signals if clock and s.name == clock), None)
        samples = {s.name: s.values for s in signals if not clock or s.name != clock}
        try:
            group = _filled(side.groups[0], samples, time, stamped=stamped)
            return replace(side, groups=(replace(group, time_column=clock),))
        except ValueError as exc:
            changed = str(exc)
    group, notes = with_clock("", signals)
    if changed:
        notes[f"{READING}jointz"] = f"{_CHANGED} ({changed})"
    if left_out:
        notes[f"{READING}left_out"] = f"columns of other kinds: {listed(left_out)}"
    return Acquisition((group,), (), notes)


def _signal(arrow: Any, values: np.ndarray, field: Any) -> Signal:
    unit = _unit(field) or unit_in_name(field.name)
    description = (field.metadata or {}).get(b"description", b"").decode()
    if arrow.types.is_temporal(_value_type(arrow.types, field.type)):
        description = description or _DATES
    if values.dtype.kind == "O":
        values[~values.astype(bool)] = ""  # None
    return Signal(field.name, values, unit, description)


def _as_numbers(arrow: Any, column: Any) -> Any:
    """Return numbers and booleans as float64, texts as a dictionary; others as they are."""
    kind = arrow.types
    if kind.is_dictionary(column.type):
        if _is_text(kind, column.type.value_type):
            return column
        column = column.dictionary_decode()
    plain = kind.is_integer(column.type) or kind.is_boolean(column.type)
    if plain or kind.is_floating(column.type) or kind.is_decimal(column.type):
        return column.cast(arrow.float64(), safe=False)
    return column


def _as_labels(arrow: Any, column: Any) -> Any:
    """Return a dictionary, by which each value is held once."""
    return column if arrow.types.is_dictionary(column.type) else column.dictionary_encode()


def _as_signal(arrow: Any, column: Any) -> Any:
    """Return numbers as float64, texts and dates as a dictionary of texts."""
    if arrow.types.is_temporal(_value_type(arrow.types, column.type)):
        return _as_labels(arrow, _decoded(arrow, column).cast(arrow.string()))
    if arrow.types.is_null(column.type):
        return column.cast(arrow.float64())
    return _as_numbers(arrow, column)


def _decoded(arrow: Any, column: Any) -> Any:
    return column.dictionary_decode() if arrow.types.is_dictionary(column.type) else column


def _samples(arrow: Any, piece: Any) -> np.ndarray:
    """Return float64, null as NaN, or objects, null as None; others as they are."""
    if not arrow.types.is_dictionary(piece.type):
        values: np.ndarray = piece.to_numpy(zero_copy_only=False)
        return values
    codes = piece.indices.fill_null(-1).to_numpy(zero_copy_only=False)
    used, codes = np.unique(codes, return_inverse=True)
    n_null = int(used.size > 0 and used[0] < 0)
    distinct = piece.dictionary.take(arrow.array(used[n_null:])).to_pylist()
    objects = np.empty(used.size, dtype=object)
    objects[:] = [None] * n_null + distinct
    return objects[codes]


def _unit(field: Any) -> str:
    """Return the unit that a field's metadata state, else ""."""
    metadata = field.metadata or {}
    return next((metadata[k].decode() for k in _UNIT_KEYS if k in metadata), "")
