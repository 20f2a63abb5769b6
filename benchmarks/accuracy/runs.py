"""Runs participants of rows in processes of their own; what is done is kept and not done again."""

import hashlib
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, replace
from functools import cache, partial
from pathlib import Path
from time import perf_counter

import numpy as np
from benchmarks.accuracy.bound import participant_bound, participant_information
from benchmarks.accuracy.people import (
    Simulated,
    as_known,
    cell_truth,
    settings_of,
    simulate,
    walk_key,
)
from benchmarks.accuracy.rows import Row
from benchmarks.kept import Entry, keep, kept_entries, one_thread_each

import jointz
from jointz.core.errors import JointzError
from jointz.identify.participant import analyze_participant
from jointz.results.estimates import CellEstimate
from jointz.tasks.engine import Task, done_in_turn
from jointz.tasks.open_engine import open_engine

#: Name of what is kept beside the methods' results.
TRUTH = "truth"
#: Packages that results depend on.
_SIMULATION = ("rig/sim", "core", "rig/devices")
ESTIMATION = ("identify", "kernels", "gait", *_SIMULATION)


@dataclass(frozen=True, slots=True)
class Job:
    """One participant of a row.

    Parameters
    ----------
    row : Row
        Which row.
    number, seed : int
        Participant, and seed of the population.
    kinds : tuple of str
        What is wanted: methods, and ``truth``.
    """

    row: Row
    number: int
    seed: int
    kinds: tuple[str, ...]


Done = list[tuple[Job, dict[str, Entry]]]


class Cache:
    """Results on disk, a line a participant.

    Parameters
    ----------
    folder : Path
        Where; a folder a row, a file a method and state of the code.
    """

    def __init__(self, folder: Path) -> None:
        self._folder = folder

    def load(self, row: Row, seed: int, kind: str) -> dict[int, Entry]:
        """Return what is there, by number of the participant.

        Parameters
        ----------
        row : Row
            Which row.
        seed : int
            Of the population.
        kind : str
            A method or ``truth``.
        """
        return kept_entries(self._path(row, seed, kind))

    def add(self, row: Row, seed: int, kind: str, entry: Entry) -> None:
        """Keep the result of one participant.

        Parameters
        ----------
        row : Row
            Which row.
        seed : int
            Of the population.
        kind : str
            A method or ``truth``.
        entry : dict
            Ready for JSON.
        """
        keep(self._path(row, seed, kind), entry)

    def _path(self, row: Row, seed: int, kind: str) -> Path:
        what = repr(replace(row, title="", target=None)).encode()
        code = code_hash(_SIMULATION if kind == TRUTH else ESTIMATION)
        key = hashlib.sha256(what + code.encode() + str(seed).encode()).hexdigest()[:16]
        return self._folder / row.name / f"{kind}-{key}.jsonl"


@cache
def code_hash(packages: tuple[str, ...]) -> str:
    """Return a hash of the source that results depend on.

    Parameters
    ----------
    packages : tuple of str
        Packages of jointz; this benchmark's own files count too.
    """
    root = Path(str(jointz.__file__)).parent
    own = [Path(__file__).with_name(f"{name}.py") for name in _OWN]
    files = sorted(path for name in packages for path in (root / name).rglob("*.py"))
    digest = hashlib.sha256()
    for path in [*files, *own]:
        digest.update(path.name.encode() + path.read_bytes())
    return digest.hexdigest()


_OWN = ("people", "bound", "linear_joint", "baseline_noise")


def jobs_of(
    rows: Sequence[Row], methods: Sequence[str], participants: int, seed: int, cache: Cache
) -> list[Job]:
    """Return what is not in the cache yet.

    Parameters
    ----------
    rows : sequence of Row
        Rows.
    methods : sequence of str
        Methods.
    participants, seed : int
        How many, and seed of the population.
    cache : Cache
        What is done.
    """
    jobs = []
    for row in rows:
        done = {kind: cache.load(row, seed, kind) for kind in (TRUTH, *methods)}
        for number in range(participants):
            missing = tuple(kind for kind, there in done.items() if number not in there)
            if missing:
                jobs.append(Job(row, number, seed, missing))
    return jobs


def run_jobs(
    jobs: Sequence[Job], *, workers: int, store: Cache, tell: Callable[[Job], None]
) -> None:
    """Run jobs and keep their results.

    Parameters
    ----------
    jobs : sequence of Job
        What to do.
    workers : int
        Processes; with 1 all is done in this one.
    store : Cache
        Where results go.
    tell : callable
        Told after every job.
    """
    for done in _results(_bundles(jobs), workers):
        for job, entries in done:
            for kind, entry in entries.items():
                store.add(job.row, job.seed, kind, entry)
            tell(job)


def _bundles(jobs: Sequence[Job]) -> list[list[Job]]:
    """Put jobs together that need the same walks."""
    bundles: dict[tuple[str, int, int], list[Job]] = {}
    for job in jobs:
        bundles.setdefault((walk_key(job.row), job.seed, job.number), []).append(job)
    return list(bundles.values())


def _results(bundles: Sequence[Sequence[Job]], workers: int) -> Iterable[Done]:
    one_thread_each()
    tasks = [Task(f"{b[0].row.name} {b[0].number}", partial(run_bundle, b)) for b in bundles]
    with open_engine(workers=workers, tasks=len(tasks), needs=__name__) as engine:
        for done in done_in_turn(engine, tasks):
            yield done.result()


def run_bundle(jobs: Sequence[Job]) -> Done:
    """Let a participant walk once and do every job with it.

    Parameters
    ----------
    jobs : sequence of Job
        One participant of rows that are walked alike.

    Returns
    -------
    list of (Job, dict)
        Each job's entries: kind -> entry, ready for JSON.
    """
    simulated = simulate(jobs[0].row, jobs[0].number, jobs[0].seed)
    return [(job, _entries(as_known(simulated, job.row), job)) for job in jobs]


def _entries(simulated: Simulated, job: Job) -> dict[str, Entry]:
    entries: dict[str, Entry] = {}
    for kind in job.kinds:
        if kind == TRUTH:
            points = participant_information(simulated, job.row)
            entries[kind] = {
                "number": job.number,
                "truth": cell_truth(simulated.truth),
                "bound": participant_bound(points, simulated, job.row),
                "misfit": float(np.mean([point.misfit for point in points.values()])),
            }
        else:
            entries[kind] = estimate(simulated, job.row, kind)
    return entries


def estimate(simulated: Simulated, row: Row, method: str) -> Entry:
    """Analyse a participant's study by one method.

    Parameters
    ----------
    simulated : Simulated
        Who walked.
    row : Row
        For what is known.
    method : str
        By which.

    Returns
    -------
    dict
        ``number, method, seconds, estimates, error``.
    """
    person = simulated.rig.person
    settings = settings_of(row, simulated.rig, [method])
    start = perf_counter()
    error, cells = "", tuple[CellEstimate, ...]()
    try:
        cells = analyze_participant(person.id, simulated.recordings, settings).cells[method]
    except JointzError as exc:
        error = str(exc)
    estimates = [
        {
            "timing_point": cell.timing_point,
            "parameter": p.name,
            "value": p.value,
            "low": p.ci_low,
            "high": p.ci_high,
            "status": p.status,
        }
        for cell in cells
        for p in cell.parameters
    ]
    return {
        "number": person.number,
        "method": method,
        "seconds": perf_counter() - start,
        "estimates": estimates,
        "error": error,
    }
