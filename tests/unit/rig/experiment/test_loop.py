"""The loop keeps an absolute grid: late ticks skip slots, and nothing is caught up."""

import gc
import os
from contextlib import nullcontext

import pytest
from hypothesis import given
from hypothesis import strategies as st

from jointz.core.clock import RealClock, VirtualClock
from jointz.rig.experiment.loop import ControlLoop, LoopCounts, undisturbed

PERIOD = 2_000_000


class LateClock(VirtualClock):
    """Wakes late by what it is told, wait by wait."""

    def __init__(self, start_ns=0, *, late_ns=()):
        super().__init__(start_ns)
        self._late = iter(late_ns)

    def wait_until_ns(self, deadline_ns):
        super().wait_until_ns(deadline_ns)
        super().wait_until_ns(self.now_ns() + next(self._late, 0))


def ran(clock, *, work_ns, ticks=None, period_ns=PERIOD):
    """Run with ticks that take given times, under a virtual clock; return calls and counts."""
    calls, work = [], list(work_ns)
    most = len(work) if ticks is None else ticks

    def tick(slot, now_ns, skipped):
        calls.append((slot, now_ns, skipped))
        if len(calls) <= len(work):
            VirtualClock.wait_until_ns(clock, clock.now_ns() + work[len(calls) - 1])
        return len(calls) < most

    return calls, ControlLoop(clock, period_ns).run(tick)


@pytest.mark.parametrize(
    ("start_ns", "first"), [(0, 0), (1, 1), (PERIOD - 1, 1), (PERIOD, 1), (PERIOD + 1, 2)]
)
def test_the_first_slot_is_the_next_one_of_the_clock(start_ns, first):
    calls, _ = ran(VirtualClock(start_ns), work_ns=[0, 0])
    assert calls == [(first, first * PERIOD, 0), (first + 1, (first + 1) * PERIOD, 0)]


def test_a_slow_tick_skips_slots_that_are_counted_and_never_caught_up():
    calls, counts = ran(VirtualClock(), work_ns=[0, 3 * PERIOD + 5, 0, 0])
    assert [(slot, skipped) for slot, _, skipped in calls] == [(0, 0), (1, 0), (4, 2), (5, 0)]
    assert calls[2][1] == 4 * PERIOD + 5
    assert counts == LoopCounts(ticks=4, missed_slots=2)


times = st.lists(st.integers(0, 5 * PERIOD), min_size=1, max_size=40)


@given(start_ns=st.integers(0, 10 * PERIOD), work_ns=times, late_ns=times)
def test_every_slot_is_served_or_counted_whatever_is_late(start_ns, work_ns, late_ns):
    calls, counts = ran(LateClock(start_ns, late_ns=late_ns), work_ns=work_ns)
    slots = [slot for slot, _, _ in calls]
    first = -(-start_ns // PERIOD)
    assert slots == sorted(set(slots))
    assert all(slot * PERIOD <= now < (slot + 1) * PERIOD for slot, now, _ in calls)
    assert counts.ticks == len(work_ns)
    assert slots[-1] - first + 1 == counts.ticks + counts.missed_slots
    assert counts.missed_slots == sum(skipped for _, _, skipped in calls)


@pytest.mark.alone
def test_real_ticks_lie_in_their_slots():
    calls, counts = ran(RealClock(), work_ns=[], ticks=25, period_ns=1_000_000)
    assert all(0 <= now - slot * 1_000_000 < 1_000_000 for slot, now, _ in calls)
    assert calls[-1][0] - calls[0][0] + 1 == counts.ticks + counts.missed_slots - calls[0][2]


@pytest.fixture
def small_heap():
    """Freeze what pytest has made: a collection of it takes seconds."""
    gc.freeze()
    yield
    gc.unfreeze()


@pytest.fixture
def scheduler(monkeypatch, small_heap):
    """A scheduler that notes what is asked of it instead of doing it."""
    asked = []
    monkeypatch.setattr(os, "sched_getscheduler", lambda _: os.SCHED_OTHER)
    monkeypatch.setattr(os, "sched_getparam", lambda _: os.sched_param(0))
    monkeypatch.setattr(
        os,
        "sched_setscheduler",
        lambda _, policy, parameters: asked.append((policy, parameters.sched_priority)),
    )
    return asked


def test_the_scheduler_is_asked_for_and_given_back(scheduler):
    with undisturbed() as granted:
        assert granted == "SCHED_FIFO"
        assert [policy for policy, _ in scheduler] == [os.SCHED_FIFO]
        assert 1 <= scheduler[0][1] <= 99
    assert scheduler[1:] == [(os.SCHED_OTHER, 0)]


def test_a_scheduler_that_is_not_permitted_is_done_without(monkeypatch, small_heap):
    def refused(pid, policy, parameters):
        raise PermissionError

    monkeypatch.setattr(os, "sched_setscheduler", refused)
    with undisturbed() as granted:
        assert granted == "SCHED_OTHER"
        assert not gc.isenabled()


@pytest.mark.parametrize("collecting", [True, False])
@pytest.mark.parametrize("failing", [True, False])
def test_the_garbage_collector_is_as_it_was_afterwards(scheduler, collecting, failing):
    was = gc.isenabled()
    frozen = gc.get_freeze_count()
    try:
        (gc.enable if collecting else gc.disable)()
        ended = pytest.raises(KeyboardInterrupt) if failing else nullcontext()
        with ended, undisturbed():
            assert not gc.isenabled()
            assert gc.get_freeze_count() > frozen
            if failing:
                raise KeyboardInterrupt
        assert gc.isenabled() is collecting
        assert gc.get_freeze_count() <= frozen
    finally:
        (gc.enable if was else gc.disable)()
