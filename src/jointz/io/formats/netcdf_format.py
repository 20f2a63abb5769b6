"""netCDF-4 files in and out: groups are groups, each with its own clock.

Of the formats that jointz writes this one holds everything. The layout, for other programs:

- every group is a netCDF group ``g1``, ``g2`` ..., with attributes ``name``, ``rate_hz`` and
  ``start_s`` where its clock is uniform, a dimension ``sample``, and a variable a signal
  (``s1``, ``s2`` ... where netCDF does not take its name) with ``name``, ``units`` and
  ``description``. A variable ``clock`` holds the time of each sample, where there is a clock.
- ``events`` holds ``time_s``, ``duration_s`` and ``label``; ``metadata`` holds ``key`` and
  ``value``.
- Behind the end that HDF5 knows stands a SHA-256 of all before it: HDF5 has none of its own, and
  on some damage it never comes back. A program that changes the file cuts it off.
"""

import hashlib
import json
import re
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from itertools import chain
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr

from jointz.core.acquisition import Acquisition, Event, Signal, SignalGroup
from jointz.core.grouping import by_key
from jointz.core.study import FilesSpec
from jointz.io.formats.columns import (
    RawTable,
    TableRequest,
    damage_errors,
    damaged,
    make_table,
    missing_columns,
)
from jointz.io.formats.losses import listed, lost_letters, plainly, text_array, words_of
from jointz.io.formats.netcdf_recording import load_group, netcdf_bytes, opened_netcdf
from jointz.io.text.column_names import READING, unit_in_name, with_clock

_MOST_COLUMNS = 64  # of a matrix, to be taken apart into columns ``NAME.1``, ``NAME.2`` and so on
_SEAL = b"\njointz sha256 "
_SEAL_BYTES = len(_SEAL) + 64
_LAYOUT = "jointz_acquisition"
_VERSION = "1"
_CLOCK = "clock"
_TAKEN = (_CLOCK, "sample")
_EASY = re.compile(r"[A-Za-z]\w*", re.ASCII)
_BLOCK_BYTES = 1 << 20
_LONGEST_ATTRIBUTE = 60_000  # bytes; HDF5 keeps attributes in a header of 64 KB


class NetcdfFormat:
    """Reads any netCDF-4 file and recordings of jointz; writes all of a content.

    A column is a variable by name, ``group/variable`` in groups; ``variable.3`` is the third
    column of a matrix.
    """

    name = "netCDF-4"

    def read(self, path: Path, files: FilesSpec) -> Acquisition:  # noqa: ARG002
        """Return every variable along one dimension, grouped by group and dimension."""
        with _opened(path) as file:
            layout = file.attrs.get(_LAYOUT)
            contents = {
                name: load_group(file[name] if name else file) for name in _groups_in(file, "")
            }
        with damage_errors(path, KeyError, ValueError, TypeError, IndexError, AttributeError):
            return _foreign(contents) if layout is None else _jointz_content(contents)

    def read_columns(self, path: Path, request: TableRequest) -> RawTable:
        """Return the requested variables; fill values become NaN, packed ones are unpacked."""
        variables: dict[str, xr.DataArray] = {}
        clocks: dict[str, np.ndarray] = {}
        with _opened(path) as file:
            names, available = [str(c) for c in request.columns], _variable_names(file, "")
            missing = [name for name in names if name not in available]
            if missing:
                raise missing_columns(path, missing, available)
            by_group = by_key((name.rpartition("/")[0], name) for name in names)
            several = request.several_clocks and len(by_group) > 1 and _LAYOUT in file.attrs
            for group, members in by_group.items():
                short = {member: member.rpartition("/")[2] for member in members}
                dataset = load_group(file[group] if group else file, short.values())
                variables |= {member: _variable(dataset, name) for member, name in short.items()}
                if several and "rate_hz" in dataset.attrs:
                    clocks |= dict.fromkeys(members, _uniform_times(dataset))
            history = _history(file)
        units = {n: str(v.attrs["units"]) for n, v in variables.items() if "units" in v.attrs}
        return make_table(
            path, request, lambda c: variables[c].values, units, history=history, clocks=clocks
        )

    def list_columns(self, path: Path, files: FilesSpec) -> list[str]:  # noqa: ARG002
        """Return the variables of all groups."""
        with _opened(path) as file:
            return _variable_names(file, "")

    def losses(self, content: Acquisition) -> list[str]:
        """List what netCDF cannot hold: NUL, surrogates, very long texts beside samples."""
        lost = lost_letters(content.groups)
        odd = [word for word in words_of(content) if _attribute(word) != word]
        if odd:
            shown = listed(repr(word[:40]) for word in odd)
            lost.append(f"It cannot hold as they are (NUL, half letters, over 60 KB): {shown}.")
        return lost

    def encode(self, content: Acquisition, path: Path) -> bytes:  # noqa: ARG002
        """Return everything; samples are kept bit for bit."""
        data = netcdf_bytes(lambda file: _fill(file, content))
        return data + _SEAL + hashlib.sha256(data).hexdigest().encode()


