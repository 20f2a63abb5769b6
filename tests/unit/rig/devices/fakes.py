"""Clocks, waits and marks that the tests of several devices share."""

import inspect
from collections.abc import Callable
from importlib.util import find_spec
from types import SimpleNamespace
from typing import Any

import pytest

from jointz.core.clock import Clock, VirtualClock


def needs(library: str) -> pytest.MarkDecorator:
    """Skip a test where a library of a device is not installed."""
    return pytest.mark.skipif(find_spec(library) is None, reason=f"{library} is not installed")


def names_of(call: Callable[..., Any]) -> list[str]:
    """Return the names of a call's arguments."""
    return list(inspect.signature(call).parameters)


def arguments_of(call: Callable[..., Any]) -> list[tuple[str, Any]]:
    """Return the names of a call's arguments and their defaults."""
    return [(p.name, p.default) for p in inspect.signature(call).parameters.values()]


def begin(*devices: Any) -> None:
    """Configure and activate devices."""
    for device in devices:
        device.configure()
        device.activate()


def wait(clock: Clock, seconds: float) -> None:
    """Wait by a clock."""
    clock.wait_until_ns(clock.now_ns() + round(seconds * 1e9))


class HeldClock(VirtualClock):
    """A clock that does repeated tasks while it is waited for; a poll may end with an error."""

    def __init__(self, start_ns: int = 1_000_000_000) -> None:
        super().__init__(start_ns)
        self.repeated: list[Any] = []

    def repeat(self, task: Callable[[], None], period_s: float) -> Any:
        """Call a task in every period, the first time after one."""
        entry = SimpleNamespace(task=task, period_ns=round(period_s * 1e9), cancelled=False)
        entry.due_ns = self.now_ns() + entry.period_ns
        entry.cancel = lambda: setattr(entry, "cancelled", True)
        self.repeated.append(entry)
        return entry

    def wait_until_ns(self, deadline_ns: int) -> None:
        """Wait, and do on the way what is due."""
        while due := [e for e in self.repeated if not e.cancelled and e.due_ns <= deadline_ns]:
            first = min(due, key=lambda entry: entry.due_ns)
            super().wait_until_ns(max(first.due_ns, self.now_ns()))
            first.due_ns += first.period_ns
            first.task()
        super().wait_until_ns(deadline_ns)

    def polling(self, _name: str, poll: Callable[[bool], None], rate_hz: float) -> "_Polling":
        """Return what polls as the thread of a device does."""
        return _Polling(self, poll, rate_hz)


class _Polling:
    def __init__(self, clock: HeldClock, poll: Callable[[bool], None], rate_hz: float) -> None:
        self.clock, self.poll, self.rate_hz = clock, poll, rate_hz

    def begin(self) -> None:
        self.entry = self.clock.repeat(lambda: self._run(True), 1.0 / self.rate_hz)
        self.entry.due_ns = self.clock.now_ns()

    def wake(self) -> None:
        self._run(False)

    def end(self) -> bool:
        self.entry.cancel()
        return True

    def _run(self, due: bool) -> None:
        if not self.entry.cancelled:
            try:
                self.poll(due)
            except Exception:  # noqa: BLE001 - as the thread does
                self.entry.cancel()
