"""netCDF: variables of others, and recordings of our own without loss."""

import hashlib
import os
import resource
import signal

import numpy as np
import pytest
import xarray as xr
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from scipy.io import netcdf_file

from jointz.core.errors import DataError, OutputError
from jointz.core.recording import build_recording, with_history
from jointz.core.study import FilesSpec
from jointz.io.formats.netcdf_recording import read_recording, write_recording
from jointz.io.formats.registry import list_columns, read_table

PLAIN = FilesSpec()


def recording(**channels):
    n = len(next(iter(channels.values())))
    built = build_recording(
        np.arange(n) * 0.001,
        channels,
        units={"emg": "V"},
        first_row=7,
        history=({"step": "read", "file": "a.csv"},),
        participant="S01",
        condition="perturbed",
        sha256="ab12",
    )
    return with_history(built, "filter", cutoff_hz=20.0)


@pytest.fixture
def path(tmp_path):
    file = tmp_path / "a.nc"
    packed = {"scale_factor": 0.5, "add_offset": 1.0, "_FillValue": -1, "dtype": "int16"}
    root = xr.Dataset(
        {"t": ("n", [0.0, 1.0], {"units": "ms"}), "side": ("n", ["left", "right"]),
         "lag": ("n", [1, 2], {"units": "seconds"}), "grid": (("n", "m"), np.zeros((2, 3)))}
    )  # fmt: skip
    root.to_netcdf(file, engine="h5netcdf")
    knee = xr.Dataset({"angle": ("n", [2.0, np.nan], {"units": "deg"})})
    knee.to_netcdf(file, engine="h5netcdf", group="knee", mode="a", encoding={"angle": packed})
    return file


def test_variables_come_with_units_through_groups_unpacked(path):
    table = read_table(path, numeric=["t", "knee/angle", "lag"], labels=["side"], files=PLAIN)
    np.testing.assert_array_equal(table.columns["knee/angle"], [2.0, np.nan])
    np.testing.assert_array_equal(table.columns["lag"], [1.0, 2.0])
    assert table.columns["side"].tolist() == ["left", "right"]
    assert table.units == {"t": "ms", "knee/angle": "deg", "lag": "seconds"}
    assert table.sha256 == hashlib.sha256(path.read_bytes()).hexdigest()
    assert table.first_row == 1


def test_variables_of_all_groups_are_listed(path):
    assert sorted(list_columns(path, PLAIN)) == [
        *("grid", "grid.1", "grid.2", "grid.3", "knee/angle", "lag", "side", "t"),
    ]
    column = read_table(path, numeric=["grid.2"], files=PLAIN).columns["grid.2"]
    assert column.shape == (2,)


def test_a_missing_variable_or_a_matrix_is_refused(path):
    with pytest.raises(DataError, match=r"no column 'angle'.*knee/angle"):
        read_table(path, numeric=["angle"], files=PLAIN)
    with pytest.raises(DataError, match=r"column 'grid': .*\(2, 3\)"):
        read_table(path, numeric=["grid"], files=PLAIN)


def test_a_cut_or_foreign_file_is_refused(path, tmp_path):
    path.write_bytes(path.read_bytes()[:-100])
    with pytest.raises(DataError, match=r"a.nc: cannot be read as a .nc file"):
        list_columns(path, PLAIN)
    old = tmp_path / "old.nc"
    with netcdf_file(old, "w") as file:
        file.createDimension("t", 2)
    for call in (lambda: list_columns(old, PLAIN), lambda: read_recording(old)):
        with pytest.raises(DataError, match="netCDF-3"):
            call()


@given(
    samples=st.lists(st.floats(width=64), min_size=2, max_size=30),
    participant=st.text(st.characters(codec="utf-8", exclude_characters="\x00")),
)
@settings(
    max_examples=15, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture]
)
def test_a_recording_is_read_back_as_it_was_written(tmp_path, samples, participant):
    original = recording(angle=samples, emg=samples[::-1])
    original = original.assign_attrs(participant=participant)
    before = original.copy(deep=True)
    write_recording(original, tmp_path / "a.nc")
    back = read_recording(tmp_path / "a.nc")
    xr.testing.assert_identical(back, original)
    xr.testing.assert_identical(original, before)
    assert {k: type(v) for k, v in back.attrs.items()} == {
        k: type(v) for k, v in original.attrs.items()
    }
    assert back["emg"].attrs == {"units": "V"}
    for name in original.variables:
        assert back[name].values.tobytes() == original[name].values.tobytes()  # bit for bit


def test_a_full_disk_is_an_output_error_and_no_crash(tmp_path):
    noise = np.random.default_rng(1).standard_normal(100_000)
    told = tmp_path / "told"
    child = os.fork()
    if child == 0:  # HDF5 itself would end the process where it cannot write
        signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
        resource.setrlimit(resource.RLIMIT_FSIZE, (100_000, 100_000))
        try:
            write_recording(recording(angle=noise), tmp_path / "a.nc")
        except OutputError as exc:
            told.write_text(f"{type(exc.__cause__).__name__} {exc}")
        finally:
            os._exit(0)

    assert os.waitpid(child, 0)[1] == 0
    assert "OSError" in told.read_text()
    assert [p.name for p in tmp_path.iterdir()] == ["told"]


def test_the_same_recording_makes_the_same_bytes(tmp_path):
    for name in ("a.nc", "b.nc"):
        write_recording(recording(angle=[1.0, 2.0], emg=[3.0, 4.0]), tmp_path / name)

    assert (tmp_path / "a.nc").read_bytes() == (tmp_path / "b.nc").read_bytes()
    assert list(read_recording(tmp_path / "a.nc").data_vars) == ["angle", "emg"]


def test_only_recordings_are_written_and_read(tmp_path, path):
    turned = recording(angle=[1.0, 2.0]).isel(time=slice(None, None, -1))
    with pytest.raises(DataError, match="time goes back"):
        write_recording(turned, tmp_path / "b.nc")
    assert not (tmp_path / "b.nc").exists()
    with pytest.raises(DataError, match="no coordinate 'time'"):
        read_recording(path)
    with pytest.raises(DataError, match="no such recording"):
        read_recording(tmp_path / "c.nc")
