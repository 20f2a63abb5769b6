"""Write the cases, run the program on each, and score what it says. See the package."""

import argparse
import csv
import json
import os
import subprocess
import sys
import time
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any

import pandas as pd
from benchmarks.planted_errors.cases import Case, clean, planted, write_case

OFF_PCT = 30.0
QUANTITIES = ("stiffness", "damping", "inertia")
PER_MASS = ("stiffness_per_mass", "damping_per_mass")
Row = dict[str, Any]


def run_case(case: Case, out: Path, code: Path) -> list[Row]:
    """Return the scores of one case."""
    folder = out / case.name
    arguments = write_case(case, folder)
    # The checkout's root is left out: only the code under test may be found.
    environment = os.environ | {"PYTHONPATH": str(code), "OPENBLAS_NUM_THREADS": "1"}
    start = time.monotonic()
    done = subprocess.run(
        [sys.executable, "-m", "jointz", *arguments],
        env=environment, capture_output=True, text=True, check=False,
    )  # fmt: skip
    base = {"case": case.name, "seconds": round(time.monotonic() - start, 1)}
    base |= {"exit": done.returncode}
    (out / f"{case.name}.log").write_text(done.stdout + done.stderr)
    truth = json.loads((folder / "truth.json").read_text())
    read = _joint_rows if case.family == "joint" else _study_rows
    rows = read(out / f"{case.name}-results", done, truth)
    if not rows:  # nothing was estimated: one row a quantity all the same
        status = "refused" if done.returncode == 2 else f"failed:exit_{done.returncode}"
        message = _one_line(done.stderr or done.stdout)
        rows = [{"quantity": q, "status": status, "message": message} for q in QUANTITIES]
    wanted = QUANTITIES + (PER_MASS if case.fault.startswith("mass_") else ())
    return [base | _scored(row, truth) for row in rows if row["quantity"] in wanted]


def _one_line(text: str) -> str:
    return " ".join(text.split())[:400]


def _study_rows(results: Path, done: subprocess.CompletedProcess[str], _truth: Row) -> list[Row]:
    """Rows of estimates.csv; the message is what is doubted, and the notes."""
    if done.returncode == 2 or not (results / "estimates.csv").exists():
        return []
    table = pd.read_csv(results / "estimates.csv", dtype={"participant": str})
    models = results / "models.csv"
    doubts = pd.read_csv(models)["doubts"].dropna().tolist() if models.exists() else []
    told = json.loads((results / "statistics.json").read_text())
    notes = [*told.get("warnings", []), *told.get("notes", [])]
    message = _one_line(" | ".join(map(str, [*doubts, *notes])))
    keys = ["participant", "timing_point", "status", "value", "ci_low", "ci_high"]
    return [
        {"quantity": row["parameter"], "message": message} | {key: row[key] for key in keys}
        for row in table.to_dict("records")
    ]


def _joint_rows(_results: Path, done: subprocess.CompletedProcess[str], _truth: Row) -> list[Row]:
    """Rows of the object that ``identify joint`` prints."""
    try:
        told = json.loads(done.stdout)
    except json.JSONDecodeError:
        return []
    if "parameters" not in told:  # a record without an answer, with its code
        told_why = {"status": told.get("status"), "message": _one_line(told.get("message", ""))}
        return [told_why | {"quantity": name, "value": None} for name in QUANTITIES]
    check = (told.get("check") or {}).get("finding", "")
    message = _one_line(" | ".join([f"check: {check}", *map(str, told.get("warnings", []))]))
    return [
        {"participant": "", "timing_point": "", "quantity": name, "message": message}
        | {"status": found["status"], "value": found["value"]}
        | dict(zip(("ci_low", "ci_high"), found.get("ci") or (), strict=False))
        for name, found in told.get("parameters", {}).items()
    ]


def _scored(row: Row, truth: Row) -> Row:
    """Set the truth and the error beside an estimate."""
    row = {"participant": "", "timing_point": "", "value": None} | row
    person = truth.get(row["participant"]) or next(iter(truth.values()))
    point = person.get(row["timing_point"], person["*"])
    right, value = point.get(row["quantity"]), row["value"]
    error = None
    if right is not None and value is not None and not pd.isna(value):
        error = round(100.0 * (value / right - 1.0), 1)
    return row | {"truth": right, "error_pct": error}


