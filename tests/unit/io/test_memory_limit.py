"""Files that unpack to more than memory may hold are refused by name, before they are read."""

import gzip
import os
import struct
import zipfile
from pathlib import Path

import h5py
import numpy as np
import pyarrow as pa
import pyarrow.parquet
import pytest
from scipy.io import savemat

from jointz.core.errors import DataError
from jointz.core.study import FilesSpec
from jointz.io.formats.memory_limit import memory_limit
from jointz.io.formats.registry import read_acquisition, read_table

MB = 1_000_000
N = MB
#: Less than N numbers take.
LIMIT = "5MB"


def packed_text(path: Path) -> None:
    with gzip.open(path, "wt") as file:
        file.write("t,angle\n" + "1,2\n" * N)


def mat_numbers(path: Path) -> None:
    savemat(path, {"angle": np.zeros(N)}, do_compression=True)


def mat_small_numbers(path: Path) -> None:
    """One byte a number in the file, inside a struct; eight in memory."""
    savemat(path, {"data": {"angle": np.zeros(N, np.uint8)}}, do_compression=True)


def mat_many_pieces(path: Path) -> None:
    savemat(path, {"angle": np.full(25_000, np.zeros(1), object)}, do_compression=True)


def mat4_sparse(path: Path) -> None:
    """Version 4: one number in a matrix of 1 x 100,000,000, in 68 bytes."""
    header = struct.pack("<5i", 2, 2, 3, 0, 6) + b"angle\0"
    path.write_bytes(header + np.array([[1, 1, 1], [1, 100 * MB, 0]], "<f8").tobytes("F"))


def mat_places(path: Path, places: bytes, *, of: np.ndarray, version: bytes = b"\0\1IM") -> None:
    """A million times as many cells, elements or letters as the file holds."""
    savemat(path, {"angle": of})
    content = path.read_bytes()
    content = content.replace(np.array(of.shape, "<i4").tobytes(), places, 1)
    path.write_bytes(content.replace(b"\0\1IM", version, 1))


def mat_cells(path: Path, **kinds) -> None:
    mat_places(path, np.array([2, 4 * MB], "<i4").tobytes(), of=np.zeros((2, 4), object), **kinds)


def mat_cells_of_odd_version(path: Path) -> None:
    mat_cells(path, version=b"\1\1IM")


