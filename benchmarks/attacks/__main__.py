"""Write the cases, analyse each, and print a table. See the package."""

import argparse
import json
import os
import re
import subprocess
import sys
import time
from collections import Counter
from pathlib import Path

import pandas as pd
from benchmarks.attacks.cases import Case, cases

OFF_PCT = 30.0
PARAMETERS = ("stiffness", "damping", "inertia")
_HEADER = "case | cells | ok | ok, >30 % off | intervals hold | undecided | failed | s | notes"


def analyze(case: Case, study: Path, results: Path, code: Path) -> tuple[pd.DataFrame, list[str]]:
    """Run the command line; return rows of estimates with their truth, and what it says."""
    arguments = ["analyze", str(study), "--out", str(results), "--no-figures", "--overwrite"]
    arguments += ["--quiet", "--workers", "1", "--resamples", "50", "--method", case.method]
    done = subprocess.run(
        [sys.executable, "-m", "jointz", *arguments],
        env=os.environ | {"PYTHONPATH": str(code), "OPENBLAS_NUM_THREADS": "1"},
        capture_output=True, text=True, check=False,
    )  # fmt: skip
    study.with_suffix(".log").write_text(done.stdout + done.stderr)
    truth = pd.DataFrame([
        {"participant": person, "timing_point": point, "parameter": name, "truth": values[name]}
        for person, points in json.loads((study / "truth.json").read_text()).items()
        for point, values in points.items()
        for name in PARAMETERS
    ])  # fmt: skip
    if done.returncode == 2 or not (results / "estimates.csv").exists():
        rows = truth.assign(status=f"failed:exit_{done.returncode}", value=None, ci_low=None)
        return rows.assign(ci_high=None), [done.stderr or done.stdout]
    estimates = pd.read_csv(results / "estimates.csv", dtype={"participant": str})
    keys = ["participant", "timing_point", "parameter"]
    columns = [*keys, "status", "value", "ci_low", "ci_high"]
    rows = truth.merge(estimates[columns], on=keys, how="left")
    rows["status"] = rows["status"].fillna("failed:missing")
    told = json.loads((results / "statistics.json").read_text())
    return rows, [*told.get("warnings", []), *told.get("notes", [])]


def first_sentences(notes: list[str]) -> list[str]:
    """Return the first sentence of each note, without names of people, each once."""
    short = [re.split(r"(?<=[.!?])\s", " ".join(str(note).split()))[0][:160] for note in notes]
    short = [re.sub(r"\bP\d\d(, P\d\d)*\b", "P", text).replace("|", "/") for text in short]
    return list(dict.fromkeys(short))


def line(case: str, rows: pd.DataFrame, notes: list[str], seconds: float) -> str:
    """Return the case's line of the table."""
    ok = rows[rows["status"] == "ok"]
    off = (ok["value"] / ok["truth"] - 1).abs() > OFF_PCT / 100
    given = rows[rows["value"].notna() & rows["ci_low"].notna() & rows["ci_high"].notna()]
    hold = (given["ci_low"] <= given["truth"]) & (given["truth"] <= given["ci_high"])
    worst = Counter(ok.loc[off, "parameter"].str[0].map({"s": "K", "d": "B", "i": "J"}))
    where = f" ({', '.join(f'{k} {n}' for k, n in worst.items())})" if worst else ""
    failed = rows["status"].str.extract(r"^failed:(.*)$")[0].dropna()
    codes = ", ".join(f"{code} {n}" for code, n in Counter(failed).items()) or "-"
    undecided = (rows["status"] == "undecided").sum()
    cells = [case, len(rows), len(ok), f"{off.sum()}{where}", f"{hold.sum()} of {len(given)}"]
    cells += [undecided, codes, f"{seconds:.0f}", "; ".join(first_sentences(notes)) or "-"]
    return "| " + " | ".join(map(str, cells)) + " |"


def main() -> None:
    """Parse the arguments and run."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.attacks")
    parser.add_argument("--out", type=Path, required=True, help="scratch folder")
    parser.add_argument("--people", type=int, default=6)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--only", nargs="+", metavar="NAME", help="names or their beginnings")
    parser.add_argument("--per-point", type=int, default=40, help="pulses a timing point")
    own = Path(__file__).resolve().parents[2] / "src"
    parser.add_argument("--code", type=Path, default=own, help="source folder of the program")
    chosen = parser.parse_args()
    known = cases()
    names: list[str] = []
    for start in chosen.only or [""]:
        found = [start] if start in known else [name for name in known if name.startswith(start)]
        if not found:
            parser.error(f"no such case: {start}; known: {', '.join(known)}")
        names += [name for name in found if name not in names]
    from benchmarks.attacks.people import walk  # need MuJoCo
    from benchmarks.attacks.studies import write_study

    out, code = chosen.out.resolve(), chosen.code.resolve()
    print(f"| {_HEADER} |\n|{' --- |' * (_HEADER.count('|') + 1)}", flush=True)
    everything = []
    for name in names:
        case, start = known[name], time.monotonic()
        settings = {"per_point": chosen.per_point} | dict(case.walk)
        walkers = [walk(chosen.seed, i, **settings) for i in range(chosen.people)]
        study = write_study(case, walkers, out / name)
        start = time.monotonic()
        rows, notes = analyze(case, study, out / f"{name}-results", code)
        print(line(name, rows, notes, time.monotonic() - start), flush=True)
        everything.append(
            rows.assign(case=name, error_pct=100 * (rows["value"] / rows["truth"] - 1))
        )
        pd.concat(everything).to_csv(out / "scores.csv", index=False)


if __name__ == "__main__":
    main()
