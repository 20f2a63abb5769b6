"""``jointz collect pool``: people to studies, studies to a mean over studies, rules stated."""

from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from typing import Any, Final

import numpy as np
import pandas as pd

from jointz.collections.pool_result import (
    DEFAULT_BY,
    ONE_STUDY,
    CollectionPool,
    pooled_table,
    study_table,
)
from jointz.collections.studies import (
    FEWEST,
    TOGETHER,
    Row,
    checked_rows,
    has_value,
    joint_mean,
    people_of,
    place_columns,
    study_means,
)
from jointz.core.codes import Failure, NotPooled
from jointz.core.errors import DataError
from jointz.core.plain_tables import plain_rows
from jointz.results.statistics.random_effects_fit import StudyMean
from jointz.stats.random_effects import pool_studies, pool_studies_jointly

#: The rules of pooling, as the page and the command state them.
RULES: Final = (
    "A person is one value: several of one person at one place are averaged first.",
    "Where a publication prints people and their mean, whichever is of more people counts.",
    "A study is the unweighted mean of its people; its variance is that between people, never "
    "below what their own intervals say, over their number, and the calibrated gains' error, "
    "which all people of a study share.",
    "A study of one person has no error of its own: it is counted and shown, not pooled.",
    "Undecided and failed estimates have no value: they are counted, not pooled. Where they are "
    "many, the mean is one of people whose data decide.",
    "Estimates at their bound count with their value, and are counted.",
    "Two studies or more are pooled: REML, interval of Knapp and Hartung with a scale of at least "
    "1. One study is shown as it is, with Student's interval over its people.",
    "The interval of another study is too short where few studies differ little.",
    "Values of one method are pooled, each method in a row of its own, unless asked otherwise.",
    "Rows are not independent: the same people and instruments stand behind several of them.",
    "Printed values stand in a table of their own unless asked for; rows that hold some name them.",
)
_COUNTS: Final = ("n_at_bound", "n_undecided", "n_failed")
_FEWEST_JOINTLY: Final = 5
#: What must be said where it is pooled: unlike things, free text of the labs, groups of people.
_TOLD: Final = ("joint", "activity", "condition", "surface", "group")
_MOST_NAMED: Final = 12


def pool_catalog(
    rows: pd.DataFrame,
    *,
    by: Sequence[str] = DEFAULT_BY,
    mix_methods: bool = False,
    with_printed: bool = False,
    jointly: bool = False,
) -> CollectionPool:
    """Pool the rows of a catalog over studies, place by place.

    Parameters
    ----------
    rows : pandas.DataFrame
        In the columns of the catalog; estimates and printed values may be among them.
    by : sequence of str
        What places are told apart by, of :data:`BY`.
    mix_methods : bool
        Pool estimates of different methods; every row names them.
    with_printed : bool
        Pool printed values too, where they have a sd and a number of people or stand for each
        person; every row names the studies.
    jointly : bool
        Also pool stiffness, damping and inertia of a place together, by people who have all of
        them, from studies with at least two people more than parameters; rows with the model
        ``joint``. At least five studies.

    Returns
    -------
    CollectionPool
        By the rules of :data:`RULES`.

    Raises
    ------
    DataError
        When columns are missing, ``by`` is unknown, a study stands there in two versions, or by
        several methods at one place that are to be mixed.
    """
    by = tuple(by)
    table = checked_rows(rows, by)
    table = table.assign(**place_columns(table, by))
    people = people_of(table, by)
    values = study_table(study_means(people, by), by)
    is_printed = values["values"] == "printed"
    used = values if with_printed else values[~is_printed]
    keys = [*by, "parameter", "unit", *([] if mix_methods else ["method"])]
    pooled, weights = [], pd.Series(np.nan, index=values.index)
    for key, group in used.groupby(keys, sort=False):
        if mix_methods:
            _check_one_method(group, dict(zip(keys, key, strict=True)))
        row, shares = _pooled_row(group)
        pooled.append(dict(zip(keys, key, strict=True)) | row)
        weights.update(shares)
    if jointly:
        chosen = people if with_printed else people[people["values"] != "printed"]
        pooled += _joint_rows(chosen, [*by, *([] if mix_methods else ["method"])])
    values["weight_pct"] = weights
    held = table[has_value(table)]
    held = held if with_printed else held[held["values"] != "printed"]
    return CollectionPool(
        pooled_table(pooled, by),
        values[~is_printed].reset_index(drop=True),
        values[is_printed].reset_index(drop=True),
        by=by,
        notes=(
            *_place_notes(held, by, pooled, together=keys),
            *_notes(people, used, values, mix_methods=mix_methods, jointly=jointly),
        ),
    )


