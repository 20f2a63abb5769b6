"""The signals that ask a run to stop, and how they are made to wait."""

import signal
from collections.abc import Iterator
from contextlib import contextmanager

#: Ctrl-C, a batch system, a terminal that was closed.
STOP_SIGNALS = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)


@contextmanager
def signals_held() -> Iterator[None]:
    """Let the signals wait until the end of the block; a process that is started in it inherits it.

    Notes
    -----
    Of one thread: in a run the main one, in which Python handles signals.
    """
    before = signal.pthread_sigmask(signal.SIG_BLOCK, STOP_SIGNALS)
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)
