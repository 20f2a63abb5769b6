"""Scores of a row: decided share, coverage of intervals and limits, errors and widths.

Errors and half-widths are in % of the truth, of decided estimates. The band of a coverage is where
a true 95 % stays with probability 95 %, for as many estimates over their design effect: those of a
person are not independent.
"""

from collections.abc import Sequence
from typing import Any

import numpy as np
import pandas as pd
from benchmarks.accuracy.scores import Coverage, coverage_of
from benchmarks.kept import Entry
from benchmarks.realistic.rows import PARAMETERS

_COLUMNS = ["timing_point", "parameter", "status", "why", "remedy"]
_NUMBERS = ["value", "low", "high", "truth"]


def table_of_cells(entries: Sequence[Entry]) -> pd.DataFrame:
    """Return a line an estimate, with the person's ``number``.

    Parameters
    ----------
    entries : sequence of dict
        Of :func:`benchmarks.realistic.rows.person_of_row`.
    """
    rows = [{"number": e["number"], **cell} for e in entries for cell in e["cells"]]
    cells = pd.DataFrame(rows, columns=["number", *_COLUMNS, *_NUMBERS])
    cells[_NUMBERS] = cells[_NUMBERS].astype(float)
    return cells


def scores_of_row(name: str, entries: Sequence[Entry]) -> pd.DataFrame:
    """Return a line a parameter.

    Parameters
    ----------
    name : str
        Row.
    entries : sequence of dict
        Results of its people.
    """
    cells = table_of_cells(entries)
    cpu_s = float(np.median([entry["cpu_s"] for entry in entries]))
    return pd.DataFrame(
        [
            {"row": name, "people": len(entries), "parameter": parameter}
            | _score(cells[cells["parameter"] == parameter])
            | {"cpu_s": cpu_s}
            for parameter in PARAMETERS
        ]
    )


def _score(cells: pd.DataFrame) -> dict[str, Any]:
    decided = cells[cells["status"].isin(["ok", "at_bound"]) & cells["value"].notna()]
    undecided = cells[cells["status"] == "undecided"]
    truth = decided["truth"]
    error = (100.0 * (decided["value"] / truth - 1.0)).to_numpy()
    width = (50.0 * (decided["high"] - decided["low"]) / truth).to_numpy()
    inside = (decided["low"] <= truth) & (truth <= decided["high"])
    limits = undecided[undecided["low"].notna()]
    sides = pd.concat([limits["truth"] < limits["high"], limits["low"] < limits["truth"]])
    whose = pd.concat([limits["number"], limits["number"]])
    return {
        "cells": len(cells),
        "decided_pct": 100.0 * len(decided) / len(cells),
        "failed_pct": 100.0 * float(cells["status"].str.startswith("failed").mean()),
        **_columns("coverage", coverage_of(inside.to_numpy(), decided["number"].to_numpy())),
        "half_width_pct": float(np.median(width)) if width.size else None,
        "rmse_pct": float(np.sqrt(np.mean(error**2))) if error.size else None,
        "bias_pct": float(error.mean()) if error.size else None,
        "withheld_pct": 100.0 * (len(undecided) - len(limits)) / len(cells),
        "limits": len(sides),
        **_columns("limits_hold", coverage_of(sides.to_numpy(), whose.to_numpy())),
        "remedy_named_pct": 100.0 * float((limits["remedy"] != "").mean()) if len(limits) else None,
    }


def _columns(name: str, coverage: Coverage) -> dict[str, float | None]:
    return {
        name: coverage.rate,
        f"{name}_low": coverage.low,
        f"{name}_high": coverage.high,
        f"{name}_design_effect": coverage.design_effect,
    }


def remedies_of(entries: Sequence[Entry]) -> pd.DataFrame:
    """Return how often the report names which measurement first, by parameter.

    Parameters
    ----------
    entries : sequence of dict
        Results of the people of a row.
    """
    cells = table_of_cells(entries)
    named = cells[cells["remedy"] != ""]
    first = named["remedy"].str.split(r"[:;]", regex=True).str[0].rename("named first")
    counts = named.groupby(["parameter", first], sort=False).size()
    return counts.rename("times").reset_index()


def withheld_reasons(entries: Sequence[Entry]) -> pd.DataFrame:
    """Return how often a value is withheld for which reason.

    Parameters
    ----------
    entries : sequence of dict
        Results of the people of a row.
    """
    cells = table_of_cells(entries)
    withheld = cells[(cells["status"] == "undecided") & cells["low"].isna()]
    return withheld.groupby("why", sort=False).size().rename("withheld").reset_index()
