"""Results of the method strapped looked through: traces by shape of pulse, new estimates."""

import shutil

import numpy as np
import pytest

from jointz.analysis.analyze import analyze
from jointz.explorer.exclusions import decide
from jointz.explorer.plots import Overlaid, overlay_figure
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


def test_every_shape_of_pulse_has_its_average_and_fit_as_signed(opened, traces):
    shapes = set()
    for cell in (c for c in opened.analysed.cells if c.participant == opened.people[0]):
        pulses = [
            p for p in pulses_of(opened.analysed, cell.label, cell.timing_point) if not p.code
        ]
        for shape, response in enumerate(cell.responses):
            windows = [traces[PulseKey.of(p)].windows[METHOD] for p in pulses]
            windows = [w for w in windows if w.shape == shape]
            assert len(windows) == response.n_pulses
            shapes.add(shape)
            start = np.argmin(np.abs(windows[0].time_s - response.time_s[0]))
            kept = slice(start, start + response.time_s.size)
            angle = np.mean([w.response_angle for w in windows], axis=0)[kept]
            np.testing.assert_allclose(angle, response.angle, atol=1e-9)
            np.testing.assert_allclose(windows[0].fitted[kept], response.fitted_angle)
            assert {w.fits for w in windows} == {"angle"}
        if cell.responses:
            assert sum(r.n_pulses for r in cell.responses) == cell.n_used == len(pulses)
    assert len(shapes) > 1


def test_averages_lie_among_the_pulses_that_they_average(opened, traces):
    cell = opened.analysed.cells[0]
    windows = [
        (p, traces[PulseKey.of(p)].windows[METHOD])
        for p in pulses_of(opened.analysed, cell.label, cell.timing_point)
    ]
    pulses = [Overlaid(k, w, used=not p.code) for k, (p, w) in enumerate(windows)]

    for quantity in ("angle", "torque"):
        data = overlay_figure(pulses, None, quantity=quantity)["data"]
        averages = [t for t in data if t["name"].startswith("average")]
        drawn = np.array([t["y"] for t in data if t["name"].startswith("pulse")])
        assert len(averages) == len(cell.responses) > 1
        assert averages[0]["name"] == f"average by shape, size and sign ({len(averages)})"
        for average in averages:
            assert (average["y"] <= drawn.max(axis=0) + 1e-9).all()
            assert (average["y"] >= drawn.min(axis=0) - 1e-9).all()
        # Pulses push both ways, and so do their averages.
        ends = [average["y"][np.argmax(np.abs(average["y"]))] for average in averages]
        assert min(ends) < 0.0 < max(ends)
    fits = [t for t in overlay_figure(pulses, None, quantity="angle")["data"] if t["name"] == "fit"]
    assert len(fits) == len(cell.responses)


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
    trace = traces_of(found)[key]
    assert trace.if_restored
    window = trace.windows[METHOD]
    np.testing.assert_allclose(window.response_angle, before.response_angle)
    assert window.fitted is None  # it is no part of the fit


def test_the_page_says_which_stiffness_is_which(opened):
    names = [p.name for p in opened.analysed.cells[0].parameters]

    assert "stiffness_onset" in names
    assert onset_note(names)
