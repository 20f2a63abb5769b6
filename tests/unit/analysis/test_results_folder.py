"""A results folder is whole or absent, and nothing of the user's is replaced."""

import errno
import json
import os
import re
from pathlib import Path

import pytest

from jointz.analysis import results_folder
from jointz.analysis.results_folder import write_results
from jointz.core.errors import OutputError
from jointz.io.new_folder import (
    ANALYSIS,
    COMPARISON,
    MARKER,
    check_free,
    new_folder,
    write_marker,
)
from jointz.results.study_analysis import StudyAnalysis

from .folders import fill, names, text_of


def test_a_new_folder_takes_its_name_when_all_went_well(tmp_path):
    with new_folder(tmp_path / "deep" / "out", marker=MARKER, overwrite=False) as folder:
        (folder / "a").write_text("1")
        assert not (tmp_path / "deep" / "out").exists()
    assert names(tmp_path / "deep" / "out") == ["a"]
    assert names(tmp_path / "deep") == ["out"]


@pytest.mark.parametrize("error", [RuntimeError, KeyboardInterrupt])
def test_nothing_is_left_of_a_folder_that_failed(tmp_path, error):
    def fail(folder):
        (folder / "a").write_text("1")
        raise error

    with pytest.raises(error), new_folder(tmp_path / "out", marker=MARKER, overwrite=False) as f:
        fail(f)
    assert names(tmp_path) == []


def test_an_old_folder_is_replaced_whole(tmp_path):
    with new_folder(tmp_path / "out", marker=MARKER, overwrite=False) as folder:
        (folder / "stale.csv").write_text("x")
        write_marker(folder, MARKER, {"made_by": ANALYSIS, "text": "old"})
    fill(tmp_path / "out", "new", overwrite=True)

    assert names(tmp_path) == ["out"]
    assert names(tmp_path / "out") == [MARKER]
    assert text_of(tmp_path / "out") == "new"


@pytest.mark.parametrize("name", ["NOTES.md", "figures/mine.svg", "study/study.toml"])
def test_a_folder_that_holds_anything_of_the_users_is_kept(tmp_path, name):
    fill(tmp_path / "out", "old")
    (tmp_path / "out" / name).parent.mkdir(exist_ok=True)
    (tmp_path / "out" / name).write_text("x")
    with pytest.raises(OutputError, match=rf"did not write \({name}\).* Move them"):
        fill(tmp_path / "out", "new", overwrite=True)
    assert text_of(tmp_path / "out") == "old"


def test_a_marker_of_somebody_else_protects_its_folder(tmp_path):
    (tmp_path / "out").mkdir()
    (tmp_path / "out" / MARKER).write_text('{"made": "by hand"}')
    with pytest.raises(OutputError, match="did not make it"):
        fill(tmp_path / "out", "new", overwrite=True)


def old_folder(out, file):
    """Write a folder as jointz did before markers told what they hold."""
    out.mkdir()
    (out / file).write_text("x")
    (out / MARKER).write_text(json.dumps({"files": [file]}))


@pytest.mark.parametrize(
    ("file", "kind", "other"),
    [("estimates.csv", ANALYSIS, COMPARISON), ("comparison.json", COMPARISON, ANALYSIS)],
)
def test_an_older_folder_is_known_by_its_files(tmp_path, file, kind, other):
    old_folder(tmp_path / "out", file)

    with pytest.raises(OutputError, match=f"made it as {kind}, not as {other}"):
        check_free(tmp_path / "out", marker=MARKER, overwrite=True, made_by=other)
    check_free(tmp_path / "out", marker=MARKER, overwrite=True, made_by=kind)


def test_a_failure_keeps_the_old_folder(tmp_path):
    fill(tmp_path / "out", "old")
    with (
        pytest.raises(RuntimeError),
        new_folder(tmp_path / "out", marker=MARKER, overwrite=True),
    ):
        raise RuntimeError
    assert text_of(tmp_path / "out") == "old"
    assert names(tmp_path) == ["out"]


def test_a_failing_rename_brings_the_old_folder_back(tmp_path, monkeypatch):
    fill(tmp_path / "out", "old")
    rename = results_folder.Path.rename

    def failing(self, target):
        if ".partial-" in self.name:
            raise OSError("disk says no")
        return rename(self, target)

    monkeypatch.setattr(results_folder.Path, "rename", failing)
    with pytest.raises(OutputError, match=r"out: cannot be written \(disk says no\)"):
        fill(tmp_path / "out", "new", overwrite=True)
    assert text_of(tmp_path / "out") == "old"
    assert names(tmp_path) == ["out"]


def test_a_write_that_the_system_refuses_names_the_folder_and_leaves_nothing(tmp_path, monkeypatch):
    def refused(self, *_, **__):
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC), str(self))

    monkeypatch.setattr(results_folder.Path, "write_text", refused)
    out = tmp_path / "deep" / "deeper" / "out"
    message = re.escape(f"{out}: cannot be written ({os.strerror(errno.ENOSPC)}).")
    with pytest.raises(OutputError, match=message):
        write_results(StudyAnalysis(cells=()), out)
    assert names(tmp_path) == []


def test_a_folder_under_a_file_cannot_be_written(tmp_path):
    (tmp_path / "file").write_text("x")
    with pytest.raises(OutputError, match=r"out: cannot be written"):
        fill(tmp_path / "file" / "out", "new")
    with pytest.raises(OutputError, match=r"cannot be written"):
        check_free(tmp_path / ("x" * 300), marker=MARKER, overwrite=False)


def test_parents_that_hold_something_else_by_then_are_kept(tmp_path):
    def fail(folder):
        (folder.parent / "note").write_text("x")
        raise RuntimeError

    out = tmp_path / "made" / "out"
    with pytest.raises(RuntimeError), new_folder(out, marker=MARKER, overwrite=False) as folder:
        fail(folder)
    assert names(tmp_path / "made") == ["note"]


def test_what_must_be_kept_is_refused(tmp_path):
    (tmp_path / "file").write_text("x")
    with pytest.raises(OutputError, match="is a file"):
        check_free(tmp_path / "file", marker=MARKER, overwrite=True)
    fill(tmp_path / "ours", "1")
    with pytest.raises(OutputError, match="--overwrite"):
        check_free(tmp_path / "ours", marker=MARKER, overwrite=False)
    check_free(tmp_path / "ours", marker=MARKER, overwrite=True)
    (tmp_path / "theirs").mkdir()
    check_free(tmp_path / "theirs", marker=MARKER, overwrite=False)  # empty
    (tmp_path / "theirs" / "thesis.doc").write_text("x")
    with pytest.raises(OutputError, match="did not make it"):
        check_free(tmp_path / "theirs", marker=MARKER, overwrite=True)
    check_free(tmp_path / "absent", marker=MARKER, overwrite=False)


@pytest.mark.parametrize("name", [".", ".."])
def test_a_folder_that_cannot_take_a_name_is_refused_before_the_work(tmp_path, monkeypatch, name):
    (tmp_path / "empty").mkdir()
    monkeypatch.chdir(tmp_path / "empty")
    with pytest.raises(OutputError, match="no name for a new folder"):
        check_free(Path(name), marker=MARKER, overwrite=False)
    assert names(tmp_path / "empty") == []
