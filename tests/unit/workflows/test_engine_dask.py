"""Tasks on a Dask cluster: started here, or a lab's own."""

import subprocess
import sys
import time
from functools import partial

import pytest

from jointz.core.errors import DataError
from jointz.workflows import engine_dask
from jointz.workflows.engine import Task, done_in_turn, open_engine

pytest.importorskip("distributed", reason="dask is not installed")
pytestmark = pytest.mark.filterwarnings("default")  # its own, about loops and sockets


@pytest.fixture(scope="module")
def address(tmp_path_factory):
    """Start a scheduler and two workers by hand, as a lab would."""
    folder = tmp_path_factory.mktemp("cluster")
    file = folder / "scheduler.json"
    start = [sys.executable, "-m", "distributed.cli.dask_scheduler"]
    scheduler = [*start, "--port", "0", "--no-dashboard", "--scheduler-file", str(file)]
    worker = [sys.executable, "-m", "distributed.cli.dask_worker", "--no-dashboard"]
    worker += ["--nthreads", "1", "--scheduler-file", str(file), "--host", "127.0.0.1"]
    quiet = {"stdout": subprocess.DEVNULL, "stderr": subprocess.DEVNULL, "cwd": folder}
    running = [subprocess.Popen([*scheduler, "--host", "127.0.0.1"], **quiet)]
    while not file.exists():
        time.sleep(0.1)
    running += [subprocess.Popen(worker, **quiet) for _ in range(2)]
    import json

    yield json.loads(file.read_text())["address"]
    for process in running:
        process.terminate()
    for process in running:
        process.wait()


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
