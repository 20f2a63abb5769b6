"""All columns of a file of any format, for looking at them."""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from jointz.core.acquisition import Acquisition, Signal, SignalGroup
from jointz.core.errors import DataError
from jointz.core.study import FilesSpec
from jointz.io.column_names import CLOCK_COLUMN, is_time, time_column_key
from jointz.io.registry import RawTable, read_table
from jointz.io.text_layout import TextLayout, find_layout
from jointz.io.vendor_logs import with_vendor_units

_MOSTLY = 0.5
_TEXT = (".csv", ".csv.gz", ".tsv", ".tsv.gz", ".txt", ".txt.gz")


@dataclass(frozen=True, slots=True, eq=False)
class Column:
    """A column as it stands in a file.

    Parameters
    ----------
    group : str
        Signals that were sampled together; "" for the only group.
    key : str or int
        What a study calls it: a name, or a number from 1.
    title : str
        What the file calls it, "" where it does not.
    values : (n,) array
        float64, or str objects.
    unit : str
        As the file states it.
    stray : str
        Why a study would refuse the column: a cell that is no number; "" where none is.
    """

    group: str
    key: str | int
    title: str
    values: np.ndarray
    unit: str = ""
    stray: str = ""

    @property
    def is_text(self) -> bool:
        """Whether it holds text."""
        return self.values.dtype.kind == "O"


@dataclass(frozen=True, slots=True, eq=False)
class GroupClock:
    """The clock that a file itself states for a group.

    Parameters
    ----------
    group : str
        Whose.
    n : int
        Samples.
    rate_hz : float or None
        Of a uniform clock.
    time_s : (n,) array or None
        Stamps.
    """

    group: str
    n: int
    rate_hz: float | None = None
    time_s: np.ndarray | None = None


@dataclass(frozen=True, slots=True, eq=False)
class Content:
    """What a file holds.

    Parameters
    ----------
    columns : tuple of Column
        In the order of the file.
    clocks : tuple of GroupClock
        One a group.
    n_events : int
        Events.
    files : FilesSpec or None
        Layout of a text file.
    notes : tuple of str
        What had to be decided.
    """

    columns: tuple[Column, ...]
    clocks: tuple[GroupClock, ...]
    n_events: int = 0
    files: FilesSpec | None = None
    notes: tuple[str, ...] = ()


def read_content(path: Path, given: Mapping[str, Any] | None = None) -> Content:
    """Read all columns of a file; the layout of a text file is found out.

    Parameters
    ----------
    path : pathlib.Path
        The file.
    given : mapping, optional
        Fields of ``[files]`` that are known.

    Raises
    ------
    DataError
        When it is missing, unknown or damaged.
    """
    if not path.is_file():
        raise DataError(
            f"{path}: no such file. Correct the name or bring the file.", path=str(path)
        )
    if path.name.lower().endswith(_TEXT):
        return _text_content(path, find_layout(path, given))
    from jointz.io.formats import read_acquisition

    return _content(read_acquisition(path))


def _text_content(path: Path, layout: TextLayout) -> Content:
    keys = [int(c) if not layout.files.header else c for c in layout.columns]
    table, refused = _read(path, keys, layout.files)
    units = layout.units or ("",) * len(keys)
    signals, log = with_vendor_units(
        [
            Signal(title or str(key), _numbers(table.columns[str(key)]), unit)
            for key, title, unit in zip(keys, layout.names, units, strict=True)
        ]
    )
    columns = tuple(
        _text_column(key, title, signal, refused.get(key, ""))
        for key, title, signal in zip(keys, layout.names, signals, strict=True)
    )
    clock = GroupClock("", len(columns[0].values) if columns else 0)
    strays = [c.stray for c in columns if c.stray]
    more = [f"({len(strays)} columns hold such cells.)"] if len(strays) > 1 else []
    notes = (*layout.notes, *([log] if log else []), " ".join([*strays[:1], *more]))
    return Content(columns, (clock,), files=layout.files, notes=tuple(n for n in notes if n))


def _text_column(key: str | int, title: str, signal: Signal, refused: str) -> Column:
    stray = "" if signal.is_text else refused
    own = "" if key == title else title
    return Column("", key, own, signal.values, signal.unit, stray)


def _read(
    path: Path, keys: list[str | int], files: FilesSpec
) -> tuple[RawTable, dict[str | int, str]]:
    """Read every column, as text where a cell is no number; with what was said of that cell."""
    refused: dict[str | int, str] = {}
    while True:
        numbers = [k for k in keys if k not in refused]
        try:
            return read_table(path, numeric=numbers, labels=tuple(refused), files=files), refused
        except DataError as exc:
            key = next((k for k in numbers if exc.channel == str(k)), None)
            if key is None or exc.row is None or "expected a number" not in str(exc):
                raise
            refused[key] = str(exc)


def _numbers(cells: np.ndarray) -> np.ndarray:
    """Return text that is mostly numbers as numbers, NaN for the cells that are none."""
    if cells.dtype.kind != "O":
        return cells
    numbers = pd.to_numeric(pd.Series(cells, dtype=object), errors="coerce")
    there = int(sum(bool(cell) for cell in cells))
    few = int(numbers.notna().sum()) <= _MOSTLY * there
    return cells if not there or few else numbers.to_numpy(dtype=float)


def _content(content: Acquisition) -> Content:
    columns = tuple(c for group in content.groups for c in _columns(group, content.metadata))
    clocks = tuple(GroupClock(g.name, g.n_samples, g.rate_hz, g.time_s) for g in content.groups)
    return Content(columns, clocks, n_events=len(content.events))


def _columns(group: SignalGroup, metadata: Mapping[str, str]) -> list[Column]:
    columns = [Column(group.name, s.name, "", s.values, s.unit) for s in group.signals]
    if group.time_s is not None and not any(is_time(s.name) for s in group.signals):
        name = metadata.get(time_column_key(group.name), CLOCK_COLUMN)
        columns.insert(0, Column(group.name, name, "", group.time_s, "s"))
    return columns
