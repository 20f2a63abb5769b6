"""Which channels of a study the columns of a file seem to be, and why."""

import re
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from jointz.core.channels import CHANNEL_UNITS, CONDITIONS
from jointz.inspection.content import Column
from jointz.inspection.names import (
    GAIT_WORDS,
    JOINTS,
    Words,
    channel_scores,
    readable_unit,
    word_set,
    words_of,
)
from jointz.inspection.signals import Course, course_of
from jointz.io.text.units import conversion, si_unit_of

#: In the order in which columns are given away; the clearer names come first.
_ORDER = (
    *("time", "trial", "condition", "contact", "ground_reaction_force", "command", "reference"),
    *("current", "motor_velocity", "motor_acceleration", "motor_angle", "torque", "angle"),
    *("velocity", "cycle"),
)
_BARE_T = re.compile(r"[%#]?\s*T\s*")
_LABELS = ("trial", "condition", "cycle")
_LARGEST_RAD = 3.5  # no joint bends so far
_FULL_TURN = 2 * np.pi
_LONGEST_STEP_S = 0.1
_MOST_A, _MOST_MA, _MOST_NM = 150.0, 40e3, 2000.0
_CHANGES = 0.05  # a label that changes more often than this share of samples is none
_UNPERTURBED = word_set("unperturbed unpert npc enp normal baseline rest off no 0 false")
_PERTURBED = word_set("perturbed pert apc ewp pulses pulse on yes 1 true")
_NO_DEVICE = word_set("nwc nodevice without barefoot")


@dataclass(frozen=True, slots=True, eq=False)
class Looked:
    """A column that was looked at: its name taken apart, and what its samples show."""

    column: Column
    words: Words  # its name, with the unit that stands beside it where one does
    course: Course  # its samples

    @property
    def key(self) -> str | int:
        """What a study calls the column."""
        return self.column.key

    @property
    def title(self) -> str:
        """What people call the column."""
        return str(self.column.title or self.column.key)


@dataclass(frozen=True, slots=True)
class Taken:
    """What a column is taken for."""

    channel: str  # the channel of a study
    why: str  # in words
    unit: str = ""  # its unit, "" for a label or a switch
    unit_why: str = ""  # why this unit, "" where the file states it


def looked_at(column: Column) -> Looked:
    """Look at the name and the samples of a column."""
    words = words_of(str(column.title or column.key))
    stated = readable_unit(column.unit)
    return Looked(column, replace(words, unit=stated) if stated else words, course_of(column))


def guessed_joint(columns: Sequence[Looked], file: Words) -> tuple[str, str]:
    """Return the joint that a file is most likely about, with why; "" where nothing says."""
    found: Counter[str] = Counter()
    for channel in ("angle", "torque"):
        for joint in {c.words.joint for c in columns if channel in channel_scores(c.words)}:
            found[joint] += 1
    del found[""]
    if file.joint and (not found or file.joint in found):
        return file.joint, "the file's or the folder's name says it"
    if found:
        best = max(found.values())
        return next(j for j in JOINTS if found[j] == best), "names of columns say it"
    named = next((j for j in JOINTS if any(c.words.joint == j for c in columns)), "")
    return named, "names of columns say it" if named else ""


def guessed_side(columns: Sequence[Looked], file: Words, joint: str) -> tuple[str, str]:
    """Return the side to begin with, "" where names say none, with why."""
    if file.side:
        return file.side, "the file's name says it"
    sides = {c.words.side for c in columns if c.words.joint in ("", joint)} - {""}
    if len(sides) > 1:
        return "right", "the columns of both sides are there; write the other's for left"
    return (sides.pop(), "names of columns say it") if sides else ("", "")


def assigned(
    columns: Sequence[Looked], file: Words, *, joint: str, side: str
) -> dict[str, tuple[Looked, Taken]]:
    """Give columns to channels; each column to one, each channel to one."""
    of_joint = [
        c for c in columns
        if c.words.joint in ("", joint) and (not side or c.words.side in ("", side))
    ]  # fmt: skip
    given: dict[str, tuple[Looked, Taken]] = {}
    used: set[int] = set()
    for channel in _ORDER:
        best = _best(channel, [c for c in of_joint if id(c) not in used])
        if best is not None:
            used.add(id(best))
            by_unit = channel_scores(best.words)[channel] == 1
            why = "its unit and name" if by_unit else "its name"
            given[channel] = (best, _taken(channel, best, why))
    _by_content(given, [c for c in of_joint if id(c) not in used], file)
    return given


def _best(channel: str, columns: Sequence[Looked]) -> Looked | None:
    fitting = [c for c in columns if _fits(channel, c)]
    return max(fitting, key=lambda c: _score(channel, c), default=None)


def _fits(channel: str, looked: Looked) -> bool:
    if channel not in channel_scores(looked.words):
        return False
    if channel in _LABELS:
        return _is_label(looked, least=2 if channel == "condition" else 1)
    if looked.column.is_text or looked.course.low is None:
        return False
    if channel == "contact" and channel_scores(looked.words)[channel] == 1:
        return looked.words.unit == "V" or len(looked.course.levels) == 2
    if channel == "time" and _BARE_T.fullmatch(looked.title) and not looked.words.unit:
        return False  # a torque, or a temperature
    return channel != "time" or looked.course.rises or _begins_again(looked)


