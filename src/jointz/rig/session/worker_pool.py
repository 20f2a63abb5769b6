"""Participants one after the other, or several at once in processes of their own."""

import multiprocessing
import os
import signal
import threading
import time
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import ProcessPoolExecutor
from contextlib import closing, contextmanager, suppress
from dataclasses import replace
from functools import partial
from multiprocessing.connection import Connection
from queue import Empty
from types import FrameType
from typing import Any

from jointz.core.stop_signals import STOP_SIGNALS, hide_consequences, interrupt
from jointz.rig.experiment.session import Operator
from jointz.rig.session.participant_run import run_participant
from jointz.rig.session.rigs.rig_settings import RigSettings, open_rig
from jointz.rig.session.run_settings import RunSettings
from jointz.tasks.engine import (
    Done,
    Engine,
    Processes,
    Serial,
    Task,
    done_in_turn,
)
from jointz.tasks.open_engine import open_engine
from jointz.tasks.process_pool import spawn_context, spawned_pool
from jointz.tasks.progress import RunProgress

_POLL_S = 0.1
_AGAIN_S = 1.0
_WORKER: dict[str, Any] = {}


class NoOperator:
    """An operator for simulated people, who need no prompt."""

    def prompt(self, text: str) -> None:
        """Return at once."""


def run_people(
    settings: RunSettings,
    rig: RigSettings,
    count: int,
    *,
    workers: int,
    scheduler: str | None,
    operator: Operator | None,
    progress: RunProgress | None,
) -> list[dict[str, Any]]:
    """Run every participant and return their reports in order."""
    tell = progress or _silent
    alone = scheduler is None and (workers == 1 or count == 1)
    call: Callable[..., dict[str, Any]] = _run_one
    if alone:
        call = partial(_run_here, operator=operator or NoOperator(), tell=tell)
    else:  # workers may have been started in another folder
        settings = replace(settings, study=settings.study.absolute())
    tasks = [
        Task(f"participant {n + 1} (seed {rig.seed})", partial(call, settings, rig, n))
        for n in range(count)
    ]
    with _engine(scheduler, 1 if alone else min(workers, count), tell) as engine:
        stops = rig.hardware is not None or settings.attended or (alone and operator is not None)
        return _reports(done_in_turn(engine, tasks), stops=stops)


def _reports(coming: Iterable[Done[dict[str, Any]]], *, stops: bool) -> list[dict[str, Any]]:
    """Return what every participant came to; who failed is told, the first by its own error."""
    done: list[Done[dict[str, Any]]] = []
    failed: list[tuple[str, Exception]] = []
    for outcome in coming:
        done.append(outcome)
        if outcome.error is not None:
            failed.append((outcome.name, outcome.error))
            if stops:
                break
    for number, (name, error) in enumerate(failed):
        failed[0][1].add_note(f"{name} failed too: {error}" if number else f"It was {name}.")
    return [outcome.result() for outcome in done]


@contextmanager
def _engine(scheduler: str | None, workers: int, tell: RunProgress) -> Iterator[Engine]:
    if scheduler is not None:
        with open_engine(scheduler, workers=workers, tasks=workers, needs=__name__) as engine:
            yield engine
        return
    if workers == 1:
        yield Serial()
        return
    # A session that was cut off goes on from its journal.
    with closing(Processes(workers, partial(_session_pool, workers, tell))) as processes:
        yield processes


@contextmanager
def _session_pool(workers: int, tell: RunProgress) -> Iterator[ProcessPoolExecutor]:
    """Yield a pool of processes that report the progress of their sessions and stop gently."""
    queue = spawn_context().Queue()
    over = threading.Event()
    threading.Thread(target=_pass_on, args=(queue, tell, over), daemon=True).start()
    try:
        with spawned_pool(workers, _begin_worker, queue, needs=__name__) as pool:
            yield pool
    finally:
        over.set()


def _pass_on(queue: Any, tell: RunProgress, over: threading.Event) -> None:
    while not over.is_set():
        with suppress(Empty):
            tell(*queue.get(timeout=_POLL_S))


def _begin_worker(until: Connection, queue: Any) -> None:
    """Listen to the parent alone: a Ctrl-C reaches every process of a terminal."""
    queue.cancel_join_thread()  # progress that nobody reads any more must not keep us
    _WORKER.update(queue=queue, until=until, busy=threading.Lock())
    hide_consequences()
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    signal.signal(signal.SIGHUP, signal.SIG_IGN)
    signal.signal(signal.SIGTERM, _outside_of_sessions)
    threading.Thread(target=_stop_with_parent, daemon=True).start()
    signal.pthread_sigmask(signal.SIG_UNBLOCK, STOP_SIGNALS)


def _outside_of_sessions(number: int, frame: FrameType | None) -> None:
    """Interrupt work outside of sessions; an idle worker need not be interrupted."""
    del number, frame
    if _WORKER["busy"].locked():
        interrupt()


def _stop_with_parent() -> None:
    """Stop the session when the parent wants it or is gone; without it nobody ends us."""
    _WORKER["until"].poll(None)
    while _WORKER["busy"].locked():
        os.kill(os.getpid(), signal.SIGTERM)
        time.sleep(_AGAIN_S)  # an interrupt in a callback is lost
    parent = multiprocessing.parent_process()
    if parent is not None:
        parent.join()
    with _WORKER["busy"]:
        os._exit(1)


@contextmanager
def _stopped_gently() -> Iterator[None]:
    """Let the parent's end interrupt the block; workers of a cluster have no parent."""
    if not _WORKER:
        yield
        return
    with _WORKER["busy"]:
        if _WORKER["until"].poll():
            raise KeyboardInterrupt
        yield


def _run_one(settings: RunSettings, rig: RigSettings, number: int) -> dict[str, Any]:
    with _stopped_gently():
        opened = open_rig(rig, number)
        queue = _WORKER.get("queue")  # a cluster's workers have none
        tell = _silent if queue is None else (lambda *told: queue.put(told))
        progress = _named(tell, opened.wearer.id)
        return run_participant(opened, settings, operator=NoOperator(), progress=progress)


def _run_here(
    settings: RunSettings, rig: RigSettings, number: int, *, operator: Operator, tell: RunProgress
) -> dict[str, Any]:
    opened = open_rig(rig, number)
    progress = _named(tell, opened.wearer.id)
    return run_participant(opened, settings, operator=operator, progress=progress)


def _named(tell: RunProgress, participant: str) -> Callable[[str, int, int, int], None]:
    def told(condition: str, strides: int, done: int, planned: int) -> None:
        tell(participant, condition, strides, done, planned)

    return told


def _silent(participant: str, condition: str, strides: int, done: int, planned: int) -> None:
    del participant, condition, strides, done, planned
