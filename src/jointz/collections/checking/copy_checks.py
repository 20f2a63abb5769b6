"""What ``collect check`` looks at between tables: copies, of files and of people's values."""

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
Who = tuple[str, str]


def copied_tables(tables: Sequence[Table]) -> Iterator[Finding]:
    """Yield tables that are those of another condition or entry, byte for byte."""
    first: dict[str, str] = {}
    for name, one in tables:
        for file, sha256 in one.sha256.items():
            place = f"{file} ({one.condition.name})"
            if sha256 in first:
                expected = "a table of its own for each condition and entry"
                found = f"that of {first[sha256]}, byte for byte"
                yield Finding(name, "values_twice", place, expected, found)
            first.setdefault(sha256, f"{name}/{place}")


def copied_values(tables: Sequence[Table]) -> Iterator[Finding]:
    """Yield people whose estimates are those of somebody else, or their own of another condition.

    A few values that agree to nine digits are enough. Rounded ones must all agree, as far as both
    are written: the values of other people agree here and there by chance.
    """
    values, people = _values(tables)
    if values.empty:
        return
    who = list(zip(people["entry"], people["participant"], strict=True))
    shared = _shared_values(values, who)
    alike = _people_alike(values, who)
    expected = "everybody once, with estimates of their own"
    told = [(pair, f"{n} values") for pair, n in shared.items()]
    for (i, j), n in alike.items():
        pair = who[j], who[i]
        if who[i] != who[j] and pair not in shared and pair[::-1] not in shared:
            shared[pair] = n
            told.append((pair, f"all {n} values, as far as both are written,"))
    order = {name: k for k, (name, _) in enumerate(tables)}
    for ((name, person), (other_name, other_person)), what in told:
        later = max((name, other_name), key=order.__getitem__)
        found = f"{what} of {person} are those of {other_name}/{other_person}"
        yield Finding(later, "person_twice", f"participants {person}", expected, found)
    same = [pair for pair in alike if who[pair[0]] == who[pair[1]]]
    yield from _conditions_twice(people, same)


def _conditions_twice(people: pd.DataFrame, pairs: Sequence[tuple[int, int]]) -> Iterator[Finding]:
    """Yield conditions of an entry that hold the same values, unless their files are the same."""
    found: dict[tuple[str, str, str], list[str]] = {}
    for i, j in pairs:
        first, second = people.iloc[i], people.iloc[j]
        if first["sha256"] != second["sha256"]:
            place = (second["entry"], second["condition"], first["condition"])
            found.setdefault(place, []).append(second["participant"])
    for (name, condition, other), persons in found.items():
        more = f" and {len(persons) - 1} more" if len(persons) > 1 else ""
        told = f"those of {persons[0]}{more} under {other!r}"
        expected = "values of their own in each condition"
        yield Finding(name, "values_twice", f"conditions {condition!r}", expected, told)


def _values(tables: Sequence[Table]) -> tuple[pd.DataFrame, pd.DataFrame]:
    """Return every value but zeros, with how it is written; and whose they are, by ``who``.

    Those at a bound are left out: a bound less an impedance that all share is the same for all.
    """
    parts = []
    for name, one in tables:
        held = standing(one.rows)
        held = held[(held["status"] == "ok") & (held["value"] != 0)]
        about = {"entry": name, "condition": one.condition.name,
                 "sha256": one.sha256[one.condition.estimates]}  # fmt: skip
        columns = ["participant", "session", "side", "method", "parameter", "timing_point", "value"]
        parts.append(held[columns].assign(**about))
    if not parts:
        return pd.DataFrame(), pd.DataFrame()
    values = pd.concat(parts, ignore_index=True)
    keys = ["entry", "condition", "participant", "session", "side", "method", "sha256"]
    code, people = pd.factorize(pd.MultiIndex.from_frame(values[keys]))
    size = values["value"].abs().to_numpy()
    exponent = np.floor(np.log10(size))
    mantissa = size / 10.0**exponent
    made = values[["parameter", "timing_point", "value"]].assign(
        who=code, exponent=exponent, digits=_digits(mantissa),
        written=np.sign(values["value"]) * np.round(mantissa, _DIGITS - 1),
    )  # fmt: skip
    return made, pd.DataFrame(people.to_list(), columns=keys)


