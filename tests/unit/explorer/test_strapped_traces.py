"""Results of the method strapped looked through: traces by shape of pulse, new estimates."""

import shutil

import numpy as np
import pytest

from jointz.analysis.analyze import analyze
from jointz.explorer.exclusions import decide
from jointz.explorer.reestimation import ReestimationRequest, reestimate
from jointz.explorer.results_files import cell_of, open_results, pulses_of
from jointz.explorer.traces import PulseKey
from jointz.report.wording import onset_note

METHOD = "strapped"


@pytest.fixture(scope="module")
def opened(strapped_results):
    return open_results(strapped_results / "results")


@pytest.fixture(scope="module")
def again(opened):
    request = ReestimationRequest.of(opened.analysed)
    return reestimate(opened.study, opened.people[0], request)


def test_nothing_changed_gives_the_same_numbers(opened, again):
    now = opened.with_result(again.participant, again.result).current()

    assert now.cells == opened.analysed.cells
    assert now.population == opened.analysed.population
    assert again.result.evidence == ()


def test_responses_of_a_shape_make_its_average_and_have_its_fit(opened, again):
    for point in {c.timing_point for c in opened.analysed.cells}:
        cell = cell_of(opened.analysed, again.participant, point)
        windows = [
            again.traces[PulseKey.of(p)].windows[METHOD]
            for p in pulses_of(opened.analysed, again.participant, point)
            if not p.code
        ]
        assert {w.fits for w in windows} == {"angle"}
        if cell.response is None:
            continue
        kept = slice(np.argmin(np.abs(windows[0].time_s - cell.response.time_s[0])), None)
        shapes = {round(float(np.nanmax(np.abs(w.fitted))), 9) for w in windows}
        sizes = [w for w in windows if _like(w, cell.response)]
        angle = np.mean([w.sign * w.response_angle for w in sizes], axis=0)[kept]
        n = cell.response.time_s.size
        np.testing.assert_allclose(angle[:n], cell.response.angle, atol=1e-9)
        np.testing.assert_allclose(
            sizes[0].sign * sizes[0].fitted[kept][:n], cell.response.fitted_angle
        )
        assert len(sizes) == len(windows) or len(shapes) > 1


def _like(window, response):
    """Whether a window has the fit of the most frequent shape, sign included."""
    signed = window.sign * np.interp(response.time_s, window.time_s, window.fitted)
    return bool(np.allclose(signed, response.fitted_angle, equal_nan=True))


def test_an_excluded_pulse_gives_what_a_fresh_analysis_gives(opened, again, tmp_path):
    point = opened.analysed.cells[0].timing_point
    pulse = pulses_of(opened.analysed, opened.people[0], point)[0]
    shutil.copytree(opened.study.root, tmp_path / "study")
    shutil.copytree(opened.folder, tmp_path / "results")
    found = open_results(tmp_path / "results")
    found = found.with_study(decide(found.study, pulse, "exclude", reason="stumbled"))

    made = reestimate(found.study, pulse.participant, ReestimationRequest.of(found.analysed))
    now = found.with_result(pulse.participant, made.result).current()

    fresh = analyze(found.study.root, method=METHOD, resamples=20)
    for name in ("cells", "comparison", "population", "pulses", "log_posteriors"):
        assert getattr(now, name) == getattr(fresh, name), name
    trace = made.traces[PulseKey.of(pulse)]
    assert trace.if_restored
    window, before = trace.windows[METHOD], again.traces[PulseKey.of(pulse)].windows[METHOD]
    np.testing.assert_allclose(window.response_angle, before.response_angle)
    assert window.fitted is None  # it is no part of the fit


def test_the_page_says_which_stiffness_is_which(opened):
    names = [p.name for p in opened.analysed.cells[0].parameters]

    assert "stiffness_onset" in names
    assert onset_note(names)
