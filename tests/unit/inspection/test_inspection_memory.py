"""Reading and inspecting a packed file together take at most 1.5 times the memory limit."""

import gzip
import json
import os
import subprocess
import sys
import zipfile
from pathlib import Path

import h5py
import numpy as np
import openpyxl
import pyarrow as pa
import pyarrow.parquet
import pytest
from scipy.io import savemat

from jointz.core.errors import DataError
from jointz.inspection import content as inspected
from jointz.inspection.inspect_file import inspect_file

MB = 1_000_000
LIMIT = 60 * MB
N = LIMIT // 9  # numbers that take just less than the limit
#: Peak of the memory of a process for each file, beyond what its modules take.
CHILD = """
import json, os, pathlib, sys
import h5netcdf, openpyxl, pandas, pyarrow.parquet, pyarrow.compute, pymatreader
from jointz.core.errors import DataError
from jointz.inspection.inspect_file import inspect_file

def peak():
    status = pathlib.Path("/proc/self/status").read_text()
    return 1024 * int(status.partition("VmHWM:")[2].split()[0])

small, *files = sys.argv[1:]
for file in files:
    if child := os.fork():
        os.waitpid(child, 0)
        continue
    inspect_file(small)
    before, refusal = peak(), ""
    try:
        inspect_file(file)
    except DataError as exc:
        refusal = str(exc)
    print(json.dumps([file, peak() - before, refusal]), flush=True)
    os._exit(0)
"""


def parquet(path: Path) -> None:
    pa.parquet.write_table(pa.table({"angle": np.zeros(N)}), path, compression="zstd")


def matlab_5(path: Path) -> None:
    savemat(path, {"angle": np.zeros(N)}, do_compression=True)


def matlab_7(path: Path) -> None:
    with h5py.File(path, "w", userblock_size=512) as file:
        samples = file.create_dataset("angle", (1, N), "f8", compression="gzip", chunks=True)
        samples.attrs["MATLAB_class"] = np.bytes_("double")
    with path.open("r+b") as stream:
        stream.write(b"MATLAB 7.3 MAT-file, Platform: GLNXA64".ljust(124) + b"\0\2IM")


def packed_text(path: Path) -> None:
    with gzip.open(path, "wt", compresslevel=1) as file:
        file.write("time,angle\n" + "1,2\n" * (N // 2))


def workbook(path: Path, cell: str) -> None:
    book = openpyxl.Workbook()
    book.active.append(["angle"])
    book.save(path)
    with zipfile.ZipFile(path) as parts:
        content = {name: parts.read(name) for name in parts.namelist()}
    sheet = content["xl/worksheets/sheet1.xml"]
    content["xl/worksheets/sheet1.xml"] = sheet.replace(b"</row>", f"</row>{cell}".encode(), 1)
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as parts:
        for name, part in content.items():
            parts.writestr(name, part)


def workbook_text(path: Path) -> None:
    text = "x" * (LIMIT * 9 // 10)
    workbook(path, f'<row><c t="inlineStr"><is><t>{text}</t></is></c></row>')


BOMBS = {
    "numbers.parquet": parquet,
    "version5.mat": matlab_5,
    "version7.mat": matlab_7,
    "packed.csv.gz": packed_text,
    "text.xlsx": workbook_text,
}


@pytest.fixture(scope="module")
def inspections(tmp_path_factory):
    """The peak and the refusal of each file's inspection in a process of its own."""
    folder = tmp_path_factory.mktemp("bombs")
    (folder / "small.csv").write_text("time,angle\n0,1\n1,2\n")
    for name, make in BOMBS.items():
        make(folder / name)
    command = [sys.executable, "-c", CHILD, "small.csv", *BOMBS]
    env = os.environ | {"JOINTZ_MEMORY_LIMIT": f"{LIMIT}B"}
    run = subprocess.run(command, cwd=folder, env=env, stdout=subprocess.PIPE, check=True)
    return {name: told for name, *told in map(json.loads, run.stdout.splitlines())}


@pytest.mark.skipif(not Path("/proc/self/status").exists(), reason="the peak is told by Linux")
@pytest.mark.parametrize("name", BOMBS)
def test_reader_and_inspection_take_at_most_1_5_times_the_limit(name, inspections):
    peak, refusal = inspections[name]

    assert peak <= 1.5 * LIMIT
    assert f"{name}: unpacks to more than 0.06 GB" in refusal


def test_blanks_of_a_workbook_are_refused_by_the_directory_of_its_parts(tmp_path, monkeypatch):
    monkeypatch.setenv("JOINTZ_MEMORY_LIMIT", "10MB")
    workbook(tmp_path / "a.xlsx", " " * 2 * MB)
    monkeypatch.setattr(zipfile.ZipFile, "open", lambda *_, **__: pytest.fail("a part is read"))

    with pytest.raises(DataError, match=r"a.xlsx: unpacks to more than 0.01 GB"):
        inspect_file(tmp_path / "a.xlsx")


def test_a_text_longer_than_a_cell_holds_is_refused_by_its_cell(tmp_path):
    text = "x" * 40_000
    workbook(tmp_path / "a.xlsx", f'<row><c t="inlineStr"><is><t>{text}</t></is></c></row>')

    with pytest.raises(DataError, match=r"a.xlsx, Sheet!A2: "):
        inspect_file(tmp_path / "a.xlsx")


def test_a_file_far_below_the_limit_is_inspected(tmp_path, monkeypatch):
    monkeypatch.setenv("JOINTZ_MEMORY_LIMIT", f"{LIMIT}B")
    t = np.arange(200_000) / 1000
    columns = {
        "time": t,
        "knee_angle": np.sin(t),
        "knee_torque": np.cos(t),
        "trial": ["a"] * t.size,
    }
    pa.parquet.write_table(pa.table(columns), tmp_path / "a.parquet")

    channels = inspect_file(tmp_path / "a.parquet").channels

    assert [c.n for c in channels] == [t.size] * 4


def test_a_table_with_stray_cells_in_every_column_is_read_three_times_at_most(
    tmp_path, monkeypatch
):
    n = 60
    table = np.ones((n, n)).astype(str)
    np.fill_diagonal(table, "x")
    rows = [",".join(f"c{k}" for k in range(n)), *map(",".join, table)]
    (tmp_path / "a.csv").write_text("\n".join(rows) + "\n")
    readings = []

    def counted(*arguments, read=inspected.read_table, **options):
        readings.append(arguments)
        return read(*arguments, **options)

    monkeypatch.setattr(inspected, "read_table", counted)

    notes = " ".join(inspect_file(tmp_path / "a.csv").notes)

    assert "row 2, column 'c0'" in notes
    assert len(readings) <= 3
