"""The control loop: ticks on an absolute grid of time."""

import gc
import os
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass

from jointz.core.clock import Clock

_PRIORITY = 49  # of 1..99 under SCHED_FIFO: just below the threads of interrupts, at 50


@dataclass(frozen=True, slots=True)
class LoopCounts:
    """Counts of a loop."""

    ticks: int  # number of slots with a tick
    missed_slots: int  # number of slots skipped because a tick took too long


class ControlLoop:
    """Calls a tick at every slot of an absolute grid.

    Slot ``k`` is due at ``k`` periods of the clock and lasts a period; a tick may
    begin late within it. Slots that passed altogether are skipped and counted,
    never caught up: lateness does not add up and the mean rate is kept.
    """

    def __init__(self, clock: Clock, period_ns: int) -> None:
        self._clock = clock
        self._period_ns = period_ns

    def run(self, tick: Callable[[int, int, int], bool]) -> LoopCounts:
        """Run until a tick returns False."""
        now_ns, wait_until_ns = self._clock.now_ns, self._clock.wait_until_ns
        period_ns = self._period_ns
        expected = -(-now_ns() // period_ns)
        ticks = missed = 0
        running = True
        while running:
            wait_until_ns(expected * period_ns)
            now = now_ns()
            slot = now // period_ns
            skipped = slot - expected
            running = tick(slot, now, skipped)
            ticks += 1
            missed += skipped
            expected = slot + 1
        return LoopCounts(ticks, missed)


@contextmanager
def undisturbed() -> Iterator[str]:
    """Keep the garbage collector and, where permitted, the scheduler out of the loop."""
    collecting = gc.isenabled()
    gc.collect()
    gc.freeze()
    gc.disable()
    try:
        with _before_others() as granted:
            yield granted
    finally:
        gc.unfreeze()
        if collecting:
            gc.enable()


@contextmanager
def _before_others() -> Iterator[str]:
    """Request the loop's priority from the scheduler, and restore the previous one."""
    if not hasattr(os, "sched_setscheduler"):  # a Mac, Windows: nobody to ask
        yield "SCHED_OTHER"
        return
    policy, parameters = os.sched_getscheduler(0), os.sched_getparam(0)
    try:
        os.sched_setscheduler(0, os.SCHED_FIFO, os.sched_param(_PRIORITY))
    except PermissionError:
        yield "SCHED_OTHER"
        return
    try:
        yield "SCHED_FIFO"
    finally:
        os.sched_setscheduler(0, policy, parameters)
