"""Columns of a study out of files that hold groups of signals."""

from pathlib import Path

import numpy as np
import pytest
from tests.unit.io.foreign_files import write_file

import jointz
from jointz.core.acquisition import Signal, SignalGroup
from jointz.core.errors import DataError, StudyError
from jointz.core.study import FilesSpec
from jointz.io.formats.columns import RawTable
from jointz.io.formats.registry import list_columns, read_table
from jointz.io.recordings import read_recording

from .c3d_files import theirs

PLAIN = FilesSpec()
N = 40
ANGLE_DEG = np.arange(N) / 8.0
TORQUE_NM = np.arange(N) / 16.0 - 1.0


@pytest.fixture
def c3d(tmp_path: Path) -> Path:
    """Markers at 50 Hz from 2 s on, and channels at 200 Hz."""
    channels = np.stack([ANGLE_DEG, TORQUE_NM, np.ones(N)])
    markers = {"LKNE": np.tile(np.arange(10.0), (3, 1))}
    file = theirs(markers, channels, ["knee", "motor", "LKNE.x"], 50)
    file["parameters"]["POINT"]["UNITS"]["value"] = ["mm"]
    file["parameters"]["ANALOG"]["UNITS"]["value"] = ["deg", "Nm", "V"]
    file["header"]["points"]["first_frame"] = 100
    file.write(str(tmp_path / "walk.c3d"))
    return tmp_path / "walk.c3d"


def columns(path: Path, *names: str, labels: tuple[str, ...] = ()) -> RawTable:
    return read_table(path, numeric=names, labels=labels, files=PLAIN)


def test_a_signal_is_found_by_its_name_where_it_is_the_only_one(c3d: Path) -> None:
    table = columns(c3d, "knee", "motor")
    assert np.array_equal(table.columns["knee"], ANGLE_DEG)
    assert np.array_equal(table.columns["motor"], TORQUE_NM)
    assert table.units == {"knee": "deg", "motor": "Nm"}


def test_a_signal_of_two_groups_is_found_by_its_group(c3d: Path) -> None:
    assert columns(c3d, "analogs/LKNE.x").units == {"analogs/LKNE.x": "V"}
    assert columns(c3d, "points/LKNE.x").columns["points/LKNE.x"].size == 10
    with pytest.raises(DataError, match=r"name points/LKNE\.x or analogs/LKNE\.x"):
        columns(c3d, "LKNE.x")


def test_time_is_the_clock_of_the_group_that_is_read(c3d: Path) -> None:
    table = columns(c3d, "time", "knee")
    np.testing.assert_allclose(table.columns["time"], 2.0 + np.arange(N) / 200, rtol=0, atol=1e-12)
    assert table.units["time"] == "s"
    table = columns(c3d, "points/time", "LKNE.y")
    assert table.columns["points/time"][-1] == pytest.approx(2.18)


def test_the_columns_are_listed_by_every_name_the_clear_ones_first(c3d: Path) -> None:
    clear = ["time", "points/time", "points/LKNE.x", "LKNE.y", "LKNE.z", "analogs/time", "knee"]
    clear += ["motor", "analogs/LKNE.x"]
    more = ["points/LKNE.y", "points/LKNE.z", "analogs/knee", "analogs/motor"]
    assert list_columns(c3d, PLAIN) == clear + more
    assert columns(c3d, "analogs/knee").units == {"analogs/knee": "deg"}


def test_columns_of_two_rates_are_refused_with_both(c3d: Path) -> None:
    with pytest.raises(DataError, match=r"knee: 40 .* 200 Hz .*LKNE\.y: 10 .* 50 Hz"):
        columns(c3d, "knee", "LKNE.y")


def test_groups_of_one_clock_may_be_read_together(tmp_path: Path) -> None:
    path = tmp_path / "two.xlsx"
    stamps = np.array([1.0, 1.5, 2.5])
    groups = [
        SignalGroup(name, (Signal(name, np.arange(3.0)),), time_s=stamps + shift)
        for name, shift in (("a", 0.0), ("b", 0.0), ("late", 0.25))
    ]
    write_file(path, *groups)
    assert set(columns(path, "a", "b").columns) == {"a", "b"}
    with pytest.raises(DataError, match="a: 3 samples"):
        columns(path, "a", "late")


