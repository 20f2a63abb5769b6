"""The benchmark of certificates: promised beside true errors."""

import json

import pytest
from benchmarks.certificate import main, simulated_study

from jointz.results.certificate_result import PARAMETERS

FEW = ["--participants", "1", "--per-point", "3", "--people", "1"]


def test_a_study_from_elsewhere_has_promised_and_true_errors(tmp_path):
    study, truth = simulated_study(
        tmp_path / "study", "nominal", participants=1, per_point=3, seed=1
    )
    file = tmp_path / "truth.json"
    file.write_text(json.dumps(truth))

    (result,) = main(["--study", str(study), "--truth", str(file), *FEW]).values()

    assert result["status"] == "cannot_promise"
    assert list(result["parameters"]) == list(PARAMETERS)
    row = result["parameters"]["stiffness"]
    assert row["true"] > 0.0
    assert row["ratio"] == pytest.approx(row["promised"] / row["true"])


@pytest.mark.slow
def test_realistic_people_are_promised_what_they_get():
    """Few people: the RMSE of J is known to a third."""
    (result,) = main(
        ["--studies", "1", "--participants", "3", "--per-point", "10", "--people", "5"]
    ).values()

    assert result["status"] == "promised"
    assert 0.3 < result["parameters"]["inertia"]["ratio"] < 3.0
