"""Tasks on a Dask cluster: started here, or a lab's own."""

import os
import re
import subprocess
import sys
import time
from concurrent.futures import Future
from contextlib import ExitStack, contextmanager
from functools import partial
from pathlib import Path

import pytest

from jointz.core.errors import DataError, EngineError, WorkerLostError
from jointz.tasks import dask_cluster as engine_dask
from jointz.tasks.engine import Task, done_in_turn
from jointz.tasks.open_engine import open_engine
from jointz.tasks.shared_memory import shared_out

distributed = pytest.importorskip("distributed", reason="dask is not installed")
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


def test_a_task_that_raises_is_told_and_the_rest_is_done(joined):
    done = list(done_in_turn(joined, [Task(str(k), partial(divmod, 6, k)) for k in range(20)]))

    assert [d.value for d in done] == [None, *[divmod(6, k) for k in range(1, 20)]]
    assert isinstance(done[0].error, ZeroDivisionError)


@pytest.mark.parametrize("name", ["jointz", "Python", "numpy", "scipy", "numba"])
def test_other_software_on_a_worker_is_refused(joined, address, monkeypatch, name):
    there = engine_dask._calculating()
    assert there[name][0].isdigit()
    monkeypatch.setattr(engine_dask, "_calculating", lambda: {**there, name: "99.0"})
    told = rf"tcp://\S+ has {name} {re.escape(there[name])} instead of 99\.0; tcp://"
    with pytest.raises(DataError, match=told), open_engine(address, tasks=1, needs="json"):
        pass


class Client:
    """Knows workers, by address, and what each says when it is asked; calls wait for ever."""

    def __init__(self, *workers):
        self.says = dict.fromkeys(workers, engine_dask._calculating())

    def nthreads(self):
        return dict.fromkeys(self.says, 1)

    def run(self, *_, workers, **__):
        return {worker: self.says[worker] for worker in workers or self.says}

    def get_executor(self, **_):
        return self

    def submit(self, *_):
        return Future()


def until_it_has(cluster, workers):
    deadline = time.monotonic() + 60
    while cluster._fit != workers:
        cluster._look(now=True)
        assert time.monotonic() < deadline
        time.sleep(0.01)


def test_a_worker_that_cannot_be_reached_at_first_is_asked_again():
    client = Client("a", "b")
    client.says["b"] = OSError("gone for a moment")
    cluster = engine_dask.Cluster(client, "tcp://lab:8786")
    assert cluster._fit == {"a"}

    client.says["b"] = client.says["a"]
    until_it_has(cluster, {"a", "b"})


def test_only_what_no_worker_is_at_any_more_is_taken_back(monkeypatch):
    monkeypatch.setattr(engine_dask, "_LOOK_S", 0.01)
    client = Client("a", "b")
    cluster = engine_dask.Cluster(client, "tcp://lab:8786")
    killed, running = cluster.submit(int), cluster.submit(int)
    killed.set_exception(distributed.KilledWorker("it", None, 3))
    assert cluster.losses(killed) == 4

    del client.says["a"]
    until_it_has(cluster, {"b"})
    assert [cluster.has_lost(future) for future in (killed, running)] == [True, False]
    cluster.renew()
    assert not running.cancelled()

    client.says = dict.fromkeys(["c"], client.says["b"])
    assert cluster.losses(running) == 1
    assert cluster.has_lost(running)
    cluster.renew()
    assert running.cancelled()
    assert cluster._fit == {"c"}


def test_a_cluster_that_cannot_be_started_here_is_told(monkeypatch):
    def refused(**_):
        raise OSError(11, "Resource temporarily unavailable")

    monkeypatch.setattr(distributed, "LocalCluster", refused)
    with (
        pytest.raises(EngineError, match="Resource temporarily unavailable"),
        open_engine("local", workers=1, tasks=1, needs="json"),
    ):
        pass


def started_now(address, stack):
    """Join a cluster as soon as it has a worker."""
    deadline = time.monotonic() + 60
    while True:
        try:
            return stack.enter_context(open_engine(address, tasks=9, needs="json"))
        except DataError:  # its worker is on its way
            assert time.monotonic() < deadline


@contextmanager
def late_workers(folder, *many):
    """Start workers that join the cluster of a folder, each with options of its own."""
    quiet = {"stdout": subprocess.DEVNULL, "stderr": subprocess.DEVNULL, "cwd": folder}
    joins = ["--no-dashboard", "--host", "127.0.0.1", "--scheduler-file", "scheduler.json"]
    command = [sys.executable, "-m", "distributed.cli.dask_worker", *joins]
    running = [subprocess.Popen([*command, *words], **quiet) for words in many]
    try:
        yield
    finally:
        for process in running:
            process.terminate()
        for process in running:
            process.wait()


#: Tells which worker made it; the workers cannot import this module.
WHO = Task("who", partial(eval, "__import__('distributed').get_worker().address"))
OLDER = "import jointz.tasks.dask_cluster as it; it._calculating = lambda: {'numpy': '1.0'}"
WITHOUT = "import sys; sys.modules['jointz'] = None"


