"""An analysis is saved and loaded again."""

import json
import shutil
import warnings

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


@pytest.fixture
def saved(analysis, tmp_path):
    analysis.save(tmp_path / "results")
    return tmp_path / "results"


@pytest.mark.parametrize(
    "text",
    ["[" * 100_000 + "]" * 100_000, '{"a": ' * 100_000 + "1" + "}" * 100_000, "[1e999]", "\xff"],
)
def test_damage_of_any_kind_is_one_error_with_the_name_of_the_file(saved, text):
    (saved / "analysis.json").write_text(text, encoding="latin-1")
    with pytest.raises(DataError, match=r"analysis\.json: cannot be read"):
        jointz.load(saved)


def test_infinity_where_a_count_belongs_is_one_error(saved):
    content = json.loads((saved / "analysis.json").read_text())
    content["cells"][0]["n_used"] = float("inf")
    (saved / "analysis.json").write_text(json.dumps(content))
    with pytest.raises(DataError, match=r"analysis\.json: cannot be read"):
        jointz.load(saved)


def test_a_number_too_large_for_an_array_is_one_error(saved):
    content = json.loads((saved / "analysis.json").read_text())
    response = next(cell["response"] for cell in content["cells"] if cell["response"])
    response["time_s"][0] = 10**400
    (saved / "analysis.json").write_text(json.dumps(content))
    with pytest.raises(DataError, match=r"analysis\.json: cannot be read"):
        jointz.load(saved)


def test_an_altered_value_is_not_loaded(saved):
    file = saved / "analysis.json"
    content = json.loads(file.read_text())
    content["cells"][0]["parameters"][0]["value"] = 1.0
    file.write_text(json.dumps(content))
    with pytest.raises(DataError, match=r"analysis\.json: was changed after jointz wrote it"):
        jointz.load(saved)


def test_an_altered_table_is_told(saved):
    with (saved / "estimates.csv").open("a") as stream:
        stream.write("\n")
    with pytest.warns(UserWarning, match=r"changed after jointz wrote them: estimates\.csv"):
        jointz.load(saved)


def test_a_folder_of_an_earlier_version_is_loaded_as_before(analysis, saved):
    content = json.loads((saved / "provenance.json").read_text())
    assert set(content["sha256"]) == set(content["files"])
    del content["sha256"]
    (saved / "provenance.json").write_text(json.dumps(content))
    (saved / "estimates.csv").write_text("")
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        assert jointz.load(saved).to_dict() == analysis.to_dict()


@pytest.mark.parametrize("text", ["", "[]", '{"sha256": 3}', "[" * 100_000])
def test_a_damaged_provenance_is_one_error_with_the_name_of_the_file(saved, text):
    (saved / "provenance.json").write_text(text)
    with pytest.raises(DataError, match=r"provenance\.json: cannot be read"):
        jointz.load(saved)
