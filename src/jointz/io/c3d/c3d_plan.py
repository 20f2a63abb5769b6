"""Plan of a C3D file: the content it can hold, and a sentence for each loss."""

import re
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from jointz.core.acquisition import Acquisition, Event, Signal, SignalGroup
from jointz.io.c3d.c3d_clock import Clock, aligned
from jointz.io.c3d.c3d_parameters import Values
from jointz.io.c3d.c3d_values import LONGEST, fits, values_of
from jointz.io.formats.losses import NOTE, listed
from jointz.io.text.column_names import READING

AXES = ("x", "y", "z")
CELLS = tuple(f"r{i}{j}" for j in range(1, 5) for i in range(1, 5))  # column by column
ROLES: Mapping[str, tuple[str, ...]] = {"points": AXES, "analogs": (), "rotations": CELLS}
SIDES = ("Left", "Right", "General")
#: Parameter that lists points of one kind -> the parameter of their unit. What is in none of
#: them is a trajectory.
KINDS: Mapping[str, str] = {
    "ANGLES": "ANGLE_UNITS",
    "FORCES": "FORCE_UNITS",
    "MOMENTS": "MOMENT_UNITS",
    "POWERS": "POWER_UNITS",
    "SCALARS": "SCALAR_UNITS",
}
_KIND_OF_UNIT = {
    **dict.fromkeys(("deg", "degree", "degrees", "rad", "°"), "ANGLES"),
    **dict.fromkeys(("N", "N/kg"), "FORCES"),
    **dict.fromkeys(("Nm", "N*m", "N.m", "Nmm", "N.mm", "Nm/kg", "Nmm/kg"), "MOMENTS"),
    **dict.fromkeys(("W", "W/kg", "mW"), "POWERS"),
}
_TOLD = re.compile(
    r"POINT\.(USED|SCALE|RATE|DATA_START|FRAMES|LONG_FRAMES|LABELS|DESCRIPTIONS|UNITS"
    rf"|{'|'.join((*KINDS, *KINDS.values()))})\d*"
    r"|ANALOG\.(USED|RATE|FORMAT|BITS|GEN_SCALE|SCALE|OFFSET|LABELS|DESCRIPTIONS|UNITS)\d*"
    r"|EVENT\.(USED|TIMES|LABELS|CONTEXTS)\d*"
    r"|ROTATION\.(USED|DATA_START|RATE|RATIO|LABELS)\d*"
    r"|TRIAL\.ACTUAL_(START|END)_FIELD"
)
_MOST_GROUPS = 127 - 5  # beside POINT, ANALOG, EVENT, ROTATION and TRIAL


@dataclass(frozen=True, slots=True)
class Columns:
    """Points, channels or rotations that are to be written."""

    labels: tuple[str, ...] = ()  # one for each point, channel or rotation
    units: tuple[str, ...] = ()  # one for each label
    notes: tuple[str, ...] = ()  # description of each label
    # (samples, labels, cells): three cells for a point, one for a channel, sixteen for a rotation
    values: np.ndarray = field(default_factory=lambda: np.zeros((0, 0, 1)))


@dataclass(frozen=True, slots=True)
class C3dContent:
    """Content to be written."""

    columns: Mapping[str, Columns]  # ``points``, ``analogs``, ``rotations`` -> their columns
    clock: Clock  # clock of the frames
    # kind of points that are no trajectories -> its unit and labels
    kinds: Mapping[str, tuple[str, list[str]]]
    events: tuple[Event, ...]  # with unrounded times
    parameters: Mapping[str, Values]  # other parameters, by ``GROUP.NAME``


def is_in_layout(name: str) -> bool:
    """Whether a parameter becomes groups, signals or events, and so no metadata."""
    return _TOLD.fullmatch(name) is not None


def plan(content: Acquisition) -> tuple[C3dContent, list[str]]:
    """Return what can be written, and a sentence for everything that cannot."""
    lost: list[str] = []
    groups = _roles(content, lost)
    clock, groups = aligned(groups, lost)
    kinds: dict[str, tuple[str, list[str]]] = {}
    columns = {role: _columns(role, group, lost) for role, group in groups.items()}
    if "points" in columns:
        columns["points"], kinds = _of_kinds(columns["points"], lost)
    for role, part in columns.items():
        lost += _rounded(role, part)
    if not columns:
        lost.append("No group of it can be written.")
    events = _events(content.events, lost)
    return C3dContent(columns, clock, kinds, events, _metadata(content.metadata, lost)), lost


