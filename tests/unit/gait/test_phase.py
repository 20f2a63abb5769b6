import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from jointz.gait.phase import gait_phase, stride_containing
from jointz.gait.strides import find_strides

NO_GAPS = np.empty((0, 2))


def strides_of(*durations):
    return find_strides(np.cumsum([0.0, *durations]), NO_GAPS)


def test_before_three_strides_there_is_no_phase():
    phase = gait_phase(np.array([-0.5, 0.5, 2.999]), strides_of(1.0, 1.0, 1.0, 1.0))
    assert phase.code == ("no_recent_strides",) * 3
    assert np.isnan(phase.pct).all()
    assert np.isnan(phase.elapsed_s[0])
    assert phase.elapsed_s[1] == 0.5


def test_when_a_strike_is_due_and_missing_the_phase_is_marked():
    phase = gait_phase(np.array([4.3, 4.34, 4.9]), strides_of(1.0, 1.0, 1.0, 2.0, 1.0))
    assert phase.code == ("", "missing_strike", "missing_strike")
    np.testing.assert_allclose(phase.pct, [30.0, 34.0, 90.0], atol=1e-9)


def test_after_a_stop_the_next_strike_gives_a_phase_again():
    strides = strides_of(1.0, 1.0, 1.0, 5.0, 1.0, 1.0)
    assert gait_phase(np.array([5.0, 8.25]), strides).code == ("missing_strike", "")
    assert gait_phase(np.array([8.25]), strides).pct[0] == pytest.approx(25.0)


def test_strides_of_long_ago_give_no_phase():
    strides = strides_of(*[1.0] * 6, 12.0, 1.0)
    assert gait_phase(np.array([18.2]), strides).code == ("no_recent_strides",)


def test_after_a_false_strike_the_phase_is_marked_until_the_next_true_one():
    strides = strides_of(1.0, 1.0, 1.0, 0.5, 0.5, 1.0, 1.0)
    phase = gait_phase(np.array([3.25, 3.75, 4.25, 5.25]), strides)
    assert phase.code == ("", "spurious_strike", "", "")
    np.testing.assert_allclose(phase.pct, [25.0, 75.0, 25.0, 25.0], atol=1e-9)
    at_the_end = strides_of(1.0, 1.0, 1.0, 0.5)
    assert gait_phase(np.array([3.7]), at_the_end).code == ("spurious_strike",)


def test_stride_containing_names_the_stride_or_minus_one():
    strides = strides_of(1.0, 1.0)
    t = np.array([-0.1, 0.0, 0.99, 1.0, 1.99, 2.0])
    assert stride_containing(t, strides).tolist() == [-1, 0, 0, 1, 1, -1]
    assert stride_containing(t, find_strides(np.empty(0), NO_GAPS)).tolist() == [-1] * 6


@given(
    st.lists(st.floats(1.0, 1.3), min_size=4, max_size=30),
    st.lists(st.floats(-1.0, 45.0), min_size=1, max_size=20),
)
def test_the_phase_equals_a_loop_over_the_definition(durations, times):
    strides = strides_of(*durations)
    phase = gait_phase(np.array(times), strides)
    for k, t in enumerate(times):
        done = [i for i in range(len(durations)) if strides.accepted[i] and strides.end_s[i] <= t]
        if len(done) < 3:
            assert phase.code[k] == "no_recent_strides"
            continue
        mean = np.mean([strides.duration_s[i] for i in done[-3:]])
        elapsed = t - max(s for s in strides.strike_s if s <= t)
        assert phase.elapsed_s[k] == pytest.approx(elapsed)
        assert phase.mean_stride_s[k] == pytest.approx(mean)
        distance = abs(phase.pct[k] - 100 * (elapsed / mean % 1)) % 100
        assert min(distance, 100 - distance) < 1e-6
