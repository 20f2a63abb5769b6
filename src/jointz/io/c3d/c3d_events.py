"""The events of a C3D file in the order of time, and what else the file says of each."""

import math
import re
from collections.abc import Mapping
from typing import Any

import numpy as np

from jointz.core.acquisition import Event
from jointz.io.c3d.c3d_frames import Source
from jointz.io.c3d.c3d_parameters import Values
from jointz.io.text.signal_names import filled

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
        labels = filled(parameters.texts("EVENT.LABELS"), used)
        sides = filled(parameters.texts("EVENT.CONTEXTS"), used)
        found = [
            Event(60.0 * minutes + seconds, f"{side} {label}" if side else label)
            for (minutes, seconds), side, label in zip(
                times[:used].tolist(), sides, labels, strict=True
            )
        ]
    else:
        found = [Event(time, label) for time, label in file.header.events]
    if not all(math.isfinite(event.time_s) for event in found):
        raise file.refuse("an event has a time that is no number.")
    order = sorted(range(len(found)), key=lambda i: found[i].time_s)
    return tuple(found[i] for i in order), _in_order(file, order) if used else {}


def _in_order(file: Source, order: list[int]) -> dict[str, Values]:
    """Return what is said of each event in the order of time, as the events are."""
    if order == sorted(order):
        return {}
    found: dict[str, Values] = {}
    left = []
    for name in _MORE:
        parts = {
            key: values
            for key, values in file.parameters.values.items()
            if (match := _PART.fullmatch(key)) and match[1] == name
        }
        if sum(map(len, map(_flat, parts.values()))) == len(order):
            found |= _turned(parts, order)
        elif parts:
            left.append(name)
    if left:
        file.notes["events"] = f"In the order of the file, not of time: EVENT:{', '.join(left)}."
    return found


def _turned(parts: Mapping[str, Values], order: list[int]) -> dict[str, Values]:
    """Return lists that continue each other in another order, each as long as it was."""
    cells = [value for values in parts.values() for value in _flat(values)]
    turned = [cells[i] for i in order]
    found: dict[str, Values] = {}
    for key, values in parts.items():
        own, turned = turned[: len(_flat(values))], turned[len(_flat(values)) :]
        found[key] = tuple(own) if isinstance(values, tuple) else np.reshape(own, values.shape)
    return found


def _flat(values: Values) -> list[Any]:
    return list(values) if isinstance(values, tuple) else list(values.ravel(order="F"))
