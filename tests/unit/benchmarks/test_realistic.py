"""Rows of realistic people: the truth of what is estimated, and the scores."""

from dataclasses import replace
from pathlib import Path

import pytest
from benchmarks.realistic.page import realistic_text, resemblance_text
from benchmarks.realistic.rows import PARAMETERS, ROWS, preset_of
from benchmarks.realistic.scores import remedies_of, scores_of_row, withheld_reasons

from jointz.core.gait_phases import TIMING_POINTS
from jointz.rig.devices.interface import Stretch
from jointz.rig.sim.direct_walk import QUICK_GRID, walk_directly
from jointz.rig.sim.own_truth import own_truth
from jointz.rig.sim.people import draw_person
from jointz.rig.sim.presets import preset
from jointz.rig.sim.rig import SimulatedRig

FEW = replace(ROWS["a"].plan, per_point=1, warm_up_strides=2, tail_strides=2)


def test_truth_of_a_joint_without_softening_is_its_curve_and_gravity() -> None:
    # Plateaus around the timing points: K is the person's all over the window.
    person = draw_person(0, seed=1)
    truth = own_truth(person, preset("nominal"), FEW, 0.1)
    assert list(truth) == sorted(TIMING_POINTS)
    for point, row in truth.items():
        assert row["stiffness"] == pytest.approx(
            person.mass_kg * person.stiffness_per_mass[point], rel=0.01
        )
        assert row["damping"] == pytest.approx(
            person.mass_kg * person.damping_per_mass[point], rel=0.01
        )
        assert row["inertia"] == pytest.approx(person.inertia)


def test_softening_lowers_the_stiffness_along_the_motion() -> None:
    person, nominal = draw_person(0, seed=1), preset("nominal")
    soft = replace(nominal, joint=replace(nominal.joint, softening_rad=0.2))
    before, after = (own_truth(person, p, FEW, 0.1) for p in (nominal, soft))
    for point in TIMING_POINTS:
        assert 0.3 < after[point]["stiffness"] / before[point]["stiffness"] < 0.99
        assert after[point]["displacement_deg"] > before[point]["displacement_deg"]


def test_truth_of_a_recorded_walk_is_that_of_its_pulses() -> None:
    person, soft = draw_person(0, seed=1), preset("realistic")
    by_plan = own_truth(person, soft, FEW, 0.1)
    rig = SimulatedRig(person, soft, grid=QUICK_GRID)
    walk = walk_directly(rig, "perturbed", plan=FEW)
    recorded = rig.truth(
        "perturbed",
        worn=True,
        stretches=[Stretch(0, 0.0, walk.end_s)],
        pulses=walk.pulses,
        shapes=FEW.shapes,
        window_s=0.1,
    )
    by_record = own_truth(person, soft, FEW, 0.1, recorded=recorded)
    for point, row in by_plan.items():
        assert by_record[point] == pytest.approx(row, rel=1e-6)

    later = [
        pulse | {"stiffness_window_mean": 2.0 * pulse["stiffness_window_mean"]}
        for pulse in recorded["pulses"]
    ]
    stiffer = own_truth(person, soft, FEW, 0.1, recorded={**recorded, "pulses": later})
    for point, row in by_record.items():
        assert 1.5 * row["stiffness"] < stiffer[point]["stiffness"] < 2.5 * row["stiffness"]
        assert stiffer[point]["damping"] == row["damping"]


def test_only_the_last_row_has_sensors_beside_the_goniometer() -> None:
    assert preset_of(ROWS["b"]).gyroscopes is None
    assert preset_of(ROWS["c"]).gyroscopes is not None


def entry(number: int, cells: list[dict[str, object]]) -> dict[str, object]:
    return {"number": number, "cpu_s": 2.0, "cells": cells}


def cell(parameter: str, status: str, **values: object) -> dict[str, object]:
    usual = {"timing_point": "LRE", "value": None, "low": None, "high": None, "truth": 100.0}
    return {"parameter": parameter, "status": status, "why": "", "remedy": "", **usual, **values}


def test_scores_of_decided_withheld_and_limited_values() -> None:
    fine = cell("inertia", "ok", value=110.0, low=90.0, high=130.0)
    ok = cell("stiffness", "ok", value=80.0, low=70.0, high=90.0)
    open_ = cell("stiffness", "undecided", low=50.0, high=99.0, remedy="twice as many pulses: 40 %")
    withheld = cell("damping", "undecided", why="lag")
    people = [entry(0, [fine, ok, withheld]), entry(1, [fine, open_, withheld])]
    scores = scores_of_row("b", people).set_index("parameter")
    stiffness = scores.loc["stiffness"]
    assert (stiffness["decided_pct"], stiffness["coverage"]) == (50.0, 0.0)
    assert stiffness["rmse_pct"] == pytest.approx(20.0)
    assert (stiffness["limits"], stiffness["limits_hold"]) == (2, 0.5)
    assert stiffness["remedy_named_pct"] == 100.0
    assert scores.loc["inertia", "coverage"] == 1.0
    assert scores.loc["inertia", "half_width_pct"] == pytest.approx(20.0)
    assert scores.loc["damping", "withheld_pct"] == 100.0
    assert withheld_reasons(people).to_dict("records") == [{"why": "lag", "withheld": 2}]
    assert remedies_of(people).to_dict("records") == [
        {"parameter": "stiffness", "named first": "twice as many pulses", "times": 1}
    ]


def test_the_page_has_a_line_a_row_and_no_section_without_figures(tmp_path: Path) -> None:
    assert realistic_text(tmp_path) == resemblance_text(tmp_path) == ""
    cells = [cell(name, "ok", value=110.0, low=90.0, high=130.0) for name in PARAMETERS]
    cells[0] = cell("stiffness", "undecided", low=50.0, high=99.0)
    scores_of_row("a", [entry(0, cells)]).to_csv(tmp_path / "realistic.csv", index=False)
    line = realistic_text(tmp_path).splitlines()[-1]
    assert "| 1 | 0 / 100 / 100 | - / 1.00 (0.00-1.00) / 1.00 (0.00-1.00) |" in line
    assert line.endswith("| - / 10 / 10 | - / 10 / 10 | - / 20 / 20 | 0.50 / - / - |")
