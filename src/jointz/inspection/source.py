"""Recordings and pulse tables among the files that are inspected."""

import os
import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from itertools import combinations
from pathlib import Path
from typing import Any

import numpy as np

from jointz.inspection.content import Column, Content, GroupClock, read_content
from jointz.inspection.file_labels import FileLabels, labels_of
from jointz.inspection.guess import (
    Assignment,
    Assignments,
    InspectedColumn,
    assign_channels,
    guessed_joint,
    guessed_side,
    in_seconds,
    inspect_column,
    si_of,
)
from jointz.inspection.inspection_result import SeenClock
from jointz.inspection.names import JOINTS, Words, channel_scores, is_of_strikes, words_of
from jointz.inspection.own_clocks import HeelStrikes, channels_at_times, times_of
from jointz.inspection.people import Person, people_of, person_of
from jointz.inspection.problems import (
    FEWEST_SAMPLES,
    Pulses,
    find_command,
    find_pulses,
    not_a_recording,
)
from jointz.inspection.pulse_columns import PulseColumns, pulse_columns
from jointz.inspection.signals import clock_of, overflow_note
from jointz.inspection.signs import angle_direction, inverted_channels
from jointz.io.formats.losses import plainly
from jointz.io.formats.registry import has_format
from jointz.io.relative_paths import seen_from
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


_WEIGHTS = {"torque": 40, "current": 20, "angle": 15}
_DEEPEST = 2  # folders below the one that is inspected


@dataclass(frozen=True, slots=True, eq=False)
class Source:
    """A recording: a file, or a part of one."""

    file: Path
    shown: str  # name in the study
    part: str  # "" for the whole file
    content: Content
    columns: tuple[InspectedColumn, ...]
    assigned: Assignments
    group: str
    clocks: tuple[SeenClock, ...]
    names: Words
    labels: FileLabels
    overflow: Mapping[str, str] = field(default_factory=dict)
    pulses: Pulses = field(default_factory=Pulses)
    angle_direction: str = ""  # of a knee's angle by its range, "" if that does not decide it
    side: tuple[str, str] = ("", "")  # side, and the reason
    table: PulseColumns | None = None  # pulse table of a part
    inverted: frozenset[str] = frozenset()  # channels whose sign is the opposite of what is meant
    clock_groups: Mapping[str, str] = field(default_factory=dict)  # channel of another -> group
    # such a channel -> column of its stamps, and their unit
    own_times: Mapping[str, tuple[str | int, str]] = field(default_factory=dict)
    heel_strikes: HeelStrikes | None = None
    joined: tuple["JoinedSource", ...] = ()
    person: Person = field(default_factory=Person)  # as single values of the file state
    people: Mapping[str, Person] = field(default_factory=dict)  # of a table in the file

    @property
    def clock(self) -> SeenClock:
        """The clock of the signals that a study takes."""
        return next((c for c in self.clocks if c.group == self.group), SeenClock(self.group, "", 0))

    @property
    def in_group(self) -> list[InspectedColumn]:
        """The columns that were sampled together with those of the study."""
        return [c for c in self.columns if c.column.group == self.group]

    @property
    def unassigned(self) -> list[InspectedColumn]:
        """The columns of the study's clock without a channel."""
        taken = {(c.column.group, c.key) for c, _ in self.assigned.values()}
        return [c for c in self.in_group if (c.column.group, c.key) not in taken]

    @property
    def joined_channels(self) -> frozenset[str]:
        """The channels that other files bring."""
        return frozenset(name for one in self.joined for name in one.channels)

    @property
    def is_series(self) -> bool:
        """Return whether a file holds samples, whatever they are."""
        return self.clock.n >= FEWEST_SAMPLES and self.heel_strikes is None

    @property
    def is_recording(self) -> bool:
        """Return whether the joint's angle is held in time."""
        in_time = not not_a_recording(self.in_group, self.assigned)[0]
        return "angle" in self.assigned and in_time


@dataclass(frozen=True, slots=True, eq=False)
class JoinedSource:
    """A file that brings channels to a recording in another."""

    source: Source
    channels: tuple[str, ...]
    offset_s: float | None  # None where their clocks do not begin and end together


def files_in(folder: Path) -> Iterator[Path]:
    """Yield the files of a folder that may hold recordings or pulse tables."""
    for file in sorted(folder.rglob("*")):
        inside = file.relative_to(folder).parts
        hidden = any(part.startswith((".", "~")) for part in inside)
        if file.is_file() and len(inside) <= _DEEPEST + 1 and not hidden and has_format(file):
            yield file


