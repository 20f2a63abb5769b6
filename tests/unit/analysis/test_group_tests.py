"""Tests of people in the report: between timing points, and with against without the device."""

import numpy as np
import pandas as pd
import pytest

from jointz.analysis.device_effect import device_effect
from jointz.analysis.level_tests import level_tests
from jointz.analysis.page.level_tests_section import level_tests_section
from jointz.results.estimates import CellEstimate, ParameterEstimate
from jointz.results.mean_stride import MeanStride
from jointz.stats import mixed_model

GAIT_PCT = np.linspace(0.0, 100.0, 101)
PEOPLE = [f"S{k:02d}" for k in range(1, 9)]


def cell(person, point, stiffness, status="ok", session="", side=""):
    value = None if status != "ok" else stiffness
    estimate = ParameterEstimate("stiffness", value, None, None, status)
    return CellEstimate(
        person, point, 10.0, (estimate,), 99.0, 5, 0, "rigid", session=session, side=side
    )


def by_factor(found):
    return {t["factor"]: t for t in level_tests(found).get("level_tests", ())}


def cells(shift, *, seed=1, status="ok"):
    rng = np.random.default_rng(seed)
    return [
        cell(person, point, 100.0 + k + shift.get(point, 0.0) + rng.normal(0.0, 5.0),
             status if (person, point) == ("S01", "MST") else "ok")
        for k, person in enumerate(PEOPLE)
        for point in ("LRE", "MST", "TST")
    ]  # fmt: skip


def stride(person, condition, bump_rad, rng, session="", side=""):
    angle = 0.5 * np.sin(2 * np.pi * GAIT_PCT / 100.0)
    for k in range(1, 6):
        angle += rng.normal(0.0, 0.01) * np.sin(2 * np.pi * k * GAIT_PCT / 100.0 + k)
    angle += bump_rad * np.exp(-(((GAIT_PCT - 50.0) / 5.0) ** 2))
    return MeanStride(
        person, condition, 20, GAIT_PCT, angle, 0.0 * angle, session=session, side=side
    )


def test_a_timing_point_that_is_stiffer_is_found_with_its_pairs():
    (test,) = level_tests(cells({"LRE": 50.0}))["level_tests"]
    (row,) = level_tests_section({"level_tests": [test]})

    assert (test["factor"], test["parameter"], test["n_participants"]) == (
        "timing_point", "stiffness", 8,
    )  # fmt: skip
    assert test["p"] < 1e-6
    assert row["pairs"] == "LRE > MST, LRE > TST"


def test_equal_timing_points_show_no_pair():
    (test,) = level_tests(cells({}, seed=2))["level_tests"]

    assert test["p"] > 0.05
    assert level_tests_section({"level_tests": [test]})[0]["pairs"] == "none"


def test_a_value_that_is_undecided_is_counted_and_not_used():
    found = cells({"LRE": 50.0}, status="undecided")
    (test,) = level_tests(found)["level_tests"]

    assert (test["n_values"], test["n_without_value"]) == (23, 1)
    rows = [(c.participant, c.timing_point, c.stiffness.value) for c in found]
    table = pd.DataFrame(rows, columns=["who", "point", "k"]).dropna()
    fit = mixed_model(table, response="k", within="point", participant="who")
    assert test["F"] == pytest.approx(fit.f_test.F)


def test_sessions_are_compared_over_the_timing_points_that_both_have():
    rng = np.random.default_rng(3)
    found = [
        cell(person, point, 100.0 + 40.0 * (session == "two") + rng.normal(0.0, 5.0),
             session=session)
        for person in PEOPLE
        for session in ("one", "two")
        for point in ("LRE", "MST")
    ]  # fmt: skip
    tests = by_factor([*found, cell("S01", "TST", 500.0, "ok", "two")])

    assert tests["session"]["n_values"] == 16
    assert level_tests_section({"level_tests": [tests["session"]]})[0]["pairs"] == "two > one"


