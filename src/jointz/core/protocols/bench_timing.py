"""Onsets of the pulses of a bench: at points of a reference's cycle, or after rests."""

from collections.abc import Sequence
from math import ceil

_ROUNDING = 1e-9


def onsets_in_cycle(
    points_pct: Sequence[float], *, cycle_s: float, apart_s: float
) -> tuple[float, ...]:
    """Return the earliest onsets, s, at points of a repeating cycle."""
    onsets, earliest = [], apart_s
    for pct in points_pct:
        first = pct / 100.0 * cycle_s
        cycles = max(0, ceil((earliest - first) / cycle_s - _ROUNDING))
        onsets.append(first + cycles * cycle_s)
        earliest = onsets[-1] + apart_s
    return tuple(onsets)


def onsets_after_rests(count: int, *, pause_s: float, duration_s: float) -> tuple[float, ...]:
    """Return the onsets, s, of pulses that each follow a rest."""
    return tuple(pause_s + k * (pause_s + duration_s) for k in range(count))
