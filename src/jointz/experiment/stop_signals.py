"""The signals that ask a run to stop, and how they are made to wait."""

import signal
from collections.abc import Iterator
from contextlib import contextmanager

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
    Of one thread: in a run the main one, in which Python handles signals. Where signals cannot
    wait, they do not.
    """
    if not CAN_WAIT:
        yield
        return
    before = signal.pthread_sigmask(signal.SIG_BLOCK, STOP_SIGNALS)
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)
