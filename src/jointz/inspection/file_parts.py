"""Parts of one file that hold a recording each: fields of a struct, its elements, sheets."""

import re
from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import combinations

from jointz.inspection.content import Column, Content
from jointz.inspection.names import channel_scores, words_of
from jointz.io.study_files import PART

_SEPARATOR = re.compile(r"([./])")
_FEWEST_COLUMNS = 2
_SHORTEST_SERIES = 100  # samples of a recording


@dataclass(frozen=True, slots=True, eq=False)
class FilePart:
    """A part of a file: its name in a study, and its columns, whose names hold for all parts."""

    name: str
    content: Content


def parts_of(content: Content) -> tuple[FilePart, ...]:
    """Return the parts of a file whose columns differ in one place of their names; else none."""
    series = [c for c in content.columns if c.values.size >= _SHORTEST_SERIES]
    tokens = {id(c): _SEPARATOR.split(str(c.key)) for c in series}
    longest = max((len(t) for t in tokens.values()), default=0)
    ends = [*range(0, longest, 2)]
    places = [(k, k + 1) for k in ends] + [(-k - 1, -k or None) for k in ends]
    places += [(a, b + 1) for a, b in combinations(ends, 2)]
    splits = [found for place in places if (found := _split(series, tokens, place))]
    best = max(splits, key=_n_channels, default={})  # the first of equals
    return tuple(_part(content, name, columns) for name, columns in best.items())


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
        own = tokens[id(column)]
        start, stop = slice(*place).indices(len(own))[:2]
        name = "".join(own[start:stop])
        if not name or len(own) < 2:
            return {}
        pattern = "".join([*own[:start], PART, *own[stop:]])
        parts.setdefault(name, []).append(replace(column, key=pattern, title=""))
    keys = [[c.key for c in columns] for columns in parts.values()]
    groups = [{c.group for c in columns} for columns in parts.values()]
    alike = len(keys) > 1 and all(sorted(map(str, k)) == sorted(map(str, keys[0])) for k in keys)
    together = all(len(group) == 1 for group in groups)
    return parts if alike and together and len(keys[0]) >= _FEWEST_COLUMNS else {}


def _part(content: Content, name: str, columns: Sequence[Column]) -> FilePart:
    (group,) = {c.group for c in columns}
    clocks = tuple(c for c in content.clocks if c.group == group)
    return FilePart(name, replace(content, columns=tuple(columns), clocks=clocks))