def seconds_of(time_s: float) -> tuple[float, float]:
    """Return a time as minutes and seconds, as a C3D file holds it."""
    minutes = float(np.float32(time_s // 60.0))
    with np.errstate(over="ignore"):
        return minutes, float(np.float32(time_s - 60.0 * minutes))


def side_of(label: str) -> tuple[str, str]:
    """Split the label of an event into context and label."""
    side, _, what = label.partition(" ")
    return (side, what) if side in SIDES and what.strip() else ("", label)


def _roles(content: Acquisition, lost: list[str]) -> dict[str, SignalGroup]:
    """Decide which group becomes the points, the analog channels and the rotations."""
    taken: dict[str, str] = {}
    named = [g for g in content.groups if g.name in ROLES and _suits(g, g.name)]
    taken.update({g.name: g.name for g in named})
    for group in content.groups:
        if group in named:
            continue
        free = [r for r in ("points", "analogs") if r not in taken.values() and _suits(group, r)]
        if not free:
            why = "has no signals of numbers" if not _numbers(group) else "has no place of its own"
            lost.append(f"Group '{group.name}' {why}, and is left out.")
            continue
        taken[group.name] = free[0]
        lost.append(f"Group '{group.name}' is called '{free[0]}' there.")
    order = [taken[g.name] for g in content.groups if g.name in taken]
    if order != [role for role in ROLES if role in order]:
        lost.append(f"Its groups come in the order {', '.join(ROLES)}.")
    by_role = {taken[g.name]: g for g in content.groups if g.name in taken}
    for role, group in by_role.items():
        text = [s.name for s in group.signals if s.is_text]
        if text:
            lost.append(f"It has no place for text signals: {listed(text)}.")
        by_role[role] = replace(group, signals=tuple(_numbers(group)))
    return {role: by_role[role] for role in ROLES if role in by_role}


def _suits(group: SignalGroup, role: str) -> bool:
    """Whether a group's signals are points, rotations, or at least numbers."""
    names, cells = [signal.name for signal in _numbers(group)], ROLES[role]
    if not names or not cells:
        return bool(names)
    stems = [name.rpartition(".")[0] for name in names[:: len(cells)]]
    return names == [f"{stem}.{cell}" for stem in stems for cell in cells]


def _numbers(group: SignalGroup) -> list[Signal]:
    return [signal for signal in group.signals if not signal.is_text]


def _columns(role: str, group: SignalGroup, lost: list[str]) -> Columns:
    step = len(ROLES[role]) or 1
    first = group.signals[::step]
    stems = [s.name.rpartition(".")[0] if step > 1 else s.name for s in first]
    _say_unequal(role, group.signals, step, lost)
    labels = tuple(_clean(stem) for stem in stems)
    changed = [s for s, label in zip(stems, labels, strict=True) if s != label or not s]
    counts = Counter(labels)
    changed += [s for s, label in zip(stems, labels, strict=True) if counts[label] > 1]
    if changed:
        lost.append(f"Names change: {listed(map(repr, changed))}.")
    values = np.stack([signal.values for signal in group.signals], axis=1)
    return Columns(
        labels,
        tuple(_clean(signal.unit) for signal in first),
        tuple(_clean(signal.description) for signal in first),
        values.reshape(len(values), len(first), step),
    )


def _say_unequal(role: str, signals: Sequence[Signal], step: int, lost: list[str]) -> None:
    """Name cells of a point whose unit or description cannot be written."""
    heads = [signals[i - i % step] for i in range(len(signals))]
    pairs = list(zip(signals, heads, strict=True))
    units = [s.name for s, head in pairs if s.unit != _clean(head.unit)]
    notes = [
        s.name
        for s, head in pairs
        if s.description != _clean(head.description) and not s.description.startswith(NOTE)
    ]
    if role == "rotations":  # a matrix has neither
        units = [s.name for s in signals if s.unit]
        notes = [s.name for s in signals if s.description]
    if units:
        lost.append(f"It has no place for the units of {listed(units)}.")
    if notes:
        lost.append(f"It has no place for the descriptions of {listed(notes)}.")


def _of_kinds(points: Columns, lost: list[str]) -> tuple[Columns, dict[str, tuple[str, list[str]]]]:
    """Sort points by unit: trajectories have one, and each further kind has one."""
    units = list(dict.fromkeys(points.units))
    usual = next((u for u in units if u not in _KIND_OF_UNIT), units[0] if units else "")
    kinds: dict[str, tuple[str, list[str]]] = {}
    excluded: list[int] = []
    for i, (label, unit) in enumerate(zip(points.labels, points.units, strict=True)):
        kind = _KIND_OF_UNIT.get(unit, "SCALARS")
        if unit == usual:
            continue
        if kinds.setdefault(kind, (unit, []))[0] != unit:
            excluded.append(i)
            continue
        kinds[kind][1].append(label)
    if excluded:
        names = [f"{points.labels[i]} ({points.units[i]})" for i in excluded]
        lost.append(f"Points of one kind have one unit; left out: {listed(names)}.")
    fitting = [i for i in range(len(points.labels)) if i not in excluded]
    return (
        Columns(
            tuple(points.labels[i] for i in fitting),
            tuple(points.units[i] for i in fitting),
            tuple(points.notes[i] for i in fitting),
            points.values[:, fitting],
        ),
        kinds,
    )


def _rounded(role: str, columns: Columns) -> Iterator[str]:
    """Name values that single precision does not hold."""
    values = columns.values
    with np.errstate(over="ignore"):
        stored = values.astype(np.float32).astype(np.float64)
    differ = (stored != values) & ~(np.isnan(stored) & np.isnan(values))
    if role == "rotations":  # a matrix that is missing is missing whole
        holes = np.isnan(values)
        if (holes.any(axis=2) & ~holes.all(axis=2)).any():
            yield "Group 'rotations': a matrix in part missing is missing whole."
    if not differ.any():
        return
    overflow = np.isinf(stored) & differ
    if overflow.any():
        yield f"Group '{role}': {int(overflow.sum())} values are too large for it."
    change = np.abs(stored - values)[differ & ~overflow]
    if change.size:
        names = [n for n, bad in zip(columns.labels, differ.any(axis=(0, 2)), strict=True) if bad]
        yield (
            f"Group '{role}': values are rounded to single precision, by up to "
            f"{change.max():.3g}: {listed(names)}."
        )


def _events(events: Sequence[Event], lost: list[str]) -> tuple[Event, ...]:
    timed = [event for event in events if np.isfinite(event.time_s)]
    written = [(e, seconds_of(e.time_s)) for e in timed]
    back = [60.0 * minutes + seconds for _, (minutes, seconds) in written]
    fitting = [np.isfinite(time) for time in back]
    changes = [abs(t - e.time_s) for t, e in zip(back, timed, strict=True) if np.isfinite(t)]
    if len(timed) < len(events) or not all(fitting):
        lost.append("Events at no finite time are left out.")
    if any(changes):
        lost.append(f"Times of events are rounded, by up to {max(changes):.3g} s.")
    if back != sorted(back):
        lost.append("Events come in the order of time.")
    durations = [event.label for event in events if event.duration_s != 0]
    if durations:
        lost.append(f"It has no place for the durations of events: {listed(durations)}.")
    labels = [event.label for event in events if _joined(*side_of(event.label)) != event.label]
    if labels:
        lost.append(f"Labels of events change: {listed(map(repr, labels))}.")
    return tuple(
        replace(event, label=_joined(*side_of(event.label)))
        for event, fits_ in zip(timed, fitting, strict=True)
        if fits_
    )


def _joined(side: str, label: str) -> str:
    return f"{side} {_clean(label)}" if side else _clean(label)


def _metadata(metadata: Mapping[str, str], lost: list[str]) -> dict[str, Values]:
    parameters: dict[str, Values] = {}
    groups: set[str] = set()
    excluded = []
    for key, text in metadata.items():
        if key.startswith(READING):
            continue
        name, values = key.upper(), values_of(text)
        values = values if fits(name, values) else (text,)
        group = name.partition(".")[0]
        stored = text not in ("", "[]") and not is_in_layout(name) and name.lower() == key
        if not stored or not fits(name, values) or len(groups | {group}) > _MOST_GROUPS:
            excluded.append(key)
            continue
        groups.add(group)
        parameters[name] = values
    if excluded:
        lost.append(f"It has no place for metadata: {listed(excluded)}.")
    return parameters


def _clean(text: str) -> str:
    """Return a text as a C3D file can hold it."""
    raw = text.partition("\0")[0].encode("utf-8", errors="replace")[:LONGEST]
    return raw.decode("utf-8", errors="ignore").rstrip(" ")
