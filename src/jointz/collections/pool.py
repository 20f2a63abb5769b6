"""Pooling of a catalog: people to studies, studies to a mean over studies."""

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

#: The rules of pooling, as the page states them.
RULES: Final = (
    "A person counts as one value: several values of a person at one place are averaged first.",
    "If a publication prints individual values and their mean, the one over more people is used.",
    "The value of a study is the unweighted mean of its people. Its variance is the variance "
    "between people, at least the one that their own intervals imply, over their number, plus the "
    "error of the calibrated gains, which all people of a study share.",
    "A study of one person has no standard error: it is counted and shown, but not pooled.",
    "Undecided and failed estimates have no value: they are counted, but not pooled. If they are "
    "many, the mean represents only the people whose data are informative.",
    "Estimates at their bound are pooled with their value, and counted.",
    "Two or more studies are pooled by REML, with the interval of Knapp and Hartung and a scale of "
    "at least 1. A single study is shown with the t interval over its people.",
    "The prediction interval for another study is too short if there are few studies with little "
    "spread.",
    "Each method is pooled in rows of its own, unless mixing was requested.",
    "Rows are not independent: they share people and instruments.",
    "Printed values are in a table of their own, unless pooling them was requested; rows with "
    "printed values name the studies.",
)
_COUNTS: Final = ("n_at_bound", "n_undecided", "n_failed")
_FEWEST_JOINTLY: Final = 5
#: Columns whose values may differ within a place; a note names them then.
_NOTED: Final = ("joint", "activity", "condition", "surface", "group")
_LONGEST_LIST: Final = 12


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
        Columns that distinguish places, of :data:`BY`.
    mix_methods : bool
        Pool estimates of different methods; every row names them.
    with_printed : bool
        Also pool printed values with an SD and a number of people, or of single people; every row
        names the studies.
    jointly : bool
        Also pool stiffness, damping and inertia of a place together, by people who have all of
        them, from studies with at least two people more than parameters; rows with the model
        ``joint``. At least five studies are needed.

    Returns
    -------
    CollectionPool
        By the rules of :data:`RULES`.

    Raises
    ------
    DataError
        If columns are missing, ``by`` is unknown, a study is present in two versions, or methods
        are mixed and a study has several methods at one place.
    """
    by = tuple(by)
    table = checked_rows(rows, by)
    table = table.assign(**place_columns(table, by))
    people = people_of(table, by)
    values = study_table(study_means(people, by), by)
    is_printed = values["values"] == "printed"
    used = values if with_printed else values[~is_printed]
    place_keys = [*by, *([] if mix_methods else ["method"])]
    keys = [*place_keys, "parameter", "unit"]
    pooled, weights = [], pd.Series(np.nan, index=values.index)
    for key, group in used.groupby(keys, sort=False):
        place = dict(zip(keys, key, strict=True))
        if mix_methods:
            _check_one_method(group, place)
        row, shares = _pooled_row(group)
        pooled.append(place | row)
        weights.update(shares)
    if jointly:
        chosen = people if with_printed else people[people["values"] != "printed"]
        pooled += _joint_rows(chosen, place_keys)
    values["weight_pct"] = weights
    with_value = table[has_value(table) & (with_printed | (table["values"] != "printed"))]
    return CollectionPool(
        pooled_table(pooled, by),
        values[~is_printed].reset_index(drop=True),
        values[is_printed].reset_index(drop=True),
        by=by,
        notes=(
            *_place_notes(with_value, by, pooled, keys=keys),
            *_notes(people, used, values, mix_methods=mix_methods, jointly=jointly),
        ),
    )


def _pooled_row(group: pd.DataFrame) -> tuple[Row, pd.Series]:
    """Return the mean over the studies of one place, and their weights."""
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
        study = ok.iloc[0]
        mean = {name: float(study[name]) for name in ("value", "ci_low", "ci_high")}
        return row | mean | {"status": ONE_STUDY}, pd.Series(dtype=float)
    if ok.empty:
        return row, pd.Series(dtype=float)
    columns = ok[["study", "value", "se", "n_people"]]
    means = [StudyMean(*study) for study in columns.itertuples(index=False, name=None)]
    f = pool_studies(means, parameter="", unit="").fit
    names = ("i2_pct", "q", "q_p", "prediction_low", "prediction_high")
    row |= {"value": f.mean, "ci_low": f.low, "ci_high": f.high, "status": "ok"}
    row |= {"tau": f.tau2**0.5, "tau_low": f.tau2_low**0.5, "tau_high": f.tau2_high**0.5}
    row |= {name: getattr(f, name) for name in names}
    return row, pd.Series(100.0 * f.weights, ok.index)


def _joint_rows(people: pd.DataFrame, keys: list[str]) -> Iterator[Row]:
    """Yield a row a parameter of every place whose parameters can be pooled together."""
    individual = people[people["parameter"].isin(TOGETHER) & (people["statistic"] != "mean")]
    for key, everybody in individual.groupby(keys, sort=False):
        group = everybody[everybody["stands"]]
        units = dict(group.drop_duplicates("parameter")[["parameter", "unit"]].to_numpy())
        units = {name: str(units[name]) for name in TOGETHER if name in units}
        studies = {str(s): joint_mean(rows, list(units)) for s, rows in group.groupby("study")}
        means = {study: mean for study, mean in studies.items() if mean is not None}
        if len(units) < FEWEST or len(means) < _FEWEST_JOINTLY:
            continue
        values = np.array([mean for _, mean, _ in means.values()])
        if (np.isfinite(values).sum(axis=0) < FEWEST).any():
            continue
        covariances = np.array([covariance for _, _, covariance in means.values()])
        fit = pool_studies_jointly(list(means), values, covariances, units=units)
        used = group[group["study"].isin(means)]
        row: Row = dict(zip(keys, key, strict=True)) | {
            "model": "joint",
            "methods": ", ".join(sorted(set(used["method"]))),
            "printed": ", ".join(sorted(set(used.loc[used["values"] == "printed", "study"]))),
            "n_people": sum(n for n, _, _ in means.values()),
            "n_left_out": len(studies) - len(means),
            **_people_counts(everybody),
            "status": "ok",
        }
        yield from (row | parameter for parameter in plain_rows(fit.to_frame()))


def _people_counts(people: pd.DataFrame) -> Row:
    """Count the people with at least one value at its bound, undecided or failed."""
    without_value, undecided = ~people["stands"], people["undecided"]
    masks = (people["at_bound"], without_value & undecided, without_value & ~undecided)
    who = ["study", "participant"]
    return {
        name: len(people.loc[mask, who].drop_duplicates())
        for name, mask in zip(_COUNTS, masks, strict=True)
    }


def _check_one_method(group: pd.DataFrame, place: Mapping[str, Any]) -> None:
    methods = group.groupby("study")["method"].nunique()
    if several := [str(study) for study, n in methods.items() if n > 1]:
        raise DataError(
            f"{', '.join(map(str, place.values()))}: expected one method a study where methods are "
            f"mixed; {', '.join(several)} has several, which would count its people twice. Choose "
            "methods by --method."
        )


def _place_notes(
    rows: pd.DataFrame, by: tuple[str, ...], pooled: Sequence[Row], *, keys: list[str]
) -> Iterator[str]:
    """Yield notes on the places, and on columns that differ within one of them.

    ``rows`` have a value to pool; those that agree in ``keys`` are pooled.
    """
    count = Counter(str(row["status"]) for row in pooled)
    yield (
        f"Places are distinguished by {', '.join(key.replace('_', ' ') for key in by)}: "
        f"{count['ok']} values over studies, {count[ONE_STUDY]} of one study, "
        f"{count.total() - count['ok'] - count[ONE_STUDY]} without a standard error."
    )
    if "condition" in by and not count["ok"] and len(set(rows["study"])) > 1:
        yield (
            "No place has two studies. If labs name the same condition differently, distinguish "
            "places by activity, speed and slope instead."
        )
    for key in _NOTED:
        groups = [] if key in by else [set(group) for _, group in rows.groupby(keys)[key]]
        if mixed := [names for names in groups if len(names) > 1]:
            names = sorted(name or "not stated" for name in set().union(*mixed))
            more = f" and {len(names) - _LONGEST_LIST} more" if len(names) > _LONGEST_LIST else ""
            shown = ", ".join(names[:_LONGEST_LIST]) + more
            yield f"Pooled at one place, because --by {key} was not given: {shown}."


def _notes(
    people: pd.DataFrame,
    used: pd.DataFrame,
    values: pd.DataFrame,
    *,
    mix_methods: bool,
    jointly: bool,
) -> Iterator[str]:
    methods = sorted(set(used["method"]))
    if len(methods) > 1:
        how = "are mixed" if mix_methods else "are in rows of their own, not pooled together"
        yield f"Methods {how}: {', '.join(methods)}."
    for status, group in used[used["status"] != "ok"].groupby("status"):
        names = ", ".join(sorted(set(group["study"])))
        reason = NotPooled(str(status)).meaning
        yield f"{len(group)} means of studies are not pooled ({reason}): {names}."
    counts = {name[2:].replace("_", " "): int(used[name].sum()) for name in _COUNTS}
    if text := ", ".join(f"{n} {name}" for name, n in counts.items() if n):
        yield f"Of the people's values: {text}."
    if printed := ", ".join(sorted(set(values.loc[values["values"] == "printed", "study"]))):
        are_pooled = "printed" in set(used["values"])
        how = "are pooled with others" if are_pooled else "are kept apart"
        yield f"Printed values of {printed} {how}."
    codes = people[people["person"] != ""].groupby("person")["study"].nunique()
    if twice := [str(code) for code, n in codes.items() if n > 1]:
        yield f"The same people in several studies count in each: {', '.join(twice)}."
    if jointly:
        yield (
            f"Joint rows need at least {_FEWEST_JOINTLY} studies with two people more than "
            "parameters, and use people who have all parameters."
        )