def most_telling(sources: Sequence[Source]) -> Source:
    """Return the recording from which the meaning of the channels is taken."""

    def telling(source: Source) -> tuple[bool, bool, int]:
        has_pulses = bool(source.pulses.source or source.table)
        return has_pulses, source.labels.condition == "perturbed", _weight(source.assigned)

    return max(sources, key=telling)


def with_most_telling_first(sources: Sequence[Source]) -> list[Source]:
    """Put the most telling recording first, and forget samples of others."""
    best = most_telling(sources)
    return [best, *(without_samples(source) for source in sources if source is not best)]


def without_samples(source: Source) -> Source:
    """Return a source without its samples."""
    empty = np.empty(0)
    assigned = {
        name: (replace(c, column=replace(c.column, values=empty)), assignment)
        for name, (c, assignment) in source.assigned.items()
    }
    content = replace(source.content, columns=(), clocks=())
    return replace(source, content=content, columns=(), assigned=assigned)


def read_sources(
    file: Path,
    layout: Mapping[str, Any] | None,
    study_folder: str | os.PathLike[str] | None,
    root: Path | None = None,
) -> tuple[list[Source], list[PulseColumns]]:
    """Return the recordings and the pulse tables of a file; ``root`` is the inspected folder."""
    folders = _folders(file, root)
    content = read_content(file, layout)
    # Bytes of a name that are no letters are written as codes.
    shown = plainly(file.name if study_folder is None else seen_from(file, Path(study_folder)))
    columns = tuple(inspect_column(column) for column in content.columns)
    by_group = [[c for c in columns if c.column.group == g.group] for g in content.clocks]
    tables = [t for group in by_group if (t := pulse_columns(shown, group)) is not None]
    people = {name: one for group in by_group for name, one in people_of(group).items()}
    parts = parts_of(content)
    if not parts:
        whole = _source(file, shown, "", content, columns, folders=folders)
        whole = replace(whole, person=person_of(content.singles), people=people)
        # A table of pulses alone is no recording, and a recording no table of pulses.
        if tables and not whole.is_recording:
            return [whole], tables
        own = {whole.group}
        return [whole], [t for t in tables if t.columns["onset"].column.group not in own]
    inside = sorted({word for c in content.columns for word in str(c.key).split(".")[:-1]})
    joints = {words_of(part.name).joint for part in parts} - {""}
    if len(joints) > 1:  # parts of one recording: the joint that is usually meant
        usual = next(joint for joint in JOINTS if joint in joints)
        parts = tuple(part for part in parts if words_of(part.name).joint in ("", usual))
    found = [_source_of_part(file, shown, part, inside, folders) for part in parts]
    names = [one.part for one in found]
    return [
        replace(
            one,
            person=person_of(content.singles, one.part, [n for n in names if n != one.part]),
            people=people,
        )
        for one in found
    ], tables


def _folders(file: Path, root: Path | None) -> list[str]:
    """Return the names of the folders of a file, the nearest first, up to the inspected one."""
    own = file.resolve().parent
    if root is None:
        return [own.name]
    above = [own, *own.parents]
    return [folder.name for folder in above[: above.index(root.resolve()) + 1]]


def _source_of_part(
    file: Path, shown: str, part: FilePart, inside: Sequence[str], folders: Sequence[str]
) -> Source:
    content = replace(part.content, mass_kg=part.mass_kg or part.content.mass_kg)
    columns = tuple(inspect_column(c) for c in content.columns)
    texts = [*part.texts, *inside]
    short = [inspect_column(c) for c in part.pulses]
    source = _source(file, shown, part.name, content, columns, texts, folders=folders)
    strikes = _heel_strikes(short, (), source.names.side)
    table = pulse_columns(shown, [c for c in short if not is_of_strikes(c.title)])
    return replace(source, table=table, heel_strikes=strikes)


