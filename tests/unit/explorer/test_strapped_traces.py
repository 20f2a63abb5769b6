"""Results of the method strapped looked through: traces by shape of pulse, new estimates."""

import shutil

import numpy as np
import pytest

from jointz.analysis.analyze import analyze
from jointz.explorer.exclusions import decide
from jointz.explorer.reestimation import ReestimationRequest, read_traces, reestimate
from jointz.explorer.results_files import open_results, pulses_of
from jointz.explorer.traces import PulseKey
from jointz.report.wording import onset_note

METHOD = "strapped"


@pytest.fixture(scope="module")
def opened(strapped_results):
    return open_results(strapped_results / "results")


def traces_of(found):
    request = ReestimationRequest.of(found.analysed)
    return read_traces(found.study, found.people[0], request, found.current())


@pytest.fixture(scope="module")
def traces(opened):
    return traces_of(opened)


def test_nothing_changed_gives_the_same_numbers(opened):
    person = opened.people[0]
    result = reestimate(opened.study, person, ReestimationRequest.of(opened.analysed))
    now = opened.with_result(person, result).current()

    assert now.cells == opened.analysed.cells
    assert now.population == opened.analysed.population
    assert result.evidence == ()


def test_an_excluded_pulse_gives_what_a_fresh_analysis_gives(opened, traces, tmp_path):
    point = opened.analysed.cells[0].timing_point
    pulse = pulses_of(opened.analysed, opened.people[0], point)[0]
    shutil.copytree(opened.study.root, tmp_path / "study")
    shutil.copytree(opened.folder, tmp_path / "results")
    found = open_results(tmp_path / "results")
    found = found.with_study(decide(found.study, pulse, "exclude", reason="stumbled"))
    key, before = PulseKey.of(pulse), traces[PulseKey.of(pulse)].windows[METHOD]

    # Until an estimation is asked for, curves are those of the numbers beside them.
    waiting = traces_of(found)[key].windows[METHOD]
    assert waiting.shape == before.shape
    np.testing.assert_array_equal(waiting.fitted, before.fitted)

    request = ReestimationRequest.of(found.analysed)
    found = found.with_result(
        pulse.participant, reestimate(found.study, pulse.participant, request)
    )
    now, fresh = found.current(), analyze(found.study.root, method=METHOD, resamples=20)
    for name in ("cells", "comparison", "population", "pulses", "log_posteriors"):
        assert getattr(now, name) == getattr(fresh, name), name
    window = traces_of(found)[key].windows[METHOD]
    np.testing.assert_allclose(window.response_angle, before.response_angle)
    assert window.fitted is None  # it is no part of the fit


def test_the_page_says_which_stiffness_is_which(opened):
    names = [p.name for p in opened.analysed.cells[0].parameters]

    assert "stiffness_onset" in names
    assert onset_note(names)
