"""An analysis is saved and loaded again."""

import shutil

import pytest

import jointz
from jointz.core.errors import DataError, OutputError


@pytest.fixture(scope="module")
def analysis(small_study_source):
    return jointz.analyze(small_study_source, resamples=20)


def test_a_saved_analysis_is_loaded_as_it_was(analysis, tmp_path):
    report = analysis.save(tmp_path / "results")
    assert report.read_text(encoding="utf-8").startswith("<!DOCTYPE html>")
    assert jointz.load(tmp_path / "results").to_dict() == analysis.to_dict()


def test_a_folder_of_results_is_kept_unless_it_may_be_replaced(analysis, tmp_path):
    analysis.save(tmp_path / "results")
    with pytest.raises(OutputError, match="exists and is kept"):
        analysis.save(tmp_path / "results")
    analysis.save(tmp_path / "results", overwrite=True)


def test_a_folder_that_holds_no_analysis_is_refused(analysis, tmp_path):
    with pytest.raises(DataError, match=r"no analysis\.json"):
        jointz.load(tmp_path)
    analysis.save(tmp_path / "results")
    shutil.copy(tmp_path / "results" / "provenance.json", tmp_path / "results" / "analysis.json")
    with pytest.raises(DataError, match="cannot be read"):
        jointz.load(tmp_path / "results")
