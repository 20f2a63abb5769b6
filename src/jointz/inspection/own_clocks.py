"""Channels with clocks of their own, at the times of a recording; for inspection only."""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Final

import numpy as np

from jointz.core.channels import LEVEL_CHANNELS, MOTION_SENSORS
from jointz.inspection.content import GUESSED_SAMPLES, GroupClock
from jointz.inspection.guess import Assignment, Assignments, InspectedColumn, in_seconds

#: Channels that may have a clock of their own.
_MOVABLE: Final = (
    *("angle", "torque", "current", "command", "trigger", "contact", "ground_reaction_force"),
    *MOTION_SENSORS,
)


@dataclass(frozen=True, slots=True)
class HeelStrikes:
    """Times of heel strikes: a column, or the label of events."""

    column: str
    unit: str = ""  # "" where the file states it, or nothing does
    file: str = ""  # "" for that of the samples


def times_of(clock: GroupClock, assigned: Assignments) -> np.ndarray | None:
    """Return the times of the samples of a group, None without a clock."""
    n = min(clock.n, GUESSED_SAMPLES)
    if clock.time_s is not None and clock.unit_stated:
        return clock.time_s[:n]
    if "time" in assigned:
        return in_seconds(*assigned["time"])[:n]
    return None if clock.rate_hz is None else clock.start_s + np.arange(n) / clock.rate_hz


def channels_at_times(
    assigned: Assignments, time_s: np.ndarray, others: Mapping[str, tuple[Assignments, np.ndarray]]
) -> tuple[dict[str, tuple[InspectedColumn, Assignment]], dict[str, str]]:
    """Return the channels that only other groups have, at given times, and the group of each."""
    found: dict[str, tuple[InspectedColumn, Assignment]] = {}
    groups = {}
    for group, (own, own_time_s) in others.items():
        for name in _MOVABLE:
            if name in own and name not in {**assigned, **found}:
                inspected, assignment = own[name]
                values = _moved(name, inspected.column.values, own_time_s, time_s)
                moved = replace(inspected, column=replace(inspected.column, values=values))
                found[name], groups[name] = (moved, assignment), group
    return found, groups


def _moved(name: str, values: np.ndarray, own_time_s: np.ndarray, time_s: np.ndarray) -> np.ndarray:
    """Return samples at other times; good enough for signs and pulses, for no estimate."""
    n = min(values.size, own_time_s.size)
    if name in LEVEL_CHANNELS:
        at = np.searchsorted(own_time_s[:n], time_s, side="right") - 1
        return np.asarray(values[np.clip(at, 0, n - 1)])
    moved = np.interp(time_s, own_time_s[:n], values[:n], left=np.nan, right=np.nan)
    return np.asarray(moved)
