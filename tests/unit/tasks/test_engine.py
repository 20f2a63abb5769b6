"""Tasks done by this process and by others: same results, and what becomes of the lost."""

import os
import pickle
import random
import signal
import subprocess
import threading
import time
from concurrent.futures import Future, ThreadPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from contextlib import closing
from functools import partial
from pathlib import Path

import pytest
from threadpoolctl import threadpool_info

from jointz.core.errors import DataError, EngineError, OutputError, WorkerLostError, WriteError
from jointz.tasks import engine as engine_module
from jointz.tasks.engine import Engine, Serial, Task, done_in_turn
from jointz.tasks.open_engine import open_engine
from jointz.tasks.shared_memory import shared_out
from jointz.tasks.task_store import TaskStore, task_key


def square(k):
    return k * k


def third_fails(k):
    if k == 3:
        raise ValueError("planted")
    return k


def third_kills(k):
    if k == 3:
        os.kill(os.getpid(), signal.SIGKILL)
    return k


def counted(folder, k):
    """Leave a mark when begun and one when done."""
    for mark in ("begun", "done"):
        with (Path(folder) / f"{k}.{mark}").open("a") as file:
            file.write("x")
        time.sleep(0.1 if mark == "begun" else 0.0)
    return k


def threads():
    import numpy as np

    np.linalg.inv(np.eye(2))
    return [one["num_threads"] for one in threadpool_info()]


def pid_or_death(parent):
    if os.getpid() != parent:
        os.kill(os.getpid(), signal.SIGKILL)
    return os.getpid()


def tasks(call, count, *arguments, store=False):
    return [
        Task(f"task {k}", partial(call, *arguments, k), partial(str, k) if store else None)
        for k in range(count)
    ]


def kept(store):
    """Keep one result, and return the folder of the store."""
    store.kept(partial(str, 0), partial(square, 3))()
    return store.folder


@pytest.fixture(autouse=True)
def cache_home(tmp_path, monkeypatch):
    """What is kept goes into the user's cache folder, which is the test's own here."""
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    return tmp_path / "cache"


@pytest.fixture(params=[1, 2], ids=["serial", "processes"])
def engine(request):
    with open_engine(workers=request.param, tasks=9, needs="json") as made:
        yield made


@pytest.fixture
def processes():
    with open_engine(workers=2, tasks=9, needs="json") as made:
        yield made


def test_results_come_in_the_order_of_the_tasks(engine):
    assert [d.result() for d in done_in_turn(engine, tasks(square, 30))] == [
        k * k for k in range(30)
    ]


def test_a_task_that_raises_is_told_and_the_rest_is_done(engine):
    done = list(done_in_turn(engine, tasks(third_fails, 7)))

    assert [d.value for d in done] == [0, 1, 2, None, 4, 5, 6]
    assert repr(done[3].error) == "ValueError('planted')"
    assert done[3].name == "task 3"
    with pytest.raises(ValueError, match="planted"):
        done[3].result()


def test_tasks_are_taken_as_they_are_needed(engine):
    taken = []

    def endless():
        while True:
            taken.append(len(taken))
            yield Task("one", partial(square, len(taken)))

    coming = done_in_turn(engine, endless())
    for _ in range(3):
        next(coming)
    coming.close()
    assert len(taken) <= 3 + engine.ahead


def test_linear_algebra_has_one_thread_in_every_task(engine):
    [done] = done_in_turn(engine, [Task("threads", threads)])

    assert set(done.result()) == {1}


def test_a_task_that_kills_its_worker_is_told_and_the_rest_is_done(processes):
    done = list(done_in_turn(processes, tasks(third_kills, 7)))

    assert [d.value for d in done] == [0, 1, 2, None, 4, 5, 6]
    assert isinstance(done[3].error, WorkerLostError)
    assert "task 3" in str(done[3].error)


class KilledError(Exception):
    """Stands for the end of the worker that a call was on."""


class Apart(Engine):
    """Workers that nobody can stop: one that is killed leaves the others at what they are at."""

    def __init__(self, workers):
        self.workers = workers
        self._pool = ThreadPoolExecutor(workers)

    def submit(self, call):
        return self._pool.submit(call)

    def losses(self, future):
        return 4 if isinstance(future.exception(), KilledError) else 0

    def has_lost(self, future):
        return future.done() and self.losses(future) > 0

    def renew(self):
        """Nothing is to be started: workers are started again by themselves."""

    def close(self):
        self._pool.shutdown()


class Sessions:
    """Sessions of participants: one that is run twice at once is refused, some kill who runs it."""

    def __init__(self, killers):
        self._killers = killers
        self._lock = threading.Lock()
        self._running = set()
        self.begun = []  # which, and what else ran

    def run(self, k):
        with self._lock:
            if k in self._running:
                raise RuntimeError("another process is running this")
            self.begun.append((k, set(self._running)))
            self._running.add(k)
        time.sleep(0.02 if k in self._killers else 0.1)
        with self._lock:
            self._running.remove(k)
        if k in self._killers:
            raise KilledError
        return k