@pytest.mark.slow
def test_a_worker_that_joins_late_gets_nothing_where_it_differs(
    dask_cluster, tmp_path, monkeypatch
):
    monkeypatch.setattr(engine_dask, "_RETURN_S", 0.5)
    late = [("--nthreads", "1", "--preload", preload) for preload in (OLDER, WITHOUT)]
    with dask_cluster(tmp_path, "") as address, ExitStack() as stack:
        engine = started_now(address, stack)
        [fit] = engine._fit
        stack.enter_context(late_workers(tmp_path, *late, ("--nthreads", "2")))
        deadline = time.monotonic() + 60
        while len(engine._unfit) < 3 and time.monotonic() < deadline:
            assert {d.result() for d in done_in_turn(engine, [WHO] * 4)} == {fit}
        assert {d.result() for d in done_in_turn(engine, [WHO] * 20)} == {fit}

        engine._client.retire_workers([fit])
        with pytest.raises(EngineError, match="no worker is left") as refused:
            list(done_in_turn(engine, [WHO]))
        shared = [wait() for wait in shared_out(engine, [partial(divmod, 7, 2)] * 2)]

    assert shared == [(3, 1)] * 2
    for told in ("numpy 1.0 instead of", "no jointz of this version (", "2 threads instead of 1"):
        assert told in str(refused.value)


@pytest.mark.slow
def test_a_worker_that_the_cluster_started_again_goes_on(dask_cluster, tmp_path):
    dies = f"test -e '{tmp_path}/died' || {{ touch '{tmp_path}/died'; kill -9 $PPID; }}"
    with dask_cluster(tmp_path, "") as address, ExitStack() as stack:
        engine = started_now(address, stack)
        [before] = engine._fit
        once = Task("dies once", partial(subprocess.run, ["sh", "-c", dies], check=True))
        done = list(done_in_turn(engine, [once, *[WHO] * 3]))

    assert done[0].result().returncode == 0
    assert before not in [d.result() for d in done[1:]]


@pytest.mark.slow
def test_a_task_that_kills_its_worker_is_told_and_the_rest_is_done():
    kills = Task("killer", partial(subprocess.run, ["sh", "-c", "kill -9 $PPID"], check=True))
    with open_engine("local", workers=1, tasks=4, needs="json") as engine:
        done = list(done_in_turn(engine, [kills, *[WHO] * 3]))

    assert isinstance(done[0].error, WorkerLostError)
    assert all(d.result().startswith("tls://") for d in done[1:])


@pytest.mark.slow
def test_a_cluster_that_is_gone_is_told(dask_cluster, tmp_path, monkeypatch):
    monkeypatch.setattr(engine_dask, "_PATIENCE_S", 2)
    monkeypatch.setattr(engine_dask, "_RETURN_S", 2)
    with dask_cluster(tmp_path, "") as address, ExitStack() as stack:
        engine = started_now(address, stack)
        coming = done_in_turn(engine, [Task(str(k), partial(divmod, k, 3)) for k in range(20)])
        assert next(coming).result() == (0, 0)
        with distributed.Client(address, set_as_default=False) as other:
            other.shutdown()
        with pytest.raises(EngineError, match=r"the workers cannot go on|no worker is left"):
            list(coming)
        [shared] = shared_out(engine, [partial(divmod, 7, 2)])
        assert shared() == (3, 1)


def test_nobody_answers(monkeypatch):
    monkeypatch.setattr(engine_dask, "_PATIENCE_S", 0.5)
    for scheduler in ("tcp://127.0.0.1:1", "nonsense"):
        with (
            pytest.raises(DataError, match=r"nobody answers|Expected tcp://"),
            open_engine(scheduler, tasks=1, needs="json"),
        ):
            pass


def _listening(pids):
    """Return addresses on which processes listen, in the hexadecimal words of /proc/net."""
    handles = [link for pid in pids for link in Path(f"/proc/{pid}/fd").iterdir()]
    sockets = {os.readlink(link) for link in handles if link.is_symlink()}
    lines = [
        line.split()
        for table in ("tcp", "tcp6")
        for line in Path(f"/proc/net/{table}").read_text().splitlines()[1:]
    ]
    return [line[1].split(":")[0] for line in lines if f"socket:[{line[9]}]" in sockets
            and line[3] == "0A"]  # fmt: skip


@pytest.mark.skipif(not sys.platform.startswith("linux"), reason="looks at /proc")
def test_nobody_else_reaches_a_cluster_of_this_machine():
    with open_engine("local", workers=1, tasks=1, needs="json") as engine:
        workers = engine._client.run(os.getpid)
        addresses = _listening([os.getpid(), *workers.values()])
        scheduler = engine._client.scheduler.address
        with pytest.raises(OSError):  # noqa: PT011 - reset or timed out
            distributed.Client(scheduler.replace("tls://", "tcp://"), timeout=2)

    assert len(addresses) >= 3  # scheduler, nanny, worker
    assert set(addresses) == {"0100007F"}  # 127.0.0.1
    assert scheduler.startswith("tls://")


def test_a_cluster_of_this_machine_is_not_started_in_the_clear(monkeypatch):
    for name in [name for name in sys.modules if name.split(".")[0] == "cryptography"]:
        monkeypatch.delitem(sys.modules, name)
    monkeypatch.setitem(sys.modules, "cryptography", None)
    with (
        pytest.raises(DataError, match=r"jointz\[scale\]"),
        open_engine("local", workers=1, tasks=1, needs="json"),
    ):
        pass
