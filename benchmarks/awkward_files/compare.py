"""Comparison of what was read with the truth of a file."""

from dataclasses import dataclass, field
from typing import Any

import numpy as np
from benchmarks.awkward_files.truth import Array, Part, Truth

SWITCH_S = 0.02  # a heel strike may be off by this much, and by two samples
MOST_MISSING = 0.02
LABELS = ("participant", "condition", "side", "session")
CHANNELS = ("angle", "torque", "command", "ground_reaction_force")
UNITS = {"angle": "rad", "torque": "N*m", "command": "N*m", "ground_reaction_force": "N"}


@dataclass(frozen=True, slots=True)
class Fault:
    """A difference from the truth; `is_number` if a number is wrong, not missing."""

    channel: str
    text: str
    is_number: bool = True

    def __str__(self) -> str:
        return f"{self.channel}: {self.text}" if self.channel else self.text


@dataclass(frozen=True, slots=True)
class Stretch:
    """A part of a recording as it was read."""

    values: dict[str, Array]
    participant: str = ""
    condition: str = ""
    side: str = ""
    session: str = ""

    @classmethod
    def of(cls, dataset: Any, angle_zero_rad: float = 0.0) -> "Stretch":
        """Return the stretch of a dataset; the study's zero of the angle is subtracted."""
        names = [name for name in ("time", *CHANNELS, "contact") if name in dataset.variables]
        values = {name: dataset[name].to_numpy().astype(float) for name in names}
        if "angle" in values:
            values["angle"] = values["angle"] - angle_zero_rad
        labels = (str(dataset.attrs.get(name, "")) for name in LABELS)
        return cls(values, *labels)


@dataclass(frozen=True, slots=True)
class Reading:
    """The parts of a recording, or the message of the refusal."""

    stretches: tuple[Stretch, ...] = field(default=())
    error: str = ""
    onsets_s: tuple[float, ...] = ()


def faults_of(reading: Reading, truth: Truth) -> list[Fault]:
    """Return all differences of a reading from the truth."""
    if not reading.stretches:
        return [Fault("", f"refused: {reading.error}", is_number=False)]
    faults: list[Fault] = []
    for stretch in reading.stretches:
        fewest: list[Fault] = min((_stretch_faults(stretch, p) for p in truth.parts), key=len)
        faults += fewest
    if truth.all_parts and len(reading.stretches) != len(truth.parts):
        text = f"{len(reading.stretches)} stretch(es) of {len(truth.parts)}"
        faults.append(Fault("time", text, is_number=False))
    return faults + _onset_faults(reading, truth)


def _onset_faults(reading: Reading, truth: Truth) -> list[Fault]:
    if not truth.onsets_s:
        return []
    if not reading.onsets_s:
        return [Fault("pulses", "not read", is_number=False)]
    time = reading.stretches[0].values["time"]
    moved = np.array(reading.onsets_s) - time[0] - truth.onsets_s[0]
    same = len(reading.onsets_s) == len(truth.onsets_s) and np.allclose(
        np.diff(reading.onsets_s), np.diff(truth.onsets_s), atol=2e-3
    )
    # The first rows of a file may have been left out, as in `_aligned`.
    if same and abs(moved[0]) <= 6 * np.median(np.diff(time)):
        return []
    return [Fault("pulses", f"{len(reading.onsets_s)} onsets, not those of the file")]


def _stretch_faults(stretch: Stretch, part: Part) -> list[Fault]:
    rows, time_fault = _aligned(stretch.values["time"], part)
    if rows is None:
        return [Fault("time", time_fault)]
    faults = [Fault("time", time_fault)] if time_fault else []
    for name in CHANNELS:
        fault = _channel_fault(name, stretch, part, rows)
        faults += [fault] if fault else []
    fault = _strike_fault(stretch, part, rows)
    return faults + ([fault] if fault else [])


def _aligned(time: Array, part: Part) -> tuple[Any, str]:
    """Return the rows of the truth that were read, and what is wrong with the time steps."""
    true = part.values["time"]
    tolerance = 1.05 * part.step.get("time", 0.0) + 1e-6
    if time.size == true.size:
        off = np.abs((time - time[0]) - (true - true[0]))
        text = _time_text(time, true) if off.max() > tolerance else ""
        return slice(None), text
    if abs(time.size - true.size) > max(5.0, 0.005 * true.size):
        return None, f"{time.size} samples of {true.size}"
    for first in range(6):
        moved = time - time[0] + true[first]
        rows = np.clip(np.searchsorted(true, moved - tolerance), 0, true.size - 1)
        if np.abs(true[rows] - moved).max() <= tolerance:
            return rows, ""
    return None, _time_text(time, true)


def _time_text(time: Array, true: Array) -> str:
    texts = (
        f"{name} {t[-1] - t[0]:.6g} s in steps of {np.median(np.diff(t)):.6g} s"
        for name, t in (("read", time), ("truth", true))
    )
    return ", ".join(texts)


def _channel_fault(name: str, stretch: Stretch, part: Part, rows: Any) -> Fault | None:
    true, values = part.values.get(name), stretch.values.get(name)
    if true is None:
        invented = values is not None and name in ("angle", "torque", "command")
        return Fault(name, f"read as {_range(values, name)}, not known") if invented else None
    if values is None:
        return Fault(name, "not read", is_number=False)
    true = true[rows]
    both = np.isfinite(true) & np.isfinite(values)
    if both.sum() < (1 - MOST_MISSING) * np.isfinite(true).sum():
        return Fault(name, f"{both.sum()} of {np.isfinite(true).sum()} values", is_number=False)
    off = np.abs(values[both] - true[both]).max()
    if off > 0.51 * part.step.get(name, 0.0) + 1e-6 or _has_a_mark_of_missing(values, true):
        return Fault(name, f"read as {_range(values, name)}, truth {_range(true, name)}")
    return None


def _has_a_mark_of_missing(values: Array, true: Array) -> bool:
    """Return whether a number that stands for a missing value was read as a value."""
    low, high = np.nanmin(true), np.nanmax(true)
    span = max(high - low, 1.0)
    return bool(np.nanmin(values) < low - span or np.nanmax(values) > high + span)


def _range(values: Any, name: str) -> str:
    return f"{np.nanmin(values):.4g} to {np.nanmax(values):.4g} {UNITS[name]}"


def _strike_fault(stretch: Stretch, part: Part, rows: Any) -> Fault | None:
    """Compare heel strikes by the rows of the file, so that a wrong clock counts once."""
    contact = stretch.values.get("contact")
    if "contact" not in part.values:
        return None
    if contact is None:
        return Fault("contact", "not read", is_number=False)
    true = part.values["contact"][rows]
    found, wanted = _rises(contact), _rises(true)
    time = part.values["time"][rows]
    tolerance = SWITCH_S + 2 * float(np.median(np.diff(time)))
    same = len(found) == len(wanted) and bool(
        np.all(np.abs(time[found] - time[wanted]) <= tolerance)
    )
    return None if same else Fault("contact", f"{len(found)} heel strikes, truth {len(wanted)}")


def _rises(contact: Array) -> Any:
    low, high = np.nanmin(contact), np.nanmax(contact)
    return np.flatnonzero(np.diff((contact > (low + high) / 2).astype(int)) == 1) + 1
