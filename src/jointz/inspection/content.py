"""All columns of a file of any format."""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from jointz.core.acquisition import Acquisition, Signal, SignalGroup
from jointz.core.errors import DataError
from jointz.core.study import FilesSpec
from jointz.io.file_kinds import missing_file
from jointz.io.formats.columns import RawTable, TableRequest
from jointz.io.formats.group_format import TIME, GroupFormat, study_columns
from jointz.io.formats.memory_limit import NUMBER_BYTES, PACKED, check_unpacked
from jointz.io.formats.registry import TEXT_SUFFIXES, format_of, read_acquisition, read_table
from jointz.io.text.clock_times import CLOCK_TEXT, seconds_of_clock
from jointz.io.text.column_names import CLOCK_COLUMN, READING, time_column_key, time_unit_key
from jointz.io.text.delimited import as_written_with_point, stray_cells
from jointz.io.text.recorder_exports import recorder_of
from jointz.io.text.text_layout import TextLayout, find_layout
from jointz.io.text.vendor_logs import with_vendor_units

_LEAST_SHARE = 0.5
#: Pulses, strides and the direction of torque are guessed from the first samples, 83 min at 1 kHz.
GUESSED_SAMPLES = 5_000_000
#: Arrays as long as the recording (measured): while its clock is inspected, while guesses are made.
_CLOCK_ARRAYS, _GUESS_ARRAYS = 8, 16


@dataclass(frozen=True, slots=True, eq=False)
class Column:
    """A column of a file."""

    group: str  # group of signals that were sampled together; "" for the only one
    key: str | int  # name in a study, or number from 1
    title: str  # name in the file, "" if there is none
    values: np.ndarray  # float64, or str objects
    unit: str = ""  # as in the file; "" if not stated
    stray: str = ""  # message about a cell that is not a number, "" if there is none
    unit_why: str = ""  # source of the unit, "" if the file states it

    @property
    def is_text(self) -> bool:
        """Whether it holds text."""
        return self.values.dtype.kind == "O"


@dataclass(frozen=True, slots=True, eq=False)
class GroupClock:
    """The clock that a file states for a group."""

    group: str
    n: int  # number of samples
    rate_hz: float | None = None  # rate of a uniform clock; None without
    start_s: float = 0.0  # time of the first sample on a uniform clock
    time_s: np.ndarray | None = None  # time stamps, (n,); None without
    unit_stated: bool = True  # whether the file states the unit of the stamps


@dataclass(frozen=True, slots=True, eq=False)
class Content:
    """Content of a file."""

    columns: tuple[Column, ...]  # in the order of the file
    clocks: tuple[GroupClock, ...]  # one for each group
    events: tuple[str, ...] = ()  # label of each
    files: FilesSpec | None = None  # layout of a text file; None for other formats
    notes: tuple[str, ...] = ()  # decisions of the reader
    mass_kg: float | None = None  # of the person, stated in a line above a table
    above: tuple[str, ...] = ()  # lines above a table
    singles: Mapping[str, str] = field(default_factory=dict)  # values beside the series, by name


def read_content(path: Path, layout: Mapping[str, Any] | None = None) -> Content:
    """Read all columns of a file; unknown parts of a text file's layout are detected."""
    if not path.is_file():
        raise DataError(missing_file(path, "Correct the name."), path=str(path))
    is_text = path.name.lower().endswith(TEXT_SUFFIXES)
    if is_text and (layout or not recorder_of(path, FilesSpec())):
        content = _text_content(path, find_layout(path, layout))
    else:
        files = FilesSpec.model_validate(layout or {})
        content = _content(path, read_acquisition(path, files))
        content = replace(content, files=files if files.decimal != "." else None)
    if path.name.lower().endswith(PACKED):
        _check_work(path, content)
    return content


def _check_work(path: Path, content: Content) -> None:
    """Refuse a packed file if its content and the inspection together exceed the memory limit."""
    held = sum(NUMBER_BYTES * np.size(column.values) for column in content.columns)
    n = max((clock.n for clock in content.clocks), default=0)
    work = max(_CLOCK_ARRAYS * n, _GUESS_ARRAYS * min(n, GUESSED_SAMPLES))
    check_unpacked(path, held + NUMBER_BYTES * work)


