"""Limits of a plan: what it may not exceed, and numbers that it refuses."""

import re

import numpy as np
import pytest

import jointz
from jointz.core.errors import DataError


def test_no_parameter_is_refused(jointz):
    assert jointz("plan", "walking", "--of", ",").code == 2


def test_nearest_half_width_with_minutes_is_kept(doublets):
    wish = {"parameters": ("inertia",), "minutes": 5.0}
    (text,) = jointz.plan(doublets, half_width_pct=6.0, **wish).refused
    width = float(re.search(r"--half-width (\d+(?:\.\d+)?)", text)[1])
    assert jointz.plan(doublets, half_width_pct=width, **wish).refused == ()


def test_nearest_half_width_of_few_minutes_can_be_asked_for(doublets):
    noisy = {"goniometer": np.deg2rad(0.6)}
    for minutes in (3.2, 5.0, 8.0):
        made = jointz.plan(doublets, half_width_pct=50.0, minutes=minutes, sensors=noisy)
        for text in made.refused:
            if found := re.search(r"--half-width (\d+(?:\.\d+)?)", text):
                assert float(found[1]) <= 50.0, text


def test_one_participant_and_a_difference(doublets):
    jointz.plan(doublets, participants=1, difference_pct=20.0)  # OverflowError


def test_nearest_difference_of_two_people_can_be_asked_for(doublets):
    (text,) = jointz.plan(doublets, participants=2, difference_pct=20.0).refused
    named = re.search(r"--difference (\d+)", text)
    assert named is None or float(named[1]) <= 300.0


@pytest.mark.parametrize(
    "given",
    [
        {"torque_nm": 0.0}, {"height_m": 175.0}, {"mass_kg": float("inf")},
        {"sensors": {"goniometer": float("inf")}}, {"sensors": {}}, {"participants": 2.5},
        {"bandwidth_hz": float("inf")}, {"seed": -1}, {"torque_nm": float("inf")},
    ],
    ids=str,
)  # fmt: skip
def test_bad_numbers(doublets, given):
    with pytest.raises(DataError):
        jointz.plan(doublets, **given)


def test_motion_is_not_exceeded(small_protocol):
    for limit in (4.0, 6.0, 9.0, 12.0):
        plan = jointz.plan(small_protocol(points={"MST": 21.5, "MSW": 81.0}), motion_deg=limit)
        assert plan.peak_deg <= limit * 1.02


def test_the_protocols_own_displacement_limit_is_not_raised(small_protocol):
    spec = small_protocol(safety={"displacement_rad": 0.2})
    plan = jointz.plan(spec)
    if plan.protocol_text:
        found = float(re.search(r"displacement_rad = (\d+(?:\.\d+)?)", plan.protocol_text)[1])
        assert found <= 0.2


def test_two_conditions_at_the_same_point_are_not_doubled(small_protocol, tmp_path):
    spec = small_protocol(per_point=16)
    raw = spec.model_dump(exclude_defaults=True, exclude_none=True)
    own = next(c for c in raw["conditions"] if "perturbations" in c)
    raw["conditions"] = [*raw["conditions"], {**own, "name": "again"}]
    twice = type(spec).model_validate(raw)
    plan = jointz.plan(twice)
    file = tmp_path / "p.toml"
    file.write_text(plan.protocol_text)
    again = jointz.plan(file)
    assert again.minutes == pytest.approx(plan.minutes)
