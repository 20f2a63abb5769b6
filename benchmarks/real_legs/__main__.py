"""Score a walking method in worlds whose truth is known.

Recorded worlds A, B and C hold people with real legs, by a simulator that shares no code with the
project; their folder is real_legs, beside the folder of real recordings (JOINTZ_DATA, or
../shared/data). Presets are simulated by jointz itself. Errors and half-widths are in % of truth;
shares have their Monte-Carlo standard error. Run from the root of the repository.
"""

import argparse
import json
import sys
from collections.abc import Iterator, Sequence
from dataclasses import asdict
from functools import partial
from pathlib import Path
from tempfile import TemporaryDirectory

from benchmarks.real_legs import studies
from benchmarks.real_legs.scores import row_table, score_table, scores
from benchmarks.real_legs.studies import World, WorldResult

from jointz.identify.estimators import METHODS
from jointz.tasks.engine import Done, Task, done_in_turn
from jointz.tasks.open_engine import open_engine

_STUDIES = ("A", "B", "C")
_PRESETS = ("clean", "nominal", "hard", "anthropometric")
_BROKEN = "failed:analysis_broke"


def main(arguments: Sequence[str] | None = None) -> int:
    """Analyse the worlds, print their tables, and return the exit code.

    Parameters
    ----------
    arguments : sequence of str, optional
        Of the command line by default.
    """
    parser = _parser()
    options = parser.parse_args(arguments)
    recorded = _available(options.studies)
    if not recorded and not options.simulated:
        return 0
    if options.method not in METHODS.serving("walking"):
        known = ", ".join(METHODS.serving("walking"))
        parser.error(f"--method: expected one of {known}; got {options.method}.")
    with TemporaryDirectory(prefix="real_legs_") as scratch:
        try:
            worlds = _worlds(recorded, options, Path(scratch))
        except ValueError as exc:
            parser.error(str(exc))
        outcomes = _outcomes(worlds, options.method, options.workers)
        results = [_shown(done, each=options.each) for done in outcomes]
    complete = [result for result in results if result is not None]
    if options.json:
        rows = [asdict(row) for result in complete for row in result.rows]
        options.json.write_text(json.dumps(rows, indent=1) + "\n")
    return 0 if len(complete) == len(results) else 1


def _available(names: Sequence[str]) -> list[str]:
    """Return the recorded worlds to analyse; none if their folder is absent."""
    folder = studies.real_legs_folder()
    if names and not folder.is_dir():
        print(f"Recorded worlds are skipped: there is no folder {folder}.", file=sys.stderr)
        return []
    return list(names)


def _worlds(recorded: Sequence[str], options: argparse.Namespace, scratch: Path) -> list[World]:
    folder = studies.real_legs_folder()
    # Recorded ones come first: a wrong window is reported before anything is simulated.
    worlds = [studies.recorded_world(folder, name, options.window, scratch) for name in recorded]
    worlds += [
        studies.simulated_world(
            preset,
            people=options.people,
            seed=options.seed,
            workers=options.workers,
            scratch=scratch,
        )
        for preset in options.simulated
    ]
    return worlds


def _outcomes(worlds: Sequence[World], method: str, workers: int) -> Iterator[Done[WorldResult]]:
    """Yield the worlds in order; each is analysed in one process, for its CPU time."""
    tasks = [Task(world.name, partial(studies.analyzed, world, method)) for world in worlds]
    count = max(1, min(workers, len(tasks)))
    with open_engine(workers=count, tasks=len(tasks), needs=studies.__name__) as engine:
        yield from done_in_turn(engine, tasks)


def _shown(done: Done[WorldResult], *, each: bool) -> WorldResult | None:
    """Print a world's table and return its result; None if its analysis failed."""
    if done.error is not None:
        message = f"{type(done.error).__name__}: {done.error}"
        print(f"{done.name}: the analysis failed. {message}", file=sys.stderr)
        return None
    result = done.result()
    world, people = result.world, len(result.world.truths)
    print(
        f"{world.name}: window {world.window_s:g} s, {people} participants, CPU "
        f"{result.cpu_s / people:.2f} s per participant (median {result.median_cpu_s:.2f} s)"
    )
    print(score_table(scores(result.rows)).to_string(index=False))
    if each:
        print(row_table(result.rows).to_string(index=False, float_format="%.4g"))
    print(flush=True)
    if any(row.status == _BROKEN for row in result.rows):
        print(*result.notes, sep="\n", file=sys.stderr)
    return result


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(prog="python -m benchmarks.real_legs", description=__doc__)
    add = parser.add_argument
    add("--method", default="bayesian", help="name of a walking method")
    add("--studies", nargs="*", choices=_STUDIES, default=list(_STUDIES), help="recorded worlds")
    add("--window", type=float, help="s, of recorded worlds; by default each study's own")
    add("--simulated", nargs="*", choices=_PRESETS, default=[], help="presets to simulate")
    add("--people", type=int, default=4, help="of every preset")
    add("--seed", type=int, default=20260, help="of the simulation")
    add("--workers", type=int, default=2, help="processes")
    add("--each", action="store_true", help="print every row")
    add("--json", type=Path, metavar="FILE", help="write every row there")
    return parser


if __name__ == "__main__":
    sys.exit(main())