def _text_content(path: Path, layout: TextLayout) -> Content:
    keys = [int(c) if not layout.files.header else c for c in layout.columns]
    table, refused = _read(path, keys, layout.files)
    units = layout.units or ("",) * len(keys)
    stated = []
    for key, title, unit in zip(keys, layout.names, units, strict=True):
        cells = table.columns[str(key)]
        values = _numbers(cells, layout.files.decimal)
        is_clock = cells.dtype.kind == "O" and values.dtype.kind == "f" and ":" in str(cells[0])
        stated.append(Signal(title or str(key), values, CLOCK_TEXT if is_clock else unit))
    signals, log = with_vendor_units(stated)
    columns = tuple(
        Column(
            "", key, "" if key == title else title, signal.values, signal.unit,
            "" if signal.is_text or signal.unit == CLOCK_TEXT else refused.get(key, ""),
            f"by the documentation of {log}" if signal.unit != own.unit else "",
        )
        for key, title, signal, own in zip(keys, layout.names, signals, stated, strict=True)
    )  # fmt: skip
    clock = GroupClock("", len(columns[0].values) if columns else 0, layout.rate_hz)
    strays = [c.stray for c in columns if c.stray]
    more = [f"({len(strays)} columns hold such cells.)"] if len(strays) > 1 else []
    text = f"taken for a log of {log}: units that it does not state are by its documentation."
    notes = (*layout.notes, text if log else "", " ".join([*strays[:1], *more]))
    notes = tuple(n for n in notes if n)
    above = layout.above[:-1] if layout.files.header else ()
    return Content(
        columns, (clock,), files=layout.files, notes=notes, mass_kg=layout.mass_kg, above=above
    )


def _read(
    path: Path, keys: list[str | int], files: FilesSpec
) -> tuple[RawTable, dict[str | int, str]]:
    """Read all columns, as text if a cell is no number; return messages about such cells, too."""
    refused: dict[str | int, str] = {}
    while True:
        numbers = [k for k in keys if k not in refused]
        try:
            return read_table(path, numeric=numbers, labels=tuple(refused), files=files), refused
        except DataError as exc:
            key = next((k for k in numbers if exc.channel == str(k)), None)
            if key is None or exc.row is None or "expected a number" not in str(exc):
                raise
            # All such columns in one pass: to read again for each takes minutes of wide tables.
            refused |= stray_cells(path, TableRequest(tuple(numbers), files=files))
            refused.setdefault(key, str(exc))


def _numbers(cells: np.ndarray, decimal: str) -> np.ndarray:
    """Return text that is mostly numbers, or times of day, as numbers, NaN for other cells."""
    if cells.dtype.kind != "O":
        return cells
    if cells.size and np.isfinite(clock := seconds_of_clock(cells)).mean() > _LEAST_SHARE:
        return clock
    points = [as_written_with_point(str(cell), decimal) for cell in cells]
    numbers = pd.to_numeric(pd.Series(points, dtype=object), errors="coerce")
    n_filled = int(sum(bool(cell) for cell in cells))
    few = int(numbers.notna().sum()) <= _LEAST_SHARE * n_filled
    return cells if not n_filled or few else numbers.to_numpy(dtype=float)


def _content(path: Path, content: Acquisition) -> Content:
    names = study_columns(content) if isinstance(format_of(path), GroupFormat) else None
    columns = tuple(c for group in content.groups for c in _columns(group, content.metadata, names))
    # The unit of stamps without a stated unit is guessed later, not taken for seconds.
    left = {time_unit_key(group.name) for group in content.groups}
    notes = tuple(
        text
        for key, text in content.metadata.items()
        if key.startswith(READING) and key not in left
    )
    clocks = tuple(
        GroupClock(g.name, g.n_samples, g.rate_hz, g.start_s, g.time_s, g.time_unit_stated)
        for g in content.groups
    )
    events = tuple(event.label for event in content.events)
    singles = {k: text for k, text in content.metadata.items() if not k.startswith(READING)}
    return Content(columns, clocks, events=events, notes=notes, singles=singles)


def _columns(
    group: SignalGroup, metadata: Mapping[str, str], names: Mapping[tuple[str, str], str] | None
) -> list[Column]:
    """Return the columns of a group under their keys in a study."""
    keys = [
        s.column or s.name if names is None else names.get((group.name, s.name), s.name)
        for s in group.signals
    ]
    columns = [
        Column(group.name, key, s.name if s.name != key else "", s.values, s.unit)
        for key, s in zip(keys, group.signals, strict=True)
    ]
    times = group.times_s()
    if times is None or (group.time_s is None and not group.start_s):
        return columns  # the rate describes a clock that starts at 0
    title = metadata.get(time_column_key(group.name), CLOCK_COLUMN)
    own = group.time_column or title
    key = own if names is None else names.get((group.name, TIME), TIME)
    shown = title if title != key else ""
    clock = Column(group.name, key, shown, times, "s" if group.time_unit_stated else "")
    return [clock, *columns] if key not in keys else columns
