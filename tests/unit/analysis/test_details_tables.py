"""The tables of what stands behind the estimates hold what the cells hold."""

import numpy as np

from jointz.analysis.page.details_tables import details_frame, models_frame
from jointz.results.study_analysis import StudyAnalysis


def test_an_undecided_estimate_keeps_its_unbounded_value(recommended):
    (row,) = details_frame(recommended).query("status == 'undecided'").to_dict("records")
    assert np.isnan(row["value"])
    assert row["unbounded"] > 0.0


def test_gravity_belongs_to_the_stiffness(recommended):
    table = details_frame(recommended)
    corrected = table["stiffness_gravity_corrected"]
    assert corrected.notna().eq(table["parameter"] == "stiffness").all()
    off = table["unbounded"] - corrected
    np.testing.assert_allclose(off[table["parameter"] == "stiffness"], 10.0)


def test_without_doubts_there_is_no_row():
    assert models_frame(StudyAnalysis(cells=())).empty
