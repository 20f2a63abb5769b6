"""Events of a C3D file in order of time, with their further parameters."""

import math
import re
from collections.abc import Mapping
from typing import Any

import numpy as np

from jointz.core.acquisition import Event
from jointz.io.c3d.c3d_frames import Source
from jointz.io.c3d.c3d_parameters import Values
from jointz.io.text.column_names import padded

#: Parameters that hold one value an event, and become metadata.
_MORE = ("DESCRIPTIONS", "SUBJECTS", "ICON_IDS", "GENERIC_FLAGS")
_PART = re.compile(r"EVENT\.([A-Z_]+?)\d*")


def read_events(file: Source) -> tuple[tuple[Event, ...], dict[str, Values]]:
    """Return events of the EVENT group (minutes and seconds), else those of the header."""
    parameters = file.parameters
    times = parameters.numbers("EVENT.TIMES")
    times = times[: 2 * (times.size // 2)].reshape(-1, 2)
    used = min(parameters.count("EVENT.USED", len(times)), len(times))
    if used:
        labels = padded(parameters.texts("EVENT.LABELS"), used)
        sides = padded(parameters.texts("EVENT.CONTEXTS"), used)
        events = [
            Event(60.0 * minutes + seconds, f"{side} {label}" if side else label)
            for (minutes, seconds), side, label in zip(
                times[:used].tolist(), sides, labels, strict=True
            )
        ]
    else:
        events = [Event(time, label) for time, label in file.header.events]
    if not all(math.isfinite(event.time_s) for event in events):
        raise file.refuse("an event has a time that is no number.")
    order = sorted(range(len(events)), key=lambda i: events[i].time_s)
    return tuple(events[i] for i in order), _in_order(file, order) if used else {}


def _in_order(file: Source, order: list[int]) -> dict[str, Values]:
    """Return what is said of each event in the order of time, as the events are."""
    if order == sorted(order):
        return {}
    ordered: dict[str, Values] = {}
    unordered = []
    for name in _MORE:
        parts = {
            key: values
            for key, values in file.parameters.values.items()
            if (match := _PART.fullmatch(key)) and match[1] == name
        }
        if sum(map(len, map(_flat, parts.values()))) == len(order):
            ordered |= _turned(parts, order)
        elif parts:
            unordered.append(name)
    if unordered:
        file.notes["events"] = (
            f"In the order of the file, not of time: EVENT:{', '.join(unordered)}."
        )
    return ordered


def _turned(parts: Mapping[str, Values], order: list[int]) -> dict[str, Values]:
    """Return lists that continue each other in another order, each as long as it was."""
    cells = [value for values in parts.values() for value in _flat(values)]
    turned = [cells[i] for i in order]
    ordered: dict[str, Values] = {}
    for key, values in parts.items():
        part, turned = turned[: len(_flat(values))], turned[len(_flat(values)) :]
        ordered[key] = tuple(part) if isinstance(values, tuple) else np.reshape(part, values.shape)
    return ordered


def _flat(values: Values) -> list[Any]:
    return list(values) if isinstance(values, tuple) else list(values.ravel(order="F"))