def _score(channel: str, looked: Looked) -> tuple[float, float]:
    level = float(channel == "time" and bool(looked.words.unit))
    if channel == "ground_reaction_force":  # of three axes, the one that bears the body
        values = looked.column.values
        level = float(np.nanmean(values)) if np.isfinite(values).any() else 0.0
    steady = "constant" in " ".join(looked.course.notes)
    return channel_scores(looked.words)[channel] - 2 * steady, level


def _is_label(looked: Looked, *, least: int) -> bool:
    """Whether a column holds whole stretches of a few values."""
    values = looked.column.values
    if not looked.column.is_text and not looked.course.whole:
        return False
    changes = int((values[1:] != values[:-1]).sum())
    return changes + 1 >= least and changes <= _CHANGES * values.size


def _begins_again(looked: Looked) -> bool:
    """Whether numbers rise, and start again now and then: the time of trials."""
    steps = np.diff(looked.column.values)
    rising = steps > 0
    return bool(rising.size and rising.mean() > 0.9)


def _by_content(
    given: dict[str, tuple[Looked, Taken]], free: Sequence[Looked], file: Words
) -> None:
    """Give columns without a name away by what they hold, in place."""
    unnamed = [c for c in free if not c.column.title and isinstance(c.key, int)]
    unnamed = [c for c in unnamed if c.course.low is not None]
    if "time" not in given and unnamed and unnamed[0].course.rises:
        first = unnamed.pop(0)
        why = "the first column, and it only grows"
        given["time"] = (first, _taken("time", first, why))
    if len(unnamed) != 1:
        return
    (only,) = unnamed
    named = channel_scores(file)
    wanted = max(named, key=lambda name: named[name], default="")
    if wanted and wanted not in given and wanted not in ("time", *_LABELS):
        given[wanted] = (only, _taken(wanted, only, "the only column beside time; file's name"))
    elif not wanted and _smooth(only) and not file.found & GAIT_WORDS:
        given["angle"] = (only, _taken("angle", only, "the only column beside time; it is smooth"))


def _smooth(looked: Looked) -> bool:
    values = looked.column.values[np.isfinite(looked.column.values)]
    spread = float(values.std())
    turning = looked.course.high is not None and max(
        abs(looked.course.high), abs(looked.course.low or 0.0)
    ) <= 360.0  # fmt: skip
    return bool(spread and turning and np.diff(values).std() < 0.2 * spread)


def _taken(channel: str, looked: Looked, why: str) -> Taken:
    if channel in _LABELS:
        return Taken(channel, why)
    if channel == "contact":
        volts = len(looked.course.levels) != 2
        return Taken(channel, why, (looked.words.unit or "V") if volts else "")
    if looked.words.unit:
        return Taken(channel, why, looked.words.unit, looked.column.unit_why)
    unit, unit_why = guessed_unit(channel, looked)
    return Taken(channel, why, unit, unit_why)


def guessed_unit(channel: str, looked: Looked) -> tuple[str, str]:
    """Return the unit that a column's numbers suggest, with why."""
    low, high = looked.course.low or 0.0, looked.course.high or 0.0
    size, span = max(abs(low), abs(high)), high - low
    if channel == "time":
        return _unit_of_time(looked.column.values)
    if channel in ("angle", "motor_angle"):
        if span > _FULL_TURN or size > _LARGEST_RAD:
            return "deg", f"{low:.4g} to {high:.4g} is too far for rad"
        return "rad", f"{low:.4g} to {high:.4g} would be little in deg"
    if channel in ("torque", "command") and size > _MOST_NM:
        return "N*m", f"the usual one, though {size:.4g} is too much"
    if channel == "current" and _MOST_A < size < _MOST_MA:
        return "mA", f"{size:.4g} is too much for A"
    return CHANNEL_UNITS[channel][0], "the usual one"


def _unit_of_time(time: np.ndarray) -> tuple[str, str]:
    steps = np.diff(time[np.isfinite(time)])
    step = float(np.median(steps)) if steps.size else 0.0
    for unit, factor in (("s", 1.0), ("ms", 1e-3), ("us", 1e-6), ("ns", 1e-9)):
        if 0 < step * factor < _LONGEST_STEP_S:
            return unit, f"stamps are {step:.6g} apart"
    return "s", "the usual one"


def si_of(taken: Taken) -> tuple[str, float]:
    """Return the SI unit of a column and the factor to it."""
    if not taken.unit:
        return "1", 1.0
    si_unit, factor, _ = si_unit_of(taken.unit)
    return si_unit, factor


def in_seconds(looked: Looked, taken: Taken) -> np.ndarray:
    """Return the stamps of a time column, s."""
    factor, offset = conversion(taken.unit or "s", "s")
    return np.asarray(factor * looked.column.values + offset)


def guessed_condition(text: str) -> str:
    """Return the condition that a name or a level stands for, "" where it says none."""
    known = CONDITIONS.get(text.strip().casefold())
    if known:
        return known
    found = words_of(text).found | {text.strip().casefold()}
    for condition, words in (
        ("no_device", _NO_DEVICE),
        ("unperturbed", _UNPERTURBED),
        ("perturbed", _PERTURBED),
    ):
        if found & words:
            return condition
    return ""
