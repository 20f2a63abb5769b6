"""Guesses of the channels of a study among the columns of a file, with reasons."""

import re
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from jointz.core.channels import CHANNEL_UNITS, CONDITIONS, MOTION_SENSORS
from jointz.core.grouping import by_key
from jointz.core.units import conversion, si_unit_of
from jointz.inspection.content import Column
from jointz.inspection.names import (
    JOINTS,
    Words,
    channel_scores,
    without_accents,
    word_set,
    words_of,
)
from jointz.inspection.signals import SignalSummary, signal_summary
from jointz.io.text.clock_times import CLOCK_TEXT
from jointz.io.text.column_names import readable_unit
from jointz.io.toml_problems import OPEN

#: Order of assignment: channels with clear names come first.
_ORDER = (
    *("time", "trial", "condition", "contact", "ground_reaction_force"),
    *("trigger", "command", "reference"),
    *("current", "motor_velocity", "motor_acceleration", "motor_angle", "torque", "angle"),
    *(*MOTION_SENSORS, "velocity", "cycle"),
)
_PART_AT_END = re.compile(r"[./](?:\{part\}|\d+)$")  # behind which a unit may stand
#: Axis behind a name, before the number of a sensor and a unit.
_AXIS_AT_END = re.compile(r"(.+?)[./_ ][xyz](?:\s+\d+)?(?:\s*[\[(][^\])]*[\])])?", re.IGNORECASE)
_FAR_MORE = 3.0  # range of the axis of flexion over those of the others
_OF_DEVICE = {"torque", "current", "command"}
_NEVER_CONSTANT = ("angle", "contact", "ground_reaction_force")
_BARE_T = re.compile(r"[%#]?\s*T\s*")
_LABELS = ("trial", "condition", "cycle")
_LARGEST_RAD = 3.5  # beyond the range of joints
_FULL_TURN = 2 * np.pi
_SHORTEST_STEP_S, _LONGEST_STEP_S = 5e-6, 0.1
_MOST_A, _MOST_MA = 150.0, 40e3
_CHANGES = 0.05  # largest share of samples at which a label changes
#: Words of names and of levels; a name that has words of two of them says neither.
_CONDITION_WORDS = {
    "no_device": word_set("nwc nodevice withoutdevice"),
    "unperturbed": word_set("unperturbed unpert npc enp baseline normal"),
    "perturbed": word_set("perturbed perturbation perturbations pert apc ewp pulses pulse"),
}
#: Levels that answer whether there were pulses, where the name of their column asks it.
_ANSWERS = {**dict.fromkeys(("0", "no", "off", "false"), "unperturbed"),
            **dict.fromkeys(("1", "yes", "on", "true"), "perturbed")}  # fmt: skip
_NOT_PERTURBED = re.compile(
    r"(?<![a-z])(?:non|not|no|sin|sans|ohne|senza|zonder|niet|without|un|on)[\s_-]*"
    r"(?:pert|stor|ge?stor|stoer|gestoer|puls|verstoor|impuls)",
    re.IGNORECASE,
)
#: Unit of time -> s: the first in which steps are those of a recorder.
_TIME_UNITS = {"s": 1.0, "ms": 1e-3, "us": 1e-6, "ns": 1e-9, "d": 86400.0}


@dataclass(frozen=True, slots=True, eq=False)
class InspectedColumn:
    """A column with the words of its name and a summary of its samples."""

    column: Column
    words: Words  # words of its name, with the stated unit if there is one
    course: SignalSummary  # summary of its samples

    @property
    def key(self) -> str | int:
        """Name of the column in a study."""
        return self.column.key

    @property
    def title(self) -> str:
        """Name of the column for people."""
        return str(self.column.title or self.column.key)


@dataclass(frozen=True, slots=True)
class Assignment:
    """Assignment of a column to a channel of a study."""

    channel: str
    why: str  # reason for the assignment, in words
    unit: str = ""  # "" for a label or a switch
    unit_why: str = ""  # reason for the unit, "" if the file states it


