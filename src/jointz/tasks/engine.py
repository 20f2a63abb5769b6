"""Engines that run the tasks of a job: this process, processes of this machine, a cluster.

A job is a list of independent tasks, each of a participant, a session or at least half a second
of work, each seeded from what it is. No number depends on the engine, on how many workers there
are, or on the order in which they end.
"""

from abc import ABC, abstractmethod
from collections import deque
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import CancelledError, Executor, Future
from concurrent.futures.process import BrokenProcessPool
from contextlib import AbstractContextManager, ExitStack, contextmanager, suppress
from dataclasses import dataclass
from functools import partial
from itertools import takewhile
from typing import Any, Generic, TypeVar

from threadpoolctl import threadpool_limits

from jointz.core.errors import DataError, EngineError, WorkerLostError
from jointz.core.stop_signals import signals_held
from jointz.tasks.task_store import TaskStore

Result = TypeVar("Result")

#: Under way for every worker: enough that none waits, few enough that memory stays flat.
_AHEAD = 4
#: A task that loses its worker so often, with nothing else under way, is to blame.
_MOST_LOSSES = 4


@dataclass(frozen=True, slots=True)
class Task(Generic[Result]):
    """One piece of a job.

    Parameters
    ----------
    name : str
        Name for the user, such as a participant or a seed.
    call : callable
        Does it; without arguments (:func:`functools.partial` puts them in), fit for pickling.
    key : callable, optional
        Returns the hash of all that the result depends on, by which a kept one is found;
        called by the worker.
    """

    name: str
    call: Callable[[], Result]
    key: Callable[[], str] | None = None


@dataclass(frozen=True, slots=True)
class Done(Generic[Result]):
    """Outcome of a task."""

    name: str  # name of the task
    value: Result | None = None  # result of the task
    error: Exception | None = None  # exception of the task

    def result(self) -> Result:
        """Return the result, or raise what the task raised."""
        if self.error is not None:
            raise self.error
        return self.value  # type: ignore[return-value]  # a task may well return None


class Engine(ABC):
    """Makes calls, some at once."""

    workers: int = 1  # how many at once

    @property
    def ahead(self) -> int:
        """Number of tasks that are worth having under way at a time."""
        return _AHEAD * self.workers

    @abstractmethod
    def submit(self, call: Callable[[], Result]) -> Future[Result]:
        """Submit a call."""

    @abstractmethod
    def renew(self) -> None:
        """Start workers again where some were killed."""

    def losses(self, future: Future[Any]) -> int:
        """Wait for a call, and return how many workers it has lost; 0 where it was made."""
        try:
            return int(isinstance(future.exception(), BrokenProcessPool))
        except CancelledError:  # with the others of its pool
            return 1

    def has_lost(self, future: Future[Any]) -> bool:
        """Tell, once a worker was lost, whether a call went with it.

        Where one that is killed takes the others with it, so does every call that is not made.
        """
        return not future.done() or self.losses(future) > 0


class Serial(Engine):
    """Makes one call after the other, in this process."""

    @property
    def ahead(self) -> int:
        """One: a call is made when it is submitted."""
        return 1

    def submit(self, call: Callable[[], Result]) -> Future[Result]:
        """Make the call at once."""
        finished: Future[Result] = Future()
        try:
            finished.set_result(call())
        except Exception as exc:  # noqa: BLE001 - whoever asks for the result gets it
            finished.set_exception(exc)
        return finished

    def renew(self) -> None:
        """Do nothing: there are no workers."""


class Processes(Engine):
    """Makes calls in processes of this machine."""

    def __init__(
        self, workers: int, opening: Callable[[], AbstractContextManager[Executor]]
    ) -> None:
        self.workers = workers
        self._opening = opening
        self._opened = ExitStack()
        with engine_errors():
            self._pool = self._opened.enter_context(opening())

    def submit(self, call: Callable[[], Result]) -> Future[Result]:
        """Submit a call to a worker."""
        with signals_held():  # it may start a worker
            return self._pool.submit(call)

    def renew(self) -> None:
        """Start the workers anew: one that is killed takes the others with it."""
        self.close()
        self._pool = self._opened.enter_context(self._opening())

    def close(self) -> None:
        """End the workers, as their pool ends."""
        self._opened.close()


def on_one_thread(call: Callable[[], Result]) -> Result:
    """Make a call with one thread of linear algebra: their number changes last digits."""
    with threadpool_limits(limits=1):
        return call()


