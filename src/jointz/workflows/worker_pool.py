"""Participants one after the other, or several at once in processes of their own."""

import multiprocessing
import os
import signal
import threading
import time
from collections.abc import Callable, Iterator
from concurrent.futures import Future, ProcessPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from contextlib import ExitStack, contextmanager, suppress
from functools import partial
from multiprocessing import resource_tracker
from multiprocessing.connection import Connection
from queue import Empty
from types import FrameType
from typing import Any, TypeVar

from jointz.core.errors import WorkerLostError
from jointz.experiment.session import Operator
from jointz.experiment.stop_signals import STOP_SIGNALS, signals_held
from jointz.workflows.engine import Done, Engine, Task, done_in_turn, open_engine
from jointz.workflows.participant_run import run_participant
from jointz.workflows.rigs import RigSettings, open_rig
from jointz.workflows.run_settings import RunSettings

#: Called with participant, condition, strides, pulses done, pulses planned.
RunProgress = Callable[[str, str, int, int, int], None]

Result = TypeVar("Result")

_POLL_S = 0.1
_AGAIN_S = 1.0
_WORKER: dict[str, Any] = {}


def run_people(
    settings: RunSettings,
    rig: RigSettings,
    count: int,
    *,
    workers: int,
    scheduler: str | None,
    operator: Operator,
    progress: RunProgress | None,
) -> list[dict[str, Any]]:
    """Run every participant and return their reports in order.

    Parameters
    ----------
    settings : RunSettings
        What to do.
    rig : RigSettings
        On which devices.
    count : int
        How many participants.
    workers : int
        How many at once.
    scheduler : str or None
        Of a Dask cluster that does it instead; it tells of participants that are done.
    operator : Operator
        Asked before every condition; only with one worker.
    progress : callable or None
        Told after every accepted stride.

    Raises
    ------
    Exception
        What the first participant that failed raised; the others were run.
    """
    tell = progress or _silent
    if scheduler is None and (workers == 1 or count == 1):
        return [
            run_participant(
                (one := open_rig(rig, number)),
                settings,
                operator=operator,
                progress=_named(tell, one.wearer.id),
            )
            for number in range(count)
        ]
    tasks = [
        Task(f"participant {n + 1} (seed {rig.seed})", partial(_run_one, settings, rig, n))
        for n in range(count)
    ]
    with _engine(scheduler, min(workers, count), tell) as engine:
        return _reports(list(done_in_turn(engine, tasks)))


def _reports(done: list[Done[dict[str, Any]]]) -> list[dict[str, Any]]:
    """Return what every participant came to; who failed is told, the first by its own error."""
    failed = [(one.name, one.error) for one in done if one.error is not None]
    for name, error in failed[1:]:
        failed[0][1].add_note(f"{name} failed too: {error}")
    return [one.result() for one in done]


@contextmanager
def _engine(scheduler: str | None, workers: int, tell: RunProgress) -> Iterator[Engine]:
    if scheduler is not None:
        with open_engine(scheduler, workers=workers, tasks=workers, needs=__name__) as engine:
            yield engine
        return
    own = SessionProcesses(workers, tell)
    try:
        yield own
    finally:
        own.close()


class SessionProcesses(Engine):
    """Runs sessions in processes of this machine, and stops them gently.

    Parameters
    ----------
    workers : int
        How many at once.
    tell : callable
        Told how far each session is.
    """

    def __init__(self, workers: int, tell: RunProgress) -> None:
        self.workers = workers
        self._tell = tell
        self._opened = ExitStack()
        self._pool = self._open()

    def submit(self, call: Callable[[], Result]) -> Future[Result]:
        """Have a session run.

        Parameters
        ----------
        call : callable
            Without arguments, fit for pickling.

        Raises
        ------
        WorkerLostError
            When a worker was killed.
        """
        try:
            return self._pool.submit(_with_care, call)
        except BrokenProcessPool as exc:
            raise WorkerLostError("a worker process was killed.") from exc

    def renew(self) -> None:
        """Start workers again; a session that was cut off goes on from its journal."""
        self.close()
        self._pool = self._open()

    def close(self) -> None:
        """Stop what runs, and wait until it has stopped."""
        self._opened.close()

    def _open(self) -> ProcessPoolExecutor:
        # Spawned, not forked: a progress display has threads, and a fork would copy their locks.
        context = multiprocessing.get_context("spawn")
        # Nothing is ever sent: workers see the end of this pipe when we close it, or are gone.
        until, open_end = context.Pipe(duplex=False)
        self._opened = stack = ExitStack()
        stack.callback(until.close)
        with signals_held():
            resource_tracker.ensure_running()  # lets them through again when it has started
        with signals_held():  # until the workers know what to do with them
            queue = context.Queue()
            pool = ProcessPoolExecutor(
                self.workers, mp_context=context, initializer=_begin_worker, initargs=(queue, until)
            )
            over = threading.Event()
            threading.Thread(
                target=_pass_on, args=(queue, self._tell, over), daemon=True, name="progress"
            ).start()
            stack.callback(over.set)
            stack.callback(pool.shutdown, wait=True, cancel_futures=True)
            stack.callback(open_end.close)
        return pool


def _pass_on(queue: Any, tell: RunProgress, over: threading.Event) -> None:
    while not over.is_set():
        with suppress(Empty):
            tell(*queue.get(timeout=_POLL_S))


def _begin_worker(queue: Any, until: Connection) -> None:
    """Listen to the parent alone: a Ctrl-C reaches every process of a terminal."""
    queue.cancel_join_thread()  # progress that nobody reads any more must not keep us
    _WORKER.update(queue=queue, until=until, busy=threading.Lock())
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    signal.signal(signal.SIGHUP, signal.SIG_IGN)
    signal.signal(signal.SIGTERM, _outside_of_sessions)
    threading.Thread(target=_stop_with_parent, daemon=True).start()
    signal.pthread_sigmask(signal.SIG_UNBLOCK, STOP_SIGNALS)


def _outside_of_sessions(number: int, frame: FrameType | None) -> None:
    """Leave what is being prepared or converted; who waits for work need not hear of it."""
    del number, frame
    if _WORKER["busy"].locked():
        raise KeyboardInterrupt


def _stop_with_parent() -> None:
    """Stop the session when the parent wants it or is gone; without it nobody ends us."""
    _WORKER["until"].poll(None)
    while _WORKER["busy"].locked():
        os.kill(os.getpid(), signal.SIGTERM)
        time.sleep(_AGAIN_S)  # an interrupt in a callback of the garbage collector is lost
    parent = multiprocessing.parent_process()
    if parent is not None:
        parent.join()
    with _WORKER["busy"]:
        os._exit(1)


def _with_care(call: Callable[[], Result]) -> Result:
    with _WORKER["busy"]:
        if _WORKER["until"].poll():
            raise KeyboardInterrupt
        return call()


def _run_one(settings: RunSettings, rig: RigSettings, number: int) -> dict[str, Any]:
    one = open_rig(rig, number)
    queue = _WORKER.get("queue")  # a cluster's workers have none
    tell = _silent if queue is None else (lambda *told: queue.put(told))
    return run_participant(one, settings, operator=_Silent(), progress=_named(tell, one.wearer.id))


class _Silent:
    def prompt(self, text: str) -> None:
        del text


def _named(tell: RunProgress, participant: str) -> Callable[[str, int, int, int], None]:
    def told(condition: str, strides: int, done: int, planned: int) -> None:
        tell(participant, condition, strides, done, planned)

    return told


def _silent(participant: str, condition: str, strides: int, done: int, planned: int) -> None:
    del participant, condition, strides, done, planned
