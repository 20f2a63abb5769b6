"""Sentences about what a format cannot hold of a content."""

from collections.abc import Callable, Iterable
from itertools import chain

import numpy as np

from jointz.core.acquisition import Acquisition, Signal, SignalGroup
from jointz.io.text.column_names import READING, time_column_key

#: Begins a description that a reader wrote, not the file: no format has to hold it.
NOTE = "(jointz) "
_MOST_NAMES = 5


def first_group(content: Acquisition) -> SignalGroup:
    """Return the group that a format of one table holds; an empty one where there is none."""
    return content.groups[0] if content.groups else SignalGroup("", ())


def lost_groups(content: Acquisition) -> list[str]:
    """Name the groups that a format of one table leaves out."""
    if len(content.groups) == 1:
        return []
    if not content.groups:
        return ["It has no group of signals, and the file would hold nothing."]
    others = listed(f"'{group.name}'" for group in content.groups[1:])
    return [f"It holds one table, group '{content.groups[0].name}'; left out: {others}."]


def lost_events(content: Acquisition) -> list[str]:
    """Count the events that are left out."""
    count = len(content.events)
    return [f"It has no place for events ({count} left out)."] if count else []


def lost_metadata(content: Acquisition) -> list[str]:
    """Name the metadata that are left out, apart from notes of a reader."""
    clock_keys = {time_column_key(group.name) for group in content.groups}
    lost = [k for k in content.metadata if not k.startswith(READING) and k not in clock_keys]
    return [f"It has no place for metadata: {listed(lost)}."] if lost else []


def lost_descriptions(group: SignalGroup) -> list[str]:
    """Name the signals that lose their description."""
    lost = [s.name for s in group.signals if s.description and not s.description.startswith(NOTE)]
    return [f"It has no place for the descriptions of {listed(lost)}."] if lost else []


def lost_signals(group: SignalGroup, why: str, leaves_out: Callable[[Signal], bool]) -> list[str]:
    """Name the signals that do not fit, and the reason."""
    lost = [signal.name for signal in group.signals if leaves_out(signal)]
    return [f"It cannot hold {why}: {listed(lost)}."] if lost else []


def has_text(signal: Signal, fits: Callable[[str], bool]) -> bool:
    """Whether any text of a signal does not fit."""
    return signal.is_text and not all(fits(str(text)) for text in signal.values)


def lost_letters(groups: Iterable[SignalGroup]) -> list[str]:
    """Name the signals of text with NUL or half letters."""
    why = "text with NUL or half letters"
    lost = (lost_signals(group, why, lambda s: has_text(s, is_plain)) for group in groups)
    return list(chain.from_iterable(lost))


def words_of(content: Acquisition) -> list[str]:
    """Return every name, unit, description, label and metadatum, for a look at their letters."""
    words = [group.name for group in content.groups]
    for group in content.groups:
        words += [w for s in group.signals for w in (s.name, s.unit, s.description)]
    words += [event.label for event in content.events]
    return words + [w for pair in content.metadata.items() for w in pair]


def is_plain(text: str) -> bool:
    """Whether a text can stand in a file at all: no NUL, nothing UTF-8 has no bytes for."""
    return "\0" not in text and not any("\ud800" <= letter <= "\udfff" for letter in text)


def plainly(text: str) -> str:
    """Return what a file can hold of a text: NUL becomes a blank, half letters their codes."""
    if is_plain(text):
        return text
    return text.encode("ascii", "backslashreplace").decode().replace("\0", " ")


def listed(names: Iterable[str]) -> str:
    """Return the first names, and how many more there are."""
    shown = list(names)
    more = len(shown) - _MOST_NAMES
    return ", ".join(shown[:_MOST_NAMES]) + (f" and {more} more" if more > 0 else "")


def text_array(texts: Iterable[str]) -> np.ndarray:
    """Return texts as an array of str objects, whatever their lengths."""
    words = list(texts)
    array = np.empty(len(words), dtype=object)
    array[:] = words
    return array