def done_in_turn(
    engine: Engine, tasks: Iterable[Task[Result]], *, store: TaskStore | None = None
) -> Iterator[Done[Result]]:
    """Have tasks done, and yield what became of each, in their order.

    Parameters
    ----------
    engine : Engine
        Who does them.
    tasks : iterable of Task
        Taken as they are needed: there may be very many.
    store : TaskStore, optional
        Where results are kept by their key, and found again.

    Yields
    ------
    Done
        One a task. A task that raises does not keep the others from being done.

    Raises
    ------
    EngineError
        When the engine itself cannot go on, which is no task's failure.

    Notes
    -----
    A worker that is killed costs what went with it. That is done again, one task after the
    other, with nothing else under way: one that loses its worker then, four times, is reported
    as lost, and the rest goes on.
    """
    coming = iter(tasks)
    line: deque[_Place[Result]] = deque()
    try:
        while True:
            while len(line) < engine.ahead and (task := next(coming, None)) is not None:
                line.append(_Place(task, store))
            if not line:
                return
            with engine_errors():
                ready = _is_first_done(engine, line)
            if ready:
                yield line.popleft().done()
    finally:
        for place in line:
            place.give_up()


@contextmanager
def engine_errors() -> Iterator[None]:
    """Turn any error into one of the engine; errors of tasks are in their futures."""
    try:
        yield
    except (EngineError, DataError):
        raise
    except Exception as exc:
        why = f"{type(exc).__name__}: {exc}".strip().rstrip(".:")
        raise EngineError(
            f"the workers cannot go on ({why}). See to the cluster, or to memory and processes of "
            "this machine, and start again."
        ) from exc


class _Place(Generic[Result]):
    """A task in the line of those under way."""

    def __init__(self, task: Task[Result], store: TaskStore | None) -> None:
        self._task = task
        call = partial(on_one_thread, task.call)
        self._call = store.kept(task.key, call) if store and task.key else call
        self._future: Future[Result] | None = None
        self._losses = 0
        #: Whether it went with a lost worker: it may have been the cause.
        self.suspect = False

    def begin(self, engine: Engine) -> None:
        """Submit the task, unless it was submitted."""
        if self._future is None:
            self._future = engine.submit(self._call)

    def losses(self, engine: Engine) -> int:
        """Wait for it, and return how many workers it has lost; 0 where it is done."""
        return 0 if self._future is None else engine.losses(self._future)

    def forget(self, engine: Engine) -> None:
        """Mark the task to be done again if it went with a lost worker."""
        if self._future is not None and engine.has_lost(self._future):
            self._future, self.suspect = None, True

    def blame(self, losses: int) -> None:
        """Count workers that the task lost while nothing else was under way."""
        self._losses += losses

    @property
    def is_hopeless(self) -> bool:
        """Whether it lost its worker again and again while nothing else was under way."""
        return self._losses >= _MOST_LOSSES

    def done(self) -> Done[Result]:
        """Return what became of it."""
        name = self._task.name
        if self._future is None:
            why = (
                f"{name}: its worker was killed {self._losses} times, most likely for memory. "
                "Give workers more of it, or take fewer at once."
            )
            return Done(name, error=WorkerLostError(why))
        error = self._future.exception()
        if error is None:
            return Done(name, self._future.result())
        if not isinstance(error, Exception):  # an interrupt is everybody's
            raise error
        return Done(name, error=error)

    def give_up(self) -> None:
        """Cancel the task, if it has not begun."""
        if self._future is not None:
            self._future.cancel()


def _is_first_done(engine: Engine, line: deque[_Place[Result]]) -> bool:
    """Wait for the first of the line; False when a worker was lost, and it is to be done again."""
    first = line[0]
    with suppress(BrokenProcessPool):
        if _is_ready(engine, line):
            return True
    for place in line:
        place.forget(engine)
    engine.renew()
    return first.is_hopeless


def _is_ready(engine: Engine, line: deque[_Place[Result]]) -> bool:
    """Submit the tasks that may run and wait for the first; False when a worker was lost."""
    first = line[0]
    if not first.suspect:
        for place in takewhile(lambda place: not place.suspect, line):
            place.begin(engine)
        return not first.losses(engine)
    # It is tried alone. Nobody can stop what other workers are still at: that ends before.
    if any(place.losses(engine) for place in line):
        return False
    first.begin(engine)
    losses = first.losses(engine)
    first.blame(losses)
    return not losses