#: Channel -> its column, and how it was assigned.
Assignments = Mapping[str, tuple[InspectedColumn, Assignment]]


def inspect_column(column: Column) -> InspectedColumn:
    """Inspect the name and the samples of a column."""
    name = str(column.title or column.key)
    words = words_of(_PART_AT_END.sub("", name))
    stated = readable_unit(column.unit)
    return InspectedColumn(
        column, replace(words, unit=stated) if stated else words, signal_summary(column)
    )


def guessed_joint(columns: Sequence[InspectedColumn], file: Words) -> tuple[str, str]:
    """Return the most likely joint of a file and the reason; "" if there is no hint."""
    found: Counter[str] = Counter()
    for channel in ("angle", "torque"):
        for joint in {c.words.joint for c in columns if channel in channel_scores(c.words)}:
            found[joint] += 1
    del found[""]
    if file.joint and (not found or file.joint in found):
        return file.joint, "by the name of the file or the folder"
    if found:
        best = max(found.values())
        return next(j for j in JOINTS if found[j] == best), "by names of columns"
    named = next((j for j in JOINTS if any(c.words.joint == j for c in columns)), "")
    return named, "by names of columns" if named else ""


def guessed_side(columns: Sequence[InspectedColumn], file: Words, joint: str) -> tuple[str, str]:
    """Return the first side to analyse and the reason; "" if names state no side."""
    if file.side:
        return file.side, "by the file's name"
    of_joint = [c for c in columns if c.words.joint in ("", joint)]
    sides = {c.words.side for c in of_joint} - {""}
    worn = {c.words.side for c in of_joint if _OF_DEVICE & set(channel_scores(c.words))} - {""}
    if len(worn) == 1 < len(sides):
        return worn.pop(), "only its torque was measured"
    if len(sides) > 1:
        return "right", "the file has columns of both sides; name the others for left"
    return (sides.pop(), "by names of columns") if sides else ("", "")


def assign_channels(
    columns: Sequence[InspectedColumn], file: Words, *, joint: str, side: str
) -> dict[str, tuple[InspectedColumn, Assignment]]:
    """Assign columns to channels, one to one."""
    of_joint = [
        c for c in _main_axes(columns)
        if c.words.joint in ("", joint) and (not side or c.words.side in ("", side))
    ]  # fmt: skip
    assigned: dict[str, tuple[InspectedColumn, Assignment]] = {}
    used: set[int] = set()
    for channel in _ORDER:
        best = _best(channel, [c for c in of_joint if id(c) not in used])
        if best is not None:
            used.add(id(best))
            by_unit = channel_scores(best.words)[channel] == 1
            why = "its unit and name" if by_unit else "its name"
            assigned[channel] = (best, _assignment(channel, best, why))
    _by_content(assigned, [c for c in of_joint if id(c) not in used], file)
    _own_clock(assigned, columns)
    return assigned


def _main_axes(columns: Sequence[InspectedColumn]) -> list[InspectedColumn]:
    """Return columns, of three axes of an angle or a moment only one that turns far more."""
    ends = ((_AXIS_AT_END.fullmatch(column.title), column) for column in columns)
    points = by_key((end[1], column) for end, column in ends if end)
    kept = {id(c): c for c in columns}
    for name, axes in points.items():
        best = max(axes, key=_span)
        words = replace(words_of(name), unit=best.words.unit)
        others = [_span(c) for c in axes if c is not best]
        far_more = _span(best) > _FAR_MORE * max(others, default=0.0)
        is_of_joint = bool({"angle", "torque"} & set(channel_scores(words)))
        if far_more and (words.joint or others) and is_of_joint:
            for axis in axes:
                del kept[id(axis)]
            kept[id(best)] = replace(best, words=words)
    return list(kept.values())


def _span(inspected: InspectedColumn) -> float:
    return (inspected.course.high or 0.0) - (inspected.course.low or 0.0)


