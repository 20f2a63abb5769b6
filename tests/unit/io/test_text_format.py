"""Whole text tables: names and units as they stand, the clock, logs of known devices."""

import gzip
from pathlib import Path

import numpy as np
import pytest

from jointz.core.acquisition import Acquisition, Signal
from jointz.core.errors import DataError
from jointz.core.study import FilesSpec
from jointz.io.formats.registry import read_acquisition, write_acquisition


def read(tmp_path: Path, text: str, name: str = "a.csv", **layout: object) -> Acquisition:
    (tmp_path / name).write_text(text, encoding="utf-8")
    return read_acquisition(tmp_path / name, FilesSpec(**layout))  # type: ignore[arg-type]


def signals(content: Acquisition) -> dict[str, Signal]:
    (group,) = content.groups
    return {signal.name: signal for signal in group.signals}


def test_units_come_from_brackets_and_names_stay_as_they_are(tmp_path):
    text = "knee [deg],torque (Nm),hip_deg,force (left)\n1,2,3,4\n5,6,7,8\n"
    found = signals(read(tmp_path, text))

    assert list(found) == ["knee [deg]", "torque (Nm)", "hip_deg", "force (left)"]
    assert [signal.unit for signal in found.values()] == ["deg", "Nm", "", ""]


def test_every_column_is_tried_as_numbers_and_those_of_text_are_told(tmp_path):
    content = read(tmp_path, "a,b,c\n1,left,\n2,right,NaN\n,left,4\n")
    found = signals(content)

    np.testing.assert_array_equal(found["a"].values, [1, 2, np.nan])
    assert found["b"].values.tolist() == ["left", "right", "left"]
    np.testing.assert_array_equal(found["c"].values, [np.nan, np.nan, 4])
    assert "'b'" in content.metadata["reading.text"]


def test_text_that_begins_late_is_still_text(tmp_path):
    rows = "".join(f"{k},\n" for k in range(300)) + "300,yes\n301,no\n"

    assert signals(read(tmp_path, f"a,note\n{rows}"))["note"].is_text


def test_one_bad_cell_among_numbers_is_an_error_with_its_row(tmp_path):
    rows = "".join(f"{k},{k}\n" for k in range(300))

    with pytest.raises(DataError, match=r"a\.csv, row 302, column 'b': .*'x5'"):
        read(tmp_path, f"a,b\n{rows}300,x5\n")


@pytest.mark.parametrize(
    ("name", "expected"),
    [
        ("time [s]", [0.0, 0.5]),
        ("TimeStamp", [0.0, 0.5]),
        ("loop_time", [0.0, 0.5]),
        ("time_ms", [0.0, 0.0005]),
        ("Time (Milliseconds)", [0.0, 0.0005]),
        ("TIME [MSEC]", [0.0, 0.0005]),
        ("time (1)", [0.0, 0.5]),
        ("Time (frames)", None),
        ("timing", None),
        ("time [deg]", None),
        ("contact time", None),
    ],
)
def test_what_is_the_clock(tmp_path, name, expected):
    (group,) = read(tmp_path, f"{name},x\n0,1\n0.5,2\n").groups

    if expected is None:
        assert group.time_s is None
    else:
        np.testing.assert_array_equal(group.time_s, expected)


def test_a_clock_without_a_unit_is_said_to_be_taken_for_seconds(tmp_path):
    content = read(tmp_path, "time,x\n0,1\n0.5,2\n")

    assert "'time'" in content.metadata["reading.time_unit"]
    assert content.metadata["time.column"] == "time"
    assert not content.groups[0].time_unit_stated
    assert read(tmp_path, "time_s,x\n0,1\n0.5,2\n").groups[0].time_unit_stated


@pytest.mark.parametrize(
    "text",
    [
        "Time (frames),x\n0,1\n1,2\n",
        "Time,x\n12:00:01.5,1\n12:00:01.6,2\n",
        "time_s,x\n0,1\n0.5,2\n0.2,3\n",
    ],
    ids=["no unit of time", "time of the day", "goes back"],
)
def test_what_is_no_clock_is_a_column_and_told(tmp_path, text):
    content = read(tmp_path, text)

    assert content.groups[0].time_s is None
    assert len(signals(content)) == 2
    assert "reading.time" in content.metadata


