"""Write the files, judge each, and print the table."""

import argparse
import csv
import tempfile
from collections import Counter
from pathlib import Path

from benchmarks.awkward_files import make as first_set
from benchmarks.awkward_files import second_set, third_set
from benchmarks.awkward_files.judge import VERDICTS, Row, judge, judge_folder
from benchmarks.awkward_files.truth import AwkwardFile, AwkwardFolder, FolderTruth, Truth

TABLES = Path(__file__).resolve().parents[2] / "docs" / "tables"
TABLE_OF = {
    "first": TABLES / "awkward-files.csv",
    "second": TABLES / "awkward-files-second.csv",
    "third": TABLES / "awkward-files-third.csv",
}
Items = dict[str, AwkwardFile | AwkwardFolder]
ITEMS_OF: dict[str, Items] = {
    "first": {**first_set.FILES},
    "second": second_set.ITEMS,
    "third": third_set.ITEMS,
}
WIDTH = 220


def rows_of(chosen: str, names: list[str], seed: int | None) -> list[Row]:
    """Make and judge files in a temporary folder, printing a line for each."""
    rows = []
    with tempfile.TemporaryDirectory() as scratch:
        folder = Path(scratch)
        for name, truth in _made(chosen, folder, names, seed).items():
            row = _judged(ITEMS_OF[chosen][name], truth, folder / name.replace(".", "_"))
            print(_line(row), flush=True)
            rows.append(row)
    return rows


def _made(
    chosen: str, folder: Path, names: list[str], seed: int | None
) -> dict[str, Truth | FolderTruth]:
    if chosen == "second":
        return second_set.make(folder, names, seed=second_set.SEED if seed is None else seed)
    if chosen == "third":
        return third_set.make(folder, names, seed=third_set.SEED if seed is None else seed)
    return {**first_set.make(folder, names, seed=first_set.SEED if seed is None else seed)}


def _judged(item: AwkwardFile | AwkwardFolder, truth: Truth | FolderTruth, folder: Path) -> Row:
    if isinstance(item, AwkwardFolder) and isinstance(truth, FolderTruth):
        return judge_folder(item, truth, folder)
    assert isinstance(item, AwkwardFile)
    assert isinstance(truth, Truth)
    return judge(item, truth, folder)


def _line(row: Row) -> str:
    text = f"{row.name:<26} {row.verdict:<9} {row.awkward}\n    {row.sentence[:WIDTH]}"
    return text + "".join(f"\n    Label: {fault}." for fault in row.label_faults)


def write_rows(rows: list[Row], path: Path) -> None:
    """Write the table that the documentation shows."""
    with path.open("w", newline="", encoding="utf-8") as file:
        table = csv.writer(file, lineterminator="\n")
        table.writerow(["name", "what is awkward", "verdict", "sentence"])
        table.writerows([r.name, r.awkward, r.verdict, r.sentence[:WIDTH]] for r in rows)


def main() -> None:
    """Parse the arguments and run; a part of the files leaves the table as it is."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.awkward_files")
    parser.add_argument("--set", choices=list(TABLE_OF), default="first", dest="chosen")
    parser.add_argument("--only", nargs="+", metavar="NAME", default=[], help="files by name")
    parser.add_argument("--seed", type=int)
    asked = parser.parse_args()
    items = ITEMS_OF[asked.chosen]
    if unknown := set(asked.only) - set(items):
        parser.error(f"no such file: {sorted(unknown)}; known: {list(items)}")
    rows = rows_of(asked.chosen, asked.only, asked.seed)
    counts = Counter(row.verdict for row in rows)
    print(", ".join(f"{counts[verdict]} {verdict}" for verdict in VERDICTS))
    n_labels = sum(bool(row.label_faults) for row in rows)
    print(f"{n_labels} file(s) with a wrong participant or condition among those that were read")
    if not asked.only:
        write_rows(rows, TABLE_OF[asked.chosen])


if __name__ == "__main__":
    main()
