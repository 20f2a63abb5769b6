"""Means of studies over their people, with errors."""

from collections.abc import Iterator
from typing import Any, Final

import numpy as np
import pandas as pd
from scipy.special import ndtri

from jointz.core.codes import NotPooled
from jointz.pooling.conditions import CONDITION_COLUMNS
from jointz.pooling.results_folders import AVAILABLE
from jointz.results.statistics.random_effects_fit import StudyMean
from jointz.stats.random_effects import mean_over_people

_FEWEST: Final = 2
#: Columns of a cell: rows that agree in them are pooled.
CELL: Final = ["parameter", "unit", *CONDITION_COLUMNS, "timing_point"]

Row = dict[str, Any]


def people_of(estimates: pd.DataFrame) -> pd.DataFrame:
    """Return one row a person and cell, with mean value and mean variance.

    The mean of a person's variances is the variance of a mean of fully correlated values, which is
    conservative. One undecided session or side makes the person undecided.
    """
    table = estimates
    is_available, at_bound = table["status"].isin(AVAILABLE), table["status"] == "at_bound"
    half = (table["ci_high"] - table["ci_low"]) / 2.0
    reach = half.where(~at_bound, table["ci_high"] - table["value"])
    quantile = ndtri(np.where(at_bound, table["ci_level"], 0.5 + table["ci_level"] / 2.0))
    rows = table.assign(
        value=table["value"].where(is_available),
        error=((reach / quantile) ** 2).where(is_available),
        has_value=is_available,
        at_bound=at_bound,
        undecided=table["status"] == "undecided",
    )
    how = {"value": "mean", "error": "mean", "gain_sd": "max", "ci_level": "first"}
    how |= dict.fromkeys(["has_value", "at_bound", "undecided"], "any")
    keys = [*CELL, "study", "participant"]
    people = rows.groupby(keys, sort=False, dropna=False).agg(how).reset_index()
    people["has_value"] &= ~people["undecided"]
    return people


def study_means(people: pd.DataFrame) -> Iterator[Row]:
    """Yield a row a study and cell, in the columns of ``studies.csv``."""
    keys = [*CELL, "study"]
    for key, group in people.groupby(keys, sort=False, dropna=False):
        used, without = group[group["has_value"]], group[~group["has_value"]]
        counts = {
            "n_people": len(used),
            "n_at_bound": int(used["at_bound"].sum()),
            "n_undecided": int(without["undecided"].sum()),
            "n_failed": int((~without["undecided"]).sum()),
        }
        yield dict(zip(keys, key, strict=True)) | counts | _mean(used)


def _mean(people: pd.DataFrame) -> Row:
    """Return the mean of a study and its standard error, or why there is none."""
    if people.empty:
        return {"status": NotPooled.NO_VALUE.value}
    n, value = len(people), float(people["value"].mean())
    if n < _FEWEST:
        return {"value": value, "status": NotPooled.ONE_PERSON.value}
    errors = people["error"].fillna(0.0).to_numpy()[:, None, None]
    shared_sd = float(people["gain_sd"].max())
    variance = mean_over_people(people[["value"]].to_numpy(), errors, shared_sd=shared_sd)[1]
    if (se := float(np.sqrt(variance[0, 0]))) == 0.0:
        return {"value": value, "status": NotPooled.NO_SPREAD.value}
    low, high = StudyMean("", value, se, n, float(people["ci_level"].iloc[0])).interval
    return {"value": value, "se": se, "ci_low": low, "ci_high": high, "status": "ok"}
