"""MATLAB files of both kinds: structs, matrices, cells, objects, damage."""

import hashlib

import h5py
import numpy as np
import pytest
import scipy.io

from jointz.core.errors import DataError
from jointz.core.study import FilesSpec
from jointz.io.formats.registry import list_columns, read_acquisition, read_table

PLAIN = FilesSpec()
ANGLE = np.array([0.1, 0.2, np.nan, 0.4])
SIGNALS = np.arange(12.0).reshape(4, 3)


def write_v5(path):
    content = {
        "time": np.arange(4.0),  # stored as (1, n)
        "on": np.array([[True], [False], [True], [True]]),
        "data": {
            "knee": {"angle": ANGLE[:, None], "side": "left"},
            "signals": SIGNALS,
            "label": np.array(["a", "b", "a", "b"], dtype=object),
            "force": ANGLE + 1j,
        },
        "trial": np.array([({"x": ANGLE},), ({"x": 2 * ANGLE},)], dtype=[("rec", object)]),
    }
    scipy.io.savemat(path, content, do_compression=True)


def write_v73(path):
    """Write as MATLAB does: transposed, structs as groups, cells as references."""

    def put(group, name, values, kind):
        group.create_dataset(name, data=values).attrs["MATLAB_class"] = np.bytes_(kind)

    with h5py.File(path, "w", userblock_size=512) as file:
        put(file, "time", np.arange(4.0)[None, :].T, "double")
        put(file, "on", np.array([[1, 0, 1, 1]], dtype=np.uint8), "logical")
        data = file.create_group("data")
        knee = data.create_group("knee")
        for group in (data, knee):
            group.attrs["MATLAB_class"] = np.bytes_("struct")
        put(knee, "angle", ANGLE[None, :], "double")
        put(data, "signals", SIGNALS.T, "double")
        refs = file.create_group("#refs#")
        for i, text in enumerate("abab"):
            put(refs, f"r{i}", np.array([[ord(text)]], dtype=np.uint16), "char")
        cells = np.array([[refs[f"r{i}"].ref for i in range(4)]], dtype=h5py.ref_dtype)
        data.create_dataset("label", data=cells, dtype=h5py.ref_dtype)
        data["label"].attrs["MATLAB_class"] = np.bytes_("cell")
    header = b"MATLAB 7.3 MAT-file, written as MATLAB does".ljust(124) + b"\x00\x02IM"
    with path.open("r+b") as raw:
        raw.write(header)


@pytest.fixture(params=[write_v5, write_v73], ids=["v5", "v7.3"])
def path(request, tmp_path):
    request.param(tmp_path / "a.mat")
    return tmp_path / "a.mat"


def test_series_are_reached_by_dotted_names(path):
    columns = ["time", "on", "data.knee.angle", "data.signals.3"]
    table = read_table(path, numeric=columns, labels=["data.label"], files=PLAIN)
    np.testing.assert_array_equal(table.columns["time"], [0, 1, 2, 3])
    np.testing.assert_array_equal(table.columns["on"], [1, 0, 1, 1])
    np.testing.assert_array_equal(table.columns["data.knee.angle"], ANGLE)
    np.testing.assert_array_equal(table.columns["data.signals.3"], SIGNALS[:, 2])
    assert table.columns["data.label"].tolist() == ["a", "b", "a", "b"]
    assert all(table.columns[c].dtype == np.float64 for c in columns)
    assert table.sha256 == hashlib.sha256(path.read_bytes()).hexdigest()
    assert (table.units, table.first_row) == ({}, 1)


def test_names_inside_structs_are_not_listed_cheaply(path):
    assert list_columns(path, PLAIN) is None


@pytest.mark.parametrize("column", ["data.knee.angel", "data.signals.4", "data.knee", "knee"])
def test_a_name_that_leads_nowhere_is_refused_with_those_there_are(path, column):
    with pytest.raises(DataError) as caught:
        read_table(path, numeric=["time", column], files=PLAIN)
    message = str(caught.value)
    assert f"no column '{column}'" in message
    for name in ("data.knee.angle", "data.signals.1", "data.signals.3", "time"):
        assert name in message


