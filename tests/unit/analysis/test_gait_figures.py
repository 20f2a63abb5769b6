"""Mean strides and the example of a pulse in an analysis, and their figures."""

import numpy as np
import pytest

import jointz
from jointz.analysis.page.captions import captions
from jointz.core.codes import Exclusion
from jointz.io.recordings import read_recording
from jointz.io.study_reader import open_study


@pytest.fixture(scope="module", params=["strapped", "rigid", "dissertation"])
def analysis(request, small_study_source):
    if request.param == "strapped":
        return jointz.load(request.getfixturevalue("strapped_results") / "results")
    if request.param == "rigid":
        return request.getfixturevalue("rigid_analysis")
    return jointz.analyze(small_study_source, method=request.param, resamples=2, progress=False)


def test_an_example_is_a_used_pulse_and_its_response_is_measured_minus_baseline(analysis):
    used = {(p.recording, p.onset_s) for p in analysis.pulses if not p.code}
    examples = [c for c in analysis.cells if c.example is not None]

    assert examples
    for cell in examples:
        example = cell.example
        assert (example.recording, pytest.approx(example.onset_s)) in [
            (file, onset) for file, onset in used
        ]
        fits_angle = cell.response.fitted_angle is not None
        measured = example.angle if fits_angle else example.torque
        baseline = example.baseline_angle if fits_angle else example.baseline_torque
        np.testing.assert_allclose(
            np.abs(example.response), np.abs(measured - baseline), rtol=0, atol=1e-9
        )
        # The pulse resembles the average that was fitted.
        average = cell.response.angle if fits_angle else cell.response.torque
        own = np.interp(cell.response.time_s, example.time_s, example.response)
        assert np.corrcoef(own, average)[0, 1] > 0.9


def test_an_example_shows_what_was_recorded(analysis, small_study_source):
    study = open_study(small_study_source)
    if analysis.settings["method"] == "dissertation":
        return  # its signals are filtered
    cell = next(c for c in analysis.cells if c.example is not None)
    entry = next(e for e in study.spec.recordings if e.file == cell.example.recording)
    recording = read_recording(study, entry)[0]
    at = cell.example.onset_s + cell.example.time_s

    recorded = np.interp(at, recording["time"].to_numpy(), recording["angle"].to_numpy())
    assert np.abs(cell.example.angle - recorded).max() < 0.01


def test_mean_strides_are_those_of_each_condition_and_survive_a_round_trip(analysis, tmp_path):
    conditions = {(m.participant, m.condition) for m in analysis.mean_strides}
    walked = {(s.participant, s.condition) for s in analysis.strides if not s.code}
    assert conditions == walked
    for mean in analysis.mean_strides:
        clean = [
            s
            for s in analysis.strides
            if (s.participant, s.condition) == (mean.participant, mean.condition) and not s.code
        ]
        if mean.condition != "perturbed":  # a pulse does not exclude its stride
            assert mean.n_strides == len(clean)
        assert mean.n_strides <= len(clean)
        assert 0.5 < np.ptp(mean.angle) < 2.0
        assert (mean.torque is None) == (mean.condition == "no_device")
    analysis.save(tmp_path / "saved", figures=False)
    assert jointz.load(tmp_path / "saved").mean_strides == analysis.mean_strides


def test_figures_are_captioned(rigid_analysis):
    texts = captions(rigid_analysis)

    assert "SD between participants" in texts["gait"]
    assert "statistical parametric mapping" not in texts["gait"]  # of two people
    assert Exclusion.USER.value not in texts["pulse_example"]
    assert "of median VAF" in texts["pulse_example"]
