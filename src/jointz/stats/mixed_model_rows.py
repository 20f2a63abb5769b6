"""Rows of a table for a mixed model, checked and numbered."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import pandas as pd

from jointz.core.errors import DataError
from jointz.results.statistics.comparison_labels import alike_labels

#: Beyond these, squares of values overflow or underflow.
_LARGEST, _SMALLEST = 1e100, 1e-100


@dataclass(frozen=True, slots=True)
class Rows:
    """The values of a table, participants and levels as numbers."""

    y: np.ndarray  # finite values
    person: np.ndarray  # index of each row into ``persons``
    level: np.ndarray  # index of each row into ``levels``
    persons: tuple[str, ...]  # labels of the participants, in order
    levels: tuple[str, ...]  # labels of the levels, in order
    notes: tuple[str, ...] = ()  # remarks on the table for the reader

    @property
    def cell(self) -> np.ndarray:
        """The cell of every row, 0, 1, ... without gaps."""
        numbers = self.person * len(self.levels) + self.level
        index: np.ndarray = np.unique(numbers, return_inverse=True)[1]
        return index

    @property
    def design(self) -> np.ndarray:
        """Intercept, and every level after the first against it."""
        columns: np.ndarray = (self.level[:, None] == np.arange(len(self.levels))).astype(float)
        columns[:, 0] = 1.0
        return columns

    @property
    def counts(self) -> np.ndarray:
        """(participant, level) rows."""
        counts = np.zeros((len(self.persons), len(self.levels)))
        np.add.at(counts, (self.person, self.level), 1.0)
        return counts

    @property
    def means(self) -> np.ndarray:
        """(participant, level) mean of the rows, NaN where there is none."""
        totals, counts = np.zeros_like(self.counts), self.counts
        np.add.at(totals, (self.person, self.level), self.y)
        means: np.ndarray = np.divide(
            totals, counts, np.full_like(totals, np.nan), where=counts > 0
        )
        return means

    @property
    def equal_counts(self) -> bool:
        """Whether all cells that have rows have as many."""
        counts = self.counts[self.counts > 0]
        return bool((counts == counts[0]).all())


def table_rows(
    table: pd.DataFrame, *, response: str, within: str, participant: str, nested: bool
) -> Rows:
    """Return the rows of a table that have a value, checked."""
    refuse_several([within] if isinstance(within, str) else within, response, participant)
    rows = _rows(table, response, within, participant)
    _check_replicates(rows, table, (participant, within, response), nested=nested)
    return rows


def _rows(table: pd.DataFrame, response: str, within: str, participant: str) -> Rows:
    names = (response, within, participant)
    missing = [name for name in names if name not in table.columns]
    if missing or len(set(names)) < 3:
        raise DataError(
            f"mixed_model: expected three columns, response {response!r}, within {within!r} and "
            f"participant {participant!r}; missing {missing or 'none, but two are the same'}. "
            f"The table has {', '.join(map(repr, table.columns))}"
        )
    twice = [name for name in names if list(table.columns).count(name) > 1]
    if twice:
        raise DataError(
            f"mixed_model: the table has several columns {', '.join(map(repr, twice))}; rename or "
            f"drop all but one"
        )
    kind = table[response].dtype
    problems = []
    if pd.api.types.is_bool_dtype(kind) or not pd.api.types.is_any_real_numeric_dtype(kind):
        kind_name = "text or a mix of kinds" if pd.api.types.is_object_dtype(kind) else str(kind)
        problems.append(
            f"column {response!r} must hold numbers, it holds {kind_name}. Make numbers of it, as "
            f"pandas.to_numeric does, or choose another column"
        )
    problems += [
        f"column {name!r} must name every row, {int(table[name].isna().sum())} have none"
        for name in (within, participant)
        if table[name].isna().any()
    ]
    if problems:
        raise DataError("mixed_model: " + "; ".join(problems))
    y = table[response].to_numpy(dtype=float, na_value=np.nan)
    if np.isinf(y).any():
        raise DataError(
            f"mixed_model: column {response!r} has {int(np.isinf(y).sum())} infinite values; "
            f"leave a value that is missing empty (NaN)"
        )
    _check_size(y, response)
    level, levels, note_levels = _labels(table[within], within)
    person, persons, note_persons = _labels(table[participant], participant)
    known = np.isfinite(y)
    rows = Rows(
        y[known], person[known], level[known], persons, levels, (*note_levels, *note_persons)
    )
    problems = _layout_problems(rows, response, within, participant)
    if problems:
        raise DataError("mixed_model: " + "; ".join(problems))
    return rows


def refuse_several(within: Sequence[str], response: str, participant: str) -> None:
    """Refuse several factors within participants, with the call of R that takes them."""
    if len(within) > 1:
        own = "".join(f" + (1 | {participant}:{factor})" for factor in within)
        model = f"{response} ~ {' * '.join(within)} + (1 | {participant}){own}"
        raise DataError(
            f"mixed_model: expected one column within, got {', '.join(within)}. For several use R: "
            f'anova(lmerTest::lmer({model}, table), ddf = "Kenward-Roger")'
        )


def _check_size(y: np.ndarray, response: str) -> None:
    known = np.abs(y[np.isfinite(y)])
    size = float(known.max()) if known.size else 0.0
    if size > _LARGEST or 0.0 < size < _SMALLEST:
        raise DataError(
            f"mixed_model: column {response!r} has values of the size of {size:.3g}, whose squares "
            f"are beyond what a computer counts. Choose another unit, or correct the values"
        )


def _labels(
    column: "pd.Series[Any]", name: str
) -> tuple[np.ndarray, tuple[str, ...], tuple[str, ...]]:
    """Return the number of every row, the labels in order, and notes on labels without rows."""
    notes: tuple[str, ...] = ()
    if isinstance(column.dtype, pd.CategoricalDtype):
        used = column.cat.remove_unused_categories()
        unused = [c for c in column.cat.categories if c not in set(used.cat.categories)]
        if unused:
            notes = (f"no row has {', '.join(map(str, unused))} of {name}",)
        codes, labels = used.cat.codes.to_numpy(), list(used.cat.categories)
    else:
        codes, unique = pd.factorize(column)
        labels = list(unique)
    texts = tuple(str(label) for label in labels)
    if len(set(texts)) < len(texts):
        twice = next(text for text in texts if texts.count(text) > 1)
        raise DataError(
            f"mixed_model: column {name!r} has two labels written {twice!r}, such as a number and "
            f"its text. Make them one kind"
        )
    for group in alike_labels(texts):
        notes += (
            f"{' and '.join(map(repr, group))} of {name} are taken as {len(group)} different "
            f"labels: write them alike where they are one",
        )
    return np.asarray(codes, dtype=int), texts, notes


def _layout_problems(rows: Rows, response: str, within: str, participant: str) -> list[str]:
    problems = []
    by_person, by_level = rows.counts.sum(axis=1), rows.counts.sum(axis=0)
    for what, name, labels, counts in (
        ("participant", participant, rows.persons, by_person),
        ("level", within, rows.levels, by_level),
    ):
        without = [label for label, count in zip(labels, counts, strict=True) if count == 0]
        if without:
            problems.append(
                f"{what} {', '.join(without)} of {name!r} has no value of {response!r}; leave its "
                f"rows out of the table"
            )
        if len(labels) < 2:
            levels_text = f"only {labels[0]!r}" if labels else "none"
            problems.append(f"expected two or more {what}s in column {name!r}, found {levels_text}")
    if rows.y.size and np.ptp(rows.y) == 0:
        problems.append(
            f"column {response!r} is constant, all {rows.y.size} values are {rows.y[0]:g}"
        )
    if not problems and (np.count_nonzero(rows.counts, axis=1) < 2).all():
        problems.append(
            f"every participant has a value at one level of {within!r} only: participants and "
            f"error cannot be told apart. Use a test for independent groups"
        )
    return problems


def _check_replicates(
    rows: Rows, table: pd.DataFrame, names: tuple[str, str, str], *, nested: bool
) -> None:
    counts = rows.counts
    valued = table[table[names[2]].notna()]
    if not nested and counts.max() > 1:
        i, j = np.argwhere(counts > 1)[0]
        same = int(valued.duplicated(list(names)).sum())
        copies = f" {same} rows repeat another: drop them if they are copies." if same else ""
        raise DataError(
            f"mixed_model: expected one row a participant and level, {rows.persons[i]!r} at "
            f"{rows.levels[j]!r} has {int(counts[i, j])} ({rows.y.size} rows in "
            f"{np.count_nonzero(counts)} cells).{copies} Rows of one cell are replicates, not "
            f"people: counted as people they make nearly every difference significant. Average "
            f"them to one row a cell, or pass nested=True to give the cells a variance of their own"
        )
    if nested and counts.max() < 2:
        raise DataError(
            "mixed_model: nested=True expects replicates, but every participant and level has one "
            "row. Pass nested=False"
        )
    # Equal values may be chance, as zeros at a bound; equal in all of more columns they are not.
    copied = int(valued.duplicated().sum()) if len(table.columns) > len(names) else 0
    if nested and copied:
        raise DataError(
            f"mixed_model: {copied} rows repeat another in all {len(table.columns)} columns; drop "
            f"the copies"
        )
