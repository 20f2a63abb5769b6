"""Quasi-stiffness of single people: values, intervals over strides, and where there are none."""

import numpy as np
import pytest

from jointz.analysis.study_statistics import quasi_stiffness_rows
from jointz.core.gait_phases import TIMING_POINTS
from jointz.identify.over_cycle.stride_curves import NODES, StrideCurves

TRUTH = 120.0


def curves(n, *, noise_nm=1.0, seed=0) -> StrideCurves:
    """Return strides whose moment follows the angle, each with a level of its own."""
    rng = np.random.default_rng(seed)
    phase = 2 * np.pi * np.linspace(0.0, 1.0, NODES)
    angle = 0.4 - 0.3 * np.cos(phase) - 0.1 * np.sin(2 * phase)
    angles = angle * rng.normal(1.0, 0.03, (n, 1))
    moments = TRUTH * (angles - 0.1) + rng.normal(0.0, noise_nm, (n, NODES))
    return StrideCurves("S01", "left", angles, moments)


def slopes(rows):
    return {r["timing_point"]: r for r in rows if r["measure"] == "slope"}


def test_every_timing_point_has_three_measures_in_newton_metres_per_radian():
    rows = quasi_stiffness_rows([curves(30)], TIMING_POINTS)

    assert len(rows) == 3 * len(TIMING_POINTS)
    assert {r["unit"] for r in rows} == {"N*m/rad"}
    assert {(r["participant"], r["side"], r["n_strides"]) for r in rows} == {("S01", "left", 30)}
    for row in slopes(rows).values():
        assert row["value"] == pytest.approx(TRUTH, rel=0.1)
        assert row["ci_low"] < row["value"] < row["ci_high"]


def test_intervals_hold_the_truth_in_about_95_of_100():
    found = [
        slopes(quasi_stiffness_rows([curves(12, seed=seed)], {"swing": 81.0}))["swing"]
        for seed in range(150)
    ]

    held = np.mean([r["ci_low"] <= TRUTH <= r["ci_high"] for r in found])
    assert 0.90 < held <= 0.99


def test_few_strides_have_values_without_an_interval():
    rows = quasi_stiffness_rows([curves(4)], TIMING_POINTS)

    assert all(r["value"] is not None for r in rows)
    assert {(r["ci_low"], r["ci_high"]) for r in rows} == {(None, None)}


def test_an_angle_that_stands_still_has_no_value_and_says_why():
    still = StrideCurves("S01", "", np.full((8, NODES), 0.2), np.ones((8, NODES)))

    rows = slopes(quasi_stiffness_rows([still], TIMING_POINTS))

    assert {r["status"] for r in rows.values()} == {"undecided"}
    assert all(r["value"] is None and r["ci_low"] is None for r in rows.values())
    assert all("no_range" in r["doubts"] for r in rows.values())
