"""Handling of the signals that ask for a stop: noted, acted on, or held back."""

import _thread
import atexit
import os
import signal
import sys
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from types import FrameType
from typing import Any

#: Whether signals can be made to wait: not on Windows.
CAN_WAIT = hasattr(signal, "pthread_sigmask")
#: Ctrl-C, a batch system, a terminal that was closed; the last not on Windows.
STOP_SIGNALS: tuple[signal.Signals, ...] = tuple(
    getattr(signal, name) for name in ("SIGINT", "SIGTERM", "SIGHUP") if hasattr(signal, name)
)

#: After what time a stop comes again that the main thread does not deal with yet, s.
_AGAIN_S = 0.3
#: How long after the first stop a Ctrl-C ends a clean-up at once, s.
_AT_ONCE_S = 10.0
#: A stop that came, and whether the work is over, so that none comes again.
_noted = _over = False
#: A session that ends its trial gently, so that none needs to come again.
_acknowledged = False
#: When the first stop came (s, 0 before), and whether the next is one that came again by itself.
_first_s, _is_repeat = 0.0, False


def listen_for_stops() -> None:
    """Have a signal raise KeyboardInterrupt, and do so again where a library swallows it.

    So Python does itself with one that is raised in a callback of a compiler or of the garbage
    collector. What is ignored stays so: ``nohup`` is meant.
    """
    global _noted, _over, _acknowledged, _first_s
    _noted = _over = _acknowledged = False
    _first_s = 0.0
    hide_consequences()
    atexit.register(_ignore_stops)  # called last: Python restores the defaults next
    for number in STOP_SIGNALS:
        if signal.getsignal(number) != signal.SIG_IGN:
            signal.signal(number, _note_stop)


def _ignore_stops() -> None:
    for number in STOP_SIGNALS:
        signal.signal(number, signal.SIG_IGN)


def end_listening() -> bool:
    """Stop listening to signals and return whether one came since listening began."""
    global _noted, _over
    received, _noted, _over = _noted, False, True
    return received


def acknowledge_stop() -> None:
    """Acknowledge a stop: the work ends by itself and the signal is not repeated."""
    global _acknowledged, _first_s
    _acknowledged, _first_s = True, _first_s or time.monotonic()


def is_stop_noted() -> bool:
    """Return whether a signal came."""
    return _noted


def hide_consequences() -> None:
    """Print no traceback of what nobody can catch once a stop was noted."""
    sys.unraisablehook, sys.excepthook = _print_unraisable, _print_error


def _print_unraisable(args: Any) -> None:
    if not (_noted or _over):
        sys.__unraisablehook__(args)


def _print_error(*error: Any) -> None:
    if not _noted:  # C libraries print errors by this before they raise others
        sys.__excepthook__(*error)


def interrupt() -> None:
    """Raise KeyboardInterrupt, unless one is being dealt with: what cleans up goes on."""
    global _noted
    _noted = True
    error = sys.exception()
    while error is not None and not isinstance(error, (KeyboardInterrupt, GeneratorExit)):
        error = error.__context__
    if error is None:
        raise KeyboardInterrupt


def _note_stop(number: int, frame: FrameType | None) -> None:
    """Interrupt the work; a late Ctrl-C ends a clean-up that hangs, after devices are stopped."""
    global _first_s, _is_repeat
    del frame
    _first_s = _first_s or time.monotonic()
    is_repeat, _is_repeat = _is_repeat, False
    if not (_noted or _over):
        with suppress(RuntimeError):  # Python ends, or no thread is to be had
            # No threading.Thread: its locks may be those that the main thread has just now.
            _thread.start_new_thread(_insist, (signal.Signals(number),))
    if not _over:
        interrupt()
    if number == signal.SIGINT and not is_repeat and time.monotonic() - _first_s > _AT_ONCE_S:
        with suppress(OSError):
            os.write(2, b"jointz: Ended at once: the clean-up was not done.\n")
        os._exit(128 + number)


def _insist(number: signal.Signals) -> None:
    """Send a signal to the main thread until it ends its work, which it may be waiting in."""
    global _is_repeat
    while True:
        time.sleep(_AGAIN_S)
        if _over or _acknowledged:
            return
        main, _is_repeat = threading.main_thread().ident, True
        if CAN_WAIT and main is not None:
            signal.pthread_kill(main, number)
        else:
            _thread.interrupt_main(number)


@contextmanager
def signals_held() -> Iterator[None]:
    """Let the signals wait until the end of the block; a process that is started in it inherits it.

    In a run by the main thread, in which Python handles signals, whichever thread of a driver or
    a progress bar the system gives them to. Where signals cannot wait, they do not.
    """
    if not CAN_WAIT:
        yield
        return
    before = signal.pthread_sigmask(signal.SIG_BLOCK, ())
    try:
        # A signal that came just before is handled in here, and may raise, with all blocked.
        signal.pthread_sigmask(signal.SIG_BLOCK, STOP_SIGNALS)
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
    received: set[int] = set()

    def keep(number: int, frame: FrameType | None) -> None:
        del frame
        received.add(number)

    current = {number: signal.getsignal(number) for number in STOP_SIGNALS}
    # What is ignored stays so; what no Python code has set could not be set again.
    handlers = {n: one for n, one in current.items() if one not in (signal.SIG_IGN, None)}
    try:
        for number in handlers:
            signal.signal(number, keep)
        yield
    finally:
        # Ctrl-C last: where it comes again now, the others are as they were.
        for number, handler in reversed(handlers.items()):
            signal.signal(number, handler)
        for late in sorted(received):
            signal.raise_signal(late)  # it waits for the mask like any other
