"""Analyse a study of the foreign world and hold it against its truth, as it comes out.

``python -m benchmarks.worlds STUDY RESULTS`` from the root of the repository; ``STUDY`` is made by
``python -m benchmarks.worlds.make``. Writes the analysis to ``RESULTS`` unless it is there.
"""

import argparse
import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

import jointz

#: Parameter -> parts of the truth that the method strapped defines it by; fixed before it was run.
TRUTHS: Mapping[str, tuple[str, ...]] = {
    "stiffness": ("stiffness", "gravity_stiffness", "inertial_stiffness"),
    "damping": ("damping",),
    "inertia": ("inertia_60ms",),
}


def scored(analysis: Any, truth: Mapping[str, Any]) -> pd.DataFrame:
    """Return one row a value: what was given, beside the truth and what the whole leg is."""
    rows = []
    for cell in analysis.cells:
        true = truth["participants"][cell.participant][cell.timing_point]
        for name, parts in TRUTHS.items():
            found = cell.parameter(name)
            rows.append({
                "participant": cell.participant,
                "timing_point": cell.timing_point,
                "parameter": name,
                "status": found.status if found else "failed:missing",
                "value": found.value if found else None,
                "unbounded": found.unbounded if found else None,
                "low": found.ci_low if found else None,
                "high": found.ci_high if found else None,
                "truth": sum(true[part] for part in parts),
                "apparent": true[f"apparent_{name}"],
                "vaf_pct": cell.vaf_pct,
            })  # fmt: skip
    return pd.DataFrame(rows)


def summary(rows: pd.DataFrame, by: list[str]) -> pd.DataFrame:
    """Return share decided, coverage, bias, RMSE and half-width of decided values."""
    found = []
    for key, group in rows.groupby(by, sort=False):
        ok = group[group["value"].notna()]
        error = ok["value"] / ok["truth"] - 1.0
        withheld = group[group["value"].isna()]
        limits = group[group["value"].isna() & (group["low"].notna() | group["high"].notna())]
        low, high = limits["low"].fillna(-np.inf), limits["high"].fillna(np.inf)
        found.append(dict(zip(by, key, strict=True)) | {
            "decided_pct": 100.0 * len(ok) / len(group),
            "failed_pct": 100.0 * group["status"].str.startswith("failed").mean(),
            "coverage": ((ok["low"] <= ok["truth"]) & (ok["truth"] <= ok["high"])).mean(),
            "bias_pct": 100.0 * error.median(),
            "rmse_pct": 100.0 * float(np.sqrt((error**2).mean())),
            "half_width_pct": 50.0 * ((ok["high"] - ok["low"]) / ok["value"]).median(),
            "limits": len(limits),
            "limits_hold": ((low <= limits["truth"]) & (limits["truth"] <= high)).mean(),
            "truth": group["truth"].median(),
            "withheld_over_truth": (withheld["unbounded"] / withheld["truth"]).median(),
            "apparent": group["apparent"].median(),
        })  # fmt: skip
    return pd.DataFrame(found)


def main() -> None:
    """Analyse, print the scores, and write them beside the results."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.worlds", description=__doc__)
    parser.add_argument("study", type=Path)
    parser.add_argument("results", type=Path)
    asked = parser.parse_args()
    if asked.results.is_dir():
        analysis = jointz.load(asked.results)
    else:
        analysis = jointz.analyze(asked.study, resamples=10)
        analysis.save(asked.results)
    rows = scored(analysis, json.loads((asked.study / "truth.json").read_text()))
    rows.to_csv(asked.results.with_suffix(".scores.csv"), index=False)
    for by in (["parameter"], ["parameter", "timing_point"]):
        print(summary(rows, by).round(3).to_string(index=False), "\n")
    for note in analysis.statistics.get("notes", ()):
        print("note:", note)


if __name__ == "__main__":
    main()
