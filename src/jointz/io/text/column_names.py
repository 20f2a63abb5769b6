"""Names of columns: the unit in brackets, the column that is the clock, unique names."""

import re
from collections.abc import Mapping, Sequence

import numpy as np

from jointz.core.acquisition import Signal, SignalGroup
from jointz.core.errors import UnitError
from jointz.core.units import si_unit_of

#: Stands between two units of one column where a file contradicts itself: ``deg or rad``.
EITHER = " or "
#: What jointz calls a column of time stamps where the content has no name for it.
CLOCK_COLUMN = "time [s]"
_CLOCK_NAMES = (CLOCK_COLUMN, "time_s", "time (s)", "Time [s]", "Time_s", "Time (s)")
#: Metadata that say what the reader made of a file; no format has to hold them.
READING = "reading."
#: Metadata that keep the name of the column a group's clock was taken from.
_TIME_COLUMN = "time.column"

#: What a row of units says of a number without one.
NO_UNIT = ("", "-", "1", "n/a", "none")
#: Last parts of names that are axes, counters or words, although they also spell a unit.
_NO_UNIT_WORDS = frozenset(
    [*"xyzthgkjwclrman", "in", "rev", "max", "min", "mean", "out", "id", "no"]
)
#: Common spellings of units in column names.
_SPELLINGS: Mapping[str, str] = {
    "nm": "N*m", "n.m": "N*m", "mnm": "mN*m", "nm/kg": "N*m/kg", "v": "V", "a": "A", "ma": "mA",
    "n": "N", "hz": "Hz", "degrees": "deg", "radians": "rad", "sec": "s", "msec": "ms",
    "seconds": "s", "milliseconds": "ms", "n/kg": "N/kg", "1/min": "rpm", "min-1": "rpm",
    "min^-1": "rpm", "volts": "V", "deg": "deg", "rad": "rad", "s": "s", "ms": "ms", "us": "us",
}  # fmt: skip
_BRACKETS = re.compile(r"[\[(]([^\])=,;]*)[^\])]*[\])]\s*$")
_IN_BRACKETS = re.compile(r"[\[(]([^\[\]()=;]*)")
_TAIL = re.compile(r"(?:[_ :]|^(?=.*/))([A-Za-z%°][A-Za-z0-9*/^°%.·-]*)$")
_PRODUCT = re.compile(r"(?<![A-Za-z])(N|lbf?|lbs|ft|in)_(m|in|ft|lbf?s?)$", re.IGNORECASE)
_PER = re.compile(r"(?<=[A-Za-z])_(?=(?:kg|s2?|sec)$)")
_CAMEL = re.compile(r"(?<=[a-z\d]{2})(?:Deg|Rad|Nm)$|(?<![A-Za-z])(?:deg|rad|degrees|radians)$")
_BRACKETED = re.compile(r"\[([^\[\]]+)\]\s*$|\(([^()]+)\)\s*$")
_TIME = re.compile(
    r"[%#]?\s*(?:(?:loop|state|elapsed|system|host|sample)[\s_.]*)?time(?:[\s_.]*stamps?)?"
    r"(?:[\s_.]*(?P<unit>s|sec|secs|seconds|ms|us|min))?"
    r"|[%#]?\s*(?:(?-i:t)|t_(?P<short>s|ms|us))",  # a bare T is a temperature, or a torque
    re.IGNORECASE,
)


def unit_in_name(name: str) -> str:
    """Return the unit that stands in brackets at the end of a column's name, else "".

    What stands in round brackets must be a unit that can be read: ``force (left)`` has none.
    """
    unit = _in_brackets(name)
    return "" if name.rstrip().endswith(")") and not _readable(unit) else unit


def known_unit_in_name(name: str) -> str:
    """Return the unit in brackets, or as in ``moment_Nm_kg``; "" where it cannot be read."""
    unit = unit_in_name(name) or ("N*m/kg" if name.endswith("_Nm_kg") else "")
    return unit if unit and all(map(_readable, unit.split(EITHER))) else ""


