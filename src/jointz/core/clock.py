"""Clocks: the machine's own, and a virtual one that advances only when something waits for it.

Everything that needs time takes a :class:`Clock`; minutes of walking pass in
milliseconds under a virtual one, and the same code runs in real time under the
real one.
"""

import time
from typing import Protocol

#: Sleeping ends up to this much late; the rest is spent looking at the clock.
_SPIN_NS = 150_000


class Clock(Protocol):
    """A clock: tells the time and waits, in monotonic nanoseconds."""

    def now_ns(self) -> int:
        """Return the time, ns."""

    def wait_until_ns(self, deadline_ns: int) -> None:
        """Return when the time is ``deadline_ns`` or later, at once where it has passed."""


class VirtualClock:
    """A clock that advances only when something waits for it.

    Parameters
    ----------
    start_ns : int
        The time at first, ns.

    Examples
    --------
    >>> clock = VirtualClock()
    >>> clock.wait_until_ns(2_000_000)
    >>> clock.now_ns()
    2000000
    """

    __slots__ = ("_now_ns",)

    def __init__(self, start_ns: int = 0) -> None:
        self._now_ns = start_ns

    def now_ns(self) -> int:
        """Return the time, ns."""
        return self._now_ns

    def wait_until_ns(self, deadline_ns: int) -> None:
        """Move to the deadline; time never goes back."""
        if deadline_ns > self._now_ns:
            self._now_ns = deadline_ns


class RealClock:
    """The machine's monotonic clock.

    Waits by sleeping until shortly before the deadline and by looking at the
    clock for the rest: sleep alone ends 50 to 150 us late.
    """

    __slots__ = ("_spin_ns",)

    def __init__(self, *, spin_ns: int = _SPIN_NS) -> None:
        self._spin_ns = spin_ns

    now_ns = staticmethod(time.perf_counter_ns)

    def wait_until_ns(self, deadline_ns: int) -> None:
        """Sleep, then spin, until the deadline."""
        now_ns = time.perf_counter_ns
        rest = deadline_ns - now_ns() - self._spin_ns
        if rest > 0:
            time.sleep(rest * 1e-9)
        while now_ns() < deadline_ns:
            pass
