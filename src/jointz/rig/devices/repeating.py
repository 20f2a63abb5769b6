"""Threads that repeat a task beside the loop."""

import threading
import time
from collections.abc import Callable
from typing import Protocol

Task = Callable[[], None]


class Repeating(Protocol):
    """A task that is being repeated."""

    def cancel(self) -> None:
        """Stop repeating; never blocks, may be called twice."""


#: Begins to repeat a task with a period (s); handed in, so that tests need no thread.
Repeat = Callable[[Task, float], Repeating]


class RepeatingThread:
    """Repeats a task in a daemon thread, on an absolute grid; what comes late is skipped.

    A thread of Python waits its turn: expect it 0.1 ms late, and up to 5 ms where another
    thread computes without a pause.
    """

    def __init__(self, task: Task, period_s: float) -> None:
        self._task = task
        self._period_s = period_s
        self._cancelled = threading.Event()
        threading.Thread(target=self._run, daemon=True, name="jointz device").start()

    def cancel(self) -> None:
        """Stop repeating; never blocks, may be called twice."""
        self._cancelled.set()

    def _run(self) -> None:
        due = time.perf_counter() + self._period_s
        while not self._cancelled.wait(max(0.0, due - time.perf_counter())):
            self._task()
            late_s = time.perf_counter() - due
            due += self._period_s * (1.0 + max(0.0, late_s // self._period_s))