@pytest.mark.parametrize("killers", [{0}, {1, 3}, {0, 1, 2, 3, 4, 5}], ids=str)
def test_what_other_workers_are_at_when_one_is_killed_is_not_done_twice(killers, monkeypatch):
    monkeypatch.setattr(engine_module, "on_one_thread", lambda call: call())  # of a whole process
    sessions = Sessions(killers)
    with closing(Apart(3)) as engine:
        done = list(done_in_turn(engine, tasks(sessions.run, 6)))

    assert [d.value for d in done] == [None if k in killers else k for k in range(6)]
    for k in killers:
        assert isinstance(done[k].error, WorkerLostError)
    begun = [k for k, _ in sessions.begun]
    assert sorted(begun) == sorted([*range(6), *killers])
    again = [who for n, (k, who) in enumerate(sessions.begun) if k in begun[:n]]
    assert again == [set()] * len(killers)  # each was tried alone


def test_a_call_of_processes_is_lost_with_any_of_them():
    engine, made, lost = Serial(), Future(), Future()
    made.set_result(1)
    lost.set_exception(BrokenProcessPool())

    assert [engine.has_lost(future) for future in (made, lost, Future())] == [False, True, True]


@pytest.mark.parametrize("kills", [1, pytest.param(10, marks=pytest.mark.slow)])
def test_workers_killed_at_random_cost_little_and_nothing_is_counted_twice(
    processes, tmp_path, kills
):
    rng = random.Random(kills)
    killed = []

    def kill():
        while len(killed) < kills:
            time.sleep(rng.uniform(0.8, 1.6))
            words = ["pgrep", "-P", str(os.getpid()), "-f", "spawn_main"]
            found = subprocess.run(words, capture_output=True, text=True, check=False).stdout
            if found:
                killed.append(rng.choice(found.split()))
                os.kill(int(killed[-1]), signal.SIGKILL)

    killer = threading.Thread(target=kill, daemon=True)
    killer.start()
    count = 40 * kills
    done = list(done_in_turn(processes, tasks(counted, count, tmp_path)))
    killer.join()

    assert [d.result() for d in done] == list(range(count))
    begun = sum(len(file.read_text()) for file in tmp_path.glob("*.begun"))
    # What each of the two workers was at, and the next that lay ready for it.
    assert begun - count <= 4 * len(killed)


def test_a_result_that_is_kept_is_not_made_again(engine, tmp_path):
    store = TaskStore(tmp_path / "tasks")
    first = [*done_in_turn(engine, tasks(counted, 4, tmp_path, store=True), store=store)]
    again = [*done_in_turn(engine, tasks(counted, 6, tmp_path, store=True), store=store)]

    assert [d.result() for d in first] == [0, 1, 2, 3]
    assert [d.result() for d in again] == [0, 1, 2, 3, 4, 5]
    assert {len(file.read_text()) for file in tmp_path.glob("*.done")} == {1}
    store.clear()
    assert not store.folder.exists()


def test_what_failed_is_not_kept(engine, tmp_path):
    store = TaskStore(tmp_path)
    list(done_in_turn(engine, tasks(third_fails, 4, store=True), store=store))

    assert sorted(file.stem for file in store.folder.iterdir()) == ["0", "1", "2"]


@pytest.mark.parametrize(
    "content",
    [b"", pickle.dumps(square)[:-4], b"cno_such_module\nThing\n."],
    ids=["empty", "cut off", "of a module that is gone"],
)
def test_a_kept_result_that_cannot_be_read_is_made_again(tmp_path, content):
    store = TaskStore(tmp_path)
    file = kept(store) / "0.result"
    file.write_bytes(content)
    [done] = done_in_turn(Serial(), tasks(counted, 1, tmp_path, store=True), store=store)

    assert done.result() == 0
    assert pickle.loads(file.read_bytes()) == 0


def test_a_result_is_on_the_disk_before_it_has_its_name(tmp_path, monkeypatch):
    synced = []
    monkeypatch.setattr(os, "fsync", lambda number: synced.append(os.fstat(number).st_size))
    assert synced == [(kept(TaskStore(tmp_path)) / "0.result").stat().st_size]


def test_a_place_that_cannot_be_made_is_told_as_such(cache_home, tmp_path):
    cache_home.touch()
    with pytest.raises(WriteError, match="XDG_CACHE_HOME"):
        kept(TaskStore(tmp_path / "results"))


def test_stores_of_folders_of_the_same_name_are_apart(tmp_path):
    first, second = (TaskStore(tmp_path / name / "results") for name in "AB")
    for store in (first, second):
        kept(store)
    first.clear()

    assert [file.name for file in second.folder.iterdir()] == ["0.result"]
    assert not first.folder.exists()


class Planted:
    """Runs code when it is unpickled: makes a file."""

    def __init__(self, file):
        self.file = file

    def __reduce__(self):
        return Path.touch, (self.file,)


