"""Rows of people of the preset ``realistic``: ``python -m benchmarks.realistic --rows a,b``.

From the root of the repository; a stopped run continues, and results of another state of the code
are not used. Writes ``docs/tables/realistic.csv``, in which rows that are not run stay.
"""

import argparse
import sys
from collections.abc import Sequence
from functools import partial
from pathlib import Path

import pandas as pd
from benchmarks.accuracy.runs import ESTIMATION, code_hash
from benchmarks.kept import add_options, by_person
from benchmarks.realistic.rows import ROWS, person_of_row
from benchmarks.realistic.scores import remedies_of, scores_of_row, withheld_reasons

_ROOT = Path(__file__).parents[2]
_TABLE = _ROOT / "docs" / "tables" / "realistic.csv"


def main(arguments: Sequence[str] | None = None) -> int:
    """Run rows, write their scores, and return the exit code.

    Parameters
    ----------
    arguments : sequence of str, optional
        Of the command line by default.
    """
    parser = _parser()
    asked = parser.parse_args(arguments)
    names = asked.rows.split(",")
    if unknown := [name for name in names if name not in ROWS]:
        parser.error(f"--rows: expected some of {','.join(ROWS)}; got {','.join(unknown)}.")
    for name in names:
        entries = by_person(
            partial(person_of_row, name, asked.seed),
            range(asked.people),
            asked.kept / name / f"{asked.seed}-{code_hash(ESTIMATION)[:16]}.jsonl",
            workers=asked.workers,
            tell=partial(print, file=sys.stderr),
        )
        scores = scores_of_row(name, entries)
        print(f"{name}: {ROWS[name].title}, window {ROWS[name].window_s:g} s")
        print(scores.drop(columns=["row", "people"]).set_index("parameter").T.to_string())
        print(remedies_of(entries).to_string(index=False))
        print(withheld_reasons(entries).to_string(index=False), "\n", flush=True)
        _write(scores, asked.table)
    return 0


def _write(scores: pd.DataFrame, table: Path) -> None:
    """Put the scores of a row in the place of its former ones."""
    whole = scores
    if table.is_file():
        kept = pd.read_csv(table)
        whole = pd.concat([kept[~kept["row"].isin(scores["row"])], scores]).sort_values(
            "row", kind="stable"
        )
    table.parent.mkdir(parents=True, exist_ok=True)
    whole.to_csv(table, index=False, float_format="%.4g")


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(prog="python -m benchmarks.realistic", description=__doc__)
    parser.add_argument("--rows", default=",".join(ROWS), help="names, separated by commas")
    kept = _ROOT / ".accuracy-cache" / "realistic"
    add_options(parser, people=30, kept=kept, table=_TABLE)
    return parser


if __name__ == "__main__":
    sys.exit(main())
