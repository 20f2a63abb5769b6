"""An analysis whose workers or whose client are killed ends with the same numbers."""

import os
import random
import signal
import subprocess
import sys
import time

import pytest

pytestmark = [
    pytest.mark.slow,
    pytest.mark.skipif(not hasattr(os, "fork"), reason="kills processes as POSIX does"),
]
JOINTZ = [sys.executable, "-m", "jointz"]
KILLS = 10
#: What two runs cannot share: when they were, and where.
TABLES = ("estimates.csv", "comparison.csv", "covariance.csv", "excluded.csv", "population.csv",
          "statistics.json", "certificate.csv")  # fmt: skip


@pytest.fixture(scope="module")
def study(tmp_path_factory, csv_study):
    folder = tmp_path_factory.mktemp("people") / "study"
    csv_study(folder, people=6, strides=40, pulses=8, seed=3)
    return folder


def started(study, out, *options):
    words = [*JOINTZ, "analyze", str(study), "--out", str(out), "--seed", "1", *options]
    return subprocess.Popen(words, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True)


def children(pid):
    words = ["pgrep", "-P", str(pid), "-f", "spawn_main"]
    return subprocess.run(words, capture_output=True, text=True, check=False).stdout.split()


def contents(results):
    return {name: (results / name).read_bytes() for name in TABLES}


@pytest.fixture(scope="module")
def undisturbed(study, tmp_path_factory):
    out = tmp_path_factory.mktemp("undisturbed") / "results"
    began = time.monotonic()
    with started(study, out, "--workers", "2") as process:
        assert process.wait() == 0
    return contents(out), time.monotonic() - began


def test_workers_killed_at_random_moments_change_nothing(study, undisturbed, tmp_path):
    expected, seconds = undisturbed
    rng = random.Random(1)
    killed = 0
    for number in range(100):
        out = tmp_path / str(number)
        with started(study, out, "--workers", "2") as process:
            time.sleep(rng.uniform(0.2, 0.9) * seconds)
            for worker in rng.sample(found := children(process.pid), min(1, len(found))):
                os.kill(int(worker), signal.SIGKILL)
                killed += 1
            told = process.communicate()[1]
        assert process.returncode == 0, told
        assert contents(out) == expected
        if killed == KILLS:
            return
    pytest.fail(f"only {killed} workers were there to be killed")


@pytest.mark.parametrize("scheduler", [(), ("--scheduler", "local")], ids=["processes", "dask"])
def test_a_killed_client_goes_on_where_it_was(study, undisturbed, tmp_path, scheduler):
    if scheduler:
        pytest.importorskip("distributed", reason="dask is not installed")
    expected, seconds = undisturbed
    rng = random.Random(2)
    out, store = tmp_path / "results", tmp_path / ".results.tasks"
    kept = {}
    for _ in range(KILLS):
        with started(study, out, "--workers", "2", *scheduler) as process:
            time.sleep(rng.uniform(0.4, 1.0) * seconds)
            if process.poll() is not None:
                break
            process.kill()
        assert not out.exists()  # whole or not at all
        now = {file.name: file.stat().st_mtime_ns for file in store.glob("*.result")}
        assert kept.items() <= now.items()  # nothing that was done was done again
        kept = now
    with started(study, out, "--workers", "2", *scheduler) as process:
        told = process.communicate()[1]

    assert process.returncode in (0, 2), told  # 2 where the last one had ended by itself
    assert len(kept) > 0
    assert contents(out) == expected
    assert not store.exists()
