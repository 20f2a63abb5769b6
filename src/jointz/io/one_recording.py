"""Read one recording that stands in a file by itself, without a study."""

import os
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr

from jointz.core.acquisition import Acquisition, SignalGroup
from jointz.core.errors import DataError
from jointz.core.study import FilesSpec
from jointz.io.formats.columns import check_samples
from jointz.io.formats.registry import list_columns, read_acquisition, read_table
from jointz.io.text.column_arguments import SI_UNITS, Column, parse_column
from jointz.io.text.units import conversion


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
        The file; its suffix says what it is (docs/formats.md).
    group : str, optional
        Which signals to read, where a file holds several groups with clocks of their own.
    files : mapping, optional
        How a text file is laid out: the keys of ``[files]`` in ``study.toml``.
    **channels : str
        Channel = ``"COLUMN"`` or ``"COLUMN:UNIT"``, such as ``angle="knee:deg"``: only these
        columns are read, and converted to SI.

    Returns
    -------
    xarray.Dataset
        One variable a signal along ``time``, with its unit in ``attrs["units"]``. Without
        ``channels`` every signal of the file, under its own name and in its own unit; the
        coordinate ``time`` is in s, and missing where the file has no clock.

    Raises
    ------
    DataError
        When the file is missing or damaged, a column is not there, or one of several groups has
        to be named.
    UnitError
        When a unit is unknown, or not one of the channel.

    Examples
    --------
    >>> import tempfile
    >>> file = Path(tempfile.mkdtemp()) / "ankle.csv"
    >>> _ = file.write_text("t,pos\n0,0\n0.5,90\n")
    >>> read(file, time="t", angle="pos:deg")["angle"].values.round(2).tolist()
    [0.0, 1.57]
    """
    if channels:
        if group is not None:
            raise DataError("read: expected group or channels, got both. Name the columns only.")
        return read_channels(Path(path), channels, files)[0]
    content = read_acquisition(Path(path), FilesSpec.model_validate(files or {}))
    return _dataset(_group_of(content, group, Path(path)), Path(path))


def read_channels(
    file: Path, channels: Mapping[str, str], files: Mapping[str, Any] | None = None
) -> tuple[xr.Dataset, dict[str, Column]]:
    """Return columns of a file under the names of their channels, in SI, and what they are."""
    unknown = [name for name in channels if name not in SI_UNITS]
    if unknown:
        raise DataError(
            f"read: expected channels out of {', '.join(SI_UNITS)}; got {', '.join(unknown)}. "
            "Leave the channels out to read every column under its own name."
        )
    layout = FilesSpec.model_validate(files or {})
    there = list_columns(file, layout) if file.is_file() else None
    columns = {name: parse_column(text, name, there) for name, text in channels.items()}
    keys = {name: _key(column, layout) for name, column in columns.items()}
    table = read_table(file, numeric=list(keys.values()), files=layout)
    check_samples(file, table)
    signals = {}
    for name, column in columns.items():
        factor, offset = conversion(column.unit, SI_UNITS[name])
        values = np.asarray(table.columns[str(keys[name])], dtype=float)
        signals[name] = ("time", factor * values + offset, {"units": SI_UNITS[name]})
    attributes = {"file": file.name, "first_row": table.first_row, "sha256": table.sha256}
    return xr.Dataset(signals, attrs=attributes), columns


def _key(column: Column, layout: FilesSpec) -> str | int:
    """Return how the readers know a column: by its name, or by number without a header."""
    if layout.header:
        return column.name
    if not column.name.isdecimal():
        raise DataError(f"{column.name}: without a header a column is a number, from 1.")
    return int(column.name)


def _group_of(content: Acquisition, name: str | None, path: Path) -> SignalGroup:
    groups = {group.name: group for group in content.groups}
    if name is None and len(groups) == 1:
        return content.groups[0]
    if name in groups:
        return groups[name]
    raise DataError(
        f"{path.name}: expected the name of a group of signals, one of {', '.join(groups)}; got "
        f"{name!r}. Give group=.",
        path=str(path),
    )


def _dataset(group: SignalGroup, path: Path) -> xr.Dataset:
    signals = {
        signal.name: ("time", signal.values, {"units": signal.unit}) for signal in group.signals
    }
    times_s = group.times_s()
    clock = {} if times_s is None else {"time": ("time", times_s, {"units": "s"})}
    return xr.Dataset(signals, coords=clock, attrs={"file": path.name})