def written_unit(name: str) -> str:
    """Return the unit that a name seems to state, in brackets or at its end, readably spelled."""
    if _BRACKETS.search(name):
        inside = [text.split(",")[0] for text in _IN_BRACKETS.findall(name)]
        return next(filter(None, map(readable_unit, reversed(inside))), "")
    joined = _PRODUCT.sub(r"\1-\2", name.replace("_per_", "/").replace(" per ", "/"))
    for text in (_PER.sub("/", joined), joined):  # torque_Nm_kg, then time_s
        tail = _TAIL.search(text)
        if tail and tail[1].casefold() not in _NO_UNIT_WORDS and (unit := readable_unit(tail[1])):
            return unit
    last = _CAMEL.search(name)
    return readable_unit(last[0].lower()) if last else ""


def readable_unit(text: str) -> str:
    """Return a unit in readable spelling, "" if it is unknown."""
    plain = text.strip()
    plain = plain if plain == "N" else _SPELLINGS.get(plain.casefold(), plain)
    return "" if plain in ("", "1", "-") or plain.isdecimal() or not _readable(plain) else plain


def is_unit(cell: str) -> bool:
    """Return whether a cell holds a unit, or says that there is none."""
    return cell.lower() in NO_UNIT or bool(readable_unit(cell))


def name_with_unit(signal: Signal) -> str:
    """Return a signal's name with its unit in brackets, where it does not end so already."""
    if not signal.unit or unit_in_name(signal.name) == signal.unit:
        return signal.name
    return f"{signal.name} [{signal.unit}]"


def with_clock(
    name: str, signals: Sequence[Signal], *, row: int = 1
) -> tuple[SignalGroup, dict[str, str]]:
    """Make a group of columns; one that holds time becomes its clock.

    Of several the first that states seconds is taken, else one that states another unit of time,
    else one that states none, and is taken for seconds; in any case it increases, and what was
    passed over is told. A column of time in seconds is taken out of the signals; its name is kept
    in the metadata. One in another unit stays as it is, and the clock is made of it.
    """
    named = sorted((s for s in signals if is_time(s.name)), key=_unclearness)
    if not named:
        return SignalGroup(name, tuple(signals)), {}
    clock, why_not = _clearest(named, row)
    notes: dict[str, str] = {}
    if why_not:
        notes[_of_group(f"{READING}time", name)] = why_not
    if clock is None:
        return SignalGroup(name, tuple(signals)), notes
    factor, column = seconds_of_one(clock) or 1.0, clock.column or clock.name
    if factor != 1.0:
        time_s = factor * clock.values
        return SignalGroup(name, tuple(signals), time_s=time_s, time_column=column), notes
    stated = bool(_time_unit(clock))
    if not stated:
        notes[time_unit_key(name)] = f"column '{column}' states no unit; taken for seconds"
    if clock.name != CLOCK_COLUMN:
        notes[time_column_key(name)] = clock.name
    rest = tuple(signal for signal in signals if signal is not clock)
    group = SignalGroup(
        name, rest, time_s=clock.values, time_column=column, time_unit_stated=stated
    )
    return group, notes


def clock_column(group: SignalGroup, metadata: Mapping[str, str]) -> str:
    """Return the name for a group's column of time stamps; no signal has it."""
    taken = {signal.name for signal in group.signals}
    taken |= {name_with_unit(signal) for signal in group.signals}
    preferred = metadata.get(time_column_key(group.name), CLOCK_COLUMN)
    name = next((n for n in (preferred, *_CLOCK_NAMES) if n not in taken and is_time(n)), None)
    if name is None:  # a name for each signal there is, and one more
        name = next(n for k in range(1, len(taken) + 2) if (n := f"clock {k} [s]") not in taken)
    return name


def time_column_key(group: str) -> str:
    """Return the key under which metadata keep the name of a group's time column."""
    return _of_group(_TIME_COLUMN, group)


