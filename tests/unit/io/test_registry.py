"""The registry of formats: suffixes, entry points, labels, messages."""

import subprocess
import sys
import tomllib
from importlib.metadata import EntryPoint
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from jointz.core.acquisition import Acquisition, Signal, SignalGroup
from jointz.core.errors import DataError
from jointz.core.study import FilesSpec
from jointz.io.formats import registry
from jointz.io.formats.columns import RawTable, label_column
from jointz.io.formats.group_format import GroupFormat
from jointz.io.formats.registry import list_columns, read_acquisition, read_table, write_acquisition

PLAIN = FilesSpec()


class OneColumn(GroupFormat):
    """The least that a lab's own format needs."""

    name = "one column"

    def read(self, path, _files):
        signal = Signal("x", np.array(path.read_text().split(), dtype=float), "m")
        return Acquisition((SignalGroup("", (signal,), 10.0),))


class Ragged:
    def list_columns(self, _path, _files):
        return None

    def read_columns(self, _path, _request):
        return RawTable({"a": np.zeros(2), "b": np.zeros(3)}, {}, "")


class Locked:
    def read_columns(self, _path, _request):
        raise PermissionError(13, "Permission denied")

    list_columns = read_columns


@pytest.fixture(autouse=True)
def _lab_formats(monkeypatch):
    """A lab's package registers its formats by entry points."""
    entries = {".gz": OneColumn, ".xyz.gz": Ragged, ".locked": Locked, ".csv": Locked}
    points = [EntryPoint(suffix, f"{__name__}:{kind.__name__}", registry.GROUP)
              for suffix, kind in entries.items()]  # fmt: skip
    points.append(EntryPoint(".zzz", "a_package_that_is_gone:Format", registry.GROUP))
    monkeypatch.setitem(sys.modules, __name__, SimpleNamespace(**globals()))
    monkeypatch.setattr("jointz.core.entry_points.entry_points", lambda **_group: points)
    registry._formats.cache_clear()
    yield
    registry._formats.cache_clear()


def test_the_registry_loads_no_format():
    # pyarrow is not among them: pandas itself loads it where it is installed.
    heavy = "{'h5netcdf', 'h5py', 'pymatreader', 'pint', 'matplotlib', 'jointz.io.c3d.c3d_format'}"
    code = (
        "import sys, jointz.io.formats.registry; "
        f"raise SystemExit(bool({heavy} & set(sys.modules)))"
    )
    assert subprocess.run([sys.executable, "-c", code], check=False).returncode == 0


def test_the_formats_of_jointz_are_entry_points():
    file = Path(__file__).parents[3] / "pyproject.toml"
    project = tomllib.loads(file.read_text("utf-8"))["project"]
    assert project["entry-points"][registry.GROUP] == dict(registry.BUILT_IN)


def test_an_unknown_suffix_is_refused_with_those_known(tmp_path):
    path = tmp_path / "a.docx"
    path.write_bytes(b"x")
    for call in (
        lambda: list_columns(path, PLAIN),
        lambda: read_table(path, numeric=["t"], files=PLAIN),
        lambda: read_acquisition(path),
    ):
        with pytest.raises(DataError, match=r"a.docx: .*\.csv, \.csv\.gz, \.dat, \.gz, \.locked"):
            call()


def test_a_target_without_a_format_is_refused_with_those_that_are_written(tmp_path):
    with pytest.raises(DataError) as caught:
        write_acquisition(Acquisition(()), tmp_path / "a.h5")

    listed = str(caught.value).partition("one of ")[2].partition(". ")[0].split(", ")
    assert {".csv", ".nc"} <= set(listed)
    assert not {".c3d", ".mat", ".parquet", ".sto", ".xlsx", ".gz", ".zzz"} & set(listed)


def test_a_labs_own_format_is_read_by_the_longest_suffix(tmp_path):
    own = tmp_path / "a.gz"
    own.write_text("1\n2\n")
    table = read_table(own, numeric=["x", "time"], files=PLAIN)
    columns = {name: values.tolist() for name, values in table.columns.items()}
    assert columns == {"x": [1.0, 2.0], "time": [0.0, 0.1]}
    assert table.units == {"x": "m", "time": "s"}
    assert list_columns(own, PLAIN) == ["time", "x"]
    with pytest.raises(DataError, match=r"b\.gz: one column is read only"):
        write_acquisition(read_acquisition(own), tmp_path / "b.gz")
    ragged = tmp_path / "a.xyz.gz"
    ragged.touch()
    assert list_columns(ragged, PLAIN) is None
    with pytest.raises(DataError, match=r"\{'a': 2, 'b': 3\}"):
        read_table(ragged, numeric=["a", "b"], files=PLAIN)


def test_a_column_is_numbers_or_labels_not_both(tmp_path):
    path = tmp_path / "a.csv"
    path.write_text("t,x\n1,2\n")
    with pytest.raises(DataError, match=r"'x' .* both"):
        read_table(path, numeric=["t", "x"], labels=["x"], files=PLAIN)


def test_a_file_that_cannot_be_opened_is_a_data_error(tmp_path):
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
