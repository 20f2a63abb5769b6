"""Limits of a plan: what it may not exceed, and numbers that it refuses."""

import re

import numpy as np
import pytest


def test_no_parameter_is_refused(jointz):
    assert jointz("plan", "walking", "--of", ",").code == 2


@pytest.mark.parametrize("minutes", [3.2, 5.0, 8.0])
def test_nearest_half_width_of_few_minutes_can_be_asked_for(doublets, bare_plan, minutes):
    noisy = {"goniometer": np.deg2rad(0.6)}
    made = bare_plan(doublets, half_width_pct=50.0, minutes=minutes, sensors=noisy)
    for text in made.refused:
        if found := re.search(r"--half-width (\d+(?:\.\d+)?)", text):
            assert float(found[1]) <= 50.0, text


@pytest.mark.parametrize("people", [1, 2])
def test_nearest_difference_of_few_people_can_be_asked_for(doublets, bare_plan, people):
    refused = bare_plan(doublets, participants=people, difference_pct=20.0).refused
    for named in (re.search(r"--difference (\d+)", text) for text in refused):
        assert named is None or float(named[1]) <= 300.0


@pytest.mark.parametrize("limit", [4.0, 6.0, 9.0, 12.0])
def test_motion_is_not_exceeded(small_protocol, bare_plan, limit):
    plan = bare_plan(small_protocol(points={"MST": 21.5, "MSW": 81.0}), motion_deg=limit)
    assert plan.peak_deg <= limit * 1.02


def test_the_protocols_own_displacement_limit_is_not_raised(small_protocol, bare_plan):
    plan = bare_plan(small_protocol(safety={"displacement_rad": 0.2}))
    if plan.protocol_text:
        found = float(re.search(r"displacement_rad = (\d+(?:\.\d+)?)", plan.protocol_text)[1])
        assert found <= 0.2


def test_two_conditions_at_the_same_point_are_not_doubled(small_protocol, bare_plan, tmp_path):
    spec = small_protocol(per_point=16)
    raw = spec.model_dump(exclude_defaults=True, exclude_none=True)
    own = next(c for c in raw["conditions"] if "perturbations" in c)
    raw["conditions"] = [*raw["conditions"], {**own, "name": "again"}]
    twice = type(spec).model_validate(raw)
    plan = bare_plan(twice)
    file = tmp_path / "p.toml"
    file.write_text(plan.protocol_text)
    again = bare_plan(file)
    assert again.minutes == pytest.approx(plan.minutes)
