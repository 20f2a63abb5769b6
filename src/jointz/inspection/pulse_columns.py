"""Pulse tables among the files of a lab: what their columns mean."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from jointz.core.units import conversion
from jointz.inspection.guess import InspectedColumn
from jointz.inspection.names import word_set
from jointz.io.pulse_tables import NAMES, SAMPLE

_MOST_PULSES = 20_000
_WORDS: Mapping[str, frozenset[str]] = {
    "onset": word_set("onset onsets"),
    "duration": word_set("duration"),
    "amplitude": word_set("amplitude torque torquenm"),
    "timing_point": word_set("timing timingpoint point phase target"),
    "recording": word_set("recording file datei aufnahme fichier archivo bestand filename"),
    "participant": word_set("participant subject proband vp id sujet sujeto soggetto person"),
    "session": word_set("session"),
    "side": word_set("side seite cote lado lato zijde"),
}
_NUMBERS = ("onset", "duration", "amplitude")
#: Units in which onsets are tried: the first whose largest lies in the recording.
_OF_TIME = (("s", 1.0), ("ms", 1e-3))


@dataclass(frozen=True, slots=True, eq=False)
class PulseColumns:
    """The columns of a pulse table by their meaning."""

    file: str  # as the study names it
    columns: Mapping[str, InspectedColumn]
    n: int = 0  # number of pulses

    @property
    def in_samples(self) -> bool:
        """Whether the onsets count samples, by the names of the columns."""
        return _in_samples(self.columns["onset"])

    @property
    def last_onset(self) -> float:
        """Return the largest onset, as it is written."""
        return float(np.nanmax(self.columns["onset"].column.values))

    def are_usual(self) -> bool:
        """Whether all columns have the names that need no line in a study."""
        return all(str(column.key) in NAMES[meaning] for meaning, column in self.columns.items())


def pulse_columns(file: str, columns: Sequence[InspectedColumn]) -> PulseColumns | None:
    """Return what the columns of a table of pulses mean, None for anything else."""
    found: dict[str, InspectedColumn] = {}
    for meaning, words in _WORDS.items():
        named = [c for c in columns if str(c.key) in NAMES[meaning] or c.words.found & words]
        fitting = [c for c in named if c not in found.values() and _fits(meaning, c)]
        if fitting:
            found[meaning] = fitting[0]
    onset = found.get("onset")
    if onset is None or onset.course.n > _MOST_PULSES:
        return None
    values = onset.column.values
    rises = np.diff(values[np.isfinite(values)])
    per_recording = {"recording", "participant"} & set(found)
    if not per_recording and (rises <= 0).any():
        return None
    return PulseColumns(file, found, n=onset.course.n)


def _fits(meaning: str, inspected: InspectedColumn) -> bool:
    if meaning not in _NUMBERS:
        return True
    return not inspected.column.is_text and inspected.course.low is not None


def _in_samples(inspected: InspectedColumn) -> bool:
    text = f"{inspected.title} {inspected.column.unit}".casefold()
    return "sample" in inspected.words.found or SAMPLE in text


def unit_of(table: PulseColumns, meaning: str, *, duration_s: float, n: int) -> tuple[str, str]:
    """Return the unit of a column of numbers, and why where the table does not state it.

    ``duration_s`` and ``n`` are the length of the recording in s and in samples.
    """
    inspected = table.columns[meaning]
    if str(inspected.key) in NAMES[meaning]:
        return "", ""  # the name says it
    if meaning == "amplitude":
        return inspected.words.unit or "N*m", "" if inspected.words.unit else "the usual one"
    if _in_samples(inspected):
        return SAMPLE, ""
    if inspected.words.unit:
        return inspected.words.unit, ""
    if meaning == "duration":  # as the onsets are written
        return unit_of(table, "onset", duration_s=duration_s, n=n)
    for unit, factor in _OF_TIME:
        if table.last_onset * factor <= duration_s:
            return unit, f"the last onset, {table.last_onset:g}, lies in the recording so"
    return SAMPLE, f"the last onset, {table.last_onset:g}, lies in {n} samples only so"


def onsets_s(table: PulseColumns, time_s: np.ndarray) -> np.ndarray:
    """Return the onsets in s, as far as they are known: samples count from 1 where nothing says."""
    values = table.columns["onset"].column.values
    values = values[np.isfinite(values)]
    key = str(table.columns["onset"].key)
    unit, _ = unit_of(table, "onset", duration_s=float(time_s[-1]), n=time_s.size)
    unit = unit or {"onset_s": "s", "onset_ms": "ms"}.get(key, SAMPLE)
    if unit != SAMPLE:
        return np.asarray(conversion(unit, "s")[0] * values)
    return np.asarray(np.interp(values - 1, np.arange(time_s.size), time_s))


def first_sample_of(table: PulseColumns, command: np.ndarray | None) -> int | None:
    """Return whether samples count from 0 or 1, by the command; None where nothing says it."""
    onsets = table.columns["onset"].column.values
    if command is None:
        return None
    rising = np.flatnonzero((command[1:] != 0) & (command[:-1] == 0)) + 1
    for first in (0, 1):
        if np.isin(onsets - first, rising).mean() > 0.5:
            return first
    return None
