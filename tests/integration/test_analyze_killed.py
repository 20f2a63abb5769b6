"""An analysis whose workers or whose client are killed ends with the same numbers."""

import os
import random
import shutil
import signal
import subprocess
import sys
import time

import pytest

from jointz.tasks.task_store import TaskStore

pytestmark = [
    pytest.mark.slow,
    pytest.mark.skipif(not hasattr(os, "fork"), reason="kills processes as POSIX does"),
]
KILLS, PEOPLE = 10, 6
#: What two runs cannot share: when they were, and where.
TABLES = ("estimates.csv", "comparison.csv", "excluded.csv", "population.csv",
          "statistics.json", "certificate.csv")  # fmt: skip


@pytest.fixture(scope="module")
def study(tmp_path_factory, csv_study):
    folder = tmp_path_factory.mktemp("people") / "study"
    csv_study(folder, people=PEOPLE, strides=40, pulses=8, seed=3)
    return folder


def started(study, out, *options):
    words = ["analyze", str(study), "--out", str(out), "--seed", "1", "--certify"]
    words = [sys.executable, "-m", "jointz", *words, *options]
    return subprocess.Popen(words, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True)


def children(pid):
    words = ["pgrep", "-P", str(pid), "-f", "spawn_main"]
    return subprocess.run(words, capture_output=True, text=True, check=False).stdout.split()


def contents(results):
    return {name: (results / name).read_bytes() for name in TABLES}


def done(store):
    return {file.name: file.stat().st_mtime_ns for file in store.glob("*.result")}


def waited_for(process, store, count):
    """Wait until so many people are done, and say whether there is somebody left to disturb."""
    while process.poll() is None and len(done(store)) < count:
        time.sleep(0.02)
    return process.poll() is None


@pytest.fixture(scope="module")
def undisturbed(study, tmp_path_factory):
    out = tmp_path_factory.mktemp("undisturbed") / "results"
    with started(study, out, "--workers", "2") as process:
        assert process.wait() == 0
    return contents(out)


@pytest.mark.timeout(1800)
def test_workers_killed_at_random_moments_change_nothing(study, undisturbed, tmp_path):
    rng = random.Random(1)
    killed = 0
    while killed < KILLS:
        out = tmp_path / str(killed)
        store = TaskStore(out).folder
        with started(study, out, "--workers", "2") as process:
            if waited_for(process, store, rng.randrange(PEOPLE - 1)):
                time.sleep(rng.uniform(0.0, 0.5))
            for worker in rng.sample(found := children(process.pid), min(1, len(found))):
                os.kill(int(worker), signal.SIGKILL)
                killed += 1
            told = process.communicate()[1]
        assert process.returncode == 0, told
        assert contents(out) == undisturbed
        shutil.rmtree(out)


@pytest.mark.timeout(1800)
@pytest.mark.parametrize("scheduler", [(), ("--scheduler", "local")], ids=["processes", "dask"])
def test_a_killed_client_goes_on_where_it_was(study, undisturbed, tmp_path, scheduler):
    if scheduler:
        pytest.importorskip("distributed", reason="dask is not installed")
    rng = random.Random(2)
    out = tmp_path / "results"
    store = TaskStore(out).folder
    kept = {}
    for target in sorted(rng.randrange(PEOPLE) for _ in range(KILLS)):
        with started(study, out, "--workers", "2", *scheduler) as process:
            assert waited_for(process, store, target)
            time.sleep(rng.uniform(0.0, 0.5))
            process.kill()
        assert not out.exists()  # whole or not at all
        now = done(store)
        assert kept.items() <= now.items()  # nothing that was done was done again
        kept = now
    with started(study, out, "--workers", "2", *scheduler) as process:
        told = process.communicate()[1]

    assert process.returncode == 0, told
    assert len(kept) > 0
    assert contents(out) == undisturbed
    assert not store.exists()