def _is_off(row: Row) -> bool:
    return row["status"] == "ok" and abs(row["error_pct"] or 0.0) > OFF_PCT


def _line(row: Row) -> str:
    where = " ".join(filter(None, [row["participant"], row["timing_point"], row["quantity"]]))
    line = f"  {row['case']}: {where} {row['status']}"
    if row["error_pct"] is not None:
        line += f" {row['value']:.4g} for {row['truth']:.4g} ({row['error_pct']:+.0f} %)"
        low, high = row.get("ci_low"), row.get("ci_high")
        known = None not in (low, high) and not pd.isna([low, high]).any()
        line += ", interval holds it" if known and low <= row["truth"] <= high else ""
    return f"{line} - {row['message'][:160]}"


def summary(rows: list[Row], kind: str) -> str:
    """Counts, wrong `ok`s, and what each case came to."""
    counts = pd.Series([row["status"] for row in rows]).value_counts()
    off = [row for row in rows if _is_off(row)]
    lines = [f"== {kind}: {len({row['case'] for row in rows})} cases, {len(rows)} quantities"]
    lines += [f"  {n:4d} {status}" for status, n in counts.items()]
    lines += [f"-- ok, but more than {OFF_PCT:.0f} % off: {len(off)}", *map(_line, off)]
    lines += ["-- case by case"]
    for name in dict.fromkeys(row["case"] for row in rows):
        own = [row for row in rows if row["case"] == name]
        told = pd.Series([row["status"] for row in own]).value_counts().to_dict()
        errors = [abs(r["error_pct"]) for r in own if r["status"] == "ok" and r["truth"]]
        worst = f", worst ok {max(errors):.0f} %" if errors else ""
        lines += [f"  {name} ({own[0]['seconds']} s): {told}{worst} - {own[0]['message'][:120]}"]
    if kind == "clean":
        bad = [row for row in rows if row["status"] != "ok"]
        lines += [f"-- not ok: {len(bad)}", *map(_line, bad)]
    return "\n".join(lines)


def main() -> None:
    """Parse the arguments and run."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.planted_errors")
    parser.add_argument("--out", type=Path, required=True, help="scratch folder")
    parser.add_argument("--only", nargs="+", metavar="NAME", help="cases by name")
    parser.add_argument("--cases", choices=["planted", "clean"], help="both by default")
    own = Path(__file__).resolve().parents[2] / "src"
    parser.add_argument("--code", type=Path, default=own, help="source folder of the program")
    asked = parser.parse_args()
    kinds = {"planted": planted(), "clean": clean()}
    known = {case.name for cases in kinds.values() for case in cases}
    if unknown := set(asked.only or ()) - known:
        parser.error(f"no such case: {sorted(unknown)}; known: {sorted(known)}")
    out, code = asked.out.resolve(), asked.code.resolve()
    out.mkdir(parents=True, exist_ok=True)
    everything, texts = [], []
    for kind, cases in kinds.items():
        chosen = [c for c in cases if not asked.only or c.name in asked.only]
        if not chosen or asked.cases not in (None, kind):
            continue
        with ThreadPoolExecutor(2) as pool:
            rows = [r for own in pool.map(lambda c: run_case(c, out, code), chosen) for r in own]
        everything += [{"kind": kind} | row for row in rows]
        texts.append(summary(rows, kind))
    _save(everything, texts, out)


def _save(rows: list[Row], texts: list[str], out: Path) -> None:
    names = ["kind", "case", "participant", "timing_point", "quantity", "status", "value", "truth"]
    names += ["ci_low", "ci_high", "error_pct", "exit", "seconds", "message"]
    with (out / "scores.csv").open("w", newline="") as file:
        table = csv.DictWriter(file, names)
        table.writeheader()
        table.writerows(rows)
    text = "\n\n".join(texts)
    (out / "summary.txt").write_text(text + "\n")
    print(text)


if __name__ == "__main__":
    main()
