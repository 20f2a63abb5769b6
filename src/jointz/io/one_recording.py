"""Read one recording from a file, without a study."""

import os
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr
from pydantic import ValidationError

from jointz.core.acquisition import Acquisition, SignalGroup
from jointz.core.channels import RECORD_UNITS, UNITLESS_RECORD_COLUMNS
from jointz.core.errors import DataError
from jointz.core.study import FilesSpec
from jointz.io.column_units import unit_in_record
from jointz.io.formats.columns import check_samples
from jointz.io.formats.registry import list_columns, read_acquisition, read_table
from jointz.io.text.column_arguments import Column, parse_column
from jointz.io.toml_problems import shape_problems


def read(
    path: str | os.PathLike[str],
    *,
    group: str | None = None,
    files: Mapping[str, Any] | None = None,
    **channels: str,
) -> xr.Dataset:
    r"""Read one recording from a file of any format that jointz reads.

    Parameters
    ----------
    path : path
        The file; its suffix selects the format (docs/formats.md).
    group : str, optional
        Name of the group of signals to read; required if the file has several, each with its own
        clock.
    files : mapping, optional
        Layout of a text file: the keys of ``[files]`` in ``study.toml``.
    **channels : str
        Channel = ``"COLUMN"``, ``"COLUMN:UNIT"`` or ``"COLUMN:FACTOR*UNIT"``, such as
        ``angle="knee:deg"``: only these columns are read, and converted to SI. Without a unit,
        that of the file holds, or SI if it states none. Numbers times the factor have the unit,
        whatever the file states. Those of ``contact`` and ``direction`` have no unit.

    Returns
    -------
    xarray.Dataset
        One variable per signal along ``time``, with its unit in ``attrs["units"]``. Without
        ``channels`` it has every signal of the file, under its own name and in its own unit. The
        coordinate ``time`` is in s; it is missing if the file has no clock, or if ``channels``
        are given without ``time``.

    Raises
    ------
    DataError
        If the file is missing or damaged, a column, a group or a key of ``files`` is unknown, or
        ``group`` is missing or given beside ``channels``.
    UnitError
        If a unit is unknown, does not fit the channel or contradicts the file.

    Examples
    --------
    >>> import tempfile
    >>> file = Path(tempfile.mkdtemp()) / "ankle.csv"
    >>> _ = file.write_text("t,pos\n0,0\n0.5,90\n")
    >>> read(file, time="t", angle="pos:deg")["angle"].values.round(2).tolist()
    [0.0, 1.57]
    """
    file = Path(path)
    if not channels:
        content = read_acquisition(file, _layout(files))
        return _dataset(_group_of(content, group, file), file)
    if group is not None:
        raise DataError("read: expected group or channels, got both. Name the columns only.")
    return read_channels(file, channels, files)[0]


def read_channels(
    file: Path, channels: Mapping[str, str], files: Mapping[str, Any] | None = None
) -> tuple[xr.Dataset, dict[str, Column]]:
    """Read columns as channels in SI; return the dataset, and the parsed columns by channel."""
    known = [*RECORD_UNITS, *UNITLESS_RECORD_COLUMNS]
    unknown = [name for name in channels if name not in known]
    if unknown:
        raise DataError(
            f"read: expected channels out of {', '.join(known)}; got {', '.join(unknown)}. "
            "Leave the channels out to read every column under its own name."
        )
    if strange := [name for name, text in channels.items() if not isinstance(text, str)]:
        raise DataError(f"read: {', '.join(strange)}: expected the name of a column.")
    layout = _layout(files)
    column_names = list_columns(file, layout) if file.is_file() else None
    columns = {name: parse_column(text, name, column_names) for name, text in channels.items()}
    keys = {name: _column_key(column, layout) for name, column in columns.items()}
    _refuse_repeated(keys)
    table = read_table(file, numeric=list(keys.values()), files=layout)
    check_samples(file, table)
    signals = {}
    for name, column in columns.items():
        unit = unit_in_record(name, column, table.units, file=file.name)
        values = np.asarray(table.columns[str(keys[name])], dtype=float)
        signals[name] = ("time", unit.in_si(values), {"units": unit.si_unit})
        columns[name] = replace(column, unit=unit.text)
    attributes = {"file": file.name, "first_row": table.first_row, "sha256": table.sha256}
    return xr.Dataset(signals, attrs=attributes), columns


def _layout(files: Mapping[str, Any] | None) -> FilesSpec:
    """Return the layout of a text file; refuse unknown keys and wrong values."""
    values = files or {}
    try:
        return FilesSpec.model_validate(values)
    except ValidationError as exc:
        problems = " ".join(shape_problems(exc, FilesSpec, values))
        raise DataError(f"read, argument files: {problems}") from exc


def _refuse_repeated(keys: Mapping[str, str | int]) -> None:
    """Refuse one column for two channels: torque on itself would have a stiffness of 1."""
    for key in keys.values():
        channels = [name for name, other in keys.items() if other == key]
        if len(channels) > 1:
            raise DataError(
                f"column '{key}': expected one channel, got {', '.join(channels)}. Name the column "
                "of each.",
                channel=channels[0],
            )


def _column_key(column: Column, layout: FilesSpec) -> str | int:
    """Return the name of a column, or its number in a file without a header."""
    if layout.header:
        return column.name
    if not column.name.isdecimal():
        raise DataError(
            f"column '{column.name}': expected a number, because the file has no header. Count "
            "the columns from 1.",
            channel=column.name,
        )
    return int(column.name)


def _group_of(content: Acquisition, name: str | None, path: Path) -> SignalGroup:
    groups = {group.name: group for group in content.groups}
    if name is None and len(groups) == 1:
        return content.groups[0]
    if name in groups:
        return groups[name]
    if names := ", ".join(filter(None, groups)):
        problem = f"expected group to be one of {names}; got {name!r}. Correct group."
    elif groups:
        problem = f"its only group of signals has no name; got {name!r}. Leave group out."
    else:
        problem = "it has no signals. Choose another file."
    raise DataError(f"{path.name}: {problem}", path=str(path))


def _dataset(group: SignalGroup, path: Path) -> xr.Dataset:
    signals = {
        signal.name: ("time", signal.values, {"units": signal.unit}) for signal in group.signals
    }
    times_s = group.times_s()
    clock = {} if times_s is None else {"time": ("time", times_s, {"units": "s"})}
    return xr.Dataset(signals, coords=clock, attrs={"file": path.name})
