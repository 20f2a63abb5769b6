"""The scheduler: gaps, misses, and every planned pulse done exactly once."""

from collections import Counter
from itertools import pairwise

import pytest
from hypothesis import given
from hypothesis import strategies as st

from jointz.core.protocols.protocol_models import PerturbationPlan
from jointz.rig.experiment.plan import PlannedPulse
from jointz.rig.experiment.scheduler import Scheduler


def planned(*gaps, gait_pct=40.0):
    return [PlannedPulse(i, "P", gait_pct, 17.0, gap) for i, gap in enumerate(gaps, start=1)]


def of(*gaps, warm_up=0, gait_pct=40.0):
    return Scheduler(planned(*gaps, gait_pct=gait_pct), PerturbationPlan(warm_up_strides=warm_up))


def fired_in(scheduler, strides, *, at_pct=40.1):
    """Walk and return (stride, number) of what fired."""
    found = []
    for stride in range(1, strides + 1):
        scheduler.stride()
        pulse = scheduler.pulse_at(at_pct)
        if pulse is not None:
            found.append((stride, pulse.number))
    return found


@pytest.mark.parametrize(
    ("phase_pct", "fires"), [(39.99, False), (40.0, True), (41.0, True), (41.01, False)]
)
def test_a_pulse_fires_at_its_timing_point_or_at_most_1_pct_later(phase_pct, fires):
    scheduler = of(1)
    scheduler.stride()
    assert (scheduler.pulse_at(phase_pct) is not None) is fires


def test_a_pulse_whose_timing_point_passed_goes_to_the_end():
    scheduler = of(1, 1, 1)
    scheduler.stride()
    assert scheduler.pulse_at(43.0) is None
    assert scheduler.stride().number == 1
    assert [p.number for p in scheduler.queue] == [2, 3, 1]
    assert scheduler.pulse_at(40.0).number == 2


def test_a_missed_pulse_makes_the_gap_longer_and_never_shorter():
    scheduler = of(3, 3, 6)
    assert fired_in(scheduler, 3) == [(3, 1)]
    for _ in range(3):
        scheduler.stride()
    assert scheduler.miss().number == 2
    scheduler.stride()
    assert scheduler.pulse_at(40.0) is None  # 4 strides since the last; the next wants 6
    scheduler.stride()
    assert scheduler.pulse_at(40.0) is None
    scheduler.stride()
    assert scheduler.pulse_at(40.0).number == 3


def test_a_stride_taken_back_after_a_pulse_makes_the_gap_no_shorter():
    scheduler = of(2, 2)
    assert fired_in(scheduler, 2) == [(2, 1)]
    scheduler.retract_stride()  # the stride in which the pulse fired
    assert fired_in(scheduler, 4) == [(3, 2)]


what = st.sampled_from(["fire", "fire", "fire", "late", "unsteady", "broken", "retracted"])


@given(gaps=st.lists(st.integers(1, 7), max_size=12), history=st.lists(what, max_size=120))
def test_every_planned_pulse_is_done_exactly_once_whatever_happens(gaps, history):
    scheduler = of(*gaps)
    done, starts, stride = Counter(), [], 0
    events = iter(history)
    # After a history of misfortunes all goes well, so that it ends.
    while scheduler.queue:
        event = next(events, "fire")
        stride += 1
        scheduler.stride()
        if event == "retracted":
            scheduler.retract_stride()
            stride -= 1
            continue
        if event == "unsteady":
            scheduler.miss()
        pulse = scheduler.pulse_at(45.0 if event == "late" else 40.5)
        if pulse is None:
            continue
        starts.append((stride, pulse.gap_strides))
        if event == "broken":
            scheduler.requeue(pulse)
        else:
            done[pulse.number] += 1
    assert done == dict.fromkeys(range(1, len(gaps) + 1), 1)
    for (before, _), (stride, gap) in pairwise(starts):
        assert stride - before >= gap


@given(gaps=st.lists(st.integers(1, 7), min_size=1, max_size=30), warm_up=st.integers(0, 20))
def test_when_all_goes_well_gaps_are_exactly_as_planned(gaps, warm_up):
    scheduler = of(*gaps, warm_up=warm_up)
    found = fired_in(scheduler, warm_up + sum(gaps))
    assert [number for _, number in found] == list(range(1, len(gaps) + 1))
    strides = [warm_up, *[stride for stride, _ in found]]
    assert [b - a for a, b in pairwise(strides)] == gaps
