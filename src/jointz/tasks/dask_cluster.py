"""A Dask cluster as an engine: a lab's own, or one that is started here."""

import threading
import time
from collections.abc import Callable, Iterator, Mapping
from concurrent.futures import Executor, Future, wait
from concurrent.futures.process import BrokenProcessPool
from contextlib import ExitStack, contextmanager, suppress
from functools import cache, partial
from importlib import import_module
from typing import Any, TypeVar
from weakref import WeakKeyDictionary

from jointz.core.errors import DataError, EngineError, install_advice
from jointz.core.provenance import software
from jointz.tasks.engine import Engine, engine_errors
from jointz.tasks.process_pool import cores, refuse_script_without_guard

Result = TypeVar("Result")

LOCAL = "local"
_PATIENCE_S = 15
#: How often the cluster is asked which workers it has.
_LOOK_S = 1.0
#: How long an analysis without a worker waits for one: a cluster starts those anew that died.
_RETURN_S = 60.0
#: What numbers are made by, beside Python and jointz itself.
_CALCULATING = ("numpy", "scipy", "numba")
#: Of a cluster that is started here: its workers do long calculations, and nothing but these.
#: Dask has workers give freed memory back at once, and arrays are then mapped anew each time,
#: which costs a third of an analysis: what glibc would come to by itself, and what it may at most.
#: It also has them look at themselves a hundred times a second, which costs a twentieth.
_OWN_CLUSTER = {
    "distributed.nanny.pre-spawn-environ.MALLOC_TRIM_THRESHOLD_": 1 << 28,
    "distributed.nanny.pre-spawn-environ.MALLOC_MMAP_THRESHOLD_": 1 << 25,
    "distributed.worker.profile.enabled": False,
    "distributed.admin.tick.interval": "1s",
    "distributed.admin.system-monitor.interval": "5s",
    # Pages have no password. Dask opens their ports even where there is nothing to show.
    "distributed.scheduler.http.routes": [],
    "distributed.worker.http.routes": [],
}
_NOT_INSTALLED = f"which is not installed. {install_advice('scale')}"


class Cluster(Engine):
    """Makes calls on the workers of a Dask cluster that calculate as this process does.

    A call is sent to workers by their addresses: to those that are known to have the same
    software. One that joins later is asked first, and gets none if it has another.

    A worker that is killed leaves the others at what they are at, and what lay ready for it goes
    to them.
    """

    def __init__(self, client: Any, address: str) -> None:
        self._client = client
        self._address = address
        self._fit: set[str] = set()
        self._unfit: dict[str, str] = {}
        self._asked: dict[str, Future[dict[str, Any]]] = {}
        self._sent: WeakKeyDictionary[Future[Any], frozenset[str]] = WeakKeyDictionary()
        self._next_look = 0.0
        self._refuse_others()

    @property
    def workers(self) -> int:  # type: ignore[override]  # workers come and go
        """Number of workers of the cluster that take calls."""
        return max(1, len(self._fit))

    def submit(self, call: Callable[[], Result]) -> Future[Result]:
        """Submit a call to a worker."""
        self._look()
        if not self._fit:
            raise BrokenProcessPool(f"{self._address}: no worker is left.")
        executor: Executor = self._client.get_executor(pure=False, workers=sorted(self._fit))
        future = executor.submit(call)
        self._sent[future] = frozenset(self._fit)
        return future

    def losses(self, future: Future[Any]) -> int:
        """Wait for a call, and return how many workers it has lost; 0 where it was made."""
        while not wait([future], timeout=_LOOK_S).done:
            self._look()
            if self._is_left_alone(future):
                return 1
        if future.cancelled():  # with the connection to the scheduler
            return 1
        error = future.exception()
        killed = import_module("distributed").KilledWorker
        return error.allowed_failures + 1 if isinstance(error, killed) else 0

    def has_lost(self, future: Future[Any]) -> bool:
        """Tell, once a worker was lost, whether a call went with it.

        One that a worker is still at has not: a cluster cannot stop it, and would make it twice.
        """
        if future.done():
            return self.losses(future) > 0
        return self._is_left_alone(future)

    def renew(self) -> None:
        """Wait for workers that the cluster starts again."""
        for future in list(self._sent):
            if self._is_left_alone(future):
                future.cancel()  # or one that comes back would make it too
        until = time.monotonic() + _RETURN_S
        self._look(now=True)
        while not self._fit:
            if time.monotonic() > until:
                raise EngineError(
                    f"{self._address}: no worker is left that may calculate. {self._complaint()}"
                    "Start workers there, and then the same again."
                )
            time.sleep(_LOOK_S / 4)
            self._look(now=True)

    def _is_left_alone(self, future: Future[Any]) -> bool:
        """Return whether all workers that a call was sent to are gone."""
        return self._fit.isdisjoint(self._sent[future])

    def _look(self, *, now: bool = False) -> None:
        """Update the lists of workers that are gone and that have joined, at most once a second."""
        if not now and time.monotonic() < self._next_look:
            return
        threads: dict[str, int] = self._client.nthreads()
        self._next_look = time.monotonic() + _LOOK_S
        self._fit &= threads.keys()
        for group in (self._unfit, self._asked):
            for worker in group.keys() - threads.keys():
                del group[worker]
        for worker in threads.keys() - self._fit - self._unfit.keys() - self._asked.keys():
            self._asked[worker] = _begun(partial(self._ask, [worker]))
        for worker, answer in list(self._asked.items()):
            if answer.done():
                del self._asked[worker]
                if found := answer.result():  # else it is asked again while it is there
                    self._take_note(worker, found[worker], threads[worker])

    def _ask(self, workers: list[str] | None = None) -> dict[str, Any]:
        """Ask workers for their versions; a task would stop a worker that has no jointz."""
        answers: dict[str, Any] = self._client.run(
            _calculating_there, workers=workers, on_error="return"
        )
        return answers

    def _take_note(self, worker: str, versions: object, threads: int) -> None:
        if why := _difference(versions, threads):
            self._unfit[worker] = why
        else:
            self._fit.add(worker)

    def _refuse_others(self) -> None:
        answers = self._ask()
        threads: dict[str, int] = self._client.nthreads()
        if not answers:
            raise DataError(f"{self._address}: the cluster has no workers. Start some first.")
        for worker in _reached(answers).keys() & threads.keys():  # others are asked again
            self._take_note(worker, answers[worker], threads[worker])
        if self._unfit:
            raise DataError(f"{self._address}: {self._complaint()}".rstrip())

    def _complaint(self) -> str:
        """Return what is wrong with workers that may not calculate, "" if there are none."""
        if not self._unfit:
            return ""
        complaints = "; ".join(f"{worker} has {why}" for worker, why in sorted(self._unfit.items()))
        return (
            f"Expected every worker to calculate as this process does: {complaints}. "
            "Install the same versions there, and start workers with --nthreads 1: numbers must "
            "not depend on where they are made. "
        )


