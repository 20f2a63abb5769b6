"""Results of simulated people in files, a line a person, so that a second run goes on."""

import argparse
import json
import os
from collections.abc import Callable, Iterable, Sequence
from functools import partial
from pathlib import Path
from typing import Any

from jointz.tasks.engine import Task, done_in_turn
from jointz.tasks.open_engine import open_engine

Entry = dict[str, Any]

_THREADS = ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "NUMBA_NUM_THREADS")


def kept_entries(path: Path) -> dict[int, Entry]:
    """Return what a file holds, by number of the person.

    Parameters
    ----------
    path : Path
        JSON, a line a person; nothing is kept yet if there is no such file.
    """
    found: dict[int, Entry] = {}
    for line in path.read_text().splitlines() if path.is_file() else []:
        try:
            entry = json.loads(line)
        except json.JSONDecodeError:
            continue  # cut off when a run was stopped
        found[int(entry["number"])] = entry
    return found


def keep(path: Path, entry: Entry) -> None:
    """Add the result of one person to a file.

    Parameters
    ----------
    path : Path
        File; its folder is made.
    entry : dict
        Ready for JSON, with the person's ``number``.
    """
    path.parent.mkdir(parents=True, exist_ok=True)
    with path.open("a") as file:
        file.write(json.dumps(entry) + "\n")


def one_thread_each() -> None:
    """Let every process have one thread: threads of their own would fight for the cores."""
    for name in _THREADS:
        os.environ.setdefault(name, "1")


def by_person(
    work: Callable[[int], Entry],
    numbers: Sequence[int],
    path: Path,
    *,
    workers: int,
    tell: Callable[[str], None] = print,
) -> list[Entry]:
    """Return the results of people, from the file where it has them.

    Parameters
    ----------
    work : callable
        Gives the result of a person by number; can be pickled.
    numbers : sequence of int
        Which people.
    path : Path
        Where results are kept.
    workers : int
        Processes, one person each.
    tell : callable
        Told after every person.
    """
    found = kept_entries(path)
    for entry in _new_entries(work, [n for n in numbers if n not in found], workers):
        keep(path, entry)
        found[entry["number"]] = entry
        tell(f"{path.parent.name}: person {entry['number']}")
    return [found[number] for number in numbers]


def _new_entries(
    work: Callable[[int], Entry], missing: Sequence[int], workers: int
) -> Iterable[Entry]:
    if not missing:
        return
    one_thread_each()
    tasks = [Task(str(number), partial(work, number)) for number in missing]
    with open_engine(workers=min(workers, len(tasks)), tasks=len(tasks), needs=__name__) as engine:
        for done in done_in_turn(engine, tasks):
            yield done.result()


def add_options(parser: argparse.ArgumentParser, *, people: int, kept: Path, table: Path) -> None:
    """Add what the programs that keep results by person share.

    Parameters
    ----------
    parser : argparse.ArgumentParser
        Of the program.
    people : int
        How many by default.
    kept, table : Path
        Folder of the results and file to write by default.
    """
    add = parser.add_argument
    add("--people", type=int, default=people, help="of every row, from one pool")
    add("--seed", type=int, default=20260, help="of the population")
    add("--workers", type=int, default=2, help="processes, one person each")
    add("--kept", type=Path, default=kept, help="results")
    add("--table", type=Path, default=table, help="file to write")
