"""Checks between tables: copied files, and copied values of people."""

from collections import Counter
from collections.abc import Iterator, Sequence

import numpy as np
import pandas as pd

from jointz.collections.checking.findings import Finding
from jointz.collections.checking.value_checks import standing
from jointz.collections.entry_reader import ConditionTables

#: So many values that two people share to nine digits are no coincidence.
_FEWEST_SHARED = 3
_DIGITS = 9
#: Single values of fewer digits are equal by chance: whole people are compared then.
_FEWEST_DIGITS = 5
#: People are the same where all that both have agrees: so many values, and so many decades of
#: precision altogether. 10,000 people make 5e7 pairs, and joints differ by a factor of three.
_FEWEST_VALUES, _FEWEST_DECADES = 6, 12.0
_SLACK = 1e-6

#: Folder of the entry, and the tables of a condition.
Table = tuple[str, ConditionTables]
#: Folder of the entry, and the participant.
Person = tuple[str, str]


def copied_tables(tables: Sequence[Table]) -> Iterator[Finding]:
    """Yield tables that are those of another condition or entry, byte for byte."""
    first: dict[str, str] = {}
    for name, table in tables:
        for file, sha256 in table.sha256.items():
            place = f"{file} ({table.condition.name})"
            if sha256 in first:
                expected = "a table of its own for each condition and entry"
                found = f"that of {first[sha256]}, byte for byte"
                yield Finding(name, "values_twice", place, expected, found)
            first.setdefault(sha256, f"{name}/{place}")


def copied_values(tables: Sequence[Table]) -> Iterator[Finding]:
    """Yield people with the estimates of another person, or their own of another condition.

    A few values that agree to nine digits are enough. Rounded values must all agree to the digits
    that both have, because some agree by chance.
    """
    values, people = _values(tables)
    if values.empty:
        return
    persons = list(zip(people["entry"], people["participant"], strict=True))
    alike = _people_alike(values, persons)
    shared = {pair: f"{n} values" for pair, n in _shared_values(values, persons).items()}
    for (i, j), n in alike.items():
        pair = persons[j], persons[i]
        if pair[0] != pair[1] and pair[::-1] not in shared:
            shared.setdefault(pair, f"all {n} values, to the digits that both have,")
    order = {name: k for k, (name, _) in enumerate(tables)}
    for ((name, person), (other_name, other_person)), amount in shared.items():
        later = max((name, other_name), key=order.__getitem__)
        found = f"{amount} of {person} are those of {other_name}/{other_person}"
        expected = "everybody once, with estimates of their own"
        yield Finding(later, "person_twice", f"participants {person}", expected, found)
    same = [pair for pair in alike if persons[pair[0]] == persons[pair[1]]]
    yield from _conditions_twice(people, same)


def _conditions_twice(people: pd.DataFrame, pairs: Sequence[tuple[int, int]]) -> Iterator[Finding]:
    """Yield conditions of an entry that hold the same values, unless their files are the same."""
    copies: dict[tuple[str, str, str], list[str]] = {}
    for i, j in pairs:
        first, second = people.iloc[i], people.iloc[j]
        if first["sha256"] != second["sha256"]:
            place = (second["entry"], second["condition"], first["condition"])
            copies.setdefault(place, []).append(second["participant"])
    for (name, condition, other), persons in copies.items():
        others = f" and {len(persons) - 1} more" if len(persons) > 1 else ""
        found = f"those of {persons[0]}{others} under {other!r}"
        expected = "values of their own in each condition"
        yield Finding(name, "values_twice", f"conditions {condition!r}", expected, found)


def _values(tables: Sequence[Table]) -> tuple[pd.DataFrame, pd.DataFrame]:
    """Return all values but zeros with their digits, and the people that ``who`` counts.

    Values at a bound are left out: a bound minus a shared impedance is the same for everybody.
    """
    columns = ["participant", "session", "side", "method", "parameter", "timing_point", "value"]
    parts = []
    for name, table in tables:
        rows = standing(table.rows)
        rows = rows.loc[(rows["status"] == "ok") & (rows["value"] != 0), columns]
        condition = table.condition
        sha256 = table.sha256[condition.estimates]
        parts.append(rows.assign(entry=name, condition=condition.name, sha256=sha256))
    if not parts:
        return pd.DataFrame(), pd.DataFrame()
    values = pd.concat(parts, ignore_index=True)
    keys = ["entry", "condition", "participant", "session", "side", "method", "sha256"]
    code, people = pd.factorize(pd.MultiIndex.from_frame(values[keys]))
    size = values["value"].abs().to_numpy()
    exponent = np.floor(np.log10(size))
    mantissa = size / 10.0**exponent
    digits = values[["parameter", "timing_point", "value"]].assign(
        who=code, exponent=exponent, digits=_digits(mantissa),
        written=np.sign(values["value"]) * np.round(mantissa, _DIGITS - 1),
    )  # fmt: skip
    return digits, pd.DataFrame(people.to_list(), columns=keys)


