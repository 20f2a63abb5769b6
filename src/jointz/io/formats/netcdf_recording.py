"""netCDF-4: recordings of other programs in, recordings of jointz in and out."""

import json
from collections import defaultdict
from collections.abc import Collection, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr

from jointz.core.errors import DataError
from jointz.core.recording import validate_recording
from jointz.core.study import FilesSpec
from jointz.core.whole_file import whole_file
from jointz.io.column_readers import (
    RawTable,
    TableRequest,
    damaged,
    file_sha256,
    label_column,
    missing_columns,
    number_column,
    register_reader,
)
from jointz.io.formats.hdf5_size import check_hdf5

#: Of a matrix, to be taken apart into columns ``NAME.1``, ``NAME.2`` and so on.
MOST_COLUMNS = 64
_CLASSIC = b"CDF"
_LIBRARY_ERRORS = (OSError, ValueError, RuntimeError, KeyError, TypeError, AttributeError)


@register_reader(".nc")
class NetcdfReader:
    """Reads variables by name, ``group/variable`` in groups, with their ``units``.

    ``variable.3`` is the third column of a matrix.
    """

    def read(self, path: Path, request: TableRequest) -> RawTable:
        """Return the wanted variables; fill values become NaN, packed ones are unpacked."""
        names = [str(c) for c in request.columns]
        available = self.list_columns(path, request.files)
        missing = [name for name in names if name not in available]
        if missing:
            raise missing_columns(path, missing, available)
        variables, history = _variables(path, names)
        columns = {
            str(c): number_column(path, str(c), variables[str(c)].values) for c in request.numeric
        }
        columns |= {
            str(c): label_column(path, str(c), variables[str(c)].values) for c in request.labels
        }
        units = {n: str(v.attrs["units"]) for n, v in variables.items() if "units" in v.attrs}
        return RawTable(columns, units, file_sha256(path), history=history)

    def list_columns(self, path: Path, files: FilesSpec) -> list[str]:  # noqa: ARG002
        """Return the variables of all groups."""
        with opened_netcdf(path) as file:
            return _walk(file, "")


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
    content = _netcdf_bytes(recording.drop_encoding())
    with whole_file(path, "Make room or name another place.") as partial:
        partial.write_bytes(content)


def _netcdf_bytes(recording: xr.Dataset) -> bytes:
    """Return the file as it is to be: where the disk is full HDF5 itself would crash."""
    import h5netcdf
    import h5py

    # No fill value: NaN is itself, and the samples come back bit for bit.
    settings = {"zlib": True, "complevel": 1, "shuffle": True, "_FillValue": None}
    encoding = {str(name): dict(settings) for name in recording.variables}
    memory = {"driver": "core", "backing_store": False, "track_order": True}
    with h5py.File("recording", "w", **memory) as content:
        with h5netcdf.File(content, "r+") as file:
            recording.dump_to_store(xr.backends.H5NetCDFStore(file), encoding=encoding)
        content.flush()
        return bytes(content.id.get_file_image())


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
        raise DataError(f"{path}: no such recording. Correct the name.", path=str(path))
    with opened_netcdf(path) as file:
        recording = load_group(file)
    plain = {k: v.item() if isinstance(v, np.generic) else v for k, v in recording.attrs.items()}
    recording.attrs = plain
    return validate_recording(recording.drop_encoding())


def _history(file: Any) -> tuple[dict[str, Any], ...]:
    """Return the history of a recording of jointz; that of other programs is plain text."""
    try:
        steps = json.loads(file.attrs.get("history", ""))
    except (ValueError, TypeError):
        return ()
    return tuple(s for s in steps if isinstance(s, dict)) if isinstance(steps, list) else ()


def _walk(group: Any, prefix: str) -> list[str]:
    names = []
    for name, variable in group.variables.items():
        names.append(prefix + name)
        shape = variable.shape
        if len(shape) == 2 and shape[1] <= MOST_COLUMNS:
            names += [f"{prefix}{name}.{k + 1}" for k in range(shape[1])]
    for name, inner in group.groups.items():
        names += _walk(inner, f"{prefix}{name}/")
    return names


def _variables(
    path: Path, names: list[str]
) -> tuple[dict[str, xr.DataArray], tuple[dict[str, Any], ...]]:
    """Return variables by name, and the history of the file."""
    by_group = defaultdict(list)
    for name in names:
        by_group[name.rpartition("/")[0]].append(name)
    variables = {}
    with opened_netcdf(path) as file:
        for group, members in by_group.items():
            own = {member: member.rpartition("/")[2] for member in members}
            dataset = load_group(file[group] if group else file, own.values())
            variables.update({member: _variable(dataset, name) for member, name in own.items()})
        return variables, _history(file)


def _variable(dataset: xr.Dataset, name: str) -> xr.DataArray:
    """Return a variable, or a column of one."""
    if name in dataset.variables:
        return dataset[name]
    matrix, _, number = name.rpartition(".")
    return dataset[matrix][:, int(number) - 1]


def load_group(group: Any, only: Collection[str] | None = None) -> xr.Dataset:
    """Return the variables of one group in memory, unpacked, times as numbers."""
    store = xr.backends.H5NetCDFStore(group)
    dataset = xr.open_dataset(store, decode_times=False, decode_timedelta=False)
    if only is None:
        return dataset.load()
    there = {n if n in dataset.variables else n.rpartition(".")[0] for n in only}
    return dataset[sorted(there)].load()


@contextmanager
def opened_netcdf(path: Path) -> Iterator[Any]:
    """Open by h5py, so that a file h5netcdf gives up on is closed all the same."""
    import h5netcdf
    import h5py

    with path.open("rb") as raw:
        if raw.read(len(_CLASSIC)) == _CLASSIC:
            raise DataError(
                f"{path.name}: expected netCDF-4, found the classic netCDF-3 format. Convert it: "
                "nccopy -k nc4 OLD NEW.",
                path=str(path),
            )
    try:
        with h5py.File(path, "r") as content:
            check_hdf5(path, content)
            content.attrs.get("_nc3_strict")  # where h5netcdf would fail half-open
            with h5netcdf.File(content, "r", decode_vlen_strings=True) as file:
                yield file
    except DataError:
        raise
    except _LIBRARY_ERRORS as exc:
        raise damaged(path, exc) from exc