def test_a_side_recorded_in_one_session_only_makes_no_effect_of_the_session():
    rng = np.random.default_rng(3)
    found = [
        cell(person, point, 100.0 + 30.0 * (side == "left") + rng.normal(0.0, 3.0),
             session=session, side=side)
        for person in PEOPLE
        for session, side in (("one", "left"), ("one", "right"), ("two", "right"))
        for point in ("LRE", "MST")
    ]  # fmt: skip
    tests = by_factor(found)

    assert tests["session"]["p"] > 0.01
    assert level_tests_section({"level_tests": [tests["side"]]})[0]["pairs"] == "left > right"


def test_two_sides_are_averaged_between_timing_points():
    rng = np.random.default_rng(3)
    found = [
        cell(person, point, 100.0 + 40.0 * (point == "LRE") + rng.normal(0.0, 3.0), side=side)
        for person in PEOPLE
        for side in ("left", "right")
        for point in ("LRE", "MST")
    ]  # fmt: skip
    test = by_factor(found)["timing_point"]

    assert (test["n_values"], test["n_participants"]) == (16, 8)
    assert test["p"] < 1e-6


def test_a_timing_point_of_one_person_is_not_tested():
    lone = [cell("S01", "TST", 900.0)]
    kept = [c for c in cells({}, seed=2) if c.timing_point != "TST"]
    (test,) = level_tests([*kept, *lone])["level_tests"]

    assert test["levels"] == ["LRE", "MST"]


def test_a_session_of_two_people_takes_nobody_out_of_the_others():
    rng = np.random.default_rng(4)
    found = [
        cell(person, point, 100.0 + rng.normal(0.0, 5.0), session=session)
        for k, person in enumerate(PEOPLE)
        for session in ("one", "two", "three")[: 3 if k < 2 else 2]
        for point in ("LRE", "MST")
    ]
    test = by_factor(found)["session"]

    assert test["levels"] == ["one", "two"]
    assert test["n_participants"] == 8


@pytest.mark.slow
def test_a_level_without_the_others_variance_needs_the_corrected_p():
    """Differences that vary unalike (no sphericity): chance findings stay near 5 %."""
    rng = np.random.default_rng(0)
    found = []
    for _ in range(200):
        rows = [
            cell(person, f"p{k}", 100.0 + rng.normal(0.0, 40.0 if k == 3 else 3.0))
            for person in PEOPLE[:6]
            for k in range(4)
        ]
        (test,) = level_tests(rows)["level_tests"]
        found.append(test["p"] < 0.05)

    assert np.mean(found) < 0.09  # 14 % by the F test of the mixed model


def test_two_people_have_no_test():
    assert level_tests([c for c in cells({}) if c.participant in PEOPLE[:2]]) == {}


def test_a_device_that_bends_the_knee_at_half_the_cycle_is_found_there():
    rng = np.random.default_rng(5)
    strides = [
        stride(person, condition, 0.1 * (condition == "unperturbed"), rng)
        for person in PEOPLE
        for condition in ("no_device", "unperturbed")
    ]
    effect = device_effect(strides)["device_effect"]

    assert effect["participants"] == PEOPLE
    (cluster,) = effect["test"]["clusters"]
    assert 38.0 < cluster["start_node"] < 50.0 < cluster["end_node"] < 62.0


def test_sessions_of_a_person_are_one_person():
    rng = np.random.default_rng(5)
    strides = [stride("S01", c, 0.0, rng, session=s) for c in ("no_device", "unperturbed")
               for s in ("one", "two", "three", "four")]  # fmt: skip

    assert device_effect(strides) == {}


def test_an_unperturbed_left_knee_is_not_compared_with_a_right_one():
    rng = np.random.default_rng(6)
    strides = [
        stride(person, condition, 0.3 * (side == "left"), rng, side=side)
        for person in PEOPLE
        for condition, side in (
            ("no_device", "right"), ("unperturbed", "right"), ("unperturbed", "left"),
        )
    ]  # fmt: skip
    effect = device_effect(strides)["device_effect"]

    assert effect["participants"] == PEOPLE
    assert effect["test"]["clusters"] == []
