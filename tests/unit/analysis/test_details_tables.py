"""The tables of what stands behind the estimates hold what the cells hold."""

import numpy as np
import pytest

from jointz.analysis.page.details_tables import (
    SOURCES,
    details_frame,
    models_frame,
)
from jointz.results.study_analysis import StudyAnalysis


def test_the_whole_sd_is_that_of_its_independent_sources(recommended):
    table = details_frame(recommended)
    parts = table[[f"sd_{source}" for source in SOURCES]].to_numpy()
    np.testing.assert_allclose(table["sd"], np.sqrt((parts**2).sum(axis=1)))


def test_an_undecided_estimate_keeps_its_unbounded_value_and_its_budget(recommended):
    (row,) = details_frame(recommended).query("status == 'undecided'").to_dict("records")
    assert np.isnan(row["value"])
    assert row["unbounded"] > 0.0
    assert row["sd"] == pytest.approx(0.4 * row["unbounded"])


def test_gravity_belongs_to_the_stiffness(recommended):
    table = details_frame(recommended)
    corrected = table["stiffness_gravity_corrected"]
    assert corrected.notna().eq(table["parameter"] == "stiffness").all()
    off = table["unbounded"] - corrected
    np.testing.assert_allclose(off[table["parameter"] == "stiffness"], 10.0)


def test_models_are_one_row_a_person(recommended):
    table = models_frame(recommended)
    assert list(table["participant"]) == ["S01", "S02", "S03"]
    assert list(table["lag_s"]) == pytest.approx([0.004, 0.007, 0.010])
    assert models_frame(StudyAnalysis(cells=())).empty
