"""Many people and many fits on every engine: same numbers, efficiency, memory, scheduler's share.

Run as ``python -m benchmarks.scale people`` or ``python -m benchmarks.scale fits``; for the growth
of time and memory, with ``people --counts 1 10 100 1000 --engines processes``. ``--out FILE``
writes JSON too. Every measurement is a process of its own, started here: its memory is that of a
client that did nothing else, and beside it that of its largest worker. People walk 300 pulses on
the direct path of the rig and are estimated by ``rigid``; only the estimates are kept. Fits
are Monte-Carlo repetitions of one least-squares fit, many to a task.
"""

import argparse
import hashlib
import json
import resource
import subprocess
import sys
import time
from collections.abc import Sequence
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from benchmarks.accuracy.people import simulate
from benchmarks.accuracy.rows import all_rows
from benchmarks.accuracy.runs import estimate
from benchmarks.figures import efficiency, write_json

from jointz.core.provenance import software
from jointz.identify.series.joint import identify_joint
from jointz.sim.knee_joint import respond
from jointz.tasks.engine import Task, done_in_turn
from jointz.tasks.open_engine import open_engine

ENGINES = ("serial", "processes", "dask")
_ROW = "nominal-lag-0.5ms"
_SEED = 77_000
_RATE_HZ, _SECONDS = 500.0, 4.0
_FITS_A_TASK = 500
#: Of people that are simulated once before the clock starts: what is compiled is compiled then.
_WARM = 2


def person(number: int) -> dict[str, Any]:
    """Simulate a person, and return the estimates and how long it took, s.

    Parameters
    ----------
    number : int
        Of the person.
    """
    began = time.perf_counter()
    row = all_rows()[_ROW]
    found = estimate(simulate(row, number, _SEED), row, "rigid")
    return {"estimates": found["estimates"], "busy_s": time.perf_counter() - began}


def fits(first: int, count: int) -> dict[str, Any]:
    """Fit as many noisy repetitions of one response, and return their K and how long it took.

    Parameters
    ----------
    first, count : int
        Numbers of the repetitions: each has noise of its own.
    """
    began = time.perf_counter()
    n = int(_SECONDS * _RATE_HZ)
    torque = 5.0 * np.sin(2 * np.pi * np.linspace(0.5, 8.0, n) * np.arange(n) / _RATE_HZ)
    angle, _ = respond(torque, 60.0, 2.5, 0.06, rate_hz=_RATE_HZ)
    found = []
    for number in range(first, first + count):
        noise = np.random.default_rng([_SEED, number]).normal(0.0, 5e-4, n)
        fit = identify_joint(
            {"angle": angle + noise, "torque": torque},
            rate_hz=_RATE_HZ,
            estimator="least_squares",
        )
        found.append([p.value for p in fit.parameters])
    return {"estimates": found, "busy_s": time.perf_counter() - began}


def client(what: str, count: int, *, workers: int, scheduler: str | None) -> dict[str, Any]:
    """Do it in this process; return a hash of all numbers, times, and memory when all have ended.

    Parameters
    ----------
    what : str
        ``people`` or ``fits``.
    count : int
        How many.
    workers : int
        How many at once.
    scheduler : str or None
        Of Dask.
    """
    tasks = _tasks(what, count)
    with open_engine(scheduler, workers=workers, tasks=len(tasks), needs=__name__) as engine:
        list(done_in_turn(engine, _tasks("people", _WARM * workers)))
        digest, busy_s, began = hashlib.sha256(), 0.0, time.perf_counter()
        for done in done_in_turn(engine, tasks):
            result = done.result()
            digest.update(json.dumps(result["estimates"]).encode())
            busy_s += result["busy_s"]
        wall_s = time.perf_counter() - began
    return {
        "digest": digest.hexdigest()[:16],
        "wall_s": wall_s,
        "busy_s": busy_s,
        "workers": workers,
        "idle_share": 1.0 - busy_s / (workers * wall_s),
        "client_mb": _peak_mb(resource.RUSAGE_SELF),
        "worker_mb": _peak_mb(resource.RUSAGE_CHILDREN) if workers > 1 else None,
    }


def _peak_mb(whose: int) -> float:
    """Return the most memory this process had, or the one of its ended children that had most."""
    return resource.getrusage(whose).ru_maxrss / 1024.0


def _tasks(what: str, count: int) -> list[Task[dict[str, Any]]]:
    if what == "people":
        return [Task(f"person {n} (seed {_SEED})", partial(person, n)) for n in range(count)]
    return [
        Task(f"fits from {first}", partial(fits, first, min(_FITS_A_TASK, count - first)))
        for first in range(0, count, _FITS_A_TASK)
    ]


def measured(what: str, count: int, engine: str) -> dict[str, Any]:
    """Measure one engine in a process of its own.

    Parameters
    ----------
    what : str
        ``people`` or ``fits``.
    count : int
        How many.
    engine : str
        ``serial``, ``processes`` or ``dask``.
    """
    words = [sys.executable, "-m", "benchmarks.scale", "client", what, str(count), engine]
    done = subprocess.run(words, stdout=subprocess.PIPE, check=True, text=True)
    found: dict[str, Any] = json.loads(done.stdout.splitlines()[-1])
    worker_mb = "   -" if found["worker_mb"] is None else f"{found['worker_mb']:4.0f}"
    print(
        f"{what:6} {count:>7} {engine:<10} {found['wall_s']:8.1f} s "
        f"{found['wall_s'] / count:8.3g} s each  idle {100 * found['idle_share']:5.1f} %  "
        f"client {found['client_mb']:4.0f} MB  largest worker {worker_mb} MB  {found['digest']}",
        flush=True,
    )
    return {"what": what, "count": count, "engine": engine, **found}


def compare(found: Sequence[dict[str, Any]]) -> None:
    """Print whether engines agree, and how well they share the work out.

    Parameters
    ----------
    found : sequence of dict
        What :func:`measured` returned for the engines, for one count.
    """
    print("same numbers:", len({one["digest"] for one in found}) == 1)
    alone = next((one for one in found if one["engine"] == "serial"), None)
    for one in found:
        if alone and one is not alone:
            print(f"efficiency {one['engine']}: {efficiency(one, alone):.2f}")


def main(arguments: Sequence[str] | None = None) -> None:
    """Run the benchmark, or the part of it that is one measurement.

    Parameters
    ----------
    arguments : sequence of str, optional
        Of the command line.
    """
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("what", choices=("people", "fits", "client"))
    parser.add_argument("rest", nargs="*", help=argparse.SUPPRESS)
    parser.add_argument("--counts", type=int, nargs="+", default=None)
    parser.add_argument("--engines", nargs="+", default=ENGINES, choices=ENGINES)
    parser.add_argument("--out", type=Path, help="file of JSON")
    given = parser.parse_args(arguments)
    if given.what == "client":
        what, count, engine = given.rest
        workers = 1 if engine == "serial" else 2
        scheduler = "local" if engine == "dask" else None
        print(json.dumps(client(what, int(count), workers=workers, scheduler=scheduler)))
        return
    every = []
    for count in given.counts or ([100] if given.what == "people" else [100_000]):
        found = [measured(given.what, count, engine) for engine in given.engines]
        if len(found) > 1:
            compare(found)
        every += found
    if given.out:
        write_json({"versions": software(), "measured": every}, given.out)


if __name__ == "__main__":
    main()
