"""Plan of an XDF file: the content it can hold, and a sentence for each loss."""

from collections import Counter
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace
from enum import StrEnum
from itertools import pairwise

import numpy as np

from jointz.core.acquisition import Acquisition, Event, Signal, SignalGroup
from jointz.io.formats.losses import NOTE, listed
from jointz.io.text.column_names import READING, distinct_names
from jointz.io.xdf.xdf_tree import Tree, grown, holdable

#: Where jointz keeps what XDF has no word for, in the description of a stream.
OWN = "desc.jointz."
#: Whether a stream of texts is events as well ("yes", "no"), or nothing else ("only").
EVENTS = "events"
#: Whether the group has no name; a stream must have one.
UNNAMED = "unnamed"
_NAME_OF_UNNAMED = "signals"
_DURATION = "duration_s"
_RESERVED = ("name", "channel_count", "channel_format", "stream_id", "effective_srate")


class Clock(StrEnum):
    """Kind of clock of a stream."""

    UNIFORM = "uniform"
    STAMPS = "stamps"
    NONE = "none"


@dataclass(frozen=True, slots=True)
class XdfStream:
    """A stream that is to be written."""

    header: Tree  # its description as a tree
    group: SignalGroup  # its signals: all of numbers, or all of text
    clock: Clock  # kind of its clock


@dataclass(frozen=True, slots=True)
class XdfContent:
    """Content to be written."""

    header: Tree  # description of the file as a tree
    streams: tuple[XdfStream, ...]  # in the order of the file


def events_of(group: SignalGroup) -> list[Event]:
    """Return an event for each text of a stream of markers."""
    times = group.times_s()
    texts = [signal for signal in group.signals if signal.is_text]
    if times is None or not texts:
        return []
    if [signal.name for signal in texts[1:]] == [_DURATION]:
        durations = [float(text) for text in texts[1].values]
        rows = zip(times.tolist(), texts[0].values, durations, strict=True)
        return [Event(time, label, duration) for time, label, duration in rows]
    return [
        Event(time, signal.values[row])
        for row, time in enumerate(times.tolist())
        for signal in texts
        if signal.values[row]
    ]


def plan(content: Acquisition) -> tuple[XdfContent, list[str]]:
    """Return what can be written, and a sentence for everything that cannot."""
    lost: list[str] = []
    owners = _owners(content)
    groups = [part for group in content.groups for part in _parts(group, lost)]
    names = [_NAME_OF_UNNAMED if not g.name else holdable(g.name) for g in groups]
    renamed = [g.name for g, name in zip(groups, names, strict=True) if g.name not in ("", name)]
    if renamed or len(set(names)) < len(names):
        lost.append(f"Names of groups change: {listed(map(repr, renamed or names))}.")
    marked, event_group = _markers(content.events, groups, lost)
    streams = [
        _stream(
            replace(group, name=name),
            lost,
            metadata=owners.get(group.name, {}) if group.name else {},
            original=group.name,
            marked=marked.get(group.name, "no"),
        )
        for group, name in zip(groups, names, strict=True)
    ]
    if event_group is not None:
        streams.append(
            _stream(event_group, lost, metadata={}, original=event_group.name, marked="only")
        )
    header, left = grown({k: v for k, v in owners[None].items() if k.split(".")[0] != "version"})
    left += [k for k in owners[None] if k.split(".")[0] == "version"]
    if left:
        lost.append(f"It has no place for metadata: {listed(left)}.")
    return XdfContent(header, tuple(streams)), lost


def _owners(content: Acquisition) -> dict[str | None, dict[str, str]]:
    """Return the metadata of each group, without its name before them, and of the file (None)."""
    owners: dict[str | None, dict[str, str]] = {None: {}}
    names = sorted((g.name for g in content.groups if g.name), key=len, reverse=True)
    for key, text in content.metadata.items():
        if key.startswith(READING):
            continue
        owner = next((name for name in names if key.startswith(f"{name}.")), None)
        inner = key if owner is None else key.removeprefix(f"{owner}.")
        owners.setdefault(owner, {})[inner] = text
    return owners


def _parts(group: SignalGroup, lost: list[str]) -> list[SignalGroup]:
    """Return a group as streams: one of numbers, one of texts; none where it has no signals."""
    if not group.signals:
        lost.append(f"Group '{group.name}' has no signals, and is left out.")
        return []
    times = np.array([group.start_s, group.rate_hz or 0.0])
    stamps = times if group.time_s is None else group.time_s
    if not np.isfinite(stamps).all() or (group.rate_hz is not None and not group.rate_hz > 0):
        lost.append(f"Group '{group.name}' is left out: its clock is no clock.")
        return []
    if group.rate_hz is None and group.start_s != 0:
        lost.append(f"Group '{group.name}' has no rate, and its start is left out.")
    texts = tuple(signal for signal in group.signals if signal.is_text)
    numbers = tuple(signal for signal in group.signals if not signal.is_text)
    if not texts or not numbers:
        return [group]
    lost.append(
        f"A stream holds numbers or texts: the texts of group '{group.name}' become group "
        f"'{group.name} text'."
    )
    return [
        replace(group, signals=numbers),
        replace(group, signals=texts, name=f"{group.name} text"),
    ]


