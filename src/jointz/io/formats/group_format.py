"""Columns of a study from formats that hold groups of signals: C3D, XDF, OpenSim, workbooks."""

import difflib
from abc import ABC, abstractmethod
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from jointz.core.acquisition import Acquisition, Signal, SignalGroup
from jointz.core.errors import DataError
from jointz.core.study import FilesSpec
from jointz.io.formats.columns import (
    RawTable,
    TableRequest,
    file_error,
    make_table,
    missing_columns,
)

#: Column that holds the clock of a group, in seconds, where no signal has this name.
TIME = "time"

#: Group, and signal in it; None for its clock.
Place = tuple[SignalGroup, Signal | None]


class GroupFormat(ABC):
    """A format whose columns are picked from all that its file holds.

    A column is a signal by name, or ``group/signal`` where two groups have one of that name.
    ``time``, or ``group/time``, is the clock of the group, in seconds or in the unit that a study
    says where the file says none; it goes by the name of its column in the file, too.
    """

    name: str

    @abstractmethod
    def read(self, path: Path, files: FilesSpec) -> Acquisition:
        """Return all that a file holds."""

    def read_columns(self, path: Path, request: TableRequest) -> RawTable:
        """Return the requested signals, which must have been sampled together."""
        content = self.read(path, request.files)
        several = request.several_clocks
        places = _places(path, content, [str(c) for c in request.columns], several=several)
        if TIME not in places:  # of one of several clocks, which the file knows
            request = replace(request, numeric=tuple(c for c in request.numeric if c != TIME))
        units = {c: unit for c, place in places.items() if (unit := _unit(*place))}
        return make_table(
            path,
            request,
            lambda c: _values(*places[c]),
            units,
            labels=lambda c: _labels(_values(*places[c])),
            as_written=request.as_written,
            clocks=_clocks(places) if several else {},
        )

    def list_columns(self, path: Path, files: FilesSpec) -> list[str]:
        """Return all names of signals, the shortest of each first.

        ``time`` is among them where several groups have a clock, and so is what the file calls
        the columns of their clocks: it is that of the group that the other columns are in.
        """
        content = self.read(path, files)
        short = _short_names(content)
        clocks = [TIME] if any(name.endswith(f"/{TIME}") for name in short) else []
        time_columns = [group.time_column for group in content.groups if group.time_column]
        names = [*clocks, *short, *_full_names(content), *time_columns, *_clock_names(content)]
        return list(dict.fromkeys(names))


def study_columns(content: Acquisition) -> dict[tuple[str, str], str]:
    """Return what a study calls the signals of a file, and the clocks of its groups."""
    return {
        (group.name, TIME if signal is None else signal.name): column
        for column, (group, signal) in _short_names(content).items()
    }


def _short_names(content: Acquisition) -> dict[str, Place]:
    """Return all columns by the shortest name that leads to one alone."""
    columns = _columns(content)
    counts = Counter(name for _, name, _ in columns)
    places: dict[str, Place] = {}
    for group, name, signal in columns:
        short = name if counts[name] == 1 or not group.name else f"{group.name}/{name}"
        places.setdefault(short, (group, signal))
    return places


def _full_names(content: Acquisition) -> dict[str, Place]:
    return {f"{g.name}/{name}": (g, signal) for g, name, signal in _columns(content) if g.name}


def _clock_names(content: Acquisition) -> dict[str, Place]:
    """Return the clocks by what the file calls their columns, where nothing else is called so."""
    clocks = [(group, group.time_column) for group in content.groups if group.time_column]
    counts = Counter([*(name for _, name in clocks), *(name for _, name, _ in _columns(content))])
    places: dict[str, Place] = {f"{g.name}/{name}": (g, None) for g, name in clocks if g.name}
    return places | {name: (group, None) for group, name in clocks if counts[name] == 1}


def _columns(content: Acquisition) -> list[tuple[SignalGroup, str, Signal | None]]:
    columns: list[tuple[SignalGroup, str, Signal | None]] = []
    for group in content.groups:
        names = [signal.name for signal in group.signals]
        if TIME not in names and group.times_s() is not None:
            columns.append((group, TIME, None))
        columns += [(group, signal.name, signal) for signal in group.signals]
    return columns