def _digits(mantissa: np.ndarray) -> np.ndarray:
    """Return the number of digits of numbers from 1 to 10, at most nine."""
    digits = np.full(mantissa.shape, float(_DIGITS))
    for n in range(_DIGITS - 1, 0, -1):
        error = np.abs(mantissa - np.round(mantissa, n - 1))
        digits[error < 0.5 * 10.0 ** (1 - _DIGITS)] = n
    return digits


def _shared_values(
    values: pd.DataFrame, persons: Sequence[Person]
) -> dict[tuple[Person, Person], int]:
    """Return pairs of people, and the number of values that they share to nine digits."""
    long = values[values["digits"] >= _FEWEST_DIGITS]
    keys = ["parameter", "exponent", "written"]
    repeated = long[long.duplicated(keys, keep=False)]
    origin = repeated.groupby(keys)["who"].transform("first")
    pairs = Counter((persons[a], persons[b]) for a, b in zip(repeated["who"], origin, strict=True))
    return {(a, b): n for (a, b), n in pairs.items() if n >= _FEWEST_SHARED and a != b}


def _people_alike(values: pd.DataFrame, persons: Sequence[Person]) -> dict[tuple[int, int], int]:
    """Return pairs of people that agree in all common values, and the number of these.

    Only people with rounded values or several conditions are compared: the unrounded values of
    others are compared one by one.
    """
    size, unit, rounded = _matrices(values, len(persons))
    present = np.isfinite(size)
    conditions = Counter(persons)
    comparable: dict[bytes, np.ndarray] = {}  # few sets of places serve all people
    pairs = {}
    for i in (i for i, who in enumerate(persons) if rounded[i] or conditions[who] > 1):
        pattern = present[i].tobytes()
        if pattern not in comparable:
            common = (present & present[i]).sum(axis=1)
            comparable[pattern] = np.flatnonzero(common >= _FEWEST_VALUES)
        for j in _agreeing(i, comparable[pattern], size, unit).tolist():
            both = present[i] & present[j]
            coarse = np.maximum(unit[i, both], unit[j, both])
            decades = np.log10(np.abs(size[i, both]) / coarse).clip(min=0.0).sum()
            if i != j and decades >= _FEWEST_DECADES:
                pairs[min(i, j), max(i, j)] = int(both.sum())
    return pairs


def _agreeing(i: int, others: np.ndarray, size: np.ndarray, unit: np.ndarray) -> np.ndarray:
    """Return the others whose values do not exclude that they are person ``i``."""
    for cell in np.flatnonzero(np.isfinite(size[i])):
        if len(others) <= 1:
            break
        difference = np.abs(size[others, cell] - size[i, cell])
        reach = 0.5 * (1.0 + _SLACK) * np.maximum(unit[others, cell], unit[i, cell])
        others = others[~(difference > reach)]  # NaN: one of them has no such value
    return others


def _matrices(values: pd.DataFrame, n: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return values (n, places), the unit of their last digit, and who is rounded.

    People round all values of a parameter to one number of digits or of decimals. A value that
    ends in zeros looks shorter, so the longest of each person counts.
    """
    column, places = pd.factorize(pd.MultiIndex.from_frame(values[["parameter", "timing_point"]]))
    decimals = values["digits"] - values["exponent"] - 1.0
    longest = values.assign(decimals=decimals).groupby(["who", "parameter"])
    digits, decimals = (longest[name].transform("max") for name in ("digits", "decimals"))
    units = np.maximum(10.0 ** (values["exponent"] - digits + 1.0), 10.0**-decimals)
    size, unit = np.full((2, n, len(places)), np.nan)
    size[values["who"], column] = values["value"]
    unit[values["who"], column] = units
    rounded = np.zeros(n, dtype=bool)
    rounded[values.loc[digits < _DIGITS, "who"]] = True
    return size, unit, rounded
