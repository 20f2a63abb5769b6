"""Participants one after the other, or several at once in processes of their own."""

import multiprocessing
from collections.abc import Callable
from concurrent.futures import ProcessPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from queue import Empty
from typing import Any

from jointz.core.errors import DeviceError
from jointz.experiment.session import Operator
from jointz.workflows.participant_run import run_participant
from jointz.workflows.rigs import RigSettings, open_rig
from jointz.workflows.run_settings import RunSettings

#: Called with participant, condition, strides, pulses done, pulses planned.
RunProgress = Callable[[str, str, int, int, int], None]

_POLL_S = 0.1
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
    queue = context.Queue()
    with ProcessPoolExecutor(
        workers, mp_context=context, initializer=_begin_worker, initargs=(queue,)
    ) as pool:
        futures = [pool.submit(_run_one, settings, rig, number) for number in range(count)]
        try:
            while not all(future.done() for future in futures):
                _pass_on(queue, tell)
            return [future.result() for future in futures]
        except BrokenProcessPool as exc:
            raise DeviceError(
                "run", "a worker process was killed. What it recorded is kept; go on with --resume."
            ) from exc
        finally:
            for future in futures:
                future.cancel()


def _pass_on(queue: Any, tell: RunProgress) -> None:
    try:
        while True:
            tell(*queue.get(timeout=_POLL_S))
    except Empty:
        return


def _begin_worker(queue: Any) -> None:
    _WORKER["queue"] = queue


def _run_one(settings: RunSettings, rig: RigSettings, number: int) -> dict[str, Any]:
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