def _begun(ask: Callable[[], dict[str, Any]]) -> Future[dict[str, Any]]:
    """Ask in a separate thread: a worker that does not answer blocks nothing."""
    answer: Future[dict[str, Any]] = Future()

    def wait_for_answer() -> None:
        versions: dict[str, Any] = {}
        with suppress(Exception):  # it is gone
            versions = _reached(ask())
        answer.set_result(versions)

    threading.Thread(target=wait_for_answer, daemon=True).start()
    return answer


def _reached(answers: Mapping[str, Any]) -> dict[str, Any]:
    """Return the answers of the workers that could be reached."""
    return {worker: one for worker, one in answers.items() if not isinstance(one, OSError)}


@contextmanager
def open_cluster(scheduler: str, *, workers: int | None = None) -> Iterator[Cluster]:
    """Join a Dask cluster, or start one."""
    try:
        distributed: Any = import_module("distributed")
    except ImportError as exc:
        raise DataError(f"a Dask cluster needs dask, {_NOT_INSTALLED}") from exc
    with ExitStack() as stack:
        address, security = scheduler, None
        if scheduler == LOCAL:
            refuse_script_without_guard()
            stack.enter_context(import_module("dask").config.set(_OWN_CLUSTER))
            security = _own_certificate(distributed)
            with engine_errors():
                local = stack.enter_context(
                    distributed.LocalCluster(
                        n_workers=workers or cores(),
                        threads_per_worker=1,
                        dashboard_address="127.0.0.1:0",
                        scheduler_kwargs={"dashboard": False},
                        protocol="tls://",
                        security=security,
                        host="127.0.0.1",
                    )
                )
            address = local.scheduler_address
        try:
            client = stack.enter_context(
                distributed.Client(
                    address, timeout=_PATIENCE_S, set_as_default=False, security=security
                )
            )
        except (OSError, TimeoutError, ValueError) as exc:
            raise DataError(
                f"scheduler {address!r}: nobody answers ({exc}). Expected tcp://host:port of a "
                "dask scheduler, or local."
            ) from exc
        yield Cluster(client, address)


def _own_certificate(distributed: Any) -> Any:
    """Return the keys of one cluster: other users of this machine could send it code."""
    try:
        return distributed.Security.temporary()
    except ImportError as exc:
        raise DataError(
            f"a Dask cluster on this machine needs cryptography, {_NOT_INSTALLED}"
        ) from exc


@cache  # reading what is installed takes a while
def _calculating() -> dict[str, str]:
    """Return the versions of what calculates here."""
    found = software()
    packages: Mapping[str, str] = found["packages"]
    return {
        "jointz": found["jointz"],
        "Python": ".".join(found["python"].split(".")[:2]),
        **{name: packages[name] for name in _CALCULATING},
    }


def _calculating_there() -> dict[str, str]:
    """Return the versions of what calculates, of whoever is asked."""
    return _calculating()


def _difference(found: object, threads: int) -> str:
    """Say how a worker differs from this process; nothing where it does not.

    Linear algebra is kept to one thread, and figures to one style, a process: two tasks at once
    in one would undo it for each other.
    """
    if not isinstance(found, dict):
        return f"no jointz of this version ({found})"
    expected = _calculating()
    differences = [
        f"{name} {found.get(name, 'not installed')} instead of {version}"
        for name, version in expected.items()
        if found.get(name) != version
    ]
    if threads != 1:
        differences.append(f"{threads} threads instead of 1")
    return ", ".join(differences)
