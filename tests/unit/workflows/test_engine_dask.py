"""Tasks on a Dask cluster: started here, or a lab's own."""

import os
import random
import signal
import subprocess
import threading
import time
from functools import partial

import pytest

from jointz.core.errors import DataError
from jointz.workflows import engine_dask
from jointz.workflows.engine import Task, done_in_turn, open_engine

pytest.importorskip("distributed", reason="dask is not installed")
pytestmark = pytest.mark.filterwarnings("default")  # its own, about loops and sockets


@pytest.fixture(scope="module")
def address(dask_cluster, tmp_path_factory):
    with dask_cluster(tmp_path_factory.mktemp("cluster")) as address:
        yield address


@pytest.fixture(scope="module")
def joined(address):
    deadline = time.monotonic() + 60
    while True:
        try:
            with open_engine(address, tasks=9, needs="json") as engine:
                if engine.workers == 2:
                    yield engine
                    return
        except DataError:  # its workers are on their way
            pass
        assert time.monotonic() < deadline
        time.sleep(0.2)


def test_results_come_in_the_order_of_the_tasks(joined):
    tasks = [Task(str(k), partial(divmod, k, 3)) for k in range(20)]

    assert [d.result() for d in done_in_turn(joined, tasks)] == [divmod(k, 3) for k in range(20)]


def test_a_task_that_raises_is_told_and_the_rest_is_done(joined):
    done = list(done_in_turn(joined, [Task(str(k), partial(divmod, 6, k)) for k in range(3)]))

    assert [d.value for d in done] == [None, (6, 0), (3, 0)]
    assert isinstance(done[0].error, ZeroDivisionError)


def test_another_version_on_a_worker_is_refused(joined, address, monkeypatch):
    monkeypatch.setattr(engine_dask, "own_version", lambda: "99.0")
    with (
        pytest.raises(DataError, match=r"expected jointz 99\.0 on every worker; tcp://.* has 0\."),
        open_engine(address, tasks=1, needs="json"),
    ):
        pass


def test_nobody_answers(monkeypatch):
    monkeypatch.setattr(engine_dask, "_PATIENCE_S", 0.5)
    for scheduler in ("tcp://127.0.0.1:1", "nonsense"):
        with (
            pytest.raises(DataError, match=r"nobody answers|Expected tcp://"),
            open_engine(scheduler, tasks=1, needs="json"),
        ):
            pass


def test_a_cluster_of_this_machine():
    with open_engine("local", workers=1, tasks=1, needs="json") as engine:
        [done] = done_in_turn(engine, [Task("one", partial(divmod, 7, 2))])
        assert done.result() == (3, 1)
        assert engine.workers == 1


@pytest.mark.slow
def test_workers_killed_at_random_cost_little(tmp_path):
    rng = random.Random(4)
    kills, count = 10, 300
    killed = []

    def kill(of):
        while len(killed) < kills:
            time.sleep(rng.uniform(1.0, 3.0))
            words = ["pgrep", "-P", str(of), "-f", "spawn_main"]
            found = subprocess.run(words, capture_output=True, text=True, check=False).stdout
            if found:
                killed.append(rng.choice(found.split()))
                os.kill(int(killed[-1]), signal.SIGKILL)

    def task(k):
        return Task(str(k), partial(subprocess.run, ["sh", "-c", noted(k)], check=True))

    def noted(k):
        return f"echo >> '{tmp_path}/{k}.begun'; sleep 0.1"

    with open_engine("local", workers=2, tasks=count, needs="subprocess") as engine:
        killer = threading.Thread(target=kill, args=(os.getpid(),), daemon=True)
        killer.start()
        done = list(done_in_turn(engine, [task(k) for k in range(count)]))
        killer.join()

    assert [d.result().args[-1] for d in done] == [noted(k) for k in range(count)]
    begun = sum(file.read_text().count("\n") for file in tmp_path.glob("*.begun"))
    # A cluster keeps results on its workers until they are fetched: those go with the worker.
    assert begun - count <= 4 * len(killed)
