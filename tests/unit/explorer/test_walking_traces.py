"""Walking results explored: traces by shape of pulse, new estimates, earlier versions."""

import shutil
from dataclasses import replace

import numpy as np
import pytest

import jointz
from jointz.analysis.pulse_traces import PulseKey, ReestimationRequest, read_traces
from jointz.core.errors import DataError
from jointz.explorer.exclusions import decide
from jointz.explorer.reestimation import reestimate
from jointz.explorer.results_files import open_results, pulses_of
from jointz.report.wording import onset_note
from jointz.results.estimates import Response

METHOD = "bayesian"
COUPLINGS = {"strapped": "strap", "rigid": "rigid"}


@pytest.fixture(scope="module", params=list(COUPLINGS))
def opened(request, strapped_results, tmp_path_factory):
    """Results of a study that states no coupling, by the method with each."""
    if request.param == "strapped":
        return open_results(strapped_results / "results")
    above = shutil.copytree(strapped_results, tmp_path_factory.mktemp("rigid") / "above")
    made = jointz.analyze(above / "study", method=request.param, resamples=20)
    made.save(above / "results", figures=False, overwrite=True)
    return open_results(above / "results")


def traces_of(found):
    request = ReestimationRequest.of(found.analysed)
    return read_traces(found.study, found.people[0], request, found.current())


def reestimated(found):
    person = found.people[0]
    result = reestimate(found.study, person, ReestimationRequest.of(found.analysed))
    return found.with_result(person, result)


def first_pulse(found):
    point = found.analysed.cells[0].timing_point
    return pulses_of(found.analysed, found.people[0], point)[0]


def earlier(opened, method, cells):
    """Return results as an earlier version named them."""
    settings = {**opened.analysed.settings, "method": method}
    del settings["coupling"]
    cells = tuple(replace(cell, method=method) for cell in cells)
    return replace(opened, analysed=replace(opened.analysed, cells=cells, settings=settings))


def test_nothing_changed_gives_the_same_numbers(opened):
    now = reestimated(opened).current()

    assert now.cells == opened.analysed.cells
    assert now.population == opened.analysed.population
    assert now.log_posteriors == opened.analysed.log_posteriors
    name = next(n for n, c in COUPLINGS.items() if c == opened.analysed.settings["coupling"])
    assert f"--method {name}" in opened.command()


def test_an_excluded_pulse_gives_what_a_fresh_analysis_gives(opened, tmp_path):
    pulse = first_pulse(opened)
    shutil.copytree(opened.study.root, tmp_path / "study")
    shutil.copytree(opened.folder, tmp_path / "results")
    found = open_results(tmp_path / "results")
    found = found.with_study(decide(found.study, pulse, "exclude", reason="stumbled"))
    key = PulseKey.of(pulse)
    before = traces_of(opened)[key].windows[METHOD]

    # Until an estimation is asked for, curves are those of the numbers beside them.
    waiting = traces_of(found)[key].windows[METHOD]
    assert waiting.shape == before.shape
    np.testing.assert_array_equal(waiting.fitted, before.fitted)

    found = reestimated(found)
    request = ReestimationRequest.of(found.analysed)
    now = found.current()
    fresh = jointz.analyze(found.study.root, method=request.method, resamples=20)
    for name in ("cells", "comparison", "population", "pulses", "log_posteriors"):
        assert getattr(now, name) == getattr(fresh, name), name
    window = traces_of(found)[key].windows[METHOD]
    np.testing.assert_allclose(window.response_angle, before.response_angle)
    assert window.fitted is None  # it is not part of the fit


def test_responses_are_arrays_of_averages_and_with_the_study_of_single_pulses(opened):
    analysis = jointz.load(opened.folder)
    averages, points = analysis.responses(), analysis.responses(opened.study)

    assert len(points) == len(averages) == sum(len(c.responses) for c in analysis.cells)
    for average, point in zip(averages, points, strict=True):
        assert "angle" not in average
        assert average.equals(point.drop_vars(["angle", "torque", "onset_s", "recording"]))
        assert point.sizes["pulse"] == point.n_pulses
        for name in ("angle", "torque"):
            np.testing.assert_allclose(point[name].mean("pulse"), point[f"mean_{name}"], atol=1e-9)
    used = sum(point.sizes["pulse"] for point in points)
    assert used == sum(cell.n_used for cell in analysis.cells)


def test_responses_of_another_study_are_refused(opened, tmp_path):
    changed = shutil.copytree(opened.study.root, tmp_path / "study") / "study.toml"
    changed.write_text(changed.read_text() + "# changed\n")

    with pytest.raises(DataError, match="expected the study that was analysed"):
        jointz.load(opened.folder).responses(changed.parent)


def test_the_page_says_which_stiffness_is_which(opened):
    names = [p.name for p in opened.analysed.cells[0].parameters]

    assert "stiffness_onset" in names
    assert onset_note(names)


def test_results_of_earlier_versions_by_strapped_are_those_of_the_strap(strapped_results):
    opened = open_results(strapped_results / "results")
    old = earlier(opened, "strapped", opened.analysed.cells)

    now, key = reestimated(old).current(), PulseKey.of(first_pulse(old))

    assert now.cells == old.analysed.cells
    assert "bayesian" not in old.more_methods()
    expected = traces_of(opened)[key].windows["bayesian"]
    window = traces_of(old)[key].windows["strapped"]
    np.testing.assert_array_equal(window.fitted, expected.fitted)
    assert window.shape == expected.shape


def test_results_by_the_earlier_rigid_show_their_fits_and_get_no_new_estimates(strapped_results):
    opened = open_results(strapped_results / "results")
    time = np.arange(50) / 500.0
    average = Response(time, time, time, time, fitted_angle=np.full(50, 0.01))
    cells = [replace(c, response=average, other_shapes=()) for c in opened.analysed.cells]
    old = earlier(opened, "rigid", cells)

    traces = traces_of(old)

    for pulse in old.analysed.pulses:
        window = traces[PulseKey.of(pulse)].windows.get("rigid")
        if window is not None and not pulse.code:
            # It averaged all pulses turned by their sign.
            assert window.factor == np.sign(pulse.amplitude)
            assert np.nanmax(window.fitted) == 0.01
            assert window.residual is not None
    assert METHOD in old.more_methods()
    with pytest.raises(DataError, match="earlier version of jointz and cannot be combined"):
        reestimated(old)
