"""Comparison of contents of files, sample for sample."""

import numpy as np

from jointz.core.acquisition import Acquisition, Event, Signal, SignalGroup


def is_same_content(a: Acquisition, b: Acquisition) -> bool:
    """Return whether two contents are the same, sample for sample; NaN equals NaN."""
    return (
        len(a.groups) == len(b.groups)
        and all(map(is_same_group, a.groups, b.groups))
        and list(map(_comparable, a.events)) == list(map(_comparable, b.events))
        and dict(a.metadata) == dict(b.metadata)
    )


def is_same_group(a: SignalGroup, b: SignalGroup) -> bool:
    """Return whether two groups have the same clock and the same signals."""
    clocks = [(g.name, g.rate_hz, g.start_s, g.time_s is None) for g in (a, b)]
    if clocks[0] != clocks[1] or len(a.signals) != len(b.signals):
        return False
    if a.time_s is not None and b.time_s is not None and not np.array_equal(a.time_s, b.time_s):
        return False
    return all(map(_is_same_signal, a.signals, b.signals))


def _is_same_signal(a: Signal, b: Signal) -> bool:
    texts = [(s.name, s.unit, s.description, s.is_text) for s in (a, b)]
    return texts[0] == texts[1] and np.array_equal(a.values, b.values, equal_nan=not a.is_text)


def _comparable(event: Event) -> tuple[float, str, float | None]:
    """Return an event as a comparable tuple; two unknown durations are equal."""
    return event.time_s, event.label, None if np.isnan(event.duration_s) else event.duration_s
