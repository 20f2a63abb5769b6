"""Stride time over walking speed."""

import pytest

from jointz.core.gait_phases import (
    FASTEST_M_S,
    REFERENCE_SPEED_M_S,
    SLOWEST_M_S,
    stride_time_ratio,
)


def test_at_the_speed_of_the_dissertation_nothing_changes():
    assert stride_time_ratio(REFERENCE_SPEED_M_S) == 1.0


@pytest.mark.parametrize("speed_m_s", [SLOWEST_M_S, 0.8, 1.7, FASTEST_M_S])
def test_step_length_over_step_rate_is_the_same_at_any_speed(speed_m_s):
    def walk_ratio(speed):
        step_s = 1.1 / 2.0 * stride_time_ratio(speed)
        return speed * step_s / (1.0 / step_s)

    assert walk_ratio(speed_m_s) == pytest.approx(walk_ratio(1.2))
