"""Identify one recording that stands in a file by itself."""

from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr

from jointz.core.errors import DataError
from jointz.core.study import FilesSpec
from jointz.identify.actuators.actuator import identify_actuator
from jointz.identify.actuators.bandwidth import identify_bandwidth
from jointz.identify.series.joint import identify_joint
from jointz.io.formats.columns import check_samples
from jointz.io.formats.registry import list_columns, read_table
from jointz.io.text.column_arguments import SI_UNITS, Column, parse_column
from jointz.io.text.units import conversion
from jointz.results.bench.actuator_fit import ActuatorFit
from jointz.results.bench.bandwidth_fit import BandwidthFit
from jointz.results.series.frequency_response_fit import FrequencyResponseFit
from jointz.results.series.impulse_response_fit import ImpulseResponseFit
from jointz.results.series.joint_fit import JointFit
from jointz.results.series.reflex_fit import ReflexFit


def identify_joint_file(
    file: Path,
    columns: Mapping[str, str],
    *,
    files: Mapping[str, Any] | None = None,
    rate_hz: float | None = None,
    **settings: Any,
) -> tuple[JointFit | ImpulseResponseFit | FrequencyResponseFit | ReflexFit, dict[str, Column]]:
    """Identify a joint from one time series in a file."""
    _check_time_or_rate(columns, rate_hz)
    recording, parsed = _read(file, columns, files)
    with _named(file, parsed):
        return identify_joint(recording, rate_hz=rate_hz, **settings), parsed


def identify_bandwidth_file(
    file: Path,
    columns: Mapping[str, str],
    *,
    files: Mapping[str, Any] | None = None,
    rate_hz: float | None = None,
    **settings: Any,
) -> tuple[BandwidthFit, dict[str, Column]]:
    """Find the torque bandwidth in one time series in a file."""
    _check_time_or_rate(columns, rate_hz)
    recording, parsed = _read(file, columns, files)
    with _named(file, parsed):
        return identify_bandwidth(recording, rate_hz=rate_hz, **settings), parsed


def identify_actuator_file(
    file: Path,
    columns: Mapping[str, str],
    *,
    files: Mapping[str, Any] | None = None,
    rate_hz: float | None = None,
    **settings: Any,
) -> tuple[ActuatorFit, dict[str, Column]]:
    """Fit a torque model to one bench record in a file."""
    if "time" in columns and rate_hz is not None:
        raise DataError("Give --time COL[:unit] or --rate HZ or neither, not both.")
    recording, parsed = _read(file, columns, files)
    with _named(file, parsed):
        return identify_actuator(recording, rate_hz=rate_hz, **settings), parsed


def _check_time_or_rate(columns: Mapping[str, str], rate_hz: float | None) -> None:
    if ("time" in columns) == (rate_hz is not None):
        raise DataError("Give either --time COL[:unit] or --rate HZ, one of them.")


def _read(
    file: Path, columns: Mapping[str, str], files: Mapping[str, Any] | None
) -> tuple[xr.Dataset, dict[str, Column]]:
    """Return the columns of a file under the names of their channels, in SI."""
    layout = FilesSpec.model_validate(files or {})
    there = list_columns(file, layout) if file.is_file() else None
    parsed = {name: parse_column(text, name, there) for name, text in columns.items()}
    wanted = [_key(column, layout) for column in parsed.values()]
    table = read_table(file, numeric=wanted, files=layout)
    check_samples(file, table)
    signals = {}
    for name, column in parsed.items():
        factor, offset = conversion(column.unit, SI_UNITS[name])
        values = np.asarray(table.columns[str(_key(column, layout))], dtype=float)
        signals[name] = ("sample", factor * values + offset)
    attributes = {"first_row": table.first_row, "sha256": table.sha256}
    return xr.Dataset(signals, attrs=attributes), parsed


@contextmanager
def _named(file: Path, columns: Mapping[str, Column]) -> Iterator[None]:
    """Say in which file, and in which of its columns, the samples cannot be trusted."""
    try:
        yield
    except DataError as exc:
        where, column = file.name, columns.get(exc.channel or "")
        if column is not None:
            where += f", column '{column.name}'"
        channel = column.name if column is not None else exc.channel
        raise DataError(f"{where}: {exc}", path=str(file), channel=channel, row=exc.row) from exc


def _key(column: Column, layout: FilesSpec) -> str | int:
    """Return how the readers know a column: by its name, or by number without a header."""
    if layout.header:
        return column.name
    if not column.name.isdecimal():
        raise DataError(f"{column.name}: without a header a column is a number, from 1.")
    return int(column.name)
