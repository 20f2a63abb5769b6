"""Pulse tables among the files of a lab: what their columns mean."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from jointz.core.units import conversion
from jointz.inspection.guess import InspectedColumn
from jointz.inspection.names import word_set
from jointz.inspection.people import digits_of, label_of
from jointz.io.column_units import SAMPLE
from jointz.io.pulse_tables import NAMES
from jointz.io.text.clock_times import CLOCK_TEXT

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
_UNITS_OF_NAMES = {"onset_s": "s", "onset_ms": "ms", "onset_sample": SAMPLE}
_SPAN_S = (-0.02, 0.05)  # about an onset: the torque has risen
_CLEARLY = 3.0  # times the rise with onsets in another unit


@dataclass(frozen=True, slots=True, eq=False)
class PulseColumns:
    """The columns of a pulse table by their meaning."""

    file: str  # as the study names it
    columns: Mapping[str, InspectedColumn]
    has_others: bool = False  # columns that mean nothing here

    @property
    def names_recordings(self) -> bool:
        """Return whether columns tell the rows of recordings or people apart."""
        return bool({"recording", "participant"} & set(self.columns))

    def are_usual(self) -> bool:
        """Return whether all columns have names that a study need not state."""
        return not self.has_others and all(
            str(column.key) in NAMES[meaning] for meaning, column in self.columns.items()
        )

    def name_of(self, participant: str) -> str:
        """Return what the table calls a person: the same name, or the same number."""
        if "participant" not in self.columns:
            return participant
        names = {label_of(v) for v in self.columns["participant"].column.values}
        alike = [n for n in names if digits_of(n) == digits_of(participant) != ""]
        return participant if participant in names or len(alike) != 1 else alike[0]

    def rows_of(self, participant: str, file: str) -> np.ndarray:
        """Return which rows belong to a recording, as far as columns say it."""
        base = file.rpartition("/")[2]
        names = {self.name_of(participant)}
        meant = {"participant": names, "recording": {file, base, base.split(".")[0]}}
        rows = np.isfinite(self.columns["onset"].column.values)
        for meaning, names in meant.items():
            if meaning in self.columns:
                texts = [label_of(v) for v in self.columns[meaning].column.values]
                rows &= np.isin(texts, sorted(names))
        return np.asarray(rows)


@dataclass(frozen=True, slots=True, eq=False)
class OwnPulses:
    """The onsets of one recording in a pulse table."""

    onsets_s: np.ndarray
    unit: str  # of the onsets as they are written
    is_unit_clear: bool  # whether it is stated, or the torque rises there only
    first_sample: int | None = None  # None where nothing says it, or samples are not counted


def pulse_columns(file: str, columns: Sequence[InspectedColumn]) -> PulseColumns | None:
    """Return what the columns of a table of pulses mean, None for anything else."""
    found: dict[str, InspectedColumn] = {}
    for meaning, words in _WORDS.items():
        named = [c for c in columns if str(c.key) in NAMES[meaning] or c.words.found & words]
        fitting = [c for c in named if c not in found.values() and _fits(meaning, c)]
        if fitting:
            found[meaning] = fitting[0]
    times = [c for c in columns if "time" in c.words.found and _fits("onset", c)]
    if "onset" not in found and "duration" in found and len(times) == 1:
        found["onset"] = times[0]  # of a table whose rows have a duration
    onset = found.get("onset")
    if onset is None or onset.course.n > _MOST_PULSES:
        return None
    return PulseColumns(file, found, has_others=len(columns) > len(found))


def _fits(meaning: str, inspected: InspectedColumn) -> bool:
    if meaning not in _NUMBERS:
        return True
    return not inspected.column.is_text and inspected.course.low is not None


def stated_unit(table: PulseColumns, meaning: str) -> str:
    """Return the unit that a table says for a column of numbers, "" for none."""
    inspected = table.columns[meaning]
    if str(inspected.key) in _UNITS_OF_NAMES:
        return _UNITS_OF_NAMES[str(inspected.key)]
    text = f"{inspected.title} {inspected.column.unit}".casefold()
    if inspected.column.unit == CLOCK_TEXT:
        return CLOCK_TEXT
    if meaning != "amplitude" and ("sample" in inspected.words.found or SAMPLE in text):
        return SAMPLE
    return inspected.words.unit


def own_pulses(
    table: PulseColumns,
    rows: np.ndarray,
    time_s: np.ndarray,
    torque: np.ndarray,
    command: np.ndarray | None,
) -> OwnPulses:
    """Return the onsets of a recording; a unit that is not stated is that in which torque rises."""
    values = table.columns["onset"].column.values[rows]
    stated = stated_unit(table, "onset")
    units = (stated,) if stated else ("s", "ms", SAMPLE)
    tried = {unit: _in_seconds(values, unit, time_s) for unit in units}
    inside = {
        u: t for u, t in tried.items() if t.size and time_s[0] <= t.min() <= t.max() <= time_s[-1]
    }
    rises = {u: _rise(times, time_s, torque) for u, times in (inside or tried).items()}
    unit, *others = sorted(rises, key=lambda u: -rises[u])
    is_clear = bool(stated) or rises[unit] > _CLEARLY * max((rises[u] for u in others), default=0.0)
    first = _first_sample(values, command) if unit == SAMPLE and command is not None else None
    return OwnPulses(tried[unit], unit, is_clear, first)


def _in_seconds(values: np.ndarray, unit: str, time_s: np.ndarray) -> np.ndarray:
    if unit != SAMPLE:
        return np.asarray(conversion(unit, "s")[0] * values)
    step_s = float(np.median(np.diff(time_s)))
    return np.asarray(time_s[0] + step_s * (values - 1))


def _rise(onsets_s: np.ndarray, time_s: np.ndarray, torque: np.ndarray) -> float:
    """Return by how much the torque usually changes after onsets."""
    if not onsets_s.size:
        return 0.0
    at = [np.interp(onsets_s + later, time_s, np.nan_to_num(torque)) for later in _SPAN_S]
    return float(np.median(np.abs(at[1] - at[0])))


def _first_sample(values: np.ndarray, command: np.ndarray) -> int | None:
    """Return whether samples count from 0 or 1, by the command; None where nothing says it."""
    rising = np.flatnonzero((command[1:] != 0) & (command[:-1] == 0)) + 1
    for first in (0, 1):
        if np.isin(values - first, rising).mean() > 0.5:
            return first
    return None
