import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from jointz.gait.timestamps import (
    find_gaps,
    is_uniform,
    longest_step_s,
    rate_hz,
    resample_stretch,
    stretches,
)


@given(rate=st.floats(50, 2000), start=st.floats(-100, 100), hole=st.floats(2.0, 500))
def test_a_hole_of_two_steps_or_more_is_found_at_any_rate(rate, start, hole):
    time = start + np.arange(200) / rate
    time[120:] += (hole - 1.0) / rate
    np.testing.assert_allclose(find_gaps(time), [[time[119], time[120]]])
    assert rate_hz(time) == pytest.approx(rate, rel=1e-6)


def test_the_limit_is_1_75_median_steps():
    time = np.cumsum([0.0] + [0.01] * 50 + [0.0174] + [0.01] * 5 + [0.0176] + [0.01] * 50)
    assert find_gaps(time).shape == (1, 2)
    assert longest_step_s(time) == pytest.approx(0.0175)


def test_stamps_rounded_to_milliseconds_at_900_hz_hold_no_gaps():
    time = np.round(np.arange(9000) / 900.0, 3)
    assert find_gaps(time).size == 0
    time[5000:] += 0.02
    assert find_gaps(time).shape == (1, 2)


def test_stretches_equal_a_walk_through_the_samples():
    rng = np.random.default_rng(3)
    time = np.cumsum(np.where(rng.random(400) < 0.02, 0.05, 0.01))
    finite = rng.random(400) > 0.1
    expected, run = [], []
    for k in range(400):
        if run and (not finite[k] or time[k] - time[k - 1] > 0.0175):
            expected.append(slice(run[0], run[-1] + 1))
            run = []
        if finite[k]:
            run.append(k)
    if run:
        expected.append(slice(run[0], run[-1] + 1))
    assert stretches(time, finite) == expected
    assert stretches(np.arange(4.0), np.zeros(4, dtype=bool)) == []
    assert stretches(np.zeros(1), np.ones(1, dtype=bool)) == [slice(0, 1)]


def test_steps_within_two_percent_are_uniform():
    steps = np.full(100, 0.01)
    steps[40] = 0.01019
    assert is_uniform(np.cumsum(steps))
    steps[40] = 0.0103
    assert not is_uniform(np.cumsum(steps))
    assert not is_uniform(np.arange(100) * 0.01, step_s=0.011)


def test_a_jittered_straight_line_stays_one_on_a_uniform_grid():
    rng = np.random.default_rng(1)
    time = 3.0 + np.arange(1000) * 0.01 + rng.uniform(-0.003, 0.003, 1000)
    values = np.stack([[2.0 * time, -time], [time + 1.0, 0.0 * time]])
    grid, out = resample_stretch(time, values)
    assert out.shape == (2, 2, grid.size)
    assert is_uniform(grid)
    assert grid[0] == time[0]
    assert time[-1] - grid[-1] < np.median(np.diff(time))
    np.testing.assert_allclose(
        out, [[2.0 * grid, -grid], [grid + 1.0, 0.0 * grid]], rtol=0, atol=1e-12
    )


def test_stretches_of_one_recording_can_share_a_step():
    time = np.arange(100) * 0.0105
    grid, values = resample_stretch(time, time, step_s=0.01)
    np.testing.assert_allclose(np.diff(grid), 0.01)
    np.testing.assert_allclose(values, grid, atol=1e-12)
