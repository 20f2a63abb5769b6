"""Steps of pooling: rows of a catalog to places, people, and means of studies with errors."""

from collections.abc import Iterator
from typing import Any, Final

import numpy as np
import pandas as pd

from jointz.collections.catalog_columns import CATALOG_COLUMNS
from jointz.collections.catalog_query import STANDING
from jointz.collections.pool_result import BY
from jointz.core.codes import NotPooled
from jointz.core.errors import DataError
from jointz.results.estimates import REACH_95
from jointz.results.statistics.random_effects_fit import StudyMean
from jointz.stats.random_effects import mean_over_people

#: Parameters with a common covariance, and the columns that hold it.
TOGETHER: Final = ("stiffness", "damping", "inertia")
WITH: Final = tuple(f"with_{name}" for name in TOGETHER)
#: Fewest people of a mean, and studies of a mean over them.
FEWEST: Final = 2

_GAIT: Final = ("walking", "running")
_NOT_STATED, _NOT_IN_GAIT = "not stated", "not in gait"
_SPEED_BAND_M_S, _PHASE_BIN_PCT = 0.2, 10.0
_REACH_ONE_SIDED = 1.6448536269514722

Row = dict[str, Any]


def checked_rows(rows: pd.DataFrame, by: tuple[str, ...]) -> pd.DataFrame:
    """Return the rows with plain columns, after checking that they can be pooled."""
    if missing := [name for name in CATALOG_COLUMNS if name not in rows.columns]:
        raise DataError(f"rows to pool: expected the catalog's columns; missing: {missing}.")
    unknown = [key for key in by if key not in BY]
    if unknown or not by or len(set(by)) < len(by):
        got = ", ".join(unknown or by) or "none"
        raise DataError(f"by: expected some of {', '.join(BY)}, each once; got {got}.")
    versions = rows.groupby("study", observed=True)["version"].nunique()
    if twice := [str(study) for study, n in versions.items() if n > 1]:
        raise DataError(
            f"{', '.join(twice)}: the collection has several versions, which would count its "
            "people twice. Keep one version of an entry, or choose by entry."
        )
    text = {name: rows[name].astype(object) for name, k in CATALOG_COLUMNS.items() if k == "text"}
    return rows.assign(**{name: column.fillna("") for name, column in text.items()})


def has_value(table: pd.DataFrame) -> pd.Series:
    """Tell which rows have a value to pool."""
    printed = (table["values"] == "printed") & (table["status"] == "")
    return table["value"].notna() & (table["status"].isin(STANDING) | printed)


def place_columns(rows: pd.DataFrame, by: tuple[str, ...]) -> dict[str, pd.Series]:
    """Return the columns that distinguish places, as text."""
    in_gait = rows["activity"].isin(_GAIT)

    def text(form: str, *numbers: pd.Series) -> pd.Series:
        texts = [form.format(*row) for row in zip(*numbers, strict=True)]
        is_known = numbers[0].notna()
        stated = pd.Series(texts, rows.index, dtype=object).where(is_known, _NOT_STATED)
        return stated.where(in_gait | is_known, _NOT_IN_GAIT)

    def band(number: pd.Series, width: float, start: float) -> tuple[pd.Series, pd.Series]:
        # 1.2 m/s is in the middle of a band; rounding must not move a value at an edge.
        low = np.floor((number - start) / width + 1e-9) * width + start
        return low + 0.0, low + width

    columns = {key: rows[key].replace("", _NOT_STATED) for key in by if key in rows}
    if "phase" in by:
        pct = rows["onset_gait_pct"].astype(float) % 100.0
        columns["phase"] = text("{:.0f} to {:.0f} %", *band(pct, _PHASE_BIN_PCT, 0.0))
    if "speed" in by:
        speed = rows["walking_speed_m_s"].astype(float)
        ends = band(speed, _SPEED_BAND_M_S, _SPEED_BAND_M_S / 2.0)
        columns["speed"] = text("{:.1f} to {:.1f} m/s", *ends)
    if "slope" in by:
        columns["slope"] = text(
            "{:g} deg", rows["slope_deg"].astype(float) + 0.0
        )  # -0 is level too
    return columns


