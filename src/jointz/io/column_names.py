"""What the names of columns say: units in brackets, and which column is the clock."""

import re
from collections.abc import Mapping, Sequence

import numpy as np

from jointz.core.acquisition import Signal, SignalGroup
from jointz.core.errors import UnitError
from jointz.io.units import si_unit_of

#: What jointz calls a column of time stamps where the content has no name for it.
CLOCK_COLUMN = "time [s]"
_CLOCK_NAMES = (CLOCK_COLUMN, "time_s", "time (s)", "Time [s]", "Time_s", "Time (s)")
#: Metadata that say what the reader made of a file; no format has to hold them.
READING = "reading."
#: Metadata that keep the name of the column a group's clock was taken from.
_TIME_COLUMN = "time.column"

_BRACKETED = re.compile(r"\[([^\[\]]+)\]\s*$|\(([^()]+)\)\s*$")
_TIME = re.compile(
    r"[%#]?\s*(?:(?:loop|state|elapsed|system|host|sample)[\s_.]*)?time(?:[\s_.]*stamps?)?"
    r"(?:[\s_.]*(?P<unit>s|sec|secs|seconds|ms|us|min))?"
    r"|[%#]?\s*(?:(?-i:t)|t_(?P<short>s|ms|us))",  # a bare T is a temperature, or a torque
    re.IGNORECASE,
)
_WORDS = {"sec": "s", "secs": "s", "seconds": "s"}


def unit_in_name(name: str) -> str:
    """Return the unit that stands in brackets at the end of a column's name, else "".

    What stands in round brackets must be a unit that can be read: ``force (left)`` has none.

    Parameters
    ----------
    name : str
        The column's name.

    Examples
    --------
    >>> unit_in_name("knee [deg]"), unit_in_name("torque (Nm)"), unit_in_name("force (left)")
    ('deg', 'Nm', '')
    """
    match = _BRACKETED.search(name)
    if match is None:
        return ""
    square, round_ = match.groups()
    unit: str = (square or round_).strip()
    if unit.isdecimal() or (round_ and not _readable(unit)):
        return ""
    return unit


def name_with_unit(signal: Signal) -> str:
    """Return a signal's name with its unit in brackets, where it does not end so already.

    Parameters
    ----------
    signal : Signal
        The signal.
    """
    if not signal.unit or unit_in_name(signal.name) == signal.unit:
        return signal.name
    return f"{signal.name} [{signal.unit}]"


def with_clock(
    name: str, signals: Sequence[Signal], *, row: int = 1
) -> tuple[SignalGroup, dict[str, str]]:
    """Make a group of columns; one that holds time becomes its clock.

    Of several the first that states seconds is taken, else one that states another unit of time,
    else one that states none; in any case it increases. A column of time in seconds is taken out
    of the signals; its name is kept in the metadata. One in another unit stays as it is, and the
    clock is made of it.

    Parameters
    ----------
    name : str
        The group.
    signals : sequence of Signal
        Its columns, all of one length.
    row : int
        Where the first sample stands in the file, for notes.

    Returns
    -------
    tuple of SignalGroup and dict
        The group, and metadata that tell what was taken for the clock and why not.
    """
    named = sorted((s for s in signals if is_time(s.name)), key=_unclearness)
    if not named:
        return SignalGroup(name, tuple(signals)), {}
    where = f"{READING}time{f'.{name}' if name else ''}"
    why_not = {signal.name: _why_no_clock(signal, row) for signal in named}
    clock = next((signal for signal in named if not why_not[signal.name]), None)
    if clock is None:
        return SignalGroup(name, tuple(signals)), {where: why_not[named[0].name]}
    factor = seconds_of_one(clock) or 1.0
    told = {}
    if not _time_unit(clock):
        told[where] = f"column '{clock.name}' states no unit; taken for seconds"
    if factor != 1.0:
        column = clock.column or clock.name
        time_s = factor * clock.values
        return SignalGroup(name, tuple(signals), time_s=time_s, time_column=column), told
    if clock.name != CLOCK_COLUMN:
        told[time_column_key(name)] = clock.name
    rest = tuple(signal for signal in signals if signal is not clock)
    column = clock.column or clock.name
    return SignalGroup(name, rest, time_s=clock.values, time_column=column), told


def clock_column(group: SignalGroup, metadata: Mapping[str, str]) -> str:
    """Return the name for a group's column of time stamps; no signal has it.

    Parameters
    ----------
    group : SignalGroup
        The group.
    metadata : mapping of str to str
        Of the content; may say what the column was called.
    """
    taken = {signal.name for signal in group.signals}
    taken |= {name_with_unit(signal) for signal in group.signals}
    wanted = metadata.get(time_column_key(group.name), CLOCK_COLUMN)
    found = next((n for n in (wanted, *_CLOCK_NAMES) if n not in taken and is_time(n)), None)
    if found is None:  # a name for each signal there is, and one more
        found = next(n for k in range(1, len(taken) + 2) if (n := f"clock {k} [s]") not in taken)
    return found


def time_column_key(group: str) -> str:
    """Return the key under which metadata keep the name of a group's time column.

    Parameters
    ----------
    group : str
        The group's name.
    """
    return f"{_TIME_COLUMN}.{group}" if group else _TIME_COLUMN


def is_time(name: str) -> bool:
    """Whether a column of this name holds time stamps, as far as a name can say.

    Parameters
    ----------
    name : str
        The column's name.
    """
    return _time_match(name) is not None


def seconds_of_one(signal: Signal) -> float | None:
    """Return the factor from a column of time to seconds, None where its unit is none of time.

    Parameters
    ----------
    signal : Signal
        The column; where it has no unit its name may, and else it is in seconds.
    """
    try:
        si_unit, factor, _ = si_unit_of(_time_unit(signal) or "s")
    except UnitError:
        return None
    return factor if si_unit == "s" else None


def unique_names(names: Sequence[str], *, sign: str = "_") -> list[str]:
    """Return names that differ: a later one of the same name gets a number.

    Parameters
    ----------
    names : sequence of str
        The names.
    sign : str
        Between name and number.

    Examples
    --------
    >>> unique_names(["a", "b", "a"])
    ['a', 'b', 'a_2']
    """
    found: dict[str, None] = {}
    following: dict[str, int] = {}
    for name in names:
        number, own = following.get(name, 2), name
        while own in found:
            own, number = f"{name}{sign}{number}", number + 1
        found[own], following[name] = None, number
    return list(found)


def _time_match(name: str) -> re.Match[str] | None:
    return _TIME.fullmatch(_BRACKETED.sub("", name).strip())


def _time_unit(signal: Signal) -> str:
    match = _time_match(signal.name)
    written = match.group("unit") or match.group("short") if match else None
    return signal.unit or _WORDS.get(str(written).lower(), (written or "").lower())


def _unclearness(signal: Signal) -> int:
    """Return by how little a column says that it holds seconds; text says it least."""
    unclear = 2 if not _time_unit(signal) else int(seconds_of_one(signal) != 1.0)
    return 3 * signal.is_text + unclear


def _why_no_clock(signal: Signal, row: int) -> str:
    """Return why a column of time is not the clock, "" where it may be."""
    if signal.is_text:
        shown = next((str(text) for text in signal.values if text), "")
        return f"column '{signal.name}' holds text ('{shown[:40]}'), no numbers: not the clock"
    if seconds_of_one(signal) is None:
        return f"column '{signal.name}' is in '{signal.unit}', no unit of time: not the clock"
    wrong = _not_increasing(signal.values)
    if wrong is not None:
        return f"column '{signal.name}' does not increase at row {row + wrong}: not the clock"
    return ""


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
