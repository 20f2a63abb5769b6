"""Worker processes that end with this process."""

import gc
import multiprocessing
import os
import signal
import sys
import threading
from collections.abc import Callable, Iterator
from concurrent.futures import Executor, ProcessPoolExecutor
from contextlib import contextmanager, suppress
from importlib import import_module
from multiprocessing import resource_tracker
from multiprocessing.connection import Connection
from multiprocessing.context import SpawnContext
from pathlib import Path
from typing import Any

from jointz.core.errors import DataError
from jointz.core.stop_signals import CAN_WAIT, STOP_SIGNALS, signals_held

#: With fewer things to do, processes take as long to start as they save.
_FEWEST = 4


def workers_for(tasks: int) -> int:
    """Return how many processes are worth starting: as many as cores, or 1.

    One on systems without POSIX signal masks: a Ctrl-C would leave processes behind.
    """
    return 1 if tasks < _FEWEST or not CAN_WAIT else min(cores(), tasks)


def cores() -> int:
    """Return how many cores this process may use."""
    if hasattr(os, "sched_getaffinity"):
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1


@contextmanager
def process_pool(workers: int, *, needs: str) -> Iterator[Executor | None]:
    """Yield a pool of processes that import the module they will need at once."""
    if workers == 1:
        yield None
        return
    with spawned_pool(workers, begin_worker, needs=needs) as pool:
        yield pool


@contextmanager
def spawned_pool(
    workers: int, begin: Callable[..., None], *arguments: Any, needs: str
) -> Iterator[ProcessPoolExecutor]:
    """Yield a pool of processes that end with it, and with this process."""
    refuse_script_without_guard()
    if not CAN_WAIT:
        raise DataError(
            f"{workers} processes: expected a system with POSIX signals, without which a Ctrl-C "
            "would leave them behind. Leave --workers out; one process does the work."
        )
    context = spawn_context()
    until, open_end = context.Pipe(duplex=False)
    pool = ProcessPoolExecutor(
        workers, mp_context=context, initializer=begin, initargs=(until, *arguments)
    )
    try:
        with signals_held():  # until the workers know what to do with them
            for _ in range(workers):  # a process is started when there is something to do
                pool.submit(_import, needs)
        yield pool
    finally:
        open_end.close()  # workers end: what they are at nobody waits for, the rest is done
        pool.shutdown(wait=True, cancel_futures=True)
        until.close()


def refuse_script_without_guard() -> None:
    """Refuse to start processes for a script that each of them would run again from its top."""
    main = sys.modules["__main__"]
    file, spec = getattr(main, "__file__", None), getattr(main, "__spec__", None)
    # The __main__.py of a package is not run again; any other module of `python -m` is.
    if file is None or (spec is not None and spec.name.rpartition(".")[2] == "__main__"):
        return
    with suppress(OSError, UnicodeDecodeError):
        if "__name__" not in Path(file).read_text(encoding="utf-8"):
            raise DataError(
                f"{file}: each worker begins by running this script, and would do it all again. "
                'Put what it does under if __name__ == "__main__":, or leave the workers out.',
                path=file,
            )


def spawn_context() -> SpawnContext:
    """Return what starts processes: spawned, not forked.

    A progress display has threads, and a fork would copy their locks.
    """
    with signals_held():
        resource_tracker.ensure_running()  # lets them through again when it has started
    return multiprocessing.get_context("spawn")


def begin_worker(until: Connection) -> None:
    """Listen to the parent alone: a Ctrl-C reaches every process of a terminal."""
    # A process a core: threads besides would wait for each other. Read when numpy is imported.
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    gc.set_threshold(50_000)  # as in the command itself, see jointz.cli.main
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    signal.pthread_sigmask(signal.SIG_UNBLOCK, STOP_SIGNALS)
    threading.Thread(target=_end_with_parent, args=(until,), daemon=True).start()


def _end_with_parent(until: Connection) -> None:
    until.poll(None)
    os._exit(1)


def _import(name: str) -> None:
    import_module(name)
