"""A thread of its own for a library that only tells its newest value, and takes its time.

opensourceleg keeps no queue and its ``update`` may sleep or wait for a bus, so it cannot be
called inside the real-time loop. One thread owns the library's object, calls it at its rate,
and leaves what it read in a bounded queue.

Its timing, stated: samples are as regular as the operating system wakes a thread, they carry
the time after the library's ``update`` returned, slots that were missed are skipped, and the
thread shares Python's interpreter lock with the loop. Where the library blocks without letting
the lock go, the loop blocks too.
"""

import importlib
import threading
import time
from collections.abc import Callable, Mapping
from contextlib import suppress
from typing import Any, Protocol

from jointz.core.clock import Clock
from jointz.core.errors import DeviceError, NotConnectedError
from jointz.rig.devices.dephy import traceback_limit_kept

NEVER_TRIED = "this adapter was never tried on hardware"
#: Samples that wait to be read; the oldest are dropped: two seconds at 1000 Hz.
QUEUE_LENGTH = 2000
#: How long the end of a thread is waited for when its device is closed, s.
_END_S = 0.2
#: How long the library may take to stop, s.
_LIBRARY_STOP_S = 1.0

#: Called with whether a sample is due; what it raises ends the polling.
Poll = Callable[[bool], None]


class Polling(Protocol):
    """Calls a poll at its rate; tests pass one that a virtual clock drives."""

    def begin(self) -> None:
        """Call from now on."""

    def wake(self) -> None:
        """Call soon, without a sample; returns at once."""

    def end(self) -> bool:
        """Call no more and tell whether the last call has returned."""


class PollingThread:
    """A thread that polls on an absolute grid of the machine's clock."""

    def __init__(self, name: str, poll: Poll, sample_rate_hz: float) -> None:
        self._poll = poll
        self._period_s = 1.0 / sample_rate_hz
        self._woken = threading.Event()
        self._ending = False
        self._thread = threading.Thread(target=self._run, name=f"poll {name}", daemon=True)

    def begin(self) -> None:
        """Start the thread."""
        self._thread.start()

    def wake(self) -> None:
        """Wake the thread to poll soon, without a sample."""
        self._woken.set()

    def end(self) -> bool:
        """Wait for a moment until the thread has ended and tell whether it has."""
        self._ending = True
        self._woken.set()
        if self._thread.is_alive():
            self._thread.join(_END_S)
        return not self._thread.is_alive()

    def _run(self) -> None:
        due_s = time.perf_counter()
        while not self._ending:
            late_s = time.perf_counter() - due_s
            due = late_s >= 0.0
            if due:  # slots that were missed are skipped
                due_s += (late_s // self._period_s + 1.0) * self._period_s
            try:
                self._poll(due)
            except Exception:  # noqa: BLE001 - the poll has kept its error for the reader
                return
            self._woken.wait(max(due_s - time.perf_counter(), 0.0))
            self._woken.clear()


PollingOf = Callable[[str, Poll, float], Polling]


class PolledDevice:
    """An opensourceleg object that a polling owns from ``configure`` to ``close``."""

    def __init__(
        self,
        library: Any,
        *,
        name: str,
        sample_rate_hz: float,
        clock: Clock,
        polling: PollingOf = PollingThread,
    ) -> None:
        self.library = library
        self.name = name
        self.sample_rate_hz = sample_rate_hz
        self.clock = clock
        self.failure: Exception | None = None
        self._polling_of = polling
        self._polling: Polling | None = None
        self._letting_go: threading.Thread | None = None

    def begin(self, begun: Callable[[], None], poll: Poll) -> None:
        """Start the library's object and poll it."""
        try:
            self.library.start()
            begun()
        except Exception as exc:  # drivers raise what their buses raise
            self._let_go()
            raise NotConnectedError(
                self.name,
                f"opensourceleg could not start it: {text_of(exc)}. Check cable, supply and port.",
            ) from exc

        def kept(due: bool) -> None:  # noqa: FBT001 - a Poll
            try:
                poll(due)
            except Exception as exc:
                self.failure = exc
                raise

        self._polling = self._polling_of(self.name, kept, self.sample_rate_hz)
        self._polling.begin()

    def wake(self) -> None:
        """Poll soon, without a sample; returns at once."""
        if self._polling is not None:
            self._polling.wake()

    def end(self, last: Callable[[], None] = lambda: None) -> bool:
        """End the polling and let the library's object go; never raises."""
        if self._polling is None:
            return self._letting_go is None or not self._letting_go.is_alive()
        ended = self._polling.end()
        self._polling = None
        self._letting_go = threading.Thread(target=self._let_go, args=(last,), daemon=True)
        self._letting_go.start()  # not here: it hangs where the object hangs
        self._letting_go.join(_LIBRARY_STOP_S if ended else _END_S)
        return not self._letting_go.is_alive()

    def check(self) -> None:
        """Raise when the library raised."""
        if self.failure is not None:
            raise NotConnectedError(
                self.name,
                f"is lost: opensourceleg raised {text_of(self.failure)}. Check cable and supply.",
            ) from self.failure

    def _let_go(self, last: Callable[[], None] = lambda: None) -> None:
        for call in (last, self.library.stop):
            with suppress(Exception):  # there is nobody left to tell
                call()


def made(kind: str, arguments: Mapping[str, Any]) -> Any:
    """Return a new object of opensourceleg; its library is imported here."""
    module, _, name = kind.partition(":")
    if module.split(".")[0] != "opensourceleg" or not name:
        raise DeviceError(
            "opensourceleg",
            f"expected module and class as opensourceleg.actuators.dephy:DephyActuator, got "
            f"{kind!r}.",
        )
    with traceback_limit_kept():  # DephyActuator stands on flexsea
        try:
            return getattr(importlib.import_module(module), name)(**arguments)
        except ImportError as exc:
            raise DeviceError("opensourceleg", _missing(kind, exc)) from exc
        except (AttributeError, TypeError, ValueError, OSError) as exc:
            raise DeviceError("opensourceleg", f"{kind} cannot be made: {text_of(exc)}.") from exc


def _missing(kind: str, exc: ImportError) -> str:
    needed = _lacking(exc)
    if needed == "opensourceleg":
        return 'is not installed. Install it: pip install "jointz[osl]" (it needs numpy below 2).'
    package = {"can": "python-can"}.get(needed, needed)
    return f"{kind} needs {needed}, which is not installed. Install it: pip install {package}"


def _lacking(exc: BaseException) -> str:
    """Return the top module that an import lacked; a cause knows where the error does not."""
    if isinstance(exc, ImportError) and exc.name:
        return exc.name.split(".")[0]
    return _lacking(exc.__cause__) if exc.__cause__ else "a library"


def text_of(exc: Exception) -> str:
    """Return type and message of an exception."""
    return f"{type(exc).__name__}: {exc}"