def _pooled_row(group: pd.DataFrame) -> tuple[Row, pd.Series]:
    """Return the studies of one place together, and their weights."""
    ok = group[group["status"] == "ok"]
    row: Row = {
        "model": "univariate",
        "methods": ", ".join(sorted(set((ok if len(ok) else group)["method"]))),
        "printed": ", ".join(ok.loc[ok["values"] == "printed", "study"]),
        "n_studies": len(ok),
        "n_people": int(ok["n_people"].sum()),
        "n_left_out": len(group) - len(ok),
        **{name: int(group[name].sum()) for name in _COUNTS},
        "status": Failure.TOO_FEW_STUDIES.status,
    }
    if len(ok) == 1:
        alone = ok.iloc[0]
        own = {name: float(alone[name]) for name in ("value", "ci_low", "ci_high")}
        return row | own | {"status": ONE_STUDY}, pd.Series(dtype=float)
    if ok.empty:
        return row, pd.Series(dtype=float)
    columns = ("study", "value", "se", "n_people")
    means = [StudyMean(*one) for one in zip(*(ok[name].tolist() for name in columns), strict=True)]
    f = pool_studies(means, parameter="", unit="").fit
    names = ("i2_pct", "q", "q_p", "prediction_low", "prediction_high")
    row |= {"value": f.mean, "ci_low": f.low, "ci_high": f.high, "status": "ok"}
    row |= {"tau": f.tau2**0.5, "tau_low": f.tau2_low**0.5, "tau_high": f.tau2_high**0.5}
    row |= {name: getattr(f, name) for name in names}
    return row, pd.Series(100.0 * f.weights, ok.index)


def _joint_rows(people: pd.DataFrame, keys: list[str]) -> Iterator[Row]:
    """Yield a row a parameter of every place whose parameters can be pooled together."""
    of_people = people[people["parameter"].isin(TOGETHER) & (people["statistic"] != "mean")]
    for key, everybody in of_people.groupby(keys, sort=False):
        group = everybody[everybody["stands"]]
        units = dict(group.drop_duplicates("parameter")[["parameter", "unit"]].to_numpy())
        units = {name: str(units[name]) for name in TOGETHER if name in units}
        found = {str(s): joint_mean(own, list(units)) for s, own in group.groupby("study")}
        means = {study: one for study, one in found.items() if one is not None}
        if len(units) < FEWEST or len(means) < _FEWEST_JOINTLY:
            continue
        values = np.array([mean for _, mean, _ in means.values()])
        if (np.isfinite(values).sum(axis=0) < FEWEST).any():
            continue
        covariances = np.array([covariance for _, _, covariance in means.values()])
        made = pool_studies_jointly(list(means), values, covariances, units=units)
        behind = group[group["study"].isin(means)]
        about: Row = dict(zip(keys, key, strict=True)) | {
            "model": "joint",
            "methods": ", ".join(sorted(set(behind["method"]))),
            "printed": ", ".join(sorted(set(behind.loc[behind["values"] == "printed", "study"]))),
            "n_people": sum(n for n, _, _ in means.values()),
            "n_left_out": len(found) - len(means),
            **_counted(everybody),
            "status": "ok",
        }
        yield from (about | row for row in plain_rows(made.to_frame()))


