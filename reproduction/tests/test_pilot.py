"""The pilot beside print, on two made-up people."""

import json

import pandas as pd
import pytest
from reproduction.chapter4.figures import draw_chapter4
from reproduction.chapter4.reproduce_chapter4 import PilotStudy, pilot_results
from reproduction.chapter4.walking import COLUMNS

from jointz.core.gait_phases import TIMING_POINTS

BASE = {"stiffness_per_mass": 1.0, "damping_per_mass": 0.04, "inertia": 0.05}


def pilot(refused=""):
    rows = [
        {
            "source": source,
            "participant": person,
            "timing_point": point,
            "parameter": name,
            "value": None
            if (source, person) == ("recommended", refused)
            else base * (1 + i) * (1.0 if person == "S01" else 3.0),
            "status": "ok",
            "vaf_pct": {"pilot": 95.0, "recommended": 99.0}.get(source),
        }
        for source in ("pilot", "recommended", "truth")
        for person in ("S01", "S02")
        for i, point in enumerate(TIMING_POINTS)
        for name, base in BASE.items()
    ]
    return PilotStudy(("S01", "S02"), pd.DataFrame(rows, columns=list(COLUMNS)))


def test_largest_and_smallest_average_over_two_people_stand_beside_print():
    table, _ = pilot_results(pilot())
    rows = {row.quantity: row for row in table.rows}
    largest = rows["largest average stiffness"]
    assert (largest.printed, largest.dissertation, largest.truth) == (2.99, 12.0, 12.0)
    assert rows["smallest average damping"].dissertation == pytest.approx(0.08)
    assert rows["VAF of person 2"].printed == 84.84
    assert rows["VAF of both"].recommended == 99.0


def test_half_a_pilot_is_no_average_and_says_who_is_missing():
    table, curves = pilot_results(pilot(refused="S02"))
    rows = {row.quantity: row for row in table.rows}
    assert rows["largest average inertia"].recommended is None
    assert rows["largest average inertia"].note == "recommended: undecided in S02"
    assert curves["parameters"]["inertia"]["recommended"]["mean"] == {}
    assert curves["parameters"]["inertia"]["recommended"]["people"][1]["LRE"][0] is None
    json.dumps(curves, allow_nan=False)
    assert len(draw_chapter4({"pilot": curves})) == 1  # without a mark of what is missing
