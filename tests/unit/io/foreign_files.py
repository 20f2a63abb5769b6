"""Files as other programs write them, of formats that jointz only reads."""

import re
from collections.abc import Callable, Mapping
from pathlib import Path

import numpy as np
import pytest
import scipy.io

from jointz.core.acquisition import Acquisition, SignalGroup
from jointz.io.formats.registry import write_acquisition
from jointz.io.text.column_names import name_with_unit


def write_file(path: Path, *groups: SignalGroup) -> None:
    """Write groups of signals in the format of the suffix; text and netCDF as jointz does."""
    write = _WRITERS.get(path.suffix)
    if write is None:
        write_acquisition(Acquisition(groups), path, lossy=True)
    else:
        write(path, groups)


def _columns(group: SignalGroup) -> dict[str, np.ndarray]:
    """Return clock and samples under names with their units."""
    time = group.times_s()
    clock = {} if time is None else {"time [s]": time}
    return clock | {name_with_unit(signal): signal.values for signal in group.signals}


def _write_mat(path: Path, groups: tuple[SignalGroup, ...]) -> None:
    structs = {}
    for group in groups:
        columns = {re.sub(r"\W+", "_", n).strip("_"): v for n, v in _columns(group).items()}
        structs[group.name or "data"] = columns
    scipy.io.savemat(path, structs, do_compression=True, oned_as="column")


def _write_parquet(path: Path, groups: tuple[SignalGroup, ...]) -> None:
    pa = pytest.importorskip("pyarrow")
    import pyarrow.parquet

    (group,) = groups
    fields = [pa.field(s.name, _kind(pa, s.values), metadata={"units": s.unit})
              for s in group.signals]  # fmt: skip
    columns = [pa.array(s.values) for s in group.signals]
    if (time := group.times_s()) is not None:
        fields.insert(0, pa.field("time", pa.float64(), metadata={"units": "s"}))
        columns.insert(0, pa.array(time))
    pyarrow.parquet.write_table(pa.table(columns, schema=pa.schema(fields)), path)


def _kind(pa, values: np.ndarray):
    return pa.string() if values.dtype.kind == "O" else pa.float64()


def _write_xlsx(path: Path, groups: tuple[SignalGroup, ...]) -> None:
    openpyxl = pytest.importorskip("openpyxl")
    book = openpyxl.Workbook()
    book.remove(book.active)
    for group in groups:
        sheet, columns = book.create_sheet(group.name or "data"), _columns(group)
        sheet.append(list(columns))
        for row in zip(*(values.tolist() for values in columns.values()), strict=True):
            sheet.append([None if cell != cell else cell for cell in row])
    book.save(path)


def _write_opensim(path: Path, groups: tuple[SignalGroup, ...]) -> None:
    (group,) = groups
    names = ["time", *(signal.name.replace(" ", "_") for signal in group.signals)]
    table = np.column_stack([group.times_s(), *(signal.values for signal in group.signals)])
    head = ["walk", "version=1", f"nRows={len(table)}", f"nColumns={len(names)}", "inDegrees=yes"]
    rows = ["\t".join(map(repr, row)) for row in table.tolist()]
    path.write_text("\n".join([*head, "endheader", "\t".join(names), *rows]) + "\n")


_WRITERS: Mapping[str, Callable[[Path, tuple[SignalGroup, ...]], None]] = {
    ".mat": _write_mat,
    ".parquet": _write_parquet,
    ".xlsx": _write_xlsx,
    ".sto": _write_opensim,
    ".mot": _write_opensim,
}
