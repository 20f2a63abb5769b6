"""A recording that is no file is named as what it is; a header too long for csv is refused."""

import os

import pytest

import jointz
from jointz.core.errors import DataError, StudyError
from jointz.inspection.inspect_file import inspect_file
from jointz.io.study_reader import open_study

#: Characters of the longest cell that Python's csv takes.
LONGEST_CELL = 131_072


def folder(path):
    path.mkdir()


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="the system has no named pipes")
@pytest.mark.parametrize(
    ("make", "kind", "read"),
    [
        (os.mkfifo, "a named pipe", jointz.read),
        (os.mkfifo, "a named pipe", inspect_file),
        (folder, "a folder", jointz.read),
    ],
)
def test_what_is_no_file_is_named_as_what_it_is(tmp_path, make, kind, read):
    make(tmp_path / "walk.csv")
    with pytest.raises(DataError, match=rf"walk\.csv: is {kind}; expected a file"):
        read(tmp_path / "walk.csv")


@pytest.mark.skipif(not os.path.exists("/dev/zero"), reason="the system has no such device")
@pytest.mark.parametrize("read", [jointz.read, inspect_file])
def test_a_device_is_named_as_a_device(read):
    with pytest.raises(DataError, match="/dev/zero: is a device"):
        read("/dev/zero")


def test_a_study_names_a_folder_in_place_of_a_recording(small_study):
    file = small_study.root / "S01_perturbed.csv"
    file.unlink()
    file.mkdir()
    with pytest.raises(StudyError, match=r"S01_perturbed\.csv' is a folder"):
        open_study(small_study.root)


def test_a_header_that_csv_cannot_hold_is_refused(tmp_path, jointz):
    file = tmp_path / "walk.csv"
    file.write_text(f"time,{'a' * (LONGEST_CELL + 1)}\n0,1\n1,2\n")
    outcome = jointz("convert", file, tmp_path / "walk.nc")
    assert outcome.code == 2
    assert "walk.csv, row 1: " in outcome.err
    assert not (tmp_path / "walk.nc").exists()


def test_a_long_header_between_semicolons_is_read(tmp_path):
    names = [f"channel_{k:0100}" for k in range(LONGEST_CELL // 100)]
    file = tmp_path / "walk.csv"
    file.write_text("\n".join(";".join(row) for row in (names, ["1"] * len(names))))
    assert list(jointz.read(file).data_vars) == names