@contextmanager
def _opened(path: Path) -> Iterator[Any]:
    """Open a file, but none of jointz that was damaged: HDF5 may hang."""
    _check_seal(path)
    with opened_netcdf(path) as file:
        yield file


def _variable_names(group: Any, prefix: str) -> list[str]:
    names = []
    for name, variable in group.variables.items():
        names.append(prefix + name)
        shape = variable.shape
        if len(shape) == 2 and shape[1] <= _MOST_COLUMNS:
            names += [f"{prefix}{name}.{k + 1}" for k in range(shape[1])]
    for name, inner in group.groups.items():
        names += _variable_names(inner, f"{prefix}{name}/")
    return names


def _variable(dataset: xr.Dataset, name: str) -> xr.DataArray:
    """Return a variable, or a column of one."""
    if name in dataset.variables:
        return dataset[name]
    matrix, _, number = name.rpartition(".")
    return dataset[matrix][:, int(number) - 1]


def _uniform_times(dataset: xr.Dataset) -> np.ndarray:
    """Return the times of the samples of a group that jointz wrote, s."""
    start_s, rate_hz = dataset.attrs["start_s"], dataset.attrs["rate_hz"]
    return np.asarray(start_s + np.arange(dataset.sizes["sample"]) / rate_hz)


def _history(file: Any) -> tuple[dict[str, Any], ...]:
    """Return the history of a recording of jointz; that of other programs is plain text."""
    try:
        steps = json.loads(file.attrs.get("history", ""))
    except (ValueError, TypeError):
        return ()
    return tuple(s for s in steps if isinstance(s, dict)) if isinstance(steps, list) else ()


def _check_seal(path: Path) -> None:
    """Refuse a file of jointz that was damaged."""
    with path.open("rb") as file:
        size = file.seek(0, 2)
        file.seek(max(0, size - _SEAL_BYTES))
        seal = file.read()
        if not seal.startswith(_SEAL):
            return  # of another program, or changed by one
        file.seek(0)
        digest, left = hashlib.sha256(), size - _SEAL_BYTES
        while left and (block := file.read(min(left, _BLOCK_BYTES))):
            digest.update(block)
            left -= len(block)
    if seal.removeprefix(_SEAL) != digest.hexdigest().encode():
        raise damaged(path, ValueError("its bytes are not those that were written"))


def _groups_in(file: Any, prefix: str) -> Iterator[str]:
    yield prefix.rstrip("/")
    for name, inner in file.groups.items():
        yield from _groups_in(inner, f"{prefix}{name}/")


# --- the layout of jointz ---------------------------------------------------------------------


def _fill(file: Any, content: Acquisition) -> None:
    file.attrs[_LAYOUT] = _VERSION
    for k, group in enumerate(content.groups, start=1):
        _put_group(file.create_group(f"g{k}"), group)
    times = [(event.time_s, event.duration_s) for event in content.events]
    table = np.array(times, dtype=np.float64).reshape(-1, 2)
    events, metadata = file.create_group("events"), file.create_group("metadata")
    events.dimensions["sample"] = len(content.events)
    _put(events, "time_s", table[:, 0], {"units": "s"})
    _put(events, "duration_s", table[:, 1], {"units": "s"})
    _put(events, "label", text_array(event.label for event in content.events), {})
    metadata.dimensions["sample"] = len(content.metadata)
    _put(metadata, "key", text_array(content.metadata), {})
    _put(metadata, "value", text_array(content.metadata.values()), {})


def _put_group(place: Any, group: SignalGroup) -> None:
    place.dimensions["sample"] = group.n_samples
    place.attrs["name"] = _attribute(group.name)
    place.attrs["start_s"] = group.start_s
    if group.rate_hz is not None:
        place.attrs["rate_hz"] = group.rate_hz
    names: set[str] = set(_TAKEN)
    for k, signal in enumerate(group.signals, start=1):
        own = [signal.name] if _EASY.fullmatch(signal.name) else []
        numbered = (f"s{i}" for i in range(k, 2**31))
        name = next(n for n in chain(own, numbered) if n not in names)
        names.add(name)
        words = {"name": signal.name, "units": signal.unit, "description": signal.description}
        attributes = {key: _attribute(w) for key, w in words.items() if w or key == "name"}
        _put(place, name, signal.values, attributes)
    time = group.times_s()
    if time is not None:
        _put(place, _CLOCK, time, {"units": "s"})


def _put(place: Any, name: str, values: np.ndarray, attributes: Mapping[str, str]) -> None:
    import h5py

    text = values.dtype.kind == "O"
    kind = h5py.string_dtype() if text else np.float64
    data = np.array([plainly(str(v)) for v in values], dtype=object) if text else values
    packed = {"compression": "gzip", "compression_opts": 1, "shuffle": True} if len(data) else {}
    variable = place.create_variable(name, ("sample",), kind, data=data, **packed)
    for key, word in attributes.items():
        variable.attrs[key] = word


