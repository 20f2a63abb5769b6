"""A few calls shared out to an engine, beside work that goes on here."""

from collections.abc import Callable, Iterable
from concurrent.futures import Future
from functools import partial
from typing import TypeVar

from jointz.tasks.engine import Engine, Serial

Result = TypeVar("Result")


def shared_out(engine: Engine, calls: Iterable[Callable[[], Result]]) -> list[Callable[[], Result]]:
    """Submit calls; each function returned waits for one result."""
    if isinstance(engine, Serial):
        return list(calls)
    return [partial(_result, engine, _begun(engine, call), call) for call in calls]


def _begun(engine: Engine, call: Callable[[], Result]) -> Future[Result] | None:
    try:
        return engine.submit(call)
    except Exception:  # noqa: BLE001 - the engine is gone; this process is not
        return None


def _result(engine: Engine, future: Future[Result] | None, call: Callable[[], Result]) -> Result:
    return call() if future is None or _is_lost(engine, future) else future.result()


def _is_lost(engine: Engine, future: Future[Result]) -> bool:
    try:
        return engine.losses(future) > 0
    except Exception:  # noqa: BLE001 - the engine is gone with it
        return True
