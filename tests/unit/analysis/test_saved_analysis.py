"""An analysis is saved and loaded again."""

import json
import shutil
import warnings

import pytest

import jointz
from jointz.analysis.saved_analysis import Analysis
from jointz.core.errors import DataError, OutputError


@pytest.fixture
def analysis(rigid_analysis):
    return rigid_analysis


@pytest.fixture(scope="module")
def saved_once(rigid_analysis, tmp_path_factory):
    out = tmp_path_factory.mktemp("saved") / "results"
    report = rigid_analysis.save(out)
    assert report.read_text(encoding="utf-8").startswith("<!DOCTYPE html>")
    return out


@pytest.fixture
def saved(saved_once, tmp_path):
    """The saved analysis, which a test may spoil."""
    return shutil.copytree(saved_once, tmp_path / "results")


def test_a_saved_analysis_is_loaded_as_it_was(analysis, saved):
    assert jointz.load(saved).to_dict() == analysis.to_dict()


def test_pdf_is_written_on_request_only(analysis, saved, tmp_path):
    analysis.save(tmp_path / "both", pdf=True)

    names = {f.name for f in (saved / "figures").iterdir()}
    assert {"gait.svg", "pulse_example.svg"} <= names
    assert {name.rpartition(".")[2] for name in names} == {"svg"}
    both = {f.name for f in (tmp_path / "both" / "figures").iterdir()}
    assert both == names | {name.replace(".svg", ".pdf") for name in names}


def test_a_folder_of_results_is_kept_unless_it_may_be_replaced(analysis, saved):
    with pytest.raises(OutputError, match="exists and is kept"):
        analysis.save(saved)
    assert jointz.load(saved).cells
    Analysis(cells=()).save(saved, overwrite=True)
    assert jointz.load(saved).cells == ()


def test_a_folder_that_holds_no_analysis_is_refused(saved, tmp_path):
    with pytest.raises(DataError, match=r"no analysis\.json"):
        jointz.load(tmp_path)
    shutil.copy(saved / "provenance.json", saved / "analysis.json")
    with pytest.raises(DataError, match=r"analysis\.json: cannot be read"):
        jointz.load(saved)


@pytest.mark.parametrize(
    "text",
    ["[" * 100_000 + "]" * 100_000, '{"a": ' * 100_000 + "1" + "}" * 100_000, "[1e999]", "\xff"],
    ids=["deep list", "deep object", "infinity", "no text"],
)
def test_damage_of_any_kind_is_one_error_with_the_name_of_the_file(saved, text):
    (saved / "analysis.json").write_text(text, encoding="latin-1")
    with pytest.raises(DataError, match=r"analysis\.json: cannot be read"):
        jointz.load(saved)


def infinite_count(content):
    content["cells"][0]["n_used"] = float("inf")


def number_too_large_for_an_array(content):
    response = next(cell["response"] for cell in content["cells"] if cell["response"])
    response["time_s"][0] = 10**400


def altered_value(content):
    content["cells"][0]["parameters"][0]["value"] = 1.0


@pytest.mark.parametrize(
    ("change", "told"),
    [
        (infinite_count, "cannot be read"),
        (number_too_large_for_an_array, "cannot be read"),
        (altered_value, "was changed"),
    ],
)
def test_a_number_that_jointz_did_not_write_is_not_loaded(saved, change, told):
    file = saved / "analysis.json"
    content = json.loads(file.read_text())
    change(content)
    file.write_text(json.dumps(content))
    with pytest.raises(DataError, match=rf"analysis\.json: {told}"):
        jointz.load(saved)


def test_an_altered_table_is_told(saved):
    with (saved / "estimates.csv").open("a") as stream:
        stream.write("\n")
    with pytest.warns(UserWarning, match=r"estimates\.csv"):
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
