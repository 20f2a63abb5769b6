"""OpenSim's .mot and .sto: headers old and new, units only where the header states them."""

from pathlib import Path

import numpy as np
import pytest

from jointz.core.acquisition import Acquisition, Signal, SignalGroup
from jointz.core.errors import DataError
from jointz.io.formats import read_acquisition, write_acquisition

MOTION = """\
Coordinates
version=1
nRows=3
nColumns=5
inDegrees=yes

Units are S.I. units (second, meters, Newtons, ...)
If the header above contains a line with 'inDegrees', angles are in degrees (yes) or radians (no).

endheader
time\tpelvis_tx\tknee_angle_r\thip_flexion_r_moment\tground_force_vy
      0.00000000\t      0.10000000\t     -5.00000000\t     12.0\t700.5
      0.01000000\t      0.11000000\t     -6.00000000\t     13.0\tnan
      0.02000000\t      0.12000000\t     -7.50000000\t     14.0\t702.0
"""
STATES = """\
inDegrees=no
DataType=double
version=3
OpenSimVersion=4.4
endheader
time\t/jointset/knee_r/knee_angle_r/value\t/jointset/knee_r/knee_angle_r/speed\t/forceset/soleus_r
0\t0.5\t-1.5\t0.25
0.1\t0.25\t-1.0\t0.5
"""
QUATERNIONS = """\
DataRate=100.0
DataType=Quaternion
version=3
endheader
time\ttibia_r_imu
0\t1.0,0.0,0.0,0.0
0.01\t0.5,0.5,0.5,0.5
"""
OLD = """\
name subject01 walk
datacolumns 3
datarows 2
range 0.5 0.6
endheader
time  ground_force_vx  knee_angle_r
0.5   1.0  2.0
0.6   3.0  4.0
"""


def read(tmp_path: Path, text: str, name: str = "a.mot") -> Acquisition:
    (tmp_path / name).write_text(text)
    return read_acquisition(tmp_path / name)


def signals(content: Acquisition) -> dict[str, Signal]:
    (group,) = content.groups
    return {signal.name: signal for signal in group.signals}


def test_a_motion_file_gives_time_values_and_header(tmp_path):
    content = read(tmp_path, MOTION)

    np.testing.assert_array_equal(content.groups[0].times_s(), [0.0, 0.01, 0.02])
    np.testing.assert_array_equal(signals(content)["knee_angle_r"].values, [-5.0, -6.0, -7.5])
    assert np.isnan(signals(content)["ground_force_vy"].values[1])
    assert content.metadata["name"] == "Coordinates"
    assert content.metadata["inDegrees"] == "yes"
    assert "S.I. units" in content.metadata["comment"]


def test_degrees_are_stated_for_rotational_coordinates_only(tmp_path):
    found = signals(read(tmp_path, MOTION))

    units = {name: signal.unit for name, signal in found.items()}
    assert units == {
        "pelvis_tx": "",
        "knee_angle_r": "deg",
        "hip_flexion_r_moment": "",
        "ground_force_vy": "",
    }
    assert "rotational coordinates only" in found["pelvis_tx"].description
    assert found["knee_angle_r"].description == ""


def test_states_have_radians_and_speeds(tmp_path):
    found = signals(read(tmp_path, STATES, "a.sto"))

    assert [signal.unit for signal in found.values()] == ["rad", "rad/s", ""]


def test_without_in_degrees_the_unit_of_an_angle_is_open(tmp_path):
    found = signals(read(tmp_path, MOTION.replace("inDegrees=yes\n", "")))

    assert found["knee_angle_r"].unit == ""
    assert "no inDegrees" in found["knee_angle_r"].description


def test_an_old_file_with_blanks_is_read(tmp_path):
    content = read(tmp_path, OLD)

    assert content.metadata["name"] == "subject01 walk"
    np.testing.assert_array_equal(signals(content)["knee_angle_r"].values, [2.0, 4.0])
    np.testing.assert_array_equal(content.groups[0].time_s, [0.5, 0.6])


def test_elements_of_vectors_become_columns(tmp_path):
    found = signals(read(tmp_path, QUATERNIONS, "a.sto"))

    assert list(found) == [f"tibia_r_imu.{k}" for k in (1, 2, 3, 4)]
    np.testing.assert_array_equal(found["tibia_r_imu.1"].values, [1.0, 0.5])


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        ("nRows=3", "nRows=4", ["header says 4 rows", "has 3", "cut off"]),
        ("nColumns=5", "nColumns=6", ["header says 6 columns", "row 11"]),
        ("nRows=3", "nRows=three", ["row 3", "whole number", "three"]),
        ("endheader", "end of header", ["endheader"]),
        ("13.0\tnan", "13.0", ["row 13", "expected 5 values, found 4"]),
        ("13.0\tnan", "1x3.0\tnan", ["row 13", "hip_flexion_r_moment", "1x3.0"]),
        ("13.0\tnan", "1_3\tnan", ["row 13", "1_3"]),
        ("0.02000000\t", "0.01000000\t", ["row 14", "time to increase"]),
        ("time\t", "frame\t", ["row 11", "'time'", "'frame'"]),
        ("pelvis_tx", "knee_angle_r", ["knee_angle_r", "two columns"]),
    ],
)
def test_what_is_wrong_is_told_with_its_row(tmp_path, old, new, words):
    with pytest.raises(DataError) as caught:
        read(tmp_path, MOTION.replace(old, new))

    assert "a.mot" in str(caught.value)
    for word in words:
        assert word in str(caught.value)


def angles(unit: str) -> Acquisition:
    values = np.array([0.5, 1.0])
    return Acquisition((SignalGroup("", (Signal("knee_angle_r", values, unit),), 100.0),))


@pytest.mark.parametrize(("unit", "line"), [("deg", "inDegrees=yes"), ("rad", "inDegrees=no")])
def test_the_header_says_the_unit_that_the_angles_have(tmp_path, unit, line):
    write_acquisition(angles(unit), tmp_path / "a.mot")

    lines = (tmp_path / "a.mot").read_text().splitlines()
    assert line in lines
    assert "nRows=2" in lines
    assert lines[lines.index("endheader") + 1] == "time\tknee_angle_r"
    assert lines[-1] == "0.01\t1.0"


def test_an_unknown_unit_is_not_said_to_be_radians(tmp_path):
    write_acquisition(angles(""), tmp_path / "a.mot")

    assert "inDegrees" not in (tmp_path / "a.mot").read_text()


def test_a_motion_file_goes_round_without_loss(tmp_path):
    content = read(tmp_path, MOTION)

    assert write_acquisition(content, tmp_path / "b.sto") == []

    assert read_acquisition(tmp_path / "b.sto").equals(content)


def test_it_is_text_that_is_refused_where_it_is_none(tmp_path):
    (tmp_path / "a.sto").write_bytes(b"\xff\xfe\x00endheader")
    with pytest.raises(DataError, match=r"a\.sto: expected text, found the byte 0xff"):
        read_acquisition(tmp_path / "a.sto")
