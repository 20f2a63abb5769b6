"""Rows of a catalog to places, to people, to the means of studies with their errors."""

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

#: Parameters whose errors go together, and the columns that say how.
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
    """Return the rows with plain columns, after seeing that they can be pooled."""
    if lacking := [name for name in CATALOG_COLUMNS if name not in rows.columns]:
        raise DataError(f"rows to pool: expected the catalog's columns; missing: {lacking}.")
    unknown = [key for key in by if key not in BY]
    if unknown or not by or len(set(by)) < len(by):
        got = ", ".join(unknown or by) or "none"
        raise DataError(f"by: expected some of {', '.join(BY)}, each once; got {got}.")
    versions = rows.groupby("study", observed=True)["version"].nunique()
    if twice := [str(study) for study, n in versions.items() if n > 1]:
        raise DataError(
            f"{', '.join(twice)}: stands in the collection in several versions, which would count "
            "its people twice. Keep one version of an entry, or choose by entry."
        )
    text = {name: rows[name].astype(object) for name, k in CATALOG_COLUMNS.items() if k == "text"}
    return rows.assign(**{name: column.fillna("") for name, column in text.items()})


def has_value(table: pd.DataFrame) -> pd.Series:
    """Tell which rows have a value to pool."""
    printed = (table["values"] == "printed") & (table["status"] == "")
    return table["value"].notna() & (table["status"].isin(STANDING) | printed)


def place_columns(rows: pd.DataFrame, by: tuple[str, ...]) -> dict[str, pd.Series]:
    """Return what tells places apart, as text."""
    in_gait = rows["activity"].isin(_GAIT)

    def told(texts: list[str], number: pd.Series, *, of_gait: bool = True) -> pd.Series:
        known = pd.Series(texts, rows.index, dtype=object).where(number.notna(), _NOT_STATED)
        return known.where(in_gait | number.notna(), _NOT_IN_GAIT) if of_gait else known

    def band(number: pd.Series, width: float, start: float, form: str) -> list[str]:
        # 1.2 m/s is in the middle of a band; rounding must not move what lies at an edge.
        low = np.floor((number - start) / width + 1e-9) * width + start
        return [form.format(a + 0.0, a + width) for a in low]

    found = {key: rows[key].replace("", _NOT_STATED) for key in by if key in rows}
    if "phase" in by:
        pct = rows["onset_gait_pct"].astype(float) % 100.0
        found["phase"] = told(band(pct, _PHASE_BIN_PCT, 0.0, "{:.0f} to {:.0f} %"), pct)
    if "speed" in by:
        speed, half = rows["walking_speed_m_s"].astype(float), _SPEED_BAND_M_S / 2.0
        found["speed"] = told(band(speed, _SPEED_BAND_M_S, half, "{:.1f} to {:.1f} m/s"), speed)
    if "slope" in by:
        slope = rows["slope_deg"].astype(float) + 0.0  # -0 is level too
        found["slope"] = told(list(map("{:g} deg".format, slope)), slope)
    return found


def people_of(table: pd.DataFrame, by: tuple[str, ...]) -> pd.DataFrame:
    """Return one row a person, place, parameter and method: values averaged, errors too.

    The mean of a person's variances is that of values whose errors go together fully: cautious.
    """
    status, value, stands = table["status"], table["value"].astype(float), has_value(table)
    at_bound = status == "at_bound"
    reach = np.where(at_bound, table["ci_high"] - value, (table["ci_high"] - table["ci_low"]) / 2.0)
    error = (reach / np.where(at_bound, _REACH_ONE_SIDED, REACH_95)) ** 2
    for name, column in zip(TOGETHER, WITH, strict=True):
        own = (table["parameter"] == name) & table[column].notna()
        error = np.where(own, table[column], error)
    seen = table.assign(
        value=value.where(stands),
        error=pd.Series(error, table.index).where(stands),
        stands=stands,
        at_bound=at_bound & stands,
        undecided=status == "undecided",
        shared_sd=np.hypot(table["torque_gain_sd"].fillna(0.0), table["angle_gain_sd"].fillna(0.0)),
    )
    keys = [*by, "parameter", "unit", "study", "method", "values", "statistic", "participant"]
    told = dict.fromkeys(["value", "error", *WITH], "mean")
    told |= {"sd": "max", "n": "min", "shared_sd": "max", "person": "first"}
    told |= dict.fromkeys(["stands", "at_bound", "undecided"], "any")
    people = seen.groupby(keys, sort=False, observed=True).agg(told).reset_index()
    people["stands"] &= ~people["undecided"]  # as person_cells: one undecided side is enough
    return people


