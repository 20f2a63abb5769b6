"""Runs of ``jointz analyze`` and how their estimates compare with the truth."""

import json
import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pandas as pd
from benchmarks.lab_folder.simulation import Person

OFF_PCT = 30.0
REFERENCES = ("one_clock", "slow_angle")
CELL = ["source", "seed", "participant", "timing_point", "parameter"]


def analyze(study: Path, people: list[Person]) -> tuple[pd.DataFrame, str, list[str]]:
    """Return a row a cell, counts of exclusions by code, and messages of the program."""
    results = study.with_name(f"{study.name}-results")
    command = [sys.executable, "-m", "jointz", "analyze", str(study), "--out", str(results)]
    command += ["--method", "rigid", "--no-figures"]
    environment = os.environ | {"OPENBLAS_NUM_THREADS": "1"}
    run = subprocess.run(command, env=environment, capture_output=True, text=True, check=False)
    study.with_name(f"{study.name}.log").write_text(run.stdout + run.stderr)
    points = [(person.id, *point) for person in people for point in person.truth.items()]
    truth = [(*point, *item) for *point, values in points for item in values.items()]
    cells = pd.DataFrame(truth, columns=[*CELL[2:], "truth"])
    if run.returncode not in (0, 1) or not (results / "estimates.csv").exists():
        cells = cells.assign(value=np.nan, ci_low=np.nan, ci_high=np.nan, status="refused")
        return cells, "", [line for line in run.stderr.splitlines() if line.strip()]
    estimates = pd.read_csv(results / "estimates.csv", dtype={"participant": str})
    estimates = estimates[[*CELL[2:], "value", "ci_low", "ci_high", "status"]]
    cells = cells.merge(estimates, how="left", validate="1:1")
    counts = pd.read_csv(results / "excluded.csv")["code"].value_counts()
    messages = json.loads((results / "statistics.json").read_text())
    exclusions = ", ".join(f"{code} {count}" for code, count in counts.items())
    return cells.fillna({"status": "absent"}), exclusions, messages["warnings"] + messages["notes"]


def count(cells: pd.DataFrame) -> dict[str, int]:
    """Return counts of statuses, of intervals that hold the truth, and of wrong estimates."""
    ok = cells["status"] == "ok"
    undecided = cells["status"].isin(["undecided", "at_bound"])
    interval = (ok | undecided) & cells["ci_high"].notna()
    low = cells["ci_low"].fillna(-np.inf)
    holds = interval & (low <= cells["truth"]) & (cells["truth"] <= cells["ci_high"])
    off = 100 * (cells["value"] / cells["truth"] - 1).abs() > OFF_PCT
    return {
        "cells": len(cells),
        "ok": int(ok.sum()),
        "undecided": int(undecided.sum()),
        "failed": int((~ok & ~undecided).sum()),
        "intervals": int(interval.sum()),
        "hold_truth": int(holds.sum()),
        "ok_and_hold_truth": int((ok & holds).sum()),
        "ok_but_30pct_off": int((ok & off).sum()),
    }


def compare_forms(cells: pd.DataFrame) -> pd.DataFrame:
    """Return a row a source and form; half-widths and differences are medians and largest ones."""
    rows = []
    for (source, form), own in cells.groupby(["source", "form"], sort=False):
        row = {"source": source, "form": form} | count(own)
        for reference in REFERENCES:
            other = cells[(cells["form"] == reference) & (cells["source"] == source)]
            both = own.merge(other, on=CELL, suffixes=("", "_reference"))
            ratio = (both["ci_high"] - both["ci_low"]) / (
                both["ci_high_reference"] - both["ci_low_reference"]
            )
            ok = both[(both["status"] == "ok") & (both["status_reference"] == "ok")]
            difference = 100 * (ok["value"] / ok["value_reference"] - 1).abs()
            row[f"half_width_over_{reference}"] = round(ratio.median(), 2)
            row[f"largest_difference_to_{reference}_pct"] = round(difference.max(), 1)
        rows.append(row)
    return pd.DataFrame(rows)


def format_markdown(table: pd.DataFrame) -> str:
    """Return the table in markdown."""
    lines = [table.columns, ["---"] * table.shape[1], *table.fillna("").to_numpy()]
    return "\n".join("| " + " | ".join(map(str, line)) + " |" for line in lines)
