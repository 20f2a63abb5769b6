"""Context manager that opens the engine of a job."""

from collections.abc import Iterator
from contextlib import closing, contextmanager
from functools import partial

from jointz.core.errors import DataError
from jointz.tasks.engine import Engine, Processes, Serial
from jointz.tasks.process_pool import begin_worker, spawned_pool, workers_for


@contextmanager
def open_engine(
    scheduler: str | None = None,
    *,
    workers: int | None = None,
    tasks: int,
    needs: str,
) -> Iterator[Engine]:
    """Yield the requested engine.

    Parameters
    ----------
    scheduler : str, optional
        ``tcp://...`` of a Dask cluster, or ``local`` for one on this machine; by default
        processes of this machine.
    workers : int, optional
        How many at once; by default as many as there are cores, where the tasks are worth it.
        A cluster that is joined has its own.
    tasks : int
        How many there will be.
    needs : str
        Module that they are in.

    Yields
    ------
    Engine
        Whoever leaves the block by an error does not wait for what is under way.

    Raises
    ------
    DataError
        When there is no such scheduler, or ``dask`` is not installed.
    EngineError
        When processes cannot be started.
    """
    if scheduler is not None:
        from jointz.tasks.dask_cluster import open_cluster  # needs an extra

        with open_cluster(scheduler, workers=workers) as cluster:
            yield cluster
        return
    count = workers_for(tasks) if workers is None else workers
    if count < 1:
        raise DataError(f"workers: expected at least 1, got {count}.")
    if count == 1:
        yield Serial()
        return
    opening = partial(spawned_pool, count, begin_worker, needs=needs)
    with closing(Processes(count, opening)) as engine:
        yield engine