def _own_clock(
    assigned: dict[str, tuple[InspectedColumn, Assignment]], columns: Sequence[InspectedColumn]
) -> None:
    """Take the column of time that stands nearest before the angle and is as long, in place."""
    angle = assigned["angle"][0] if "angle" in assigned else None
    clocks = [c for c in columns if _fits("time", c) or c.column.unit == CLOCK_TEXT]
    if angle is not None and len(clocks) > 1 and not angle.column.is_text:
        before = [c for c in clocks[1:] if columns.index(c) < columns.index(angle)]
        as_long = [c for c in before if _n_filled(c) == _n_filled(angle)]
        if as_long and _n_filled(assigned["time"][0]) != _n_filled(angle):
            why = "the column of time before the angle"
            assigned["time"] = (as_long[-1], _assignment("time", as_long[-1], why))
    elif "time" not in assigned and clocks:
        assigned["time"] = (clocks[0], _assignment("time", clocks[0], "it holds times of day"))


def _n_filled(inspected: InspectedColumn) -> int:
    return inspected.course.n - inspected.course.n_missing


def _best(channel: str, columns: Sequence[InspectedColumn]) -> InspectedColumn | None:
    fitting = [c for c in columns if _fits(channel, c)]
    return max(fitting, key=lambda c: _score(channel, c), default=None)


def _fits(channel: str, inspected: InspectedColumn) -> bool:
    scores = channel_scores(inspected.words)
    if channel not in scores:
        return False
    if channel in _LABELS:
        if channel not in channel_scores(words_of(inspected.title.rpartition(".")[2])):
            return False  # in a struct named "trial"
        return _is_label(inspected, least=2 if channel == "condition" else 1)
    low = inspected.course.low
    if inspected.column.is_text or low is None:
        return False
    if low == inspected.course.high and channel in _NEVER_CONSTANT:
        return False  # a setting, such as an offset
    if channel == "contact" and scores[channel] == 1:
        return inspected.words.unit == "V" or len(inspected.course.levels) == 2
    if channel == "time" and _BARE_T.fullmatch(inspected.title) and not inspected.words.unit:
        return False  # a torque, or a temperature
    return channel != "time" or inspected.course.rises or _restarts(inspected)


def _score(channel: str, inspected: InspectedColumn) -> tuple[float, float]:
    level = float(channel == "time" and bool(inspected.words.unit))
    if channel == "ground_reaction_force":  # of three axes, the one that carries the body
        values = inspected.column.values
        level = float(abs(np.nanmean(values))) if np.isfinite(values).any() else 0.0
    level -= float(inspected.words.unit.endswith("/kg"))  # a moment that was computed
    steady = inspected.course.low == inspected.course.high
    return channel_scores(inspected.words)[channel] - 2 * steady, level


def _is_label(inspected: InspectedColumn, *, least: int) -> bool:
    """Tell whether a column holds few values that rarely change."""
    values = inspected.column.values
    if not inspected.column.is_text and not inspected.course.whole:
        return False
    changes = int((values[1:] != values[:-1]).sum())
    return changes + 1 >= least and changes <= _CHANGES * values.size


def _restarts(inspected: InspectedColumn) -> bool:
    """Tell whether numbers rise and sometimes restart, as the time of trials."""
    values = inspected.column.values
    rising = values[1:] > values[:-1]
    return bool(rising.size and rising.mean() > 0.9)


def _by_content(
    assigned: dict[str, tuple[InspectedColumn, Assignment]],
    free: Sequence[InspectedColumn],
    file: Words,
) -> None:
    """Assign columns without a name by their samples, in place."""
    unnamed = [c for c in free if not c.column.title and isinstance(c.key, int)]
    unnamed = [c for c in unnamed if c.course.low is not None]
    if "time" not in assigned and unnamed and unnamed[0].course.rises:
        first = unnamed.pop(0)
        why = "the first column, and it only increases"
        assigned["time"] = (first, _assignment("time", first, why))
    if len(unnamed) != 1:
        return
    (only,) = unnamed
    named = channel_scores(file)
    wanted = max(named, key=lambda name: named[name], default="")
    if wanted and wanted not in assigned and wanted not in ("time", *_LABELS):
        why = "the only column beside time; file's name"
        assigned[wanted] = (only, _assignment(wanted, only, why))