def test_a_matrix_needs_the_number_of_a_column(path):
    with pytest.raises(DataError, match=r"4 x 3.* data\.signals\.1 "):
        read_table(path, numeric=["data.signals"], files=PLAIN)


def test_complex_numbers_are_refused(tmp_path):
    write_v5(tmp_path / "a.mat")
    with pytest.raises(DataError, match="expected numbers, found complex"):
        read_table(tmp_path / "a.mat", numeric=["data.force"], files=PLAIN)


def test_an_element_of_a_struct_array_is_numbered(tmp_path):
    trials = np.zeros((1, 2), dtype=[("x", object)])
    trials["x"][0, 0], trials["x"][0, 1] = ANGLE[:, None], 2 * ANGLE[:, None]
    scipy.io.savemat(tmp_path / "a.mat", {"trial": trials})
    table = read_table(tmp_path / "a.mat", numeric=["trial.x.2"], files=PLAIN)
    np.testing.assert_array_equal(table.columns["trial.x.2"], 2 * ANGLE)
    with pytest.raises(DataError, match=r"trial\.x\.1 "):
        read_table(tmp_path / "a.mat", numeric=["trial.x"], files=PLAIN)


def test_objects_of_matlab_are_explained(tmp_path):
    with h5py.File(tmp_path / "a.mat", "w", userblock_size=512) as file:
        file.create_dataset("T", data=np.zeros((1, 6), np.uint32)).attrs["MATLAB_class"] = (
            np.bytes_("string")
        )
    with (tmp_path / "a.mat").open("r+b") as raw:
        raw.write(b"MATLAB 7.3 MAT-file".ljust(124) + b"\x00\x02IM")
    with pytest.raises(DataError, match=r"MATLAB objects .*table2struct"):
        read_table(tmp_path / "a.mat", numeric=["T"], files=PLAIN)


def test_what_matlab_keeps_of_its_objects_is_no_series(tmp_path):
    handle = np.array([[0xDD000000, 2, 1, 1, 1, 1]], np.uint32)
    with h5py.File(tmp_path / "a.mat", "w", userblock_size=512) as file:
        file.create_dataset("T", data=handle).attrs["MATLAB_class"] = np.bytes_("table")
        file.create_dataset("x", data=ANGLE[None]).attrs["MATLAB_class"] = np.bytes_("double")
        file.create_dataset("#subsystem#/MCOS", data=np.arange(60.0)[None])
    with (tmp_path / "a.mat").open("r+b") as raw:
        raw.write(b"MATLAB 7.3 MAT-file".ljust(124) + b"\x00\x02IM")
    (group,) = read_acquisition(tmp_path / "a.mat").groups
    assert [signal.name for signal in group.signals] == ["x"]
    with pytest.raises(DataError, match=r"The file has: x\. .*table2struct"):
        read_table(tmp_path / "a.mat", numeric=["T"], files=PLAIN)


@pytest.mark.parametrize("keep", [0.0, 0.02, 0.5, 0.98])
def test_a_cut_file_is_refused(path, keep):
    content = path.read_bytes()
    path.write_bytes(content[: int(keep * len(content))])
    with pytest.raises(DataError, match=r"a.mat: cannot be read as a .mat file"):
        read_table(path, numeric=["data.knee.angle"], files=PLAIN)


def test_a_changed_byte_in_a_compressed_variable_is_refused(tmp_path):
    write_v5(tmp_path / "a.mat")
    content = bytearray((tmp_path / "a.mat").read_bytes())
    content[-5] ^= 0xFF
    (tmp_path / "a.mat").write_bytes(content)
    with pytest.raises(DataError, match=r"cannot be read as a .mat file"):
        read_table(tmp_path / "a.mat", numeric=["time"], files=PLAIN)


@pytest.mark.real_data
def test_a_real_matrix_is_read_by_column(real_data):
    path = real_data / "gaitanalysistoolkit" / "refresults.mat"
    table = read_table(path, numeric=["refresults.1", "refresults.15"], files=PLAIN)
    expected = scipy.io.loadmat(path)["refresults"]
    np.testing.assert_array_equal(table.columns["refresults.15"], expected[:, 14])