def study_means(people: pd.DataFrame, by: tuple[str, ...]) -> Iterator[Row]:
    """Yield a row a study, place, parameter and method, in the columns of ``studies.csv``."""
    keys = [*by, "parameter", "unit", "study", "method", "values"]
    for key, group in people.groupby(keys, sort=False):
        chosen = _of_more_people(group)
        held, gone = chosen[chosen["stands"]], chosen[~chosen["stands"]]
        row: Row = dict(zip(keys, key, strict=True)) | {
            "n_people": len(held),
            "n_at_bound": int(held["at_bound"].sum()),
            "n_undecided": int(gone["undecided"].sum()),
            "n_failed": int((~gone["undecided"]).sum()),
        }
        yield row | _study_mean(held)


def _of_more_people(group: pd.DataFrame) -> pd.DataFrame:
    """Return the people of a study, or its printed mean where that is of more of them."""
    is_mean = group["statistic"] == "mean"
    people, mean = group[~is_mean], group[is_mean & group["stands"]]
    if mean.empty or mean["n"].fillna(0.0).max() <= people["stands"].sum():
        return people if len(people) else group
    return mean


def _study_mean(held: pd.DataFrame) -> Row:
    """Return the mean of a study and its error, or why there is none."""
    if held.empty:
        return {"status": NotPooled.NO_VALUE.value}
    n, value = len(held), float(held["value"].mean())
    shared = float(held["shared_sd"].iloc[0])
    if held["statistic"].iloc[0] == "mean":
        n, sd = int(np.nan_to_num(held["n"].iloc[0])), float(held["sd"].iloc[0])
        if not (n >= FEWEST and sd > 0.0):
            return {"n_people": n, "value": value, "status": NotPooled.NO_SD.value}
        se = float(np.hypot(sd / np.sqrt(n), shared * value))
    elif n < FEWEST:
        return {"value": value, "status": NotPooled.ONE_PERSON.value}
    else:
        errors = held["error"].fillna(0.0).to_numpy()[:, None, None]
        variance = mean_over_people(held[["value"]].to_numpy(), errors, shared_sd=shared)[1]
        se = float(np.sqrt(variance[0, 0]))
    if se == 0.0:
        return {"value": value, "status": NotPooled.NO_SPREAD.value}
    low, high = StudyMean("", value, se, n).interval
    return {"n_people": n, "value": value, "se": se, "ci_low": low, "ci_high": high, "status": "ok"}


def joint_mean(
    own: pd.DataFrame, parameters: list[str]
) -> tuple[int, np.ndarray, np.ndarray] | None:
    """Return people, means and covariance of the parameters of a study at a place."""
    wide = own.pivot_table(
        index="participant", columns="parameter", values=["value", "error", *WITH]
    )
    held = [name for name in parameters if ("value", name) in wide]
    wide = wide.dropna(subset=[("value", name) for name in held])
    if len(wide) < len(held) + FEWEST:
        return None
    values = wide["value"][held].to_numpy()
    shared = float(own["shared_sd"].iloc[0])
    mean, covariance = mean_over_people(values, _own_errors(wide, held), shared_sd=shared)
    at = [parameters.index(name) for name in held]
    means, whole = np.full(len(parameters), np.nan), np.zeros((len(parameters),) * 2)
    means[at], whole[np.ix_(at, at)] = mean, covariance
    return len(wide), means, whole


def _own_errors(wide: pd.DataFrame, held: list[str]) -> np.ndarray:
    """Return the covariance (n, p, p) of each person's errors; 0 where it is not told both ways."""
    blank = pd.Series(np.nan, wide.index)
    told = np.array([[wide.get((f"with_{b}", a), blank) for b in held] for a in held])
    told = told.transpose(2, 0, 1).astype(float)
    errors: np.ndarray = np.nan_to_num((told + told.transpose(0, 2, 1)) / 2.0)
    variance = np.array([wide.get(("error", name), blank).fillna(0.0) for name in held]).T
    errors[:, range(len(held)), range(len(held))] = variance
    return errors
