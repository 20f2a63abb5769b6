"""Tables of chapter IV from simulated people, on made-up people small enough to check by hand."""

import json

import numpy as np
import pandas as pd
import pytest
from reproduction.chapter4.person_tables import (
    accuracy_table,
    means_table,
    participant_grids,
)
from reproduction.chapter4.reproduce_chapter4 import simulated_chapter, simulated_statistics
from reproduction.chapter4.walking import (
    COLUMNS,
    PersonGait,
    WalkedStudy,
    estimated,
    true_values,
)

from jointz.core.gait_phases import TIMING_POINTS
from jointz.reference import chapter4
from jointz.results.estimates import CellEstimate, ParameterEstimate

PEOPLE = tuple(f"S{k:02d}" for k in range(1, 11))
TRUTH = {"stiffness_per_mass": 1.0, "damping_per_mass": 0.04, "inertia": 0.05}


def study(factor=1.2, refused=()):
    """Return ten people: the dissertation's method off by a factor, the recommended by 1 %."""
    rows = []
    for j, person in enumerate(PEOPLE):
        for i, point in enumerate(TIMING_POINTS):
            for name, base in TRUTH.items():
                # People and timing points add up, but for a ripple that leaves a residual.
                size = 1.0 + 0.1 * i * (name != "inertia") + 0.02 * j
                ripple = 0.01 * np.sin(3.0 * i + 5.0 * j)
                true = base * (size + ripple)
                for source, value in (
                    ("truth", true),
                    ("dissertation", factor * true * (1.0 + 0.02 * np.cos(2.0 * i + 7.0 * j))),
                    ("recommended", 1.01 * true),
                ):
                    known = (source, name, person) not in refused
                    vaf_pct = {"dissertation": 99.0 - 0.1 * j, "recommended": 99.9}.get(source)
                    ends = (value, 0.95 * value, 1.05 * value) if known else (None, None, None)
                    status = "ok" if known else "undecided"
                    onset = TIMING_POINTS[point]
                    rows.append((source, person, point, onset, name, *ends, status, vaf_pct))
    population = pd.DataFrame(
        [
            (point, name, base, 0.9 * base, 1.1 * base)
            for point in TIMING_POINTS
            for name, base in TRUTH.items()
        ],
        columns=["timing_point", "parameter", "value", "ci_low", "ci_high"],
    )
    return WalkedStudy(PEOPLE, pd.DataFrame(rows, columns=list(COLUMNS)), population, gait())


def gait(shift_rad=0.0):
    rng = np.random.default_rng(3)
    phase = np.linspace(0.0, 2 * np.pi, 101)
    angle = 0.5 - 0.4 * np.cos(phase)
    found = {}
    for person in PEOPLE:
        own = 0.01 * rng.standard_normal((2, 1, 1)) + 0.01 * rng.standard_normal((2, 4, 1)) * (
            np.sin(phase)
        )
        found[person] = PersonGait(
            angle + own[0], angle + shift_rad + own[1], 0.5 * np.sin(phase) + own[1]
        )
    return found


def test_tables_4_1_to_4_4_hold_print_both_methods_and_the_truth():
    grids = participant_grids(study())
    assert [grid.name for grid in grids] == ["table_4_1", "table_4_2", "table_4_3", "table_4_4"]
    assert [len(grid.blocks) for grid in grids] == [4, 4, 4, 3]
    stiffness = grids[0]
    assert stiffness.participants == chapter4.SUBJECTS
    assert stiffness.blocks[0].cells["LRE"][2] == 4.23
    assert stiffness.blocks[0].average["LRE"] == 2.13
    truth = stiffness.blocks[3].cells["LRE"]
    assert stiffness.blocks[2].cells["LRE"] == pytest.approx([1.01 * t for t in truth])
    assert stiffness.blocks[3].average["LRE"] == pytest.approx(np.mean(truth))
    assert grids[3].blocks[1].cells["MSW"][9] == pytest.approx(98.1)


def test_a_refused_value_is_empty_counted_and_no_part_of_an_average():
    found = study(refused={("recommended", "inertia", "S01")})
    inertia = participant_grids(found)[2]
    row = inertia.blocks[2].cells["TST"]
    assert row[0] is None
    assert inertia.blocks[2].average["TST"] == pytest.approx(np.mean(row[1:]))
    assert "6 of 60 values undecided (of S01)" in inertia.caption
    notes = {row.quantity: row.note for row in accuracy_table(found).rows}
    assert notes["inertia: RMS error"] == "60 and 54 estimates; 0 and 6 refused"


def test_means_stand_beside_print_with_spread_interval_and_truth():
    table = means_table(study())
    assert len(table.rows) == 24
    row = table.rows[0]
    assert (row.quantity, row.unit) == ("stiffness at LRE", "N*m/rad/kg")
    assert (row.printed, row.printed_sd) == (2.13, None)
    assert row.dissertation == pytest.approx(1.2 * row.truth, rel=0.02)
    assert (row.recommended, row.recommended_low, row.recommended_high) == (1.0, 0.9, 1.1)
    assert table.rows[-1].printed == 90.02
    assert table.rows[-1].dissertation == pytest.approx(99.0 - 0.45)


