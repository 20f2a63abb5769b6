"""What a table of one group cannot hold in its cells, as one line of JSON beside them."""

import json
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from jointz.core.acquisition import Acquisition, Event, Signal, SignalGroup

_VERSION = 1


@dataclass(frozen=True, slots=True)
class SideInformation:
    """Everything of an acquisition of one group but its samples.

    Parameters
    ----------
    group : SignalGroup
        Its signals have names, units and descriptions, and no samples.
    stamped : bool
        Whether time stamps are the clock; else the group's rate, or nothing.
    events : tuple of Event
        The events.
    metadata : dict of str to str
        The metadata.
    """

    group: SignalGroup
    stamped: bool
    events: tuple[Event, ...]
    metadata: dict[str, str]


def written_beside(content: Acquisition, group: SignalGroup) -> str:
    """Return the line of JSON for a group and the events and metadata of its content.

    Parameters
    ----------
    content : Acquisition
        What is written.
    group : SignalGroup
        The group that the table holds.
    """
    return json.dumps(
        {
            "version": _VERSION,
            "group": group.name,
            "rate_hz": group.rate_hz,
            "start_s": group.start_s,
            "stamped": group.time_s is not None,
            "signals": [[s.name, s.unit, s.description, s.is_text] for s in group.signals],
            "events": [[e.time_s, e.label, e.duration_s] for e in content.events],
            "metadata": dict(content.metadata),
        }
    )


def read_beside(text: str) -> SideInformation:
    """Read what :func:`written_beside` wrote.

    Parameters
    ----------
    text : str
        The line.

    Raises
    ------
    ValueError
        When it is damaged, or of a later version.
    """
    try:
        found = json.loads(text)
        if found["version"] != _VERSION:
            raise ValueError(f"version {found['version']} of the jointz line, expected {_VERSION}")
        return SideInformation(
            group=_group(found),
            stamped=bool(found["stamped"]),
            events=tuple(Event(float(t), str(name), float(d)) for t, name, d in found["events"]),
            metadata={str(k): str(v) for k, v in found["metadata"].items()},
        )
    except (KeyError, TypeError, AttributeError, RecursionError) as exc:
        raise ValueError(f"the jointz line is damaged ({type(exc).__name__}: {exc})") from exc


def _group(found: dict[str, Any]) -> SignalGroup:
    kinds = {True: object, False: np.float64}
    signals = tuple(
        Signal(str(name), np.empty(0, kinds[bool(text)]), str(unit), str(description))
        for name, unit, description, text in found["signals"]
    )
    rate = found["rate_hz"]
    return SignalGroup(
        str(found["group"]),
        signals,
        None if rate is None else float(rate),
        float(found["start_s"]),
    )


def filled(
    told: SideInformation, columns: Sequence[np.ndarray], stamps: np.ndarray | None
) -> Acquisition:
    """Put samples into what was read beside them.

    Parameters
    ----------
    told : SideInformation
        What was read.
    columns : sequence of array
        The samples, one array a signal.
    stamps : array or None
        Time stamps of the table.

    Raises
    ------
    ValueError
        When columns and signals do not go together.
    """
    texts = [signal.is_text for signal in told.group.signals]
    if texts != [column.dtype.kind == "O" for column in columns]:
        raise ValueError(
            f"the jointz line tells of {len(texts)} signals that are not the {len(columns)} "
            "columns of the table"
        )
    signals = tuple(
        replace(signal, values=values)
        for signal, values in zip(told.group.signals, columns, strict=True)
    )
    group = replace(told.group, signals=signals, time_s=stamps if told.stamped else None)
    return Acquisition((group,), told.events, told.metadata)
