"""Heel strikes in real time: chatter, refractory time, missing samples."""

from math import isnan, nan

import pytest
from hypothesis import given
from hypothesis import strategies as st

from jointz.rig.experiment.gait.gait_watch import HeelStrikeDetector

MS = 1_000_000


def taken_and_back_ms(values, *, step_ms=1, refractory_s=0.3):
    """Return when strikes come, and when one is taken back, in samples ``step_ms`` apart."""
    detector = HeelStrikeDetector(low=0.3, high=0.7, refractory_s=refractory_s)
    taken, back = [], []
    for i, value in enumerate(values):
        strike = detector.update(i * step_ms * MS, value)
        if detector.retracted:
            back.append(i * step_ms)
        if strike is not None:
            assert strike == i * step_ms * MS
            taken.append(i * step_ms)
    return taken, back


def strikes_ms(values, **settings):
    """Return when strikes come, later taken back or not."""
    return taken_and_back_ms(values, **settings)[0]


def steps(*stretches):
    """Return samples of stretches (value, how many)."""
    return [value for value, count in stretches for _ in range(count)]


@pytest.mark.parametrize(("off_ms", "counted"), [(59, False), (60, True)])
def test_the_switch_must_have_been_off_for_60_ms(off_ms, counted):
    values = steps((0.0, 400), (1.0, 600), (0.0, off_ms), (1.0, 10))
    assert (strikes_ms(values) == [400, 1000 + off_ms]) is counted


@pytest.mark.parametrize(("after_ms", "counted"), [(299, False), (300, True)])
def test_no_strike_is_taken_within_the_refractory_time(after_ms, counted):
    values = steps((0.0, 100), (1.0, 100), (0.0, after_ms - 100), (1.0, 10))
    assert (strikes_ms(values) == [100, 100 + after_ms]) is counted


def test_a_contact_that_does_not_last_is_taken_back_and_hides_no_strike():
    values = steps((0.0, 400), (1.0, 30), (0.0, 100), (1.0, 600))
    assert taken_and_back_ms(values) == ([400, 530], [460])


@pytest.mark.parametrize(("low", "high"), [(0.5, 0.5), (0.7, 0.3), (nan, 0.5)])
def test_thresholds_must_be_in_order(low, high):
    with pytest.raises(ValueError, match="expected low < high"):
        HeelStrikeDetector(low=low, high=high, refractory_s=0.3)


levels = st.one_of(st.sampled_from([0.0, 1.0, 0.5, nan]), st.floats(-1, 2))
signals = st.lists(st.tuples(levels, st.integers(1, 80)), max_size=40)


def naive(values, step_ms, refractory_ms):
    """The same in words: state of the switch first, then rises, then what rules out which."""
    on, state = True, []
    for value in values:
        on = False if value < 0.3 else True if value >= 0.7 else on
        state.append(on)
    taken, back, stand = [], [], []
    for i in range(1, len(state)):
        if not state[i] or state[i - 1]:
            continue
        at = i * step_ms
        down = next(j for j in range(i - 1, -1, -1) if j == 0 or state[j - 1])
        long_off = (i - down) * step_ms >= 60
        rested = not stand or at - stand[-1] >= refractory_ms
        if not (long_off and rested):
            continue
        taken.append(at)
        after = values[i + 1 : i + 1 + 60 // step_ms]
        known = [value for value in after if not isnan(value)]
        complete = len(after) == 60 // step_ms
        if complete and sum(value >= 0.3 for value in known) < 0.75 * len(known):
            back.append(at + 60)
        else:
            stand.append(at)
    return taken, back


@given(signals)
def test_it_agrees_with_a_slow_obvious_detector(stretches):
    values = steps(*stretches)
    found = taken_and_back_ms(values, step_ms=5, refractory_s=0.25)
    assert found == naive(values, 5, 250)
