"""Parts of one file that hold a recording each: fields of a struct, its elements, sheets."""

import re
from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import combinations

import numpy as np

from jointz.inspection.content import Column, Content
from jointz.inspection.names import channel_scores, is_of_strikes, words_of
from jointz.io.study_files import PART

_SEPARATOR = re.compile(r"([./])")
_FEWEST_COLUMNS = 2
_SHORTEST_SERIES = 100  # samples of a recording
_AXES = ("x", "y", "z")  # of a point: no parts
_POINTS = tuple(f"{PART}.{axis}" for axis in _AXES)  # nor are points


@dataclass(frozen=True, slots=True, eq=False)
class FilePart:
    """A part of a file: its name in a study, and its columns, whose names hold for all parts."""

    name: str
    content: Content
    pulses: tuple[Column, ...] = ()  # short series beside those of the recording
    texts: tuple[str, ...] = ()  # what the file says of the part
    mass_kg: float | None = None


def parts_of(content: Content) -> tuple[FilePart, ...]:
    """Return the parts of a file whose columns differ in one place of their names; else none."""
    series = [c for c in content.columns if _is_series(c)]
    tokens = {id(c): _SEPARATOR.split(str(c.key)) for c in series}
    longest = max((len(t) for t in tokens.values()), default=0)
    ends = [*range(0, longest, 2)]
    places = [(k, k + 1) for k in ends] + [(-k - 1, -k or None) for k in ends]
    places += [(a, b + 1) for a, b in combinations(ends, 2)]
    splits = [(place, found) for place in places if (found := _split(series, tokens, place))]
    if not splits:
        return ()
    # The first of equals; a part that holds two recordings has fewer parts than one of each.
    place, best = max(splits, key=lambda split: (_n_channels(split[1]), len(split[1])))
    return tuple(_part(content, name, columns, place, len(best)) for name, columns in best.items())


def _is_series(column: Column) -> bool:
    """Return whether a column may hold samples of a recording, no times of events."""
    return column.values.size >= _SHORTEST_SERIES and not is_of_strikes(str(column.key))


def _n_channels(parts: dict[str, list[Column]]) -> int:
    """Return how many channels the names of a part's columns are like."""
    first = next(iter(parts.values()))
    return len({channel for c in first for channel in channel_scores(words_of(str(c.key)))})


def _split(
    series: Sequence[Column], tokens: dict[int, list[str]], place: tuple[int, int | None]
) -> dict[str, list[Column]]:
    """Return the columns of each part if all parts have the same ones, else nothing."""
    parts: dict[str, list[Column]] = {}
    for column in series:
        name, pattern = _apart(tokens[id(column)], place)
        if not name or name in _AXES or pattern in _POINTS:
            return {}
        parts.setdefault(name, []).append(replace(column, key=pattern, title=""))
    keys = [[c.key for c in columns] for columns in parts.values()]
    alike = len(keys) > 1 and all(sorted(map(str, k)) == sorted(map(str, keys[0])) for k in keys)
    return parts if alike and len(keys[0]) >= _FEWEST_COLUMNS else {}


def _apart(own: list[str], place: tuple[int, int | None]) -> tuple[str, str]:
    """Return the part in the name of a column, and the name for all parts; "" where it has none."""
    start, stop = slice(*place).indices(len(own))[:2]
    if len(own) < _FEWEST_COLUMNS:
        return "", ""
    return "".join(own[start:stop]), "".join([*own[:start], PART, *own[stop:]])


def _part(
    content: Content,
    name: str,
    columns: Sequence[Column],
    place: tuple[int, int | None],
    n_parts: int,
) -> FilePart:
    groups = {c.group for c in columns}
    clocks = tuple(c for c in content.clocks if c.group in groups)
    short = [c for c in content.columns if not _is_series(c)]
    apart = [(c, *_apart(_SEPARATOR.split(str(c.key)), place)) for c in short]
    pulses = tuple(replace(c, key=key, title="") for c, own, key in apart if own == name)
    texts, mass_kg = [], None
    for column in short if name.isdecimal() else ():  # a field of each element of a struct array
        if column.values.size == n_parts and int(name) <= n_parts:
            value = column.values[int(name) - 1]
            if column.is_text:
                texts.append(str(value))
            elif "mass" in words_of(str(column.key)).found and np.isfinite(value):
                mass_kg = float(value)
    whole = replace(content, columns=tuple(columns), clocks=clocks)
    return FilePart(name, whole, pulses, tuple(texts), mass_kg)