def mat_struct(path: Path) -> None:
    fields = [(f"field{k}", object) for k in range(40)]
    mat_places(path, np.array([2, MB // 20], "<i4").tobytes(), of=np.zeros((2, 4), fields))


def hdf5(path: Path, **kinds) -> None:
    with h5py.File(path, "w", userblock_size=512 if path.suffix == ".mat" else 0) as file:
        file.create_dataset("angle", shape=(100 * MB,), dtype="f8", chunks=(1000,), **kinds)


def hdf5_chunk(path: Path) -> None:
    with h5py.File(path, "w") as file:
        ones, kinds = np.ones(10), {"maxshape": (None,), "compression": "gzip"}
        file.create_dataset("angle", (10,), "f8", ones, chunks=(N,), **kinds)


def hdf5_links(path: Path) -> None:
    """A thousand million paths to eight numbers."""
    with h5py.File(path, "w") as file:
        inner = file.create_group("g0")
        inner["angle"] = np.ones(8)
        for depth in range(1, 10):
            outer = file.create_group(f"g{depth}")
            for k in range(10):
                outer[f"x{k}"] = inner
            inner = outer


def hdf5_references(path: Path) -> None:
    with h5py.File(path, "w", userblock_size=512) as file:
        target = file.create_dataset("#refs#/a", data=np.ones(1000))
        links = np.full(1500, target.ref, dtype=h5py.ref_dtype)
        file.create_dataset("angle", data=links, dtype=h5py.ref_dtype, compression="gzip")


def parquet_numbers(path: Path) -> None:
    pa.parquet.write_table(pa.table({"angle": np.zeros(N)}), path, compression="zstd")


def parquet_texts(path: Path) -> None:
    pa.parquet.write_table(pa.table({"angle": ["x" * 100_000] * 250}), path)


def hdf5_texts(path: Path) -> None:
    with h5py.File(path, "w") as file:
        file.create_dataset("angle", data=np.array(["x" * 1000] * 7_000, object))


def parquet_large_texts(path: Path) -> None:
    texts = pa.array(["x" * 100_000] * 250).cast(pa.large_string())
    pa.parquet.write_table(pa.table({"angle": texts}), path)


def workbook(path: Path, rows: str, more: str = "") -> None:
    import openpyxl

    book = openpyxl.Workbook()
    book.active.append(["angle"])
    book.save(path)
    with zipfile.ZipFile(path) as book:
        parts = {name: book.read(name) for name in book.namelist()}
    sheet = parts["xl/worksheets/sheet1.xml"].decode()
    sheet = sheet.replace("</sheetData>", f"{rows}</sheetData>{more}")
    parts["xl/worksheets/sheet1.xml"] = sheet.encode()
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as book:
        for name, content in parts.items():
            book.writestr(name, content)


def workbook_cells(path: Path) -> None:
    workbook(path, "<row>" + "<c/>" * 30_000 + "</row>")


def workbook_rows(path: Path) -> None:
    workbook(path, '<row ht="1"/>' * 30_000)


def workbook_merged(path: Path) -> None:
    workbook(path, "", '<mergeCells><mergeCell ref="A1:XFD1048576"/></mergeCells>')


def workbook_part(path: Path) -> None:
    workbook(path, "<!--" + " " * (7 * MB) + "-->")


BOMBS = [
    ("a.csv.gz", packed_text),
    ("a.mat", mat_numbers),
    ("a.mat", mat_small_numbers),
    ("a.mat", mat_many_pieces),
    ("a.mat", mat4_sparse),
    ("a.mat", mat_cells),
    ("a.mat", mat_cells_of_odd_version),
    ("a.mat", mat_struct),
    ("a.mat", hdf5),
    ("a.mat", hdf5_references),
    ("a.nc", hdf5),
    ("a.nc", hdf5_chunk),
    ("a.nc", hdf5_links),
    ("a.nc", hdf5_texts),
    ("a.parquet", parquet_numbers),
    ("a.parquet", parquet_texts),
    ("a.parquet", parquet_large_texts),
    ("a.xlsx", workbook_cells),
    ("a.xlsx", workbook_rows),
    ("a.xlsx", workbook_merged),
    ("a.xlsx", workbook_part),
]


@pytest.mark.parametrize(("name", "make"), BOMBS, ids=[f"{n}-{m.__name__}" for n, m in BOMBS])
def test_a_file_that_unpacks_to_more_than_the_limit_is_refused_by_name(
    name, make, tmp_path, monkeypatch
):
    monkeypatch.setenv("JOINTZ_MEMORY_LIMIT", LIMIT)
    path = tmp_path / name
    make(path)

    with pytest.raises(DataError, match=rf"{name}: unpacks to more than 0.005 GB"):
        read_table(path, numeric=["angle"], files=FilesSpec())
    with pytest.raises(DataError, match=rf"{name}: unpacks to more than 0.005 GB"):
        read_acquisition(path)


def test_labels_of_packed_text_count_as_texts(tmp_path, monkeypatch):
    monkeypatch.setenv("JOINTZ_MEMORY_LIMIT", "20MB")
    path = tmp_path / "a.csv.gz"
    with gzip.open(path, "wt") as file:
        file.write("t,trial\n" + "".join(f"1,{k}\n" for k in range(110_000)))

    assert len(read_table(path, numeric=["t"], files=FilesSpec()).columns["t"]) == 110_000
    with pytest.raises(DataError, match=r"a.csv.gz: unpacks to more than 0.02 GB"):
        read_table(path, numeric=["t"], labels=["trial"], files=FilesSpec())


@pytest.mark.parametrize("kind", [pa.list_(pa.float64()), pa.binary(3), pa.string_view()])
def test_a_parquet_column_of_unknown_size_is_refused_only_where_it_is_wanted(kind, tmp_path):
    path = tmp_path / "a.parquet"
    odd = pa.nulls(2, kind)
    pa.parquet.write_table(pa.table({"angle": [1.0, 2.0], "odd": odd}), path)

    assert len(read_table(path, numeric=["angle"], files=FilesSpec()).columns["angle"]) == 2
    assert "odd" in str(read_acquisition(path).metadata)
    with pytest.raises(DataError, match=r"a.parquet, column 'odd': "):
        read_table(path, numeric=[], labels=["odd"], files=FilesSpec())


@pytest.mark.parametrize(
    ("name", "make"),
    [("a.csv.gz", packed_text), ("a.mat", mat_small_numbers), ("a.parquet", parquet_numbers)],
)
def test_a_raised_limit_takes_the_file(name, make, tmp_path, monkeypatch):
    monkeypatch.setenv("JOINTZ_MEMORY_LIMIT", "500 MB")
    path = tmp_path / name
    make(path)
    column = "data.angle" if make is mat_small_numbers else "angle"

    assert len(read_table(path, numeric=[column], files=FilesSpec()).columns[column]) == N


@pytest.mark.parametrize(("stated", "share"), [("1000000\n", 250_000), ("max\n", None)])
def test_the_limit_of_a_container_is_taken_where_it_is_less(stated, share, tmp_path, monkeypatch):
    monkeypatch.delenv("JOINTZ_MEMORY_LIMIT", raising=False)
    monkeypatch.setattr("jointz.io.formats.memory_limit.CGROUP_FILES", ())
    whole, file = memory_limit(), tmp_path / "memory.max"
    file.write_text(stated)
    monkeypatch.setattr("jointz.io.formats.memory_limit.CGROUP_FILES", (tmp_path / "none", file))

    assert memory_limit() == (share or whole)


def test_the_limit_is_a_quarter_of_memory_unless_another_is_given(jointz, tmp_path, monkeypatch):
    monkeypatch.delenv("JOINTZ_MEMORY_LIMIT", raising=False)
    monkeypatch.setattr("jointz.io.formats.memory_limit.CGROUP_FILES", ())
    assert memory_limit() == os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES") // 4

    monkeypatch.setenv("JOINTZ_MEMORY_LIMIT", "1kB")
    path = tmp_path / "a.parquet"
    pa.parquet.write_table(pa.table({"angle": np.zeros(1000)}), path)
    assert jointz("inspect", path).code == 2
    assert jointz("--memory-limit", "1GB", "inspect", path).code == 0
    wrong = jointz("--memory-limit", "much", "inspect", path)
    assert wrong.code == 2
    assert "'much'" in wrong.err