def _jointz_content(contents: Mapping[str, xr.Dataset]) -> Acquisition:
    numbered = sorted(int(n[1:]) for n in contents if re.fullmatch(r"g\d+", n))
    pairs = [_jointz_group(f"g{k}", contents[f"g{k}"]) for k in numbered]
    columns = [contents["events"][n].to_numpy() for n in ("time_s", "label", "duration_s")]
    texts = [contents["metadata"][n].to_numpy() for n in ("key", "value")]
    metadata = {str(k): str(v) for k, v in zip(*texts, strict=True)}
    return Acquisition(
        tuple(group for group, _ in pairs),
        tuple(Event(float(t), str(n), float(d)) for t, n, d in zip(*columns, strict=True)),
        metadata | {f"{READING}clock.{group.name}": note for group, note in pairs if note},
    )


def _jointz_group(place: str, content: xr.Dataset) -> tuple[SignalGroup, str]:
    """Return a group, and a note where its clock is not the one that jointz wrote."""
    signals = tuple(
        Signal(
            str(v.attrs.get("name", "")),
            _samples(v),
            str(v.attrs.get("units", "")),
            str(v.attrs.get("description", "")),
            f"{place}/{key}",
        )
        for key, v in content.variables.items()
        if key != _CLOCK
    )
    name, rate = str(content.attrs["name"]), content.attrs.get("rate_hz")
    stamps = content[_CLOCK].to_numpy() if _CLOCK in content else None
    column = "" if stamps is None else f"{place}/{_CLOCK}"
    start = float(content.attrs["start_s"])
    if rate is None:
        return SignalGroup(name, signals, None, start, stamps, column), ""
    uniform = SignalGroup(name, signals, float(rate), start, time_column=column)
    times = uniform.times_s()
    if stamps is not None and times is not None and np.array_equal(stamps, times, equal_nan=True):
        return uniform, ""
    # Another program took samples or the clock out, and left the rate as it was.
    note = (
        f"group '{name}' is not as jointz wrote it: its {rate:g} Hz from {start:g} s are not those "
        f"of its samples, {'which have no clock' if stamps is None else 'whose stamps are taken'}"
    )
    return SignalGroup(name, signals, None, 0.0, stamps, column), note


# --- files of others --------------------------------------------------------------------------


def _foreign(contents: Mapping[str, xr.Dataset]) -> Acquisition:
    groups: list[SignalGroup] = []
    metadata: dict[str, str] = {}
    left_out: list[str] = []
    for place, content in contents.items():
        prefix = f"{place.replace('/', '.')}." if place else ""
        metadata |= {f"{prefix}{key}": str(value) for key, value in content.attrs.items()}
        by_dimension, names = _columns(place, content)
        left_out += [f"{place}/{name}" if place else name for name in names]
        for dimension, signals in by_dimension.items():
            name = "/".join(p for p in (place, dimension if len(by_dimension) > 1 else "") if p)
            group, notes = with_clock(name, signals)
            groups.append(group)
            metadata |= notes
    if left_out:
        metadata[f"{READING}left_out"] = f"no series of samples: {listed(left_out)}"
    return Acquisition(tuple(groups), (), metadata)


def _columns(path: str, content: xr.Dataset) -> tuple[dict[str, list[Signal]], list[str]]:
    """Return signals by dimension, and the variables that are no series."""
    by_dimension: dict[str, list[Signal]] = {}
    left_out = []
    for key, variable in content.variables.items():
        name = str(key)
        wide = variable.ndim == 2 and variable.shape[1] <= _MOST_COLUMNS
        if not (variable.ndim == 1 or wide) or variable.dtype.kind not in "fiubOSU":
            left_out.append(name)
            continue
        values = _samples(variable)
        columns = (
            {name: values}
            if variable.ndim == 1
            else {f"{name}.{k + 1}": values[:, k] for k in range(variable.shape[1])}
        )
        unit = str(variable.attrs.get("units", "")) or unit_in_name(name)
        attributes = variable.attrs
        description = str(attributes.get("description") or attributes.get("long_name") or "")
        place = by_dimension.setdefault(str(variable.dims[0]), [])
        prefix = f"{path}/" if path else ""
        place += [Signal(n, v, unit, description, f"{prefix}{n}") for n, v in columns.items()]
    return by_dimension, left_out


def _samples(variable: Any) -> np.ndarray:
    values = variable.values
    if values.dtype.kind in "fiub":
        return np.asarray(values, dtype=np.float64)
    flat = [v.decode("utf-8", "replace") if isinstance(v, bytes) else str(v) for v in values.flat]
    return text_array(flat).reshape(values.shape)


def _attribute(word: str) -> str:
    """Return what an attribute can hold of a word."""
    return plainly(word).encode()[:_LONGEST_ATTRIBUTE].decode(errors="ignore")