@pytest.mark.parametrize("delimiter", [" ", "   ", "|", "\t"])
def test_signs_between_columns_are_found_as_inspect_finds_them(tmp_path, delimiter):
    lines = [("t", "knee", "hip"), ("0.0", "1.5", "2"), ("0.1", "2.5", "3")]

    content = read(tmp_path, "".join(f"{delimiter.join(line)}\n" for line in lines), "a.txt")

    np.testing.assert_array_equal(signals(content)["hip"].values, [2, 3])
    np.testing.assert_array_equal(content.groups[0].time_s, [0.0, 0.1])
    assert "reading.delimiter" in content.metadata


@pytest.mark.parametrize("text", ["Lab of gait\nt;knee\n0.0;1.5\n0.1;2.5\n", "a,b\nx,y\nz,w\n"])
def test_a_table_without_a_column_of_numbers_is_refused(tmp_path, text):
    with pytest.raises(DataError, match=r"a\.csv: .*--skip-rows"):
        read(tmp_path, text)


@pytest.mark.parametrize(
    ("header", "expected"),
    [
        ("T,time [s],knee", [0.0, 0.5]),  # a torque, or a temperature
        ("time,time_ms,knee", [0.0, 0.0005]),  # one that says its unit
        ("time_ms,Time (s),knee", [0.0, 0.5]),
        ("time_s,knee,time", [1.0, 2.0]),  # one that increases
        ("T,x,knee", None),
    ],
)
def test_of_several_columns_of_time_the_clearest_that_increases_is_the_clock(
    tmp_path, header, expected
):
    (group,) = read(tmp_path, f"{header}\n20.5,0,1\n20.4,0.5,2\n").groups

    if expected is None:
        assert group.time_s is None
    else:
        np.testing.assert_allclose(group.time_s, expected)


def test_a_log_of_an_actpack_has_the_units_of_its_fields(tmp_path):
    header = "state_time,mot_ang,mot_vel,mot_cur,batt_volt,accelx,mine"
    content = read(tmp_path, f"{header}\n10,100,5,1500,36000,8192,1\n12,101,6,1501,36001,8193,2\n")
    found = signals(content)

    units = [signal.unit for signal in found.values()]
    assert units == ["ms", "turn/16384", "deg/s", "mA", "mV", "", ""]
    assert "reading.log" in content.metadata
    np.testing.assert_allclose(content.groups[0].time_s, [0.010, 0.012], rtol=1e-15)


def test_other_files_get_no_units_of_known_devices(tmp_path):
    found = signals(read(tmp_path, "motor_position,motor_current\n1,2\n3,4\n"))

    assert {signal.unit for signal in found.values()} == {""}


def test_a_blank_after_every_cell_is_no_trouble(tmp_path):
    found = signals(read(tmp_path, "a\tb\n1 \tNaN \n2 \t3 \n", "a.txt"))

    np.testing.assert_array_equal(found["b"].values, [np.nan, 3])


def test_what_is_written_has_units_in_the_names(tmp_path):
    content = read(tmp_path, "time_s,knee [deg]\n0,1.5\n0.1,NaN\n")

    write_acquisition(content, tmp_path / "b.csv.gz")

    text = gzip.decompress((tmp_path / "b.csv.gz").read_bytes()).decode()
    assert text == "time_s,knee [deg]\n0.0,1.5\n0.1,NaN\n"


@pytest.mark.real_data
def test_every_text_file_of_the_real_recordings_is_read(real_data):
    headless = FilesSpec(header=False)
    layouts = {
        "example_vertical_grf.csv": headless,
        "treadmill-speed.csv": headless,
        "log_mitry_dephy.csv": headless,
        "trial8.csv": FilesSpec(skip_rows=1, header=False),  # seven columns under six names
    }
    files = [*real_data.rglob("*.csv"), *real_data.rglob("*.csv.gz"), *real_data.rglob("raw*.txt")]

    for file in files:
        (group,) = read_acquisition(file, layouts.get(file.name, FilesSpec())).groups
        assert group.n_samples >= 1
        assert group.time_s is not None or any(not s.is_text for s in group.signals)

    assert len(files) >= 15
