"""Columns of a study out of files that hold groups of signals: C3D, XDF, OpenSim, workbooks."""

import difflib
from collections import Counter
from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np

from jointz.core.acquisition import Acquisition, Signal, SignalGroup
from jointz.core.errors import DataError
from jointz.core.study import FilesSpec
from jointz.io.column_readers import (
    RawTable,
    TableRequest,
    file_sha256,
    label_column,
    missing_columns,
    number_column,
    register_reader,
)
from jointz.io.formats.registry import read_acquisition

#: Column that holds the clock of a group, in seconds, where no signal has this name.
TIME = "time"

SUFFIXES = (".c3d", ".xdf", ".mot", ".sto", ".xlsx")

#: Group, and signal in it; None for its clock.
Place = tuple[SignalGroup, Signal | None]


@register_reader(*SUFFIXES)
class AcquisitionReader:
    """Reads signals by name, or by ``group/signal`` where two groups have one of that name.

    ``time``, or ``group/time``, is the clock of the group, in seconds or in the unit that a study
    says where the file says none; it goes by the name of its column in the file, too.
    """

    def read(self, path: Path, request: TableRequest) -> RawTable:
        """Return the wanted signals, which must have been sampled together."""
        content = read_acquisition(path, request.files)
        places = _places(path, content, [str(c) for c in request.columns])
        columns = {}
        for c in map(str, request.numeric):
            columns[c] = number_column(path, c, _values(*places[c]))
        for c in map(str, request.labels):
            written = request.as_written
            columns[c] = label_column(path, c, _labels(*places[c]), as_written=written)
        units = {c: unit for c, place in places.items() if (unit := _unit(*place))}
        return RawTable(columns, units, file_sha256(path))

    def list_columns(self, path: Path, files: FilesSpec) -> list[str]:
        """Return all names by which signals can be asked for, the shortest of each first.

        ``time`` is among them where several groups have a clock, and so is what the file calls
        the columns of their clocks: it is that of the group that the other columns are in.
        """
        content = read_acquisition(path, files)
        short = list(_short_names(content))
        clocks = [TIME] if any(name.endswith(f"/{TIME}") for name in short) else []
        own = [group.time_column for group in content.groups if group.time_column]
        full = [*_full_names(content), *own, *_own_clocks(content)]
        return list(dict.fromkeys([*clocks, *short, *full]))


def study_columns(content: Acquisition) -> dict[tuple[str, str], str]:
    """Return what a study calls the signals of a file, and the clocks of its groups."""
    return {
        (group.name, TIME if signal is None else signal.name): column
        for column, (group, signal) in _short_names(content).items()
    }


def _short_names(content: Acquisition) -> dict[str, Place]:
    """Return all columns by the shortest name that leads to one alone."""
    every = _every(content)
    counts = Counter(name for _, name, _ in every)
    found: dict[str, Place] = {}
    for group, name, signal in every:
        short = name if counts[name] == 1 or not group.name else f"{group.name}/{name}"
        found.setdefault(short, (group, signal))
    return found


def _full_names(content: Acquisition) -> dict[str, Place]:
    every = _every(content)
    return {f"{g.name}/{name}": (g, signal) for g, name, signal in every if g.name}


def _own_clocks(content: Acquisition) -> dict[str, Place]:
    """Return the clocks by what the file calls their columns, where nothing else is called so."""
    clocks = [(group, group.time_column) for group in content.groups if group.time_column]
    counts = Counter([*(name for _, name in clocks), *(name for _, name, _ in _every(content))])
    found: dict[str, Place] = {}
    for group, name in clocks:
        if group.name:
            found[f"{group.name}/{name}"] = (group, None)
        if counts[name] == 1:
            found[name] = (group, None)
    return found


def _every(content: Acquisition) -> list[tuple[SignalGroup, str, Signal | None]]:
    every: list[tuple[SignalGroup, str, Signal | None]] = []
    for group in content.groups:
        names = [signal.name for signal in group.signals]
        if TIME not in names and group.times_s() is not None:
            every.append((group, TIME, None))
        every += [(group, signal.name, signal) for signal in group.signals]
    return every


def _places(path: Path, content: Acquisition, names: Sequence[str]) -> dict[str, Place]:
    """Find the columns; ``time`` is the clock of the group that the others are in."""
    short = _short_names(content)
    full = {**_own_clocks(content), **_full_names(content)}
    known = {**full, **short}
    found = {name: known[name] for name in names if name in known}
    groups = {id(group): group for group, _ in found.values()}
    if len(groups) == 1:
        (group,) = groups.values()
        clocks = {name: known.get(f"{group.name}/{name}") for name in (TIME, group.time_column)}
        found |= {n: own for n, own in clocks.items() if own and n in names and n not in found}
    missing = [name for name in names if name not in found]
    if missing:
        raise _not_there(path, missing, list(short), list(full))
    _check_together(path, found)
    return {name: found[name] for name in names}


def _check_together(path: Path, places: Mapping[str, Place]) -> None:
    """Refuse columns whose samples were not taken at the same times."""
    by_group: dict[int, tuple[SignalGroup, list[str]]] = {}
    for name, (group, _) in places.items():
        by_group.setdefault(id(group), (group, []))[1].append(name)
    groups = list(by_group.values())
    if all(_same_clock(groups[0][0], group) for group, _ in groups[1:]):
        return
    found = "; ".join(f"{', '.join(names)}: {_told(group)}" for group, names in groups)
    raise DataError(
        f"{path.name}: columns of one table must be sampled together, found {found}. Name columns "
        "of one group, or bring them to one rate before: jointz interpolates nothing.",
        path=str(path),
    )


def _same_clock(a: SignalGroup, b: SignalGroup) -> bool:
    one, other = a.times_s(), b.times_s()
    if one is None or other is None:
        return one is other and a.n_samples == b.n_samples
    return np.array_equal(one, other)


def _told(group: SignalGroup) -> str:
    clock = f"{group.rate_hz:g} Hz" if group.rate_hz else "time stamps of its own"
    clock = clock if group.times_s() is not None else "no clock"
    start = "" if group.rate_hz is None else f" from {group.start_s:g} s"
    return f"{group.n_samples} samples at {clock}{start} (group '{group.name}')"


def _not_there(
    path: Path, missing: Sequence[str], short: Sequence[str], full: Sequence[str]
) -> DataError:
    """Make the error for names that lead nowhere, or to several groups."""
    hints = []
    for name in missing:
        several = [place for place in full if place.endswith(f"/{name}")]
        if len(several) > 1:
            hints.append(f"'{name}' is in several groups: name {' or '.join(several)}.")
        elif not several and f"{name}.x" in short:
            hints.append(f"'{name}' is a point: name '{name}.x', '{name}.y' or '{name}.z'.")
    close = [n for n in missing if difflib.get_close_matches(n, short, n=1)]
    hint = " ".join(hints) or ("" if close else "Correct the column's name.")
    return missing_columns(path, missing, short, hint)


def _values(group: SignalGroup, signal: Signal | None) -> np.ndarray:
    if signal is not None:
        return signal.values
    times = group.times_s()
    return np.zeros(0) if times is None else times


def _labels(group: SignalGroup, signal: Signal | None) -> np.ndarray:
    values = _values(group, signal)
    if values.dtype.kind == "O":
        return np.array([text if text else None for text in values], dtype=object)
    return values


def _unit(group: SignalGroup, signal: Signal | None) -> str:
    if signal is not None:
        return signal.unit
    return "s" if group.time_unit_stated else ""