def _digits(mantissa: np.ndarray) -> np.ndarray:
    """Return how many digits numbers of 1 to 10 are written with, at most nine."""
    found = np.full(mantissa.shape, float(_DIGITS))
    for n in range(_DIGITS - 1, 0, -1):
        apart = np.abs(mantissa - np.round(mantissa, n - 1))
        found[apart < 0.5 * 10.0 ** (1 - _DIGITS)] = n
    return found


def _shared_values(values: pd.DataFrame, who: Sequence[Who]) -> dict[tuple[Who, Who], int]:
    """Return pairs of people, and how many values they share to nine digits."""
    long = values[values["digits"] >= _FEWEST_DIGITS]
    keys = ["parameter", "exponent", "written"]
    repeated = long[long.duplicated(keys, keep=False)]
    origin = repeated.groupby(keys)["who"].transform("first")
    pairs = Counter((who[a], who[b]) for a, b in zip(repeated["who"], origin, strict=True))
    return {(a, b): n for (a, b), n in pairs.items() if n >= _FEWEST_SHARED and a != b}


def _people_alike(values: pd.DataFrame, who: Sequence[Who]) -> dict[tuple[int, int], int]:
    """Return pairs of ``who`` that agree in all that both have, and in how many values.

    Looked at are people whose values are rounded, and those with several conditions: of others
    every value tells.
    """
    size, unit, rounded = _matrices(values, len(who))
    there = np.isfinite(size)
    conditions = Counter(who)
    with_whom: dict[bytes, np.ndarray] = {}  # few sets of places serve all people
    found = {}
    for i in (i for i in range(len(who)) if rounded[i] or conditions[who[i]] > 1):
        pattern = there[i].tobytes()
        if pattern not in with_whom:
            common = (there & there[i]).sum(axis=1)
            with_whom[pattern] = np.flatnonzero(common >= _FEWEST_VALUES)
        for j in _agreeing(i, with_whom[pattern], size, unit).tolist():
            both = there[i] & there[j]
            coarse = np.maximum(unit[i, both], unit[j, both])
            decades = np.log10(np.abs(size[i, both]) / coarse).clip(min=0.0).sum()
            if i != j and decades >= _FEWEST_DECADES:
                found[min(i, j), max(i, j)] = int(both.sum())
    return found


def _agreeing(i: int, others: np.ndarray, size: np.ndarray, unit: np.ndarray) -> np.ndarray:
    """Return who of the others has nothing that speaks against being person ``i``."""
    for cell in np.flatnonzero(np.isfinite(size[i])):
        if len(others) <= 1:
            break
        apart = np.abs(size[others, cell] - size[i, cell])
        reach = 0.5 * (1.0 + _SLACK) * np.maximum(unit[others, cell], unit[i, cell])
        others = others[~(apart > reach)]  # NaN: one of them has no such value
    return others


def _matrices(values: pd.DataFrame, n: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return values (n, places), the unit of the last place they are written to, who is rounded.

    People round all values of a parameter alike: to so many digits, or to so many decimals. A
    value that ends in zeros is shorter, so the longest of each person's tells.
    """
    place = pd.MultiIndex.from_frame(values[["parameter", "timing_point"]])
    column, places = pd.factorize(place)
    own = values.groupby(["who", "parameter"])
    digits = own["digits"].transform("max")
    last = (values["digits"] - values["exponent"] - 1.0).groupby(
        [values["who"], values["parameter"]]
    )
    decimals = last.transform("max")
    units = np.maximum(10.0 ** (values["exponent"] - digits + 1.0), 10.0**-decimals)
    size, unit = np.full((2, n, len(places)), np.nan)
    size[values["who"], column] = values["value"]
    unit[values["who"], column] = units
    rounded = np.zeros(n, dtype=bool)
    rounded[values.loc[digits < _DIGITS, "who"]] = True
    return size, unit, rounded
