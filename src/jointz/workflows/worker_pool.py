"""Participants one after the other, or several at once in processes of their own."""

import multiprocessing
import os
import signal
import threading
import time
from collections.abc import Callable
from concurrent.futures import ProcessPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from contextlib import ExitStack
from multiprocessing import resource_tracker
from multiprocessing.connection import Connection
from queue import Empty
from types import FrameType
from typing import Any

from jointz.core.errors import DeviceError
from jointz.experiment.session import Operator
from jointz.experiment.stop_signals import STOP_SIGNALS, signals_held
from jointz.workflows.participant_run import run_participant
from jointz.workflows.rigs import RigSettings, open_rig
from jointz.workflows.run_settings import RunSettings

#: Called with participant, condition, strides, pulses done, pulses planned.
RunProgress = Callable[[str, str, int, int, int], None]

_POLL_S = 0.1
_AGAIN_S = 1.0
_WORKER: dict[str, Any] = {}


def run_people(
    settings: RunSettings,
    rig: RigSettings,
    count: int,
    *,
    workers: int,
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
    operator : Operator
        Asked before every condition; only with one worker.
    progress : callable or None
        Told after every accepted stride.
    """
    tell = progress or _silent
    if workers == 1 or count == 1:
        return [
            run_participant(
                (one := open_rig(rig, number)),
                settings,
                operator=operator,
                progress=_named(tell, one.wearer.id),
            )
            for number in range(count)
        ]
    return _in_processes(settings, rig, count, workers=min(workers, count), tell=tell)


def _in_processes(
    settings: RunSettings, rig: RigSettings, count: int, *, workers: int, tell: RunProgress
) -> list[dict[str, Any]]:
    # Spawned, not forked: a progress display has threads, and a fork would copy their locks.
    context = multiprocessing.get_context("spawn")
    # Nothing is ever sent: workers see the end of this pipe when we close it, or are gone.
    until, open_end = context.Pipe(duplex=False)
    with ExitStack() as stack:
        stack.callback(until.close)
        with signals_held():
            resource_tracker.ensure_running()  # lets them through again when it has started
        with signals_held():  # until the workers know what to do with them
            queue = context.Queue()
            pool = ProcessPoolExecutor(
                workers, mp_context=context, initializer=_begin_worker, initargs=(queue, until)
            )
            stack.callback(pool.shutdown, wait=True, cancel_futures=True)
            stack.callback(open_end.close)
            futures = [pool.submit(_run_one, settings, rig, number) for number in range(count)]
        while not all(future.done() for future in futures):
            _pass_on(queue, tell)
        try:
            return [future.result() for future in futures]
        except BrokenProcessPool as exc:
            raise DeviceError("run", "a worker process was killed.") from exc


def _pass_on(queue: Any, tell: RunProgress) -> None:
    try:
        while True:
            tell(*queue.get(timeout=_POLL_S))
    except Empty:
        return


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


def _run_one(settings: RunSettings, rig: RigSettings, number: int) -> dict[str, Any]:
    with _WORKER["busy"]:
        if _WORKER["until"].poll():
            raise KeyboardInterrupt
        one = open_rig(rig, number)
        tell = _named(lambda *told: _WORKER["queue"].put(told), one.wearer.id)
        return run_participant(one, settings, operator=_Silent(), progress=tell)


class _Silent:
    def prompt(self, text: str) -> None:
        del text


def _named(tell: RunProgress, participant: str) -> Callable[[str, int, int, int], None]:
    def told(condition: str, strides: int, done: int, planned: int) -> None:
        tell(participant, condition, strides, done, planned)

    return told


def _silent(participant: str, condition: str, strides: int, done: int, planned: int) -> None:
    del participant, condition, strides, done, planned
