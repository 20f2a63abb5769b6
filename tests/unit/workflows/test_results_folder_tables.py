"""Which tables a results folder has, and when."""

import numpy as np
import pandas as pd

from jointz.core.analysis import StudyAnalysis
from jointz.core.estimates import CellEstimate, ParameterEstimate
from jointz.core.participant_model import ParticipantModel
from jointz.report.details import details_frame
from jointz.workflows.results_folder import write_results


def analysis(*, models=()):
    undecided = ParameterEstimate("stiffness", None, None, None, "undecided", unbounded=21.5)
    cell = CellEstimate(
        "S01", "ISW", 68.4, (undecided,), 99.9, 50, 0, "recommended",
        displacement_rad=0.31, centre_gait_pct=73.1,
        budget={"stiffness": {"noise": 3.0, "lag": 4.0}},
    )  # fmt: skip
    return StudyAnalysis((cell,), models=models)


def test_details_are_written_for_every_analysis(tmp_path):
    write_results(analysis(), tmp_path / "out")
    table = pd.read_csv(tmp_path / "out" / "details.csv")
    (row,) = table.to_dict("records")
    assert row["unbounded"] == 21.5
    assert row["sd"] == 5.0
    assert np.isnan(row["value"])
    assert list(table.columns) == list(details_frame(StudyAnalysis(cells=())).columns)
    assert not (tmp_path / "out" / "models.csv").exists()


def test_models_are_written_where_there_are_any(tmp_path):
    found = ParticipantModel("S01", 0.0064, 0.001, 1.1, 0.1, 0.02, 0.97, 0.0, 939, ("a", "b"))
    write_results(analysis(models=(found,)), tmp_path / "out")
    (row,) = pd.read_csv(tmp_path / "out" / "models.csv").to_dict("records")
    assert row == found.to_dict() | {"doubts": "a b"}
