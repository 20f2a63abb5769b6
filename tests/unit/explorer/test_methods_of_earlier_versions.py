"""Results by a method that this version does not have: they open, and are not estimated again."""

import shutil
from dataclasses import replace

import pytest

import jointz
from jointz.analysis.pulse_traces import ReestimationRequest
from jointz.core.errors import DataError
from jointz.explorer.reestimation import estimate_by_method, reestimate
from jointz.explorer.results_files import open_results

GONE = "weak_form"


@pytest.fixture(scope="module")
def opened(small_study_source, tmp_path_factory):
    """A study, and results of it as an earlier version wrote them."""
    above = tmp_path_factory.mktemp("earlier")
    study = shutil.copytree(small_study_source, above / "study")
    made = jointz.analyze(study, method="least_squares", resamples=20)
    cells = tuple(replace(cell, method=GONE) for cell in made.cells)
    settings = {**made.settings, "method": GONE}
    replace(made, cells=cells, settings=settings).save(above / "results", figures=False)
    return open_results(above / "results")


def test_results_are_read_and_written_again(opened, tmp_path):
    opened.analysed.save(tmp_path / "again", figures=False)
    again = jointz.load(tmp_path / "again")

    assert {cell.method for cell in again.cells} == {GONE}
    assert again.to_frame().equals(opened.analysed.to_frame())
    assert opened.methods()[0] == GONE
    assert GONE not in opened.more_methods()


def test_new_estimates_are_refused_and_other_methods_stay(opened):
    person, request = opened.people[0], ReestimationRequest.of(opened.analysed)
    with pytest.raises(DataError, match=GONE):
        reestimate(opened.study, person, request)

    cells = estimate_by_method(opened.study, person, request, method="least_squares")
    old = {c.timing_point: c.parameters for c in opened.analysed.cells if c.participant == person}
    assert {c.timing_point: c.parameters for c in cells} == old