def people_of(table: pd.DataFrame, by: tuple[str, ...]) -> pd.DataFrame:
    """Return one row a person, place, parameter and method, with mean value and mean variance.

    The mean of a person's variances is the variance of a mean of fully correlated values, which is
    conservative.
    """
    status, value, stands = table["status"], table["value"].astype(float), has_value(table)
    at_bound = status == "at_bound"
    reach = np.where(at_bound, table["ci_high"] - value, (table["ci_high"] - table["ci_low"]) / 2.0)
    error = (reach / np.where(at_bound, _REACH_ONE_SIDED, REACH_95)) ** 2
    for name, column in zip(TOGETHER, WITH, strict=True):
        stated = (table["parameter"] == name) & table[column].notna()
        error = np.where(stated, table[column], error)
    rows = table.assign(
        value=value.where(stands),
        error=pd.Series(error, table.index).where(stands),
        stands=stands,
        at_bound=at_bound & stands,
        undecided=status == "undecided",
        shared_sd=np.hypot(table["torque_gain_sd"].fillna(0.0), table["angle_gain_sd"].fillna(0.0)),
    )
    keys = [*by, "parameter", "unit", "study", "method", "values", "statistic", "participant"]
    how = dict.fromkeys(["value", "error", *WITH], "mean")
    how |= {"sd": "max", "n": "min", "shared_sd": "max", "person": "first"}
    how |= dict.fromkeys(["stands", "at_bound", "undecided"], "any")
    people = rows.groupby(keys, sort=False, observed=True).agg(how).reset_index()
    people["stands"] &= ~people["undecided"]  # as person_cells: one undecided side is enough
    return people


def study_means(people: pd.DataFrame, by: tuple[str, ...]) -> Iterator[Row]:
    """Yield a row a study, place, parameter and method, in the columns of ``studies.csv``."""
    keys = [*by, "parameter", "unit", "study", "method", "values"]
    for key, group in people.groupby(keys, sort=False):
        chosen = _of_more_people(group)
        with_value, without = chosen[chosen["stands"]], chosen[~chosen["stands"]]
        row: Row = dict(zip(keys, key, strict=True)) | {
            "n_people": len(with_value),
            "n_at_bound": int(with_value["at_bound"].sum()),
            "n_undecided": int(without["undecided"].sum()),
            "n_failed": int((~without["undecided"]).sum()),
        }
        yield row | _study_mean(with_value)


def _of_more_people(group: pd.DataFrame) -> pd.DataFrame:
    """Return the people of a study, or its printed mean if that is over more people."""
    is_mean = group["statistic"] == "mean"
    people, mean = group[~is_mean], group[is_mean & group["stands"]]
    if mean.empty or mean["n"].fillna(0.0).max() <= people["stands"].sum():
        return people if len(people) else group
    return mean


def _study_mean(people: pd.DataFrame) -> Row:
    """Return the mean of a study and its standard error, or why there is none."""
    if people.empty:
        return {"status": NotPooled.NO_VALUE.value}
    n, value = len(people), float(people["value"].mean())
    shared = float(people["shared_sd"].iloc[0])
    if people["statistic"].iloc[0] == "mean":
        n, sd = int(np.nan_to_num(people["n"].iloc[0])), float(people["sd"].iloc[0])
        if not (n >= FEWEST and sd > 0.0):
            return {"n_people": n, "value": value, "status": NotPooled.NO_SD.value}
        se = float(np.hypot(sd / np.sqrt(n), shared * value))
    elif n < FEWEST:
        return {"value": value, "status": NotPooled.ONE_PERSON.value}
    else:
        errors = people["error"].fillna(0.0).to_numpy()[:, None, None]
        variance = mean_over_people(people[["value"]].to_numpy(), errors, shared_sd=shared)[1]
        se = float(np.sqrt(variance[0, 0]))
    if se == 0.0:
        return {"value": value, "status": NotPooled.NO_SPREAD.value}
    low, high = StudyMean("", value, se, n).interval
    return {"n_people": n, "value": value, "se": se, "ci_low": low, "ci_high": high, "status": "ok"}


def joint_mean(
    people: pd.DataFrame, parameters: list[str]
) -> tuple[int, np.ndarray, np.ndarray] | None:
    """Return people, means and covariance of the parameters of a study at a place."""
    wide = people.pivot_table(
        index="participant", columns="parameter", values=["value", "error", *WITH]
    )
    names = [name for name in parameters if ("value", name) in wide]
    wide = wide.dropna(subset=[("value", name) for name in names])
    if len(wide) < len(names) + FEWEST:
        return None
    values, shared = wide["value"][names].to_numpy(), float(people["shared_sd"].iloc[0])
    mean, covariance = mean_over_people(values, _covariances(wide, names), shared_sd=shared)
    at = [parameters.index(name) for name in names]
    means, whole = np.full(len(parameters), np.nan), np.zeros((len(parameters),) * 2)
    means[at], whole[np.ix_(at, at)] = mean, covariance
    return len(wide), means, whole


def _covariances(wide: pd.DataFrame, names: list[str]) -> np.ndarray:
    """Return the covariance (n, p, p) of each person's errors; 0 unless it is stated both ways."""
    missing = pd.Series(np.nan, wide.index)
    stated = np.array([[wide.get((f"with_{b}", a), missing) for b in names] for a in names])
    stated = stated.transpose(2, 0, 1).astype(float)
    errors: np.ndarray = np.nan_to_num((stated + stated.transpose(0, 2, 1)) / 2.0)
    variance = np.array([wide.get(("error", name), missing).fillna(0.0) for name in names]).T
    errors[:, range(len(names)), range(len(names))] = variance
    return errors
