"""Results that state their errors are compared by one model of all people."""

import json

import numpy as np
import pandas as pd
import pytest

from jointz.comparison.compare import compare_results
from jointz.core.errors import DataError
from jointz.results.estimates import CellEstimate, ParameterEstimate

from .results_folders import POINTS, estimates, said

WHOLE = ("stiffness", "damping", "inertia")
#: Of the estimates, relative.
ERROR = 0.05


def number(value):
    return None if pd.isna(value) else float(value)


def cells_of(table, *, error=ERROR):
    """Return the cells of the method rigid behind a table of estimates."""
    cells = []
    for (person, point), rows in table.groupby(["participant", "timing_point"], sort=False):
        parameters, budget = [], {}
        for row in rows.to_dict("records"):
            size = abs(row["value"]) if np.isfinite(row["value"]) else 75.0
            parameters.append(
                ParameterEstimate(
                    row["parameter"], number(row["value"]), number(row["ci_low"]),
                    number(row["ci_high"]), row["status"], unbounded=size,
                )
            )  # fmt: skip
            if row["parameter"] in WHOLE:
                decided = row["status"] == "ok"
                budget[row["parameter"]] = {"noise": (error if decided else 1.0) * size}
        cells.append(
            CellEstimate(
                person, point, POINTS[point], tuple(parameters), 99.0, 50, 0, "rigid", budget=budget
            )
        )
    return cells


@pytest.fixture
def stated(results):
    """Write a results folder with the errors of its estimates, and return its path."""

    def write(name, table, *, analysed=None, masses=70.0, **options):
        people = [{"id": p, "mass_kg": masses} for p in table["participant"].unique()]
        folder = results(name, table=table, participants=people)
        cells = cells_of(table if analysed is None else analysed, **options)
        content = {"cells": [cell.to_dict() for cell in cells], "log_posteriors": []}
        (folder / "analysis.json").write_text(json.dumps(content))
        return folder

    return write


def of_stiffness(made):
    return [d for d in made.differences if d.parameter == "stiffness_per_mass"]


def test_the_same_people_in_two_conditions_are_one_model(stated):
    usual, stiffer = estimates(seed=0), estimates(seed=1, scale=1.2)
    made = compare_results([stated("stiffer", stiffer), stated("usual", usual)])
    for difference in of_stiffness(made):
        assert difference.effect == "d_z"
        assert difference.t is None
        assert 0.12 < difference.difference / difference.mean_second < 0.28
        assert difference.p < 0.05
    assert {m.status for m in made.means} == {"ok"}
    assert said(made, "all participants together")


def of_coupling(folder, coupling):
    file = folder / "provenance.json"
    content = json.loads(file.read_text())
    content["settings"]["coupling"] = coupling
    file.write_text(json.dumps(content))
    return folder


def test_strapped_of_earlier_versions_is_one_method_with_bayesian_and_couplings_are_named(stated):
    old = stated("old", estimates(seed=0).assign(method="strapped"))
    new = stated("new", estimates(seed=1).assign(method="bayesian"))
    made = compare_results([of_coupling(new, "strap"), old])
    assert {d.effect for d in of_stiffness(made)} == {"d_z"}
    assert not said(made, "different methods")
    assert said(made, "the prior draws the inertias")
    (note,) = said(compare_results([of_coupling(new, "rigid"), old]), "different methods")
    assert "new by bayesian with the coupling rigid" in note
    assert "old by bayesian with the coupling strap" in note


def test_the_earlier_rigid_is_another_method(stated):
    old = stated("old", estimates(seed=0))
    new = stated("new", estimates(seed=1).assign(method="bayesian"))
    made = compare_results([of_coupling(new, "rigid"), old])
    assert said(made, "different methods")[0].startswith("WARNING: ")
    assert {d.effect for d in of_stiffness(made)} == {"g_z"}
    assert said(made, "new and old: means are of all participants together")


def test_an_undecided_person_counts_by_what_the_data_say(stated):
    table = estimates()
    at = (table["participant"] == "B") & (table["parameter"].str.startswith("stiffness"))
    table.loc[at, ["value", "ci_low", "ci_high"]] = np.nan
    table.loc[at, "status"] = "undecided"
    made = compare_results([stated("a", table), stated("b", estimates(seed=1))])
    mean = next(m for m in made.means if (m.source, m.parameter) == ("a", "stiffness_per_mass"))
    assert (mean.n, mean.n_missing) == (5, 0)
    assert {d.n_first for d in of_stiffness(made)} == {5}
    assert not made.missing


def test_undecided_differences_count_in_the_adjustment(stated):
    """Otherwise only significant ones would be left, and adjusted for each other alone."""
    table = estimates(seed=0)
    loud = stated("a", table, error=1.5)
    made = compare_results([loud, stated("b", estimates(seed=1), error=1.5)])
    assert {d.status for d in of_stiffness(made)} == {"undecided"}
    for difference in of_stiffness(made):
        assert difference.difference is None
        assert difference.p is not None
        assert difference.p_adjusted >= difference.p
    assert not made.available


def test_an_analysis_that_is_not_that_of_the_estimates_is_refused(stated):
    one, other = estimates(seed=0), estimates(seed=3)
    with pytest.raises(DataError, match=r"analysis\.json: does not agree with estimates\.csv"):
        compare_results([stated("a", one, analysed=other), stated("b", one)])


@pytest.mark.parametrize("mass", [0.0, "abc", -4.0])
def test_a_mass_that_is_none_is_refused(stated, mass):
    with pytest.raises(DataError, match=r"provenance\.json"):
        compare_results([stated("a", estimates(), masses=mass), stated("b", estimates(seed=1))])


def test_an_analysis_that_cannot_be_read_is_refused(stated):
    folder = stated("a", estimates())
    (folder / "analysis.json").write_text('{"cells": [{}]}')
    with pytest.raises(DataError, match=r"analysis\.json: cannot be read"):
        compare_results([folder])


def test_timing_points_of_one_folder_are_compared(stated):
    made = compare_results([stated("a", estimates())])
    assert {(d.first, d.second) for d in of_stiffness(made)} == {
        ("LRE", "MST"), ("LRE", "TST"), ("MST", "TST"),
    }  # fmt: skip
    assert all(d.effect == "d_z" for d in of_stiffness(made))