def time_unit_key(group: str) -> str:
    """Return the key under which metadata say that a clock without a unit is taken for seconds."""
    return _of_group(f"{READING}time_unit", group)


def is_time(name: str) -> bool:
    """Whether a column of this name holds time stamps, as far as a name can say."""
    return _time_match(name) is not None


def seconds_of_one(signal: Signal) -> float | None:
    """Return the factor from a column of time to seconds, None where its unit is none of time."""
    try:
        si_unit, factor, _ = si_unit_of(_time_unit(signal) or "s")
    except UnitError:
        return None
    return factor if si_unit == "s" else None


def unique_names(names: Sequence[str], *, sign: str = "_") -> list[str]:
    """Return names that differ: a later one of the same name gets a number."""
    names_so_far: dict[str, None] = {}
    following: dict[str, int] = {}
    for name in names:
        number, unique = following.get(name, 2), name
        while unique in names_so_far:
            unique, number = f"{name}{sign}{number}", number + 1
        names_so_far[unique], following[name] = None, number
    return list(names_so_far)


def distinct_names(labels: Sequence[str], count: int, kind: str) -> list[str]:
    """Return one name each: a second ``Fx`` is ``Fx#2``, a channel without label is counted."""
    plain = [label or f"{kind} {i}" for i, label in enumerate(padded(labels, count), start=1)]
    return unique_names(plain, sign="#")


def padded(texts: Sequence[str], count: int) -> list[str]:
    """Return as many texts as wanted, "" where there are fewer."""
    return [*texts[:count], *[""] * (count - len(texts))]


def _of_group(key: str, group: str) -> str:
    return f"{key}.{group}" if group else key


def _in_brackets(name: str) -> str:
    """Return what stands in brackets at the end of a name, "" for nothing or a number."""
    match = _BRACKETED.search(name)
    text: str = (match[1] or match[2]).strip() if match else ""
    return "" if text.isdecimal() else text


def _time_match(name: str) -> re.Match[str] | None:
    return _TIME.fullmatch(_BRACKETED.sub("", name).strip())


def _time_unit(signal: Signal) -> str:
    """Return the unit that a column of time states, one that cannot be read too; "" for none."""
    match = _time_match(signal.name)
    written = match.group("unit") or match.group("short") if match else None
    stated = signal.unit or _in_brackets(signal.name) or written or ""
    return readable_unit(stated) or stated


def _clearest(named: Sequence[Signal], row: int) -> tuple[Signal | None, str]:
    """Return the first column that may be the clock, and why none before it is."""
    passed_over: list[str] = []
    for signal in named:
        why_not = _why_no_clock(signal, row)
        if not why_not:
            return signal, "; ".join(passed_over)
        passed_over.append(f"column '{signal.column or signal.name}' {why_not}: not the clock")
    return None, "; ".join(passed_over)


def _unclearness(signal: Signal) -> int:
    """Return by how little a column says that it holds seconds; text says it least."""
    unclear = 2 if not _time_unit(signal) else int(seconds_of_one(signal) != 1.0)
    return 3 * signal.is_text + unclear


def _why_no_clock(signal: Signal, row: int) -> str:
    """Return why a column of time is not the clock, "" where it may be."""
    if signal.is_text:
        shown = next((str(text) for text in signal.values if text), "")
        return f"holds text ('{shown[:40]}'), no numbers"
    if seconds_of_one(signal) is None:
        return f"is in '{_time_unit(signal)}', no unit of time"
    wrong = _not_increasing(signal.values)
    return f"does not increase at row {row + wrong}" if wrong is not None else ""


def _not_increasing(values: np.ndarray) -> int | None:
    """Return the first sample that is no later than the one before, counted from 0."""
    fine = np.isfinite(values)
    fine[1:] &= values[1:] > values[:-1]
    return None if fine.all() else int(np.flatnonzero(~fine)[0])


def _readable(unit: str) -> bool:
    try:
        si_unit_of(unit)
    except UnitError:
        return False
    return True