def test_accuracy_is_the_error_against_the_truth_and_the_share_of_intervals_that_hold_it():
    rows = {row.quantity: row for row in accuracy_table(study()).rows}
    assert rows["stiffness: mean error"].dissertation == pytest.approx(20.0, abs=0.5)
    assert rows["stiffness: mean error"].recommended == pytest.approx(1.0)
    assert rows["damping: RMS error"].recommended == pytest.approx(1.0)
    coverage = rows["inertia: coverage of the 95 % intervals"]
    assert (coverage.dissertation, coverage.recommended) == (0.0, 100.0)
    assert rows["VAF, mean over people and timing points"].printed == 90.62


@pytest.mark.parametrize(("worse_with_vaf", "expected"), [(True, 1.0), (False, -1.0)])
def test_the_rank_correlation_says_whether_a_higher_vaf_means_a_smaller_error(
    worse_with_vaf, expected
):
    found = study()
    table = found.estimates.copy()
    ours = table["source"] == "dissertation"
    true = table.loc[table["source"] == "truth", "value"].to_numpy()
    grow = np.tile(np.arange(60), (3, 1)).T.ravel()
    table.loc[ours, "value"] = true * (1.0 + 0.01 * (1 + grow))
    table.loc[ours, "vaf_pct"] = 90.0 + 0.1 * (grow if worse_with_vaf else -grow)
    rows = accuracy_table(WalkedStudy(PEOPLE, table, found.population, {})).rows
    rank = [row.dissertation for row in rows if "rank correlation" in row.quantity]
    assert rank == pytest.approx([expected] * 3)


def test_statistics_of_the_simulated_people_count_people_and_say_what_is_true():
    claims = {row.claim: row for row in simulated_statistics(study(), None).rows}
    point = claims["stiffness, timing point, by the recommended method"]
    assert point.ours.startswith("F(5, 45.0) = ")
    assert point.verdict == "reproduced"
    assert claims["inertia, timing point, by the recommended method"].verdict == "not tested"
    assert claims["inertia, timing point, by the dissertation's method"].verdict == "not reproduced"


def test_missing_cells_and_people_are_used_and_counted():
    found = study(refused={("recommended", "stiffness_per_mass", "S04")})
    table = found.estimates.copy()
    ours = (table["source"] == "recommended") & (table["parameter"] == "stiffness_per_mass")
    table.loc[ours & (table["timing_point"] == "ISW"), "value"] = None
    table.loc[
        ours & (table["timing_point"] == "LRE") & (table["participant"] == "S01"), "value"
    ] = None
    rows = simulated_statistics(WalkedStudy(PEOPLE, table, found.population, {}), None).rows
    claim = next(r for r in rows if r.claim == "stiffness, timing point, by the recommended method")
    assert claim.ours.startswith("F(4, ")
    assert "1 cell without a value, 1 person without a value, 1 timing point" in claim.remark


@pytest.mark.parametrize(("shift", "verdict"), [(0.0, "reproduced"), (0.2, "not reproduced")])
def test_the_device_is_found_to_change_gait_where_it_does(shift, verdict):
    whole = study()
    found = WalkedStudy(PEOPLE, whole.estimates, whole.population, gait(shift))
    tables, curves = simulated_chapter(found)
    rows = [r for r in tables[-1].rows if r.where in ("4.3.1", "4.4")]
    assert [r.verdict for r in rows] == [verdict] * 3
    assert ("different at 0 to 100 %" in rows[0].ours) == (shift > 0)
    assert curves["device_effect"]["n_people"] == 10
    json.dumps(curves, allow_nan=False)


def test_estimates_that_do_not_stand_have_no_value():
    parameters = (
        ParameterEstimate("stiffness", 70.0, 60.0, 80.0, "ok"),
        ParameterEstimate("stiffness_per_mass", 1.0, 0.9, 1.1, "ok"),
        ParameterEstimate("inertia", 0.1, 0.0, 0.3, "undecided"),
    )
    cell = CellEstimate("S01", "LRE", 7.0, parameters, 99.0, 3, 0, "recommended")
    rows = estimated("recommended", [cell])
    assert [(r["parameter"], r["value"]) for r in rows] == [
        ("stiffness_per_mass", 1.0),
        ("inertia", None),
    ]


def test_the_truth_is_per_kg_where_the_tables_are(tmp_path):
    point = {"stiffness": 140.0, "damping": 2.8, "inertia": 0.05, "onset_gait_pct": 7.1}
    content = {"participants": {"S01": {"perturbed": {"timing_points": {"LRE": point}}}}}
    (tmp_path / "ground_truth.json").write_text(json.dumps(content), encoding="utf-8")
    rows = {row["parameter"]: row["value"] for row in true_values(tmp_path, {"S01": 70.0})}
    assert rows == pytest.approx(
        {"stiffness_per_mass": 2.0, "damping_per_mass": 0.04, "inertia": 0.05}
    )
    assert [row["parameter"] for row in true_values(tmp_path, {"S01": None})] == ["inertia"]
