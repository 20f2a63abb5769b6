"""Pulses of a bench fire at their points, far enough apart, as early as they can."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from jointz.core.protocols.bench_timing import onsets_after_rests, onsets_in_cycle

points = st.lists(st.floats(0.0, 99.9), min_size=1, max_size=12)


@given(points, st.floats(0.2, 6.0), st.floats(0.05, 3.0))
def test_every_pulse_stands_at_its_point_and_none_could_be_earlier(pct, cycle_s, apart_s):
    onsets = np.array(onsets_in_cycle(pct, cycle_s=cycle_s, apart_s=apart_s))

    phase = (onsets / cycle_s - np.array(pct) / 100.0 + 0.5) % 1.0 - 0.5
    assert np.abs(phase).max() < 1e-6
    rest = np.diff(onsets, prepend=0.0) - apart_s
    assert rest.min() > -1e-6
    assert rest.max() < cycle_s + 1e-6


def test_a_cycle_of_five_seconds_holds_four_pulses():
    onsets = onsets_in_cycle([10.0, 40.0, 60.0, 90.0] * 2, cycle_s=5.0, apart_s=0.9)

    assert onsets == pytest.approx((5.5, 7.0, 8.0, 9.5, 10.5, 12.0, 13.0, 14.5))


def test_twenty_pulses_after_rests_end_with_the_minute():
    onsets = onsets_after_rests(20, pause_s=2.75, duration_s=0.25)

    assert onsets[-1] + 0.25 == pytest.approx(60.0)
    assert np.diff(onsets) == pytest.approx(3.0)
