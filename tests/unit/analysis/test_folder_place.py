"""What appears at the place of a folder while it is written is kept, and so is the new folder."""

import threading
from pathlib import Path

import pytest

from jointz.analysis.results_folder import write_results
from jointz.core.errors import OutputError
from jointz.io.new_folder import ANALYSIS, MARKER, check_free
from jointz.results.study_analysis import StudyAnalysis

from .folders import fill, names, text_of

RACES = 20


def foreign_folder(out):
    out.mkdir()
    (out / "thesis.doc").write_text("x")


def file_of_others(out):
    out.write_text("x")


def link_to_nothing(out):
    out.symlink_to("elsewhere")


@pytest.mark.parametrize("overwrite", [False, True])
@pytest.mark.parametrize(
    "appear", [foreign_folder, file_of_others, link_to_nothing, lambda out: fill(out, "other")]
)
def test_what_appears_meanwhile_is_kept(tmp_path, appear, overwrite):
    out = tmp_path / "out"
    with pytest.raises(OutputError, match=r"out: appeared .* is kept\. .* complete: .*out-2\. "):
        fill(out, "new", overwrite=overwrite, meanwhile=lambda: appear(out))
    assert names(tmp_path) == ["out", "out-2"]
    assert text_of(tmp_path / "out-2") == "new"
    if appear is foreign_folder:
        assert names(out) == ["thesis.doc"]


def test_a_folder_that_was_changed_meanwhile_is_not_replaced(tmp_path):
    out = tmp_path / "out"
    fill(out, "old")
    with pytest.raises(OutputError, match="was changed"):
        fill(out, "new", overwrite=True, meanwhile=lambda: (out / "note.md").write_text("x"))
    assert names(out) == ["note.md", MARKER]
    (out / "note.md").unlink()
    with pytest.raises(OutputError, match="out-3"):
        fill(out, "new", overwrite=True, meanwhile=lambda: (out / MARKER).write_text("{}"))
    assert names(tmp_path) == ["out", "out-2", "out-3"]


def test_what_appears_during_the_analysis_is_kept_too(tmp_path):
    out = tmp_path / "out"
    fill(out, "first")
    before = check_free(out, marker=MARKER, overwrite=True, made_by=ANALYSIS)
    fill(out, "second", overwrite=True)
    with pytest.raises(OutputError, match="out-2"):
        fill(out, "third", overwrite=True, before=before)
    assert text_of(out) == "second"
    assert text_of(tmp_path / "out-2") == "third"


def test_a_folder_that_was_removed_meanwhile_is_written(tmp_path):
    out = tmp_path / "out"
    fill(out, "old")
    fill(out, "new", overwrite=True, meanwhile=lambda: out.rename(tmp_path / "moved"))
    assert (text_of(out), text_of(tmp_path / "moved")) == ("new", "old")


def test_a_link_to_nothing_is_refused_before_the_work(tmp_path):
    link_to_nothing(tmp_path / "out")
    with pytest.raises(OutputError, match="link to nothing"):
        check_free(tmp_path / "out", marker=MARKER, overwrite=True)


@pytest.mark.parametrize("overwrite", [False, True])
def test_races_for_one_name_lose_nothing(tmp_path, overwrite):
    for race in range(RACES):
        out = tmp_path / f"out{race}"
        if overwrite:
            fill(out, "old")
        start, refusals = threading.Barrier(2), []

        def write(text, out=out, start=start, refusals=refusals):
            try:
                fill(out, text, overwrite=overwrite, meanwhile=start.wait)
            except OutputError as exc:
                refusals.append(str(exc))

        writers = [threading.Thread(target=write, args=(text,)) for text in ("a", "b")]
        for writer in writers:
            writer.start()
        for writer in writers:
            writer.join()
        assert len(refusals) == 1
        assert f"{out}-2" in refusals[0]
        assert sorted(map(text_of, (out, Path(f"{out}-2")))) == ["a", "b"]
    assert len(names(tmp_path)) == 2 * RACES


def test_a_name_that_is_not_utf8_is_refused_before_the_work(tmp_path):
    out = tmp_path / "bad\udcff"
    with pytest.raises(OutputError, match=r"bad\\udcff: expected a name in UTF-8"):
        check_free(out, marker=MARKER, overwrite=False)
    with pytest.raises(OutputError, match="UTF-8"):
        write_results(StudyAnalysis(cells=()), out)
    assert names(tmp_path) == []