def _counted(people: pd.DataFrame) -> Row:
    """Return how many people have at least one such value at a place."""
    gone = ~people["stands"]
    told = (people["at_bound"], gone & people["undecided"], gone & ~people["undecided"])
    who = ["study", "participant"]
    return {
        name: len(people.loc[which, who].drop_duplicates())
        for name, which in zip(_COUNTS, told, strict=True)
    }


def _check_one_method(group: pd.DataFrame, place: Mapping[str, Any]) -> None:
    methods = group.groupby("study")["method"].nunique()
    if several := [str(study) for study, n in methods.items() if n > 1]:
        raise DataError(
            f"{', '.join(map(str, place.values()))}: expected one method a study where methods are "
            f"mixed; {', '.join(several)} has several, which would count its people twice. Choose "
            "the methods first."
        )


def _place_notes(
    held: pd.DataFrame, by: tuple[str, ...], pooled: Sequence[Row], *, together: list[str]
) -> Iterator[str]:
    """Yield what became of the places, and of what does not tell them apart.

    ``held`` are the rows with a value to pool; those that agree in ``together`` are pooled.
    """
    count = Counter(str(row["status"]) for row in pooled)
    yield (
        f"Places are told apart by {', '.join(key.replace('_', ' ') for key in by)}: "
        f"{count['ok']} values over studies, {count[ONE_STUDY]} of one study, "
        f"{count.total() - count['ok'] - count[ONE_STUDY]} without an error."
    )
    if "condition" in by and not count["ok"] and len(set(held["study"])) > 1:
        yield (
            "At no place are there two studies. Where labs name the same condition unlike, tell "
            "places apart by activity, speed and slope instead."
        )
    for key in _TOLD:
        found = [] if key in by else [set(own) for _, own in held.groupby(together)[key]]
        if several := [names for names in found if len(names) > 1]:
            names = sorted(name or "not stated" for name in set().union(*several))
            more = f" and {len(names) - _MOST_NAMED} more" if len(names) > _MOST_NAMED else ""
            told = ", ".join(names[:_MOST_NAMED]) + more
            yield f"Not told apart by {key} (--by {key} would), and pooled at one place: {told}."


def _notes(
    people: pd.DataFrame, used: pd.DataFrame, values: pd.DataFrame, *, mix_methods: bool,
    jointly: bool,
) -> tuple[str, ...]:  # fmt: skip
    notes = []
    methods = ", ".join(sorted(set(used["method"])))
    if len(set(used["method"])) > 1:
        done = "are mixed" if mix_methods else "stand in rows of their own, not pooled together"
        notes.append(f"Methods {done}: {methods}.")
    for status, group in used[used["status"] != "ok"].groupby("status"):
        names = ", ".join(sorted(set(group["study"])))
        told = NotPooled(str(status)).meaning
        notes.append(f"{len(group)} means of studies are not pooled ({told}): {names}.")
    counts = {name[2:].replace("_", " "): int(used[name].sum()) for name in _COUNTS}
    if told := ", ".join(f"{n} {name}" for name, n in counts.items() if n):
        notes.append(f"Of the people's values: {told}.")
    if printed := ", ".join(sorted(set(values.loc[values["values"] == "printed", "study"]))):
        apart = (
            "are kept apart" if "printed" not in set(used["values"]) else "are pooled with others"
        )
        notes.append(f"Printed values of {printed} {apart}.")
    codes = people[people["person"] != ""].groupby("person")["study"].nunique()
    if twice := [str(code) for code, n in codes.items() if n > 1]:
        notes.append(f"The same people in several studies count in each: {', '.join(twice)}.")
    if jointly:
        notes.append(
            f"Joint rows: where at least {_FEWEST_JOINTLY} studies have two people more than "
            "parameters, by people who have all of them."
        )
    return tuple(notes)
