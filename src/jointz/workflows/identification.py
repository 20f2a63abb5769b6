"""Identify one recording that stands in a file by itself."""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from jointz.core.channels import CHANNEL_UNITS
from jointz.core.errors import DataError, UnitError
from jointz.core.joint_fit import JointFit
from jointz.core.study import FilesSpec
from jointz.identify.joint import identify_joint
from jointz.io.registry import list_columns, read_table
from jointz.io.units import conversion


@dataclass(frozen=True, slots=True)
class Column:
    """A column of a file and its unit.

    Parameters
    ----------
    name : str
        The column.
    unit : str
        As written; SI where nothing was.
    """

    name: str
    unit: str


def parse_column(text: str, channel: str, columns: list[str] | None = None) -> Column:
    """Read ``COL[:unit]``.

    Parameters
    ----------
    text : str
        As on the command line.
    channel : str
        ``time``, ``angle``, ``torque`` or ``command``; says what is measured.
    columns : list of str, optional
        Columns of the file: a name that holds a colon is then understood.

    Returns
    -------
    Column
        SI where no unit is given.

    Raises
    ------
    UnitError
        When the unit cannot be read or measures something else.

    Examples
    --------
    >>> parse_column("knee_angle:deg", "angle")
    Column(name='knee_angle', unit='deg')
    """
    si_unit = CHANNEL_UNITS[channel][0]
    if columns is not None and text in columns:
        return Column(text, si_unit)
    name, colon, unit = text.rpartition(":")
    if not colon:
        return Column(text, si_unit)
    try:
        conversion(unit, si_unit)
    except UnitError as exc:
        raise UnitError(f"--{channel} {text}: {exc}", channel=channel) from exc
    return Column(name, unit)


def identify_joint_file(
    file: Path,
    columns: Mapping[str, str],
    *,
    files: Mapping[str, Any] | None = None,
    rate_hz: float | None = None,
    **settings: Any,
) -> tuple[JointFit, dict[str, Column]]:
    """Identify a joint from one time series in a file.

    Parameters
    ----------
    file : pathlib.Path
        Any format jointz reads.
    columns : mapping of str to str
        ``angle``, ``torque`` and, where there are, ``time`` and ``command`` ->
        ``COL[:unit]``.
    files : mapping, optional
        Layout of a text file: ``delimiter``, ``decimal``, ``skip_rows``, ``header``
        as under ``[files]`` of a study; without a header a column is a number.
    rate_hz : float, optional
        Where the file has no time column.
    **settings : Any
        ``model``, ``estimator``, ``input``, ``cutoff_hz``, ``torque_acts_on``
        of :func:`jointz.identify_joint`.

    Returns
    -------
    fit : JointFit
        The result.
    columns : dict of str to Column
        The columns as they were understood.

    Raises
    ------
    DataError
        When the file or a column cannot be used.
    """
    if ("time" in columns) == (rate_hz is not None):
        raise DataError("Give either --time COL[:unit] or --rate HZ, one of them.")
    layout = FilesSpec.model_validate(files or {})
    there = list_columns(file, layout) if file.is_file() else None
    parsed = {name: parse_column(text, name, there) for name, text in columns.items()}
    wanted = [_key(column, layout) for column in parsed.values()]
    table = read_table(file, numeric=wanted, files=layout)
    signals: dict[str, np.ndarray] = {}
    for name, column in parsed.items():
        factor, offset = conversion(column.unit, CHANNEL_UNITS[name][0])
        signals[name] = factor * np.asarray(table.columns[column.name], dtype=float) + offset
    fit = identify_joint(signals, rate_hz=rate_hz, **settings)
    return fit, parsed


def _key(column: Column, layout: FilesSpec) -> str | int:
    """Return how the readers know a column: by its name, or by number without a header."""
    if layout.header:
        return column.name
    if not column.name.isdecimal():
        raise DataError(f"{column.name}: without a header a column is a number, from 1.")
    return int(column.name)