def _source(
    file: Path,
    shown: str,
    part: str,
    content: Content,
    columns: tuple[InspectedColumn, ...],
    inside: Sequence[str] = (),
    *,
    folders: Sequence[str],
) -> Source:
    labels = labels_of(file.name, part, inside, folders)
    names = words_of(f"{file.parent.resolve().name} {file.name.split('.')[0]}")
    names = Words(names.found, names.joint, labels.side or _side_above(content))
    every, group = _groups(columns, content.clocks, names)
    assigned = every.get(group, {})
    by_group = {c.group: c for c in content.clocks}
    moved, clock_groups = _brought(every, by_group, group)
    assigned = {**assigned, **moved}
    # Stamps are better than a line above them.
    timed = content.files is not None and "time" in assigned
    clocks = tuple(
        _clock(
            replace(c, rate_hz=None) if timed else c,
            every[c.group] if c.group == group or c.time_s is not None else {},
        )
        for c in content.clocks
    )
    source = Source(
        file, shown, part, content, columns, assigned, group, clocks, names, labels,
        _overflows(assigned),
        clock_groups=clock_groups,
        own_times={
            name: (every[g]["time"][0].key, every[g]["time"][1].unit)
            for name, g in clock_groups.items()
            if "time" in every[g]
        },
        heel_strikes=_heel_strikes(columns, content.events, names.side),
    )  # fmt: skip
    if not source.overflow:
        assigned = find_command(source.in_group, assigned, source.clock)
    sound = {name: column for name, column in assigned.items() if name not in source.overflow}
    direction = angle_direction(assigned)[0] if "angle" in sound else ""
    joint, _ = guessed_joint(source.in_group, names)
    return replace(
        source,
        assigned=assigned,
        pulses=find_pulses(sound, source.clock),
        angle_direction=direction,
        side=_side(source, joint),
        inverted=inverted_channels(sound, source.clock),
    )


def _side(source: Source, joint: str) -> tuple[str, str]:
    """Return the side by names, else the only one that lines above a table tell."""
    stated = _side_above(source.content)
    if stated and not source.labels.side:
        return stated, "a line above the table"
    return guessed_side(source.in_group, source.names, joint)


def _side_above(content: Content) -> str:
    sides = {words_of(line).side for line in content.above} - {""}
    return sides.pop() if len(sides) == 1 else ""


def _groups(
    columns: Sequence[InspectedColumn], clocks: Sequence[GroupClock], names: Words
) -> tuple[dict[str, Assignments], str]:
    """Return the channels of every group of signals, and the group with the most useful ones."""
    found: dict[str, Assignments] = {}
    for clock in clocks:
        own = [c for c in columns if c.column.group == clock.group]
        joint, _ = guessed_joint(own, names)
        side, _ = guessed_side(own, names, joint)
        found[clock.group] = assign_channels(own, names, joint=joint, side=side)
    return found, max(found, key=lambda group: _weight(found[group]), default="")


def _brought(
    every: Mapping[str, Assignments], clocks: Mapping[str, GroupClock], group: str
) -> tuple[dict[str, tuple[InspectedColumn, Assignment]], dict[str, str]]:
    """Return the channels that other groups of a file bring to that of a recording."""
    times = {g: times_of(clocks[g], own) for g, own in every.items()}
    if (time_s := times.get(group)) is None:
        return {}, {}
    others = {
        g: (every[g], own_time_s)
        for g, own_time_s in times.items()
        if g != group and own_time_s is not None and own_time_s.size
    }
    return channels_at_times(every[group], time_s, others)


def _heel_strikes(
    columns: Sequence[InspectedColumn], events: Sequence[str], side: str
) -> HeelStrikes | None:
    """Return the column, or the label of events, of heel strikes; of the other leg none."""
    named = [c for c in columns if is_of_strikes(c.title) and c.course.rises]
    labels = [HeelStrikes(label) for label in dict.fromkeys(events) if is_of_strikes(label)]
    found = [HeelStrikes(str(c.key), c.words.unit) for c in named] + labels
    sides = {words_of(one.column).side for one in found} - {""}
    own = [one for one in found if words_of(one.column).side in ("", side)]
    return next(iter(own if side or len(sides) > 1 else found), None)


def _weight(assigned: Assignments) -> int:
    # The torque's clock is that of the recording: its edges carry the timing.
    measured = [n for n, (_, a) in assigned.items() if not a.unit.endswith("/kg")]
    return len(assigned) + sum(_WEIGHTS.get(name, 0) for name in measured)


def _clock(stated: GroupClock, assigned: Assignments) -> SeenClock:
    if stated.time_s is not None and stated.unit_stated:
        return clock_of(stated.group, stated.n, "the file's own stamps", stated.time_s)
    if stated.rate_hz is not None:
        start, n = stated.start_s, stated.n
        end = start + (n - 1) / stated.rate_hz if n else start
        return SeenClock(stated.group, "rate", n, stated.rate_hz, start, end, uniform=True)
    if "time" in assigned:
        column = str(assigned["time"][0].key)
        return clock_of(stated.group, stated.n, column, in_seconds(*assigned["time"]))
    return SeenClock(stated.group, "", stated.n)


def _overflows(assigned: Assignments) -> dict[str, str]:
    return {
        channel: note
        for channel, (inspected, assignment) in assigned.items()
        if (note := overflow_note(inspected.course, *si_of(assignment)))
    }