def _places(
    path: Path, content: Acquisition, names: Sequence[str], *, several: bool = False
) -> dict[str, Place]:
    """Find the columns; ``time`` is the clock of the group that the others are in.

    Where they may be of ``several`` clocks and are, it is none of them, and left out.
    """
    short = _short_names(content)
    full = {**_clock_names(content), **_full_names(content)}
    known = {**full, **short}
    places = {name: known[name] for name in names if name in known}
    groups = {id(group): group for group, _ in places.values()}
    if len(groups) == 1:
        (group,) = groups.values()
        clocks = {name: known.get(f"{group.name}/{name}") for name in (TIME, group.time_column)}
        places |= {
            n: place for n, place in clocks.items() if place and n in names and n not in places
        }
    missing = [name for name in names if name not in places]
    if several and len(groups) > 1:
        missing = [name for name in missing if name != TIME]
    if missing:
        raise _missing(path, missing, list(short), list(full))
    if not several:
        _check_together(path, places)
    return places


def _clocks(places: Mapping[str, Place]) -> dict[str, np.ndarray]:
    """Return the times of each column, s; groups with the same clock have the same array."""
    known: list[tuple[SignalGroup, np.ndarray]] = []
    clocks = {}
    for column, (group, _) in places.items():
        times = next((t for other, t in known if _same_clock(other, group)), group.times_s())
        if times is not None:
            known.append((group, times))
            clocks[column] = times
    return clocks


def _check_together(path: Path, places: Mapping[str, Place]) -> None:
    """Refuse columns whose samples were not taken at the same times."""
    groups = {id(group): group for group, _ in places.values()}
    first, *others = groups.values()
    if all(_same_clock(first, group) for group in others):
        return
    members = {
        key: ", ".join(name for name, (group, _) in places.items() if id(group) == key)
        for key in groups
    }
    clocks = "; ".join(f"{members[key]}: {_clock(group)}" for key, group in groups.items())
    raise file_error(
        path,
        f"columns of one table must be sampled together, found {clocks}. Name columns of one "
        "group; a study (study.toml) may have channels of several.",
    )


def _same_clock(a: SignalGroup, b: SignalGroup) -> bool:
    times, other_times = a.times_s(), b.times_s()
    if times is None or other_times is None:
        return times is other_times and a.n_samples == b.n_samples
    return np.array_equal(times, other_times)


def _clock(group: SignalGroup) -> str:
    clock = f"{group.rate_hz:g} Hz" if group.rate_hz else "time stamps of its own"
    clock = clock if group.times_s() is not None else "no clock"
    start = "" if group.rate_hz is None else f" from {group.start_s:g} s"
    return f"{group.n_samples} samples at {clock}{start} (group '{group.name}')"


def _missing(
    path: Path, missing: Sequence[str], short: Sequence[str], full: Sequence[str]
) -> DataError:
    """Return the error for names that lead nowhere, or to several groups."""
    hints = []
    for name in missing:
        several = [place for place in full if place.endswith(f"/{name}")]
        if len(several) > 1:
            hints.append(f"'{name}' is in several groups: name {' or '.join(several)}.")
        elif not several and f"{name}.x" in short:
            hints.append(f"'{name}' is a point: name '{name}.x', '{name}.y' or '{name}.z'.")
    close = any(difflib.get_close_matches(name, short, n=1) for name in missing)
    hint = " ".join(hints) or ("" if close else "Correct the column's name.")
    return missing_columns(path, missing, short, hint)


def _values(group: SignalGroup, signal: Signal | None) -> np.ndarray:
    if signal is not None:
        return signal.values
    times = group.times_s()
    return np.zeros(0) if times is None else times


def _labels(values: np.ndarray) -> np.ndarray:
    if values.dtype.kind != "O":
        return values
    return np.array([text if text else None for text in values], dtype=object)


def _unit(group: SignalGroup, signal: Signal | None) -> str:
    if signal is not None:
        return signal.unit
    return "s" if group.time_unit_stated else ""
