"""The door to all formats: suffixes, labels, messages."""

import subprocess
import sys

import numpy as np
import pytest

from jointz.core.errors import DataError
from jointz.core.study import FilesSpec
from jointz.io import column_readers as registry
from jointz.io.column_readers import (
    RawTable,
    label_column,
    list_columns,
    read_table,
    register_reader,
)

PLAIN = FilesSpec()


class Short:
    def list_columns(self, _path, _files):
        return ["short"]


class Long:
    def list_columns(self, _path, _files):
        return None

    def read(self, _path, _request):
        return RawTable({"a": np.zeros(2), "b": np.zeros(3)}, {}, "")


class Locked:
    def read(self, _path, _request):
        raise PermissionError(13, "Permission denied")

    list_columns = read


def test_importing_the_registry_loads_no_reader():
    # pyarrow is not among them: pandas itself loads it where it is installed.
    heavy = (
        "{'h5netcdf', 'h5py', 'pymatreader', 'pint', 'matplotlib', 'jointz.io.formats.columnar'}"
    )
    code = (
        f"import sys, jointz.io.column_readers; raise SystemExit(bool({heavy} & set(sys.modules)))"
    )
    assert subprocess.run([sys.executable, "-c", code], check=False).returncode == 0


def test_an_unknown_suffix_is_refused_with_those_known(tmp_path):
    path = tmp_path / "a.docx"
    path.write_bytes(b"x")
    for call in (
        lambda: list_columns(path, PLAIN),
        lambda: read_table(path, numeric=["t"], files=PLAIN),
    ):
        with pytest.raises(DataError, match=r"a.docx: no reader .*\.csv, \.csv\.gz, \.mat, \.mot"):
            call()


def test_a_missing_file_is_a_data_error(tmp_path):
    with pytest.raises(DataError, match="no such file"):
        read_table(tmp_path / "a.csv", numeric=["t"], files=PLAIN)


@pytest.mark.usefixtures("own_readers")
def test_the_longest_suffix_wins_and_a_user_may_add_a_reader(tmp_path):
    register_reader(".gz")(Short)
    register_reader(".xyz.gz")(Long)
    for name, expected in (("a.gz", ["short"]), ("a.xyz.gz", None)):
        (tmp_path / name).touch()
        assert list_columns(tmp_path / name, PLAIN) == expected
    with pytest.raises(DataError, match=r"columns differ in length: \{'a': 2, 'b': 3\}"):
        read_table(tmp_path / "a.xyz.gz", numeric=["a", "b"], files=PLAIN)


@pytest.fixture
def own_readers(monkeypatch):
    monkeypatch.setattr(registry, "_READERS", dict(registry._READERS))


def test_a_column_is_numbers_or_labels_not_both(tmp_path):
    path = tmp_path / "a.csv"
    path.write_text("t,x\n1,2\n")
    with pytest.raises(DataError, match="'x' is asked for both as numbers and as labels"):
        read_table(path, numeric=["t", "x"], labels=["x"], files=PLAIN)


@pytest.mark.usefixtures("own_readers")
def test_a_file_that_cannot_be_opened_is_a_data_error(tmp_path):
    register_reader(".locked")(Locked)
    path = tmp_path / "a.locked"
    path.touch()
    for call in (
        lambda: list_columns(path, PLAIN),
        lambda: read_table(path, numeric=["t"], files=PLAIN),
    ):
        with pytest.raises(DataError, match="Permission denied"):
            call()


@pytest.mark.parametrize(
    ("values", "expected"),
    [
        (np.array([0, 1]), ["0", "1"]),
        (np.array([0.0, 1.0, np.nan, 2.5, -0.0]), ["0", "1", "", "2.5", "0"]),
        (np.array([True, False]), ["True", "False"]),
        (np.array(["1.0", None, " left ", "007", "1e2"], dtype=object),
         ["1", "", "left", "007", "100"]),
        (np.array([b"left", b"right"]), ["left", "right"]),
    ],
)  # fmt: skip
def test_labels_are_plain_text(tmp_path, values, expected):
    labels = label_column(tmp_path, "side", values)
    assert labels.dtype == object
    assert labels.tolist() == expected


def test_a_long_list_of_columns_is_cut(tmp_path):
    path = tmp_path / "a.csv"
    names = ",".join(f"marker{i}" for i in range(100))
    path.write_text(f"{names}\n{'0,' * 99}0\n")
    with pytest.raises(DataError, match="marker39 and 60 more"):
        read_table(path, numeric=["angle"], files=PLAIN)