def test_a_missing_column_is_named_with_those_there_are(c3d: Path) -> None:
    with pytest.raises(DataError, match=r"'kneee'.*'knee'"):
        columns(c3d, "kneee")
    path = c3d.with_name("points.c3d")
    theirs({"RKNE": np.zeros((3, 4))}, np.zeros((0, 4)), []).write(str(path))
    with pytest.raises(DataError, match=r"'RKNE' is a point: name"):
        columns(path, "RKNE")


def test_text_is_a_label_and_no_number(tmp_path: Path) -> None:
    head = ["Time [s]", "task"]
    path = book(tmp_path / "words.xlsx", head, [0.0, "walk"], [0.1, None], [0.2, "1.0"])
    assert columns(path, labels=("task",)).columns["task"].tolist() == ["walk", "", "1"]
    with pytest.raises(DataError, match="expected numbers, found text"):
        columns(path, "task")


STUDY = """\
jointz = 1
joint = "knee"
kind = "walking"
positive = "flexion"
torque_acts_on = "device"
participants = [{ id = "S01" }]
recordings = [{ participant = "S01", condition = "unperturbed", file = "walk.c3d" }]
[channels]
time = { column = "time", unit = "s" }
angle = { column = "knee", unit = "deg" }
torque.column = "motor"
"""


def test_a_study_of_a_c3d_file_opens_and_gives_si_units(c3d: Path) -> None:
    study_file = c3d.with_name("study.toml")
    study_file.write_text(STUDY, encoding="utf-8")
    study = jointz.open_study(c3d.parent)
    (recording,) = read_recording(study, study.spec.recordings[0])
    np.testing.assert_allclose(recording["angle"], np.deg2rad(ANGLE_DEG), rtol=1e-15)
    np.testing.assert_allclose(recording["torque"], -TORQUE_NM, rtol=0)
    np.testing.assert_allclose(recording["time"], 2.0 + np.arange(N) / 200, rtol=0, atol=1e-12)
    study_file.write_text(STUDY.replace('"knee", unit', '"ankle", unit'), encoding="utf-8")
    with pytest.raises(StudyError, match=r"walk\.c3d has no column 'ankle' for channel 'angle'"):
        jointz.open_study(c3d.parent)


def book(path: Path, *rows: list[object]) -> Path:
    openpyxl = pytest.importorskip("openpyxl", reason="workbooks need jointz[formats]")
    made = openpyxl.Workbook()
    for row in rows:
        made.active.append(row)
    made.save(path)
    return path


@pytest.mark.parametrize("column", ["time", "Time"])
def test_a_clock_without_a_unit_has_the_one_that_a_study_says(tmp_path: Path, column: str) -> None:
    samples = zip(5.0 * np.arange(N), ANGLE_DEG, TORQUE_NM, strict=True)
    head = ["Time", "knee", "motor"], [None, "deg", "Nm"]
    path = book(tmp_path / "walk.xlsx", *head, *[[float(x) for x in row] for row in samples])
    assert "Time" in list_columns(path, PLAIN)
    assert columns(path, "time", "knee").units == {"knee": "deg"}

    said = STUDY.replace('"time", unit = "s"', f'"{column}", unit = "ms"').replace(".c3d", ".xlsx")
    path.with_name("study.toml").write_text(said, encoding="utf-8")
    study = jointz.open_study(tmp_path)
    (recording,) = read_recording(study, study.spec.recordings[0])
    np.testing.assert_allclose(recording["time"], np.arange(N) / 200, rtol=0, atol=1e-12)


def test_of_two_clocks_of_one_name_that_of_the_group_is_read(tmp_path: Path) -> None:
    head = ["Time [s]", "knee", None, "Time [s]", "motor"]
    rows = [[0.0, 1.0, None, 0.00, 7.0], [0.1, 2.0, None, 0.05, 8.0]]
    path = book(tmp_path / "two.xlsx", head, *rows)
    assert columns(path, "Time [s]", "motor").columns["Time [s]"].tolist() == [0.0, 0.05]
    assert columns(path, "Sheet!A/Time [s]", "knee").columns["Sheet!A/Time [s]"][1] == 0.1
    with pytest.raises(DataError, match=r"name Sheet!A/Time \[s\] or Sheet!D/Time \[s\]"):
        columns(path, "Time [s]")
