"""Clocks: a virtual one that only moves when waited for, and the machine's."""

import time

import pytest

from jointz.core.clock import RealClock, VirtualClock

MS = 1_000_000


def test_virtual_time_stands_still_until_it_is_waited_for():
    clock = VirtualClock()
    assert [clock.now_ns() for _ in range(3)] == [0, 0, 0]
    clock.wait_until_ns(7 * MS)
    assert clock.now_ns() == 7 * MS


@pytest.mark.parametrize("deadline_ns", [-1, 3 * MS])
def test_virtual_time_never_goes_back(deadline_ns):
    clock = VirtualClock(3 * MS)
    clock.wait_until_ns(deadline_ns)
    assert clock.now_ns() == 3 * MS


@pytest.mark.parametrize("spin_ns", [0, 50 * MS])
def test_real_time_is_never_before_the_deadline(spin_ns):
    clock = RealClock(spin_ns=spin_ns)
    deadline = clock.now_ns() + 3 * MS
    for _ in range(5):
        clock.wait_until_ns(deadline)
        assert clock.now_ns() >= deadline
        deadline += MS


def test_a_real_deadline_that_has_passed_is_no_wait(monkeypatch):
    def slept(seconds):
        pytest.fail(f"slept {seconds} s")

    monkeypatch.setattr(time, "sleep", slept)
    clock = RealClock()
    clock.wait_until_ns(clock.now_ns() - MS)
    clock.wait_until_ns(clock.now_ns())


@pytest.mark.alone
def test_a_real_clock_sleeps_until_shortly_before_the_deadline(monkeypatch):
    slept = []
    monkeypatch.setattr(time, "sleep", slept.append)
    clock = RealClock(spin_ns=2 * MS)
    clock.wait_until_ns(clock.now_ns() + 5 * MS)
    assert len(slept) == 1
    assert 0.0 < slept[0] <= 0.003