def _assignment(channel: str, inspected: InspectedColumn, why: str) -> Assignment:
    if channel in (*_LABELS, "trigger"):
        return Assignment(channel, why)
    if channel == "contact":
        volts = len(inspected.course.levels) != 2
        return Assignment(channel, why, (inspected.words.unit or "V") if volts else "")
    if inspected.words.unit:
        return Assignment(channel, why, inspected.words.unit, inspected.column.unit_why)
    unit, unit_why = guessed_unit(channel, inspected)
    return Assignment(channel, why, unit, unit_why)


def guessed_unit(channel: str, inspected: InspectedColumn) -> tuple[str, str]:
    """Return the unit that a column's numbers suggest, and the reason."""
    low, high = inspected.course.low or 0.0, inspected.course.high or 0.0
    size, span = max(abs(low), abs(high)), high - low
    if channel == "time":
        return _unit_of_time(inspected.column.values)
    if channel in ("angle", "motor_angle"):
        if span > _FULL_TURN or size > _LARGEST_RAD:
            return "deg", f"{low:.4g} to {high:.4g} is too far for rad"
        return "rad", f"{low:.4g} to {high:.4g} would be small in deg"
    if channel == "current" and _MOST_A < size < _MOST_MA:
        return "mA", f"{size:.4g} is too much for A"
    return CHANNEL_UNITS[channel][0], "the usual one"


def _unit_of_time(time: np.ndarray) -> tuple[str, str]:
    steps = np.diff(time[np.isfinite(time)])
    step = float(np.median(steps)) if steps.size else 0.0
    for unit, factor in _TIME_UNITS.items():
        if _SHORTEST_STEP_S < step * factor < _LONGEST_STEP_S:
            return unit, f"stamps are {step:.6g} apart"
    return "s", "the usual one"


def si_of(assignment: Assignment) -> tuple[str, float]:
    """Return the SI unit of a column and the factor to it."""
    if not assignment.unit:
        return "1", 1.0
    si_unit, factor, _ = si_unit_of(assignment.unit)
    return si_unit, factor


def in_seconds(inspected: InspectedColumn, assignment: Assignment) -> np.ndarray:
    """Return the stamps of a time column, s."""
    factor, offset = conversion(assignment.unit or "s", "s")
    return np.asarray(factor * inspected.column.values + offset)


def guessed_condition(text: str) -> str:
    """Return the condition that a name or a level means, "" for none."""
    if known := CONDITIONS.get(text.strip().casefold()):
        return known
    if _NOT_PERTURBED.search(without_accents(text)):
        return "unperturbed"
    found = words_of(text).found
    meant = [condition for condition, words in _CONDITION_WORDS.items() if found & words]
    return meant[0] if len(meant) == 1 else ""


def condition_levels(assigned: Assignments) -> dict[str, str]:
    """Return the meaning of the levels of a column of conditions: by words, else by the command."""
    if "condition" not in assigned:
        return {}
    inspected = assigned["condition"][0]
    asks = inspected.words.found & _CONDITION_WORDS["perturbed"]
    levels = {}
    for level in filter(None, inspected.course.levels):
        meant = guessed_condition(level) or (asks and _ANSWERS.get(level.casefold(), ""))
        if not meant and "command" in assigned:
            command = assigned["command"][0].column.values
            values = inspected.column.values
            own = values == level if inspected.column.is_text else values == float(level)
            meant = "perturbed" if np.nan_to_num(command[own]).any() else "unperturbed"
        levels[level] = meant or OPEN
    return levels