def _markers(
    events: tuple[Event, ...], groups: Iterable[SignalGroup], lost: list[str]
) -> tuple[dict[str, str], SignalGroup | None]:
    """Decide which streams of texts are events, and make one of the events that are in none."""
    timed = [event for event in events if np.isfinite(event.time_s)]
    if len(timed) < len(events):
        lost.append("Events at no finite time are left out.")
    if any(a.time_s > b.time_s for a, b in pairwise(timed)):
        lost.append("Events come in the order of time.")
    if any(event.label != _encodable(event.label) for event in timed):
        lost.append("Labels of events change: they have letters that UTF-8 has not.")
    left = Counter(timed)
    marked: dict[str, str] = {}
    merged: list[Event] = []
    for group in groups:
        if not group.signals[0].is_text:
            continue
        found = Counter(_events_if_any(group))
        marked[group.name] = "yes" if found and found <= left else "no"
        if marked[group.name] == "yes":
            left -= found
            merged += events_of(group)
    rest = [event for event in timed if left[event] > 0 and not left.subtract([event])]
    merged = sorted(merged + rest, key=lambda event: event.time_s)
    if merged != timed:  # at one time, in another order
        return dict.fromkeys(marked, "no"), _event_group(timed)
    return marked, _event_group(rest)


def _events_if_any(group: SignalGroup) -> list[Event]:
    """Return the events of a stream of texts, none where a duration in it is no number."""
    try:
        return events_of(group)
    except ValueError:
        return []


def _event_group(events: list[Event]) -> SignalGroup | None:
    if not events:
        return None
    labels = np.array([_encodable(event.label) for event in events], dtype=object)
    durations = np.array([repr(float(event.duration_s)) for event in events], dtype=object)
    return SignalGroup(
        "events",
        (Signal("label", labels), Signal(_DURATION, durations)),
        time_s=np.array([event.time_s for event in events], dtype=np.float64),
    )


def _stream(
    group: SignalGroup,
    lost: list[str],
    *,
    metadata: Mapping[str, str],
    original: str,
    marked: str,
) -> XdfStream:
    """Return a stream with its description."""
    clock = Clock.STAMPS if group.time_s is not None else Clock.UNIFORM
    clock = Clock.NONE if group.time_s is None and group.rate_hz is None else clock
    texts = group.signals[0].is_text
    nominal, kept = _nominal(group, clock, metadata)
    fixed = {
        "name": group.name,
        "channel_count": str(len(group.signals)),
        "nominal_srate": nominal,
        "channel_format": "string" if texts else "double64",
        f"{OWN}clock": clock.value,
    }
    if clock is Clock.UNIFORM:
        fixed[f"{OWN}start_s"] = repr(float(group.start_s))
    if not original:
        fixed[f"{OWN}{UNNAMED}"] = "yes"
    if texts:
        fixed[f"{OWN}{EVENTS}"] = marked
        if "type" not in kept and marked != "no":
            fixed |= {"type": "Markers", f"{OWN}type": "told"}
    fixed |= _channels(group, lost)
    free = {k: v for k, v in kept.items() if k not in fixed and k not in _RESERVED}
    free = {k: v for k, v in free.items() if not k.startswith(OWN)}
    tree, unfit = grown({**fixed, **free})
    unfit += [k for k in metadata if k not in kept or k not in {*free}]
    written = ("nominal_srate", nominal)
    unfit = [k for k in dict.fromkeys(unfit) if k in metadata and (k, metadata[k]) != written]
    if unfit:
        lost.append(f"It has no place for metadata: {listed(f'{original}.{k}' for k in unfit)}.")
    return XdfStream(tree, replace(group, signals=_encoded(group.signals, lost)), clock)


def _nominal(
    group: SignalGroup, clock: Clock, metadata: Mapping[str, str]
) -> tuple[str, dict[str, str]]:
    """Return the nominal rate as text, and the metadata without it."""
    kept = {k: v for k, v in metadata.items() if k != "nominal_srate"}
    if clock is Clock.UNIFORM:
        return repr(float(group.rate_hz or 0.0)), kept
    stated = metadata.get("nominal_srate", "")
    try:
        usable = 0 < float(stated) < np.inf and clock is Clock.STAMPS
    except ValueError:
        usable = False
    return (stated if usable else "0"), kept


def _channels(group: SignalGroup, lost: list[str]) -> dict[str, str]:
    """Return label, unit and description of each channel, as far as XML holds them."""
    texts: dict[str, str] = {}
    changed = []
    labels = [holdable(signal.name) for signal in group.signals]
    names = distinct_names(labels, len(labels), "channel")
    for i, (signal, label) in enumerate(zip(group.signals, labels, strict=True), start=1):
        place = f"desc.channels.channel{f'.{i}' if i > 1 else ''}"
        words = {"label": label, "unit": holdable(signal.unit)}
        words["description"] = holdable(signal.description)
        note = "" if signal.description.startswith(NOTE) else signal.description
        written = (names[i - 1], words["unit"], words["description"] if note else "")
        if written != (signal.name, signal.unit, note):
            changed.append(signal.name)
        texts |= {f"{place}.{tag}": text for tag, text in words.items() if text}
    if changed:
        lost.append(f"Names, units or descriptions change: {listed(map(repr, changed))}.")
    return texts


def _encoded(signals: tuple[Signal, ...], lost: list[str]) -> tuple[Signal, ...]:
    """Return texts without letters that UTF-8 has not."""
    encoded = []
    for signal in signals:
        if not signal.is_text:
            encoded.append(signal)
            continue
        values = np.array([_encodable(str(text)) for text in signal.values], dtype=object)
        if any(a != b for a, b in zip(values, signal.values, strict=True)):
            lost.append(f"Signal '{signal.name}' has letters that UTF-8 has not.")
        encoded.append(replace(signal, values=values))
    return tuple(encoded)


def _encodable(text: str) -> str:
    return text.encode("utf-8", errors="replace").decode("utf-8")
