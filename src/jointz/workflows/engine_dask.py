"""A Dask cluster as an engine: a lab's own, or one that is started here."""

import os
from collections.abc import Callable, Iterator
from concurrent.futures import Executor, Future
from contextlib import ExitStack, contextmanager
from importlib import import_module
from typing import Any, TypeVar

from jointz.core.errors import DataError
from jointz.core.provenance import own_version
from jointz.workflows.engine import Engine

Result = TypeVar("Result")

LOCAL = "local"
_PATIENCE_S = 15


class Cluster(Engine):
    """Makes calls on the workers of a Dask cluster.

    Parameters
    ----------
    client : distributed.Client
        Connected to it.
    address : str
        Of its scheduler, for messages.
    """

    def __init__(self, client: Any, address: str) -> None:
        self._client = client
        self._address = address
        self._executor: Executor = client.get_executor(pure=False)
        self._refuse_other_versions()

    @property
    def workers(self) -> int:  # type: ignore[override]  # workers come and go
        """How many threads the cluster has for calls."""
        return max(1, sum(map(int, self._client.nthreads().values())))

    def submit(self, call: Callable[[], Result]) -> Future[Result]:
        """Have a call made on a worker.

        Parameters
        ----------
        call : callable
            Without arguments, fit for pickling.
        """
        return self._executor.submit(_made_by_same_version, own_version(), call)

    def renew(self) -> None:
        """Do nothing: the cluster has its own means to start workers again."""

    def _refuse_other_versions(self) -> None:
        found: dict[str, Any] = self._client.run(_version_there, on_error="return")
        wrong = {worker: v for worker, v in found.items() if v != own_version()}
        if not found:
            raise DataError(f"{self._address}: the cluster has no workers. Start some first.")
        if wrong:
            told = "; ".join(f"{worker} has {_shown(v)}" for worker, v in sorted(wrong.items()))
            raise DataError(
                f"{self._address}: expected jointz {own_version()} on every worker; {told}. "
                "Install the same version there: numbers must not depend on where they are made."
            )


@contextmanager
def open_cluster(scheduler: str, *, workers: int | None = None) -> Iterator[Cluster]:
    """Join a Dask cluster, or start one.

    Parameters
    ----------
    scheduler : str
        ``tcp://host:port``, or ``local``.
    workers : int, optional
        Of a local cluster; as many as there are cores by default.

    Yields
    ------
    Cluster
        A local one ends with the block.

    Raises
    ------
    DataError
        When ``dask`` is not installed, nobody answers, or a worker has another jointz.
    """
    try:
        distributed: Any = import_module("distributed")
    except ImportError as exc:
        raise DataError(
            "a Dask cluster needs dask, which is not installed. Install it: "
            'pip install "jointz[scale]".'
        ) from exc
    with ExitStack() as stack:
        address = scheduler
        if scheduler == LOCAL:
            cores = len(os.sched_getaffinity(0))
            local = stack.enter_context(
                distributed.LocalCluster(
                    n_workers=workers or cores,
                    threads_per_worker=1,
                    dashboard_address=":0",
                    host="127.0.0.1",
                )
            )
            address = local.scheduler_address
        try:
            client = stack.enter_context(
                distributed.Client(address, timeout=_PATIENCE_S, set_as_default=False)
            )
        except (OSError, TimeoutError, ValueError) as exc:
            raise DataError(
                f"scheduler {address!r}: nobody answers ({exc}). Expected tcp://host:port of a "
                "dask scheduler, or local."
            ) from exc
        yield Cluster(client, address)


def _version_there() -> str:
    """Return the version of whoever is asked."""
    return own_version()


def _made_by_same_version(version: str, call: Callable[[], Result]) -> Result:
    """Make a call, unless this worker joined later with another version."""
    if own_version() != version:
        raise DataError(f"expected jointz {version} on every worker, found {own_version()}.")
    return call()


def _shown(found: object) -> str:
    return f"none ({found})" if isinstance(found, Exception) else str(found)