def test_a_planted_result_is_not_read(engine, tmp_path):
    ran, place = tmp_path / "ran", tmp_path / "results"
    for folder in (tmp_path / ".results.tasks", place, tmp_path / "jointz" / "tasks"):
        folder.mkdir(parents=True)
        (folder / "0.result").write_bytes(pickle.dumps(Planted(ran)))
    store = TaskStore(place)
    [done] = done_in_turn(engine, tasks(counted, 1, tmp_path, store=True), store=store)

    assert done.result() == 0
    assert not ran.exists()
    assert store.folder.stat().st_mode & 0o777 == 0o700


def _shared(folder):
    folder.chmod(0o770)


def _linked(folder):
    folder.rename(folder.with_name("elsewhere"))
    folder.symlink_to(folder.with_name("elsewhere"))


@pytest.mark.skipif(not hasattr(os, "getuid"), reason="owners and modes as POSIX has them")
@pytest.mark.parametrize("depth", [0, 1, 2])
@pytest.mark.parametrize("spoil", [_shared, _linked, None], ids=["shared", "linked", "foreign"])
def test_a_cache_folder_that_others_can_write_to_is_refused(tmp_path, monkeypatch, spoil, depth):
    store, ran = TaskStore(tmp_path / "results"), tmp_path / "ran"
    kept(store)
    (store.folder / "0.result").write_bytes(pickle.dumps(Planted(ran)))
    folder = [store.folder, *store.folder.parents][depth]
    if spoil:
        spoil(folder)
    else:
        monkeypatch.setattr(os, "getuid", lambda: folder.stat().st_uid + 1)
    with pytest.raises(OutputError, match="expected a folder of your own"):
        kept(store)
    assert not ran.exists()


def test_what_nobody_went_on_with_for_a_month_is_removed(tmp_path):
    old, new, now = (TaskStore(tmp_path / name) for name in ("old", "new", "now"))
    for store, days in ((old, 31), (new, 29)):
        kept(store)
        os.utime(store.folder, times=(time.time() - days * 86_400,) * 2)
    kept(now)

    assert [store.folder.exists() for store in (old, new, now)] == [False, True, True]


def test_a_key_is_of_all_that_a_result_depends_on():
    def key(**changed):
        given = {"what": "analyze S01", "inputs": {"a.csv": "12"}, "settings": {"seed": 1}}
        return task_key(**(given | changed))

    keys = [key(), key(what="analyze S02"), key(inputs={"a.csv": "13"}), key(settings={"seed": 2})]
    assert len(set(keys)) == 4
    assert key() == keys[0]


def test_what_is_shared_out_is_waited_for_one_by_one(processes):
    found = [wait() for wait in shared_out(processes, [partial(divmod, k, 3) for k in range(5)])]
    broken, fine = shared_out(processes, [partial(divmod, 1, 0), partial(divmod, 1, 1)])

    assert found == [divmod(k, 3) for k in range(5)]
    with pytest.raises(ZeroDivisionError):
        broken()
    assert fine() == (1, 0)


def test_what_a_killed_worker_owed_of_what_was_shared_out_is_done_here(processes):
    (killed,) = shared_out(processes, [partial(pid_or_death, os.getpid())])

    assert killed() == os.getpid()
    (after,) = shared_out(processes, [os.getpid])
    assert after() == os.getpid()


class Failing(Engine):
    """Fails by itself where it is told to, at its so-manieth call."""

    def __init__(self, *, at, call=3):
        self._at, self._left, self._serial = at, call, Serial()

    def submit(self, call):
        self._left -= 1
        if self._at == "submit" and self._left == 0:
            raise RuntimeError("the client is closed")
        made = self._serial.submit(call)
        if self._at == "renew" and self._left == 0:
            made = Future()
            made.set_exception(BrokenProcessPool())
        return made

    def renew(self):
        raise OSError("no more processes")


@pytest.mark.parametrize("at", ["submit", "renew"])
def test_what_an_engine_raises_is_no_task_s(tmp_path, at):
    store = TaskStore(tmp_path)
    coming = done_in_turn(Failing(at=at), tasks(square, 4, store=True), store=store)

    with pytest.raises(EngineError, match=r"cannot go on .*(client is closed|no more processes)"):
        list(coming)
    assert {"0.result", "1.result"} <= {file.name for file in store.folder.iterdir()}


def test_what_is_shared_out_to_an_engine_that_is_gone_is_done_here():
    for at in ("submit", "renew"):
        engine = Failing(at=at, call=2)
        found = [wait() for wait in shared_out(engine, [partial(square, k) for k in range(3)])]
        assert found == [0, 1, 4]


def test_processes_that_cannot_be_started_are_told(monkeypatch):
    def refused(*_, **__):
        raise OSError(11, "Resource temporarily unavailable")

    monkeypatch.setattr("jointz.tasks.open_engine.spawned_pool", refused)
    with (
        pytest.raises(EngineError, match=r"Resource temporarily unavailable"),
        open_engine(workers=2, tasks=9, needs="json"),
    ):
        pass


def test_one_worker_is_this_process():
    with open_engine(workers=1, tasks=100, needs="json") as engine:
        assert isinstance(engine, Serial)
    with (
        pytest.raises(DataError, match="workers"),
        open_engine(workers=0, tasks=1, needs="json"),
    ):
        pass
