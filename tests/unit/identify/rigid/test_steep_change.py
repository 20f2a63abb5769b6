"""Estimates on a rise of the stiffness: found by their neighbours, widened by their response."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.optimize import least_squares

from jointz import phase_curve
from jointz.identify.rigid.steep_change import drift_reach, undecided_where_steep, widen_steep
from jointz.results.estimates import CellEstimate, ParameterEstimate, Response
from jointz.results.study_analysis import StudyAnalysis

K, B, J, WINDOW_S, RATE_HZ = 80.0, 2.0, 0.06, 0.1, 500.0
TIMES = np.arange(-3, int(WINDOW_S * RATE_HZ) + 1) / RATE_HZ


def push(t):
    return 17.0 * (1.0 - np.exp(-np.maximum(t - 0.006, 0.0) / 0.012))


def moved(stiffness, damping, inertia, drift=0.0):
    """Return the angle of a joint whose K drifts by so much over the window, by scipy."""
    middle = WINDOW_S / 1.6

    def rates(t, state):
        spring = stiffness + drift * (t - middle) / WINDOW_S
        return [state[1], (push(t) - damping * state[1] - spring * state[0]) / inertia]

    span = (TIMES[0], TIMES[-1])
    return solve_ivp(rates, span, [0.0, 0.0], t_eval=TIMES, rtol=1e-9, atol=1e-12).y[0]


def cell(point, onset, stiffness=K, *, sd=2.0, person="S1", **changes):
    values = {"stiffness": stiffness, "damping": B, "inertia": J}
    made = CellEstimate(
        participant=person,
        timing_point=point,
        onset_gait_pct=onset,
        parameters=tuple(
            ParameterEstimate(name, value, 0.9 * value, 1.1 * value, "ok", unbounded=value)
            for name, value in values.items()
        ),
        vaf_pct=99.9,
        n_used=40,
        n_excluded=0,
        method="rigid",
        response=Response(TIMES, moved(stiffness, B, J), push(TIMES), push(TIMES)),
        centre_gait_pct=(onset + 5.7) % 100.0,
        budget={"stiffness": {"noise": sd, "drift": 1.0}, "damping": {"noise": 0.1}},
    )
    return replace(made, **changes)


def rise(**changes):
    """Return timing points with a rise from 30 to 150 about the one at 93.5 %."""
    values = {"MST": (21.5, 60.0), "ISW": (68.5, 30.0), "MSW": (81.0, 30.0)}
    values |= {"TSW": (93.5, 90.0), "ICO": (1.0, 150.0), "LRE": (7.0, 150.0)}
    return [cell(name, at, k, **changes) for name, (at, k) in values.items()]


def test_a_drift_moves_the_fit_of_a_joint_without_one_as_far_as_is_said():
    drift = 4.0
    shown = moved(K, B, J, drift)
    found = least_squares(
        lambda p: 1e4 * (moved(*p) - shown), (K, B, J), x_scale=(K, B, J), diff_step=1e-4
    )
    reach = drift_reach(cell("A", 30.0))
    # To first order: a drift of a twentieth of K.
    assert found.x[0] - K == pytest.approx(drift * reach[0], rel=0.05)
    assert found.x[1] - B == pytest.approx(drift * reach[1], rel=0.05)
    assert reach[0] > 0.0 > reach[1]


def test_only_the_estimate_between_a_lower_and_a_higher_one_is_steep():
    widened = widen_steep(rise(), {})
    assert set(widened.steep) == {("S1", "TSW")}
    flat = [replace(c, participant="S2") for c in rise() if c.timing_point != "TSW"]
    assert set(widen_steep([*flat, *rise()], {}).steep) == {("S1", "TSW")}
    assert [c.timing_point for c in widened.cells] == [c.timing_point for c in rise()]
    assert [c for c in widened.cells if c.timing_point != "TSW"] == [
        c for c in rise() if c.timing_point != "TSW"
    ]


def test_a_drift_does_not_begin_beyond_the_neighbour_before_it():
    # From the 30 before to the 90 in the middle of the window: 96 over all of it.
    wide = widen_steep(rise(), {}).steep["S1", "TSW"]
    reach = drift_reach(next(c for c in rise() if c.timing_point == "TSW"))
    assert wide.budget["stiffness"]["drift"] == pytest.approx(np.hypot(1.0, 96.0 * reach[0]))
    assert wide.budget["damping"]["drift"] == pytest.approx(abs(96.0 * reach[1]))
    assert wide.budget["stiffness"]["noise"] == 2.0
    damping = wide.parameter("damping")
    assert damping.status == "undecided"
    assert (damping.value, damping.unbounded) == (None, B)


def test_a_drift_is_at_most_from_one_neighbour_to_the_other():
    cells = [c for c in rise() if c.timing_point != "TSW"]
    cells.append(cell("TSW", 93.5, 110.0))
    wide = widen_steep(cells, {}).steep["S1", "TSW"]
    reach = drift_reach(cells[-1])
    assert wide.budget["damping"]["drift"] == pytest.approx(abs(120.0 * reach[1]))


def test_an_estimator_that_may_have_followed_the_curve_needs_less_or_no_allowance():
    wide = widen_steep(rise(), {"S1": 0.75}).steep["S1", "TSW"]
    reach = drift_reach(next(c for c in rise() if c.timing_point == "TSW"))
    assert wide.budget["damping"]["drift"] == pytest.approx(abs(0.5 * 96.0 * reach[1]))
    assert list(widen_steep(rise(), {"S1": 1.0}).cells) == rise()
    assert undecided_where_steep(rise(), 1.0) == rise()


def test_a_difference_within_its_errors_vouches_for_no_slope():
    assert not widen_steep(rise(sd=60.0), {}).steep


def test_a_gentle_slope_is_no_steep_one():
    cells = [
        cell(f"{at} %", at, 80.0 + 20.0 * np.sin(at / 50.0 * np.pi)) for at in range(0, 100, 10)
    ]
    assert not widen_steep(cells, {}).steep


@pytest.mark.parametrize("missing", ["response", "centre_gait_pct", "onset_gait_pct", "budget"])
def test_what_tells_too_little_stays_as_it_is(missing):
    empty = {} if missing == "budget" else None
    cells = [replace(c, **{missing: empty}) for c in rise()]
    assert list(widen_steep(cells, {}).cells) == cells


def test_a_curve_says_where_it_is_steep_and_marks_what_that_leaves_undecided():
    curve = phase_curve(StudyAnalysis(tuple(rise())), parameters=["stiffness", "damping"])
    (warning,) = curve.warnings
    assert "TSW (1 of 1 people)" in warning
    undecided = [p.timing_point for p in curve.band("damping", "S1").points if not p.decided]
    assert undecided == ["TSW"]


def test_a_value_is_withheld_where_a_neighbour_within_the_window_tells_of_a_rise():
    kept = undecided_where_steep(rise(), 0.0)
    for before, after in zip(rise(), kept, strict=True):
        if before.timing_point != "TSW":
            assert after == before
    (told,) = [c for c in kept if c.timing_point == "TSW"]
    assert [p.status for p in told.parameters] == ["undecided", "undecided", "ok"]
    assert told.parameter("stiffness").unbounded == 90.0
    assert told.budget == rise()[3].budget


def test_a_neighbour_further_off_than_the_window_tells_nothing_of_it():
    far = [c for c in rise() if c.timing_point != "ICO"]
    assert undecided_where_steep(far, 0.0) == far
