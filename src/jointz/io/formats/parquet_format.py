"""Whole parquet tables in and out, through pyarrow (the extra ``jointz[parquet]``)."""

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from jointz.core.acquisition import Acquisition, Signal
from jointz.core.errors import DataError
from jointz.core.study import FilesSpec
from jointz.core.whole_file import whole_file
from jointz.io.column_readers import damaged
from jointz.io.formats.columnar import arrow_for, arrow_numbers, field_unit, read_columns
from jointz.io.formats.losses import (
    NOTE,
    first_group,
    has_text,
    is_plain,
    listed,
    lost_groups,
    lost_signals,
    plainly,
)
from jointz.io.formats.registry import register_format
from jointz.io.text.column_names import (
    READING,
    clock_column,
    unique_names,
    unit_in_name,
    with_clock,
)
from jointz.io.text.side_information import SideInformation, filled, read_beside, written_beside

_SIDE = b"jointz"
_CHANGED = (
    "the table is not the one that jointz wrote, and was read as any other: rate, events and "
    "metadata beside it belong to what it was"
)
_DATES = NOTE + "dates and times, written as ISO 8601"


@register_format(".parquet")
class ParquetFormat:
    """Reads any flat table; writes one group, the rest as one line of JSON in the metadata."""

    name = "parquet"

    def read(self, path: Path, files: FilesSpec) -> Acquisition:  # noqa: ARG002
        """Return all columns of numbers, text and dates; nulls become NaN or ""."""
        arrow = arrow_for(path)
        try:
            return _content(arrow, path)
        except (arrow.ArrowException, OSError, ValueError) as exc:
            if isinstance(exc, DataError):
                raise
            raise damaged(path, exc) from exc

    def losses(self, content: Acquisition) -> list[str]:
        """Say what one table cannot hold: other groups, letters that are none."""
        group = first_group(content)
        odd = [s.name for s in group.signals if not is_plain(s.name + s.unit + s.description)]
        lost = lost_groups(content)
        lost += lost_signals(
            group, "text with NUL or half letters", lambda s: has_text(s, is_plain)
        )
        if odd:
            lost.append(f"It cannot hold the names of {listed(map(repr, odd))} as they are.")
        return lost

    def write(self, content: Acquisition, path: Path) -> None:
        """Write the first group; a clock stands as the first column."""
        arrow = arrow_for(path)
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
        with whole_file(path, "Make room or name another place.") as partial:
            arrow.parquet.write_table(table, partial, compression="zstd")


def _content(arrow: Any, path: Path) -> Acquisition:
    names = arrow.parquet.read_schema(path).names
    twice = sorted({name for name in names if names.count(name) > 1})
    if twice:
        raise DataError(
            f"{path.name}: two columns are named '{twice[0]}'. Rename one and export it again.",
            path=str(path),
            channel=twice[0],
        )
    schema, table = read_columns(arrow, path)
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
        told = read_beside(metadata[_SIDE].decode())
        try:
            return _own(told, metadata.get(b"jointz_clock", b"").decode(), signals)
        except ValueError as exc:
            changed = str(exc)
    group, notes = with_clock("", signals)
    if changed:
        notes[f"{READING}jointz"] = f"{_CHANGED} ({changed})"
    if left_out:
        notes[f"{READING}left_out"] = f"columns of other kinds: {listed(left_out)}"
    return Acquisition((group,), (), notes)


def _own(told: SideInformation, clock: str, signals: Sequence[Signal]) -> Acquisition:
    """Return what jointz wrote."""
    time = next((s.values for s in signals if clock and s.name == clock), None)
    columns = {s.name: s.values for s in signals if not clock or s.name != clock}
    labels = unique_names([plainly(signal.name) for signal in told.group.signals])
    content = filled(told, columns, time, labels=labels)
    (group,) = content.groups
    named = tuple(replace(s, column=n) for s, n in zip(group.signals, labels, strict=True))
    return replace(content, groups=(replace(group, signals=named, time_column=clock),))


def _signal(arrow: Any, column: Any, field: Any) -> Signal | None:
    """Return a column as a signal, None where it is nested or of a kind that has no samples."""
    kind = arrow.types
    unit = field_unit(field) or unit_in_name(field.name)
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
    values = arrow_numbers(arrow, column)
    if values.dtype.kind != "f":
        return None
    return Signal(field.name, values.astype(np.float64), unit, description)


def _field(arrow: Any, name: str, signal: Signal) -> Any:
    told = {"units": plainly(signal.unit), "description": plainly(signal.description)}
    kind = arrow.string() if signal.is_text else arrow.float64()
    return arrow.field(name, kind, metadata={key: text for key, text in told.items() if text})


def _column(arrow: Any, signal: Signal) -> Any:
    if signal.is_text:
        return arrow.array([plainly(str(text)) for text in signal.values], arrow.string())
    return arrow.array(signal.values, arrow.float64(), from_pandas=False)
