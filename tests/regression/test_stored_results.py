"""Results that earlier versions stored are still read, to the last digit.

``make_results.py`` made them; the truth is a spring, damper and inertia.
"""

import json
from pathlib import Path

import numpy as np
import pytest

from jointz.core.codes import Exclusion, Failure
from jointz.results.series.joint_fit import JointFit
from jointz.results.study_analysis import StudyAnalysis

HERE = Path(__file__).parent
TRUTH = {
    "soft": {"stiffness": 40.0, "damping": 1.0, "inertia": 0.05},
    "stiff": {"stiffness": 90.0, "damping": 1.5, "inertia": 0.05},
}
#: Less than half a percent is left by the differences and the filter at 250 Hz.
RELATIVE = 0.005


def stored(name: str) -> dict:
    return json.loads((HERE / name).read_text(encoding="utf-8"))


@pytest.fixture(scope="module")
def analysis() -> StudyAnalysis:
    return StudyAnalysis.from_dict(stored("study_analysis_1.json"))


@pytest.fixture(scope="module")
def fit() -> JointFit:
    return JointFit.from_dict(stored("joint_fit_1.json"))


def test_the_stored_analysis_still_holds_its_estimates(analysis):
    table = analysis.to_frame().set_index(["participant", "parameter"])

    found = {key: row["value"] for key, row in table.iterrows() if key[0] != "lone"}
    assert found == {
        ("soft", "stiffness"): 40.105623538990194,
        ("soft", "damping"): 0.9986399002523301,
        ("soft", "inertia"): 0.05021608357280206,
        ("soft", "stiffness_per_mass"): 0.5729374791284313,
        ("soft", "damping_per_mass"): 0.014266284289319002,
        ("stiff", "stiffness"): 90.14486128621917,
        ("stiff", "damping"): 1.5022759337615061,
        ("stiff", "inertia"): 0.05020547097720906,
    }
    assert set(table.loc[["soft", "stiff"], "status"]) == {"ok"}
    assert table.loc[("soft", "stiffness"), "ci_low"] == 40.10562353854272
    assert analysis.n_standing == 8


def test_the_stored_analysis_still_says_what_failed(analysis):
    table = analysis.to_frame().query("participant == 'lone'")

    assert set(table["status"]) == {Failure.TOO_FEW_PULSES.status}
    assert table["value"].isna().all()
    (left_out,) = analysis.excluded_frame().to_dict("records")
    assert (left_out["onset_s"], left_out["code"]) == (1.004, Exclusion.LONE_PULSE)


def test_the_stored_analysis_still_has_its_responses_pulses_and_means(analysis):
    response = analysis.cells[0].response

    assert response.time_s.shape == (25,)
    assert response.fitted_torque[20] == 4.9786670443321475
    assert np.abs(response.angle).max() == analysis.cells[0].displacement_rad
    assert len(analysis.pulses) == 9
    assert analysis.population[0].value == 65.12524241260468
    assert analysis.settings["seed"] == 1
    assert analysis.provenance["jointz"] == "0.1.0"


def test_the_stored_results_are_near_the_truth(analysis, fit):
    for result in (*analysis.cells, fit):
        case = getattr(result, "participant", "soft")
        for name, truth in TRUTH.get(case, {}).items():
            assert result.parameter(name).value == pytest.approx(truth, rel=RELATIVE)


def test_the_stored_fit_still_holds_its_numbers(fit):
    assert {p.name: (p.value, p.ci_low, p.ci_high) for p in fit.parameters} == {
        "stiffness": (40.00692199942993, 40.00456374562555, 40.0092802532343),
        "damping": (1.0005889358214415, 1.0003823099693412, 1.0007955616735418),
        "inertia": (0.050003878586383305, 0.04999725756260918, 0.05001049961015743),
    }
    assert fit.vaf_pct == 99.99998786261746
    assert fit.covariance[0][0] == 9.946191315434822e-07
    assert (fit.estimator, fit.status, fit.n_samples) == ("admittance", "ok", 950)
    assert len(fit.series.measured) == len(fit.series.modelled) == 950


@pytest.mark.parametrize(
    ("name", "result"), [("study_analysis_1.json", StudyAnalysis), ("joint_fit_1.json", JointFit)]
)
def test_what_was_stored_is_written_again_as_it_stood(name, result):
    plain = stored(name)

    again = json.loads(json.dumps(result.from_dict(plain).to_dict(), allow_nan=False))

    assert as_far_as(plain, again) == plain
    assert plain["schema"].endswith("/1")


def as_far_as(old, new):
    """Return what is new without the keys that the old one did not have yet."""
    if isinstance(old, dict):
        return {key: as_far_as(old[key], value) for key, value in new.items() if key in old}
    if isinstance(old, list) and len(old) == len(new):
        return [as_far_as(*pair) for pair in zip(old, new, strict=True)]
    return new
