"""Phases of the gait cycle, on a circle."""

import math
from itertools import pairwise

import pytest
from hypothesis import given
from hypothesis import strategies as st

from jointz.core.gait_phases import PHASES, TIMING_POINTS, nearest_timing_point, phase_name


def test_phases_follow_each_other_around_the_cycle():
    bounds = list(PHASES.values())

    assert bounds[0][0] == 0.0
    assert bounds[-1][1] == 100.0
    assert all(first[1] == second[0] for first, second in pairwise(bounds))


def test_timing_points_lie_in_the_middle_of_their_phase():
    for name, pct in TIMING_POINTS.items():
        assert pct == pytest.approx(sum(PHASES[name]) / 2)


@pytest.mark.parametrize(
    ("pct", "name"),
    [(0.0, "ICO"), (math.nextafter(2.0, 0.0), "ICO"), (2.0, "LRE"), (100.0, "ICO"), (-0.5, "TSW"),
     (-93.0, "LRE"), (-1e-20, "ICO"), (250, "PSW")],
)  # fmt: skip
def test_a_phase_ends_before_its_end_in_every_cycle(pct, name):
    assert phase_name(pct) == name


@pytest.mark.parametrize("pct", [math.nan, math.inf, -math.inf])
def test_what_is_no_number_has_no_phase(pct):
    with pytest.raises(ValueError, match=r"^gait_pct: "):
        phase_name(pct)


@pytest.mark.parametrize(
    ("pct", "name"),
    [(97.0, "early"), (-3.0, "early"), (41.9, "early"), (42.0, "late"), (91, "late")],
)
def test_the_nearest_timing_point_may_lie_across_the_heel_strike(pct, name):
    assert nearest_timing_point(pct, {"late": 83.0, "early": 1.0}) == name


@given(st.sampled_from(sorted(TIMING_POINTS)), st.integers(-9, 9))
def test_a_timing_point_is_its_own_nearest_after_any_number_of_cycles(name, cycles):
    assert nearest_timing_point(TIMING_POINTS[name] + 100.0 * cycles, TIMING_POINTS) == name
    assert phase_name(TIMING_POINTS[name] + 100.0 * cycles) == name
