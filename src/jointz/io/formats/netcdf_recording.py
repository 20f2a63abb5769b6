"""netCDF-4: recordings of jointz in and out, and how any netCDF-4 file is opened."""

from collections.abc import Callable, Collection, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr

from jointz.core.errors import DataError
from jointz.core.recording import validate_recording
from jointz.core.whole_file import whole_file
from jointz.io.file_kinds import missing_file
from jointz.io.formats.columns import damage_errors, file_error
from jointz.io.formats.hdf5_size import check_hdf5

_CLASSIC = b"CDF"
_LIBRARY_ERRORS = (OSError, ValueError, RuntimeError, KeyError, TypeError, AttributeError)


def write_recording(recording: xr.Dataset, path: Path) -> None:
    """Write a recording as netCDF-4; samples are kept exactly, attributes as they are.

    The file appears under its name when it is complete, never before.

    Parameters
    ----------
    recording : xarray.Dataset
        The recording (see :mod:`jointz.core.recording`); it is not modified.
    path : pathlib.Path
        The file; one that exists is replaced.

    Raises
    ------
    DataError
        When it is not a valid recording.
    WriteError
        When the file cannot be written.
    """
    validate_recording(recording)
    plain = recording.drop_encoding()
    # No fill value: NaN is itself, and the samples come back bit for bit.
    settings = {"zlib": True, "complevel": 1, "shuffle": True, "_FillValue": None}
    encoding = {str(name): dict(settings) for name in plain.variables}
    content = netcdf_bytes(
        lambda file: plain.dump_to_store(xr.backends.H5NetCDFStore(file), encoding=encoding)
    )
    with whole_file(path, "Make room or name another place.") as partial:
        partial.write_bytes(content)


def read_recording(path: Path) -> xr.Dataset:
    """Read a recording that :func:`write_recording` wrote.

    Parameters
    ----------
    path : pathlib.Path
        The file.

    Returns
    -------
    xarray.Dataset
        The recording, in memory and validated; identical to the one written.

    Raises
    ------
    DataError
        When the file is missing, damaged, or does not hold a recording.
    """
    if not path.is_file():
        raise DataError(missing_file(path, "Correct the name.", "recording"), path=str(path))
    with opened_netcdf(path) as file:
        recording = load_group(file)
    plain = {k: v.item() if isinstance(v, np.generic) else v for k, v in recording.attrs.items()}
    recording.attrs = plain
    return validate_recording(recording.drop_encoding())


def netcdf_bytes(fill: Callable[[Any], object]) -> bytes:
    """Return a file made in memory: where the disk is full HDF5 itself would crash."""
    import h5netcdf
    import h5py

    memory = {"driver": "core", "backing_store": False, "track_order": True}
    with h5py.File("netcdf", "w", **memory) as content:
        with h5netcdf.File(content, "r+") as file:
            fill(file)
        content.flush()
        return bytes(content.id.get_file_image())


def load_group(group: Any, only: Collection[str] | None = None) -> xr.Dataset:
    """Return the variables of one group in memory, unpacked, times as numbers."""
    store = xr.backends.H5NetCDFStore(group)
    dataset = xr.open_dataset(store, decode_times=False, decode_timedelta=False)
    if only is None:
        return dataset.load()
    names = {n if n in dataset.variables else n.rpartition(".")[0] for n in only}
    return dataset[sorted(names)].load()


@contextmanager
def opened_netcdf(path: Path) -> Iterator[Any]:
    """Open by h5py, so that a file h5netcdf gives up on is closed all the same."""
    import h5netcdf
    import h5py

    with path.open("rb") as raw:
        if raw.read(len(_CLASSIC)) == _CLASSIC:
            raise file_error(
                path,
                "expected netCDF-4, found the classic netCDF-3 format. Convert it: nccopy -k nc4 "
                "OLD NEW.",
            )
    with damage_errors(path, *_LIBRARY_ERRORS), h5py.File(path, "r") as content:
        check_hdf5(path, content)
        content.attrs.get("_nc3_strict")  # where h5netcdf would fail half-open
        with h5netcdf.File(content, "r", decode_vlen_strings=True) as file:
            yield file
