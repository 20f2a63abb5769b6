"""The signals that ask a run to stop, and how they are made to wait."""

import signal
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from types import FrameType

#: Whether signals can be made to wait: not on Windows.
CAN_WAIT = hasattr(signal, "pthread_sigmask")
#: Ctrl-C, a batch system, a terminal that was closed; the last not on Windows.
STOP_SIGNALS: tuple[signal.Signals, ...] = tuple(
    getattr(signal, name) for name in ("SIGINT", "SIGTERM", "SIGHUP") if hasattr(signal, name)
)


@contextmanager
def signals_held() -> Iterator[None]:
    """Let the signals wait until the end of the block; a process that is started in it inherits it.

    Notes
    -----
    In a run by the main thread, in which Python handles signals, whichever thread of a driver or
    a progress bar the system gives them to. Where signals cannot wait, they do not.
    """
    if not CAN_WAIT:
        yield
        return
    before = signal.pthread_sigmask(signal.SIG_BLOCK, STOP_SIGNALS)
    try:
        with _handled_later():
            yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)


@contextmanager
def _handled_later() -> Iterator[None]:
    """Keep signals that other threads get: a mask holds back those of its own thread only."""
    if threading.current_thread() is not threading.main_thread():
        yield  # Python handles none here
        return
    came: set[int] = set()

    def keep(number: int, frame: FrameType | None) -> None:
        del frame
        came.add(number)

    found = {number: signal.getsignal(number) for number in STOP_SIGNALS}
    # What is ignored stays so; what no Python code has set could not be set again.
    handlers = {n: one for n, one in found.items() if one not in (signal.SIG_IGN, None)}
    try:
        for number in handlers:
            signal.signal(number, keep)
        yield
    finally:
        # Ctrl-C last: where it comes again now, the others are as they were.
        for number, handler in reversed(handlers.items()):
            signal.signal(number, handler)
        for late in sorted(came):
            signal.raise_signal(late)  # it waits for the mask like any other
