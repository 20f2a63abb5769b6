"""Write the files, judge each, and print the table."""

import argparse
import csv
import tempfile
from collections import Counter
from pathlib import Path

from benchmarks.awkward_files.judge import VERDICTS, Row, judge
from benchmarks.awkward_files.make import FILES, SEED, make

TABLE = Path(__file__).resolve().parents[2] / "docs" / "tables" / "awkward-files.csv"
WIDTH = 220


def rows_of(names: list[str], seed: int) -> list[Row]:
    """Make and judge files in a temporary folder, printing a line for each."""
    rows = []
    with tempfile.TemporaryDirectory() as scratch:
        folder = Path(scratch)
        for name, truth in make(folder, names, seed=seed).items():
            row = judge(FILES[name], truth, folder / name.replace(".", "_"))
            print(_line(row), flush=True)
            rows.append(row)
    return rows


def _line(row: Row) -> str:
    text = f"{row.name:<26} {row.verdict:<9} {row.awkward}\n    {row.sentence[:WIDTH]}"
    return text + "".join(f"\n    Label: {fault}." for fault in row.label_faults)


def write_rows(rows: list[Row]) -> None:
    """Write the table that the documentation shows."""
    with TABLE.open("w", newline="", encoding="utf-8") as file:
        table = csv.writer(file, lineterminator="\n")
        table.writerow(["name", "what is awkward", "verdict", "sentence"])
        table.writerows([r.name, r.awkward, r.verdict, r.sentence[:WIDTH]] for r in rows)


def main() -> None:
    """Parse the arguments and run; a part of the files leaves the table as it is."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.awkward_files")
    parser.add_argument("--only", nargs="+", metavar="NAME", default=[], help="files by name")
    parser.add_argument("--seed", type=int, default=SEED)
    asked = parser.parse_args()
    if unknown := set(asked.only) - set(FILES):
        parser.error(f"no such file: {sorted(unknown)}; known: {list(FILES)}")
    rows = rows_of(asked.only, asked.seed)
    counts = Counter(row.verdict for row in rows)
    print(", ".join(f"{counts[verdict]} {verdict}" for verdict in VERDICTS))
    n_labels = sum(bool(row.label_faults) for row in rows)
    print(f"{n_labels} file(s) with a wrong participant or condition among those that were read")
    if not asked.only:
        write_rows(rows)


if __name__ == "__main__":
    main()
