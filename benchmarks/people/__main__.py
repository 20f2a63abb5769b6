"""Coverage and power of people together: ``python -m benchmarks.people --worlds nominal``.

From the root of the repository; a stopped run continues. Everybody of one pool walks twice, as
usual and with a knee that is 20 % stiffer. Studies are drawn from it, and their means, paired
differences and differences of groups are held against those of the whole pool; beside them stand
paired t tests of the decided values. Studies are drawn without replacement: their errors are
smaller than those of new people by sqrt(1 - size / people). Writes
``docs/tables/people-WORLD.csv``.
"""

import argparse
import sys
from collections.abc import Sequence
from functools import partial
from pathlib import Path

from benchmarks.accuracy.runs import ESTIMATION, code_hash
from benchmarks.kept import add_options, by_person
from benchmarks.people.draws import studies, summary
from benchmarks.people.pool import CONDITIONS, WORLDS, person_of_pool

_ROOT = Path(__file__).parents[2]


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the pools, draw studies, write the tables, and return the exit code."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.people", description=__doc__)
    add = parser.add_argument
    add("--worlds", default=",".join(WORLDS), help="names, separated by commas")
    add("--draws", type=int, default=100, help="studies drawn from each pool")
    add("--size", type=int, default=10, help="people of a study")
    tables, kept = _ROOT / "docs" / "tables", _ROOT / ".accuracy-cache" / "people"
    add_options(parser, people=40, kept=kept, table=tables)
    asked = parser.parse_args(arguments)
    names = asked.worlds.split(",")
    if unknown := [name for name in names if name not in WORLDS]:
        parser.error(f"--worlds: expected some of {','.join(WORLDS)}; got {','.join(unknown)}.")
    if 2 * asked.size > asked.people:
        parser.error(f"--size: two groups of {asked.size} need {2 * asked.size} people.")
    for world in names:
        pool = {
            condition: by_person(
                partial(person_of_pool, world, condition, asked.seed),
                range(asked.people),
                asked.kept
                / f"{world}-{condition}"
                / f"{asked.seed}-{code_hash(ESTIMATION)[:16]}.jsonl",
                workers=asked.workers,
                tell=partial(print, file=sys.stderr),
            )
            for condition in CONDITIONS
        }
        rows = studies(
            pool, draws=asked.draws, size=asked.size, seed=asked.seed, workers=asked.workers
        )
        shown = summary(rows)
        print(f"{world}: {asked.draws} studies of {asked.size} of {asked.people} people")
        print(shown.round(3).to_string(index=False), "\n", flush=True)
        asked.table.mkdir(parents=True, exist_ok=True)
        shown.to_csv(asked.table / f"people-{world}.csv", index=False, float_format="%.4g")
    return 0


if __name__ == "__main__":
    sys.exit(main())
