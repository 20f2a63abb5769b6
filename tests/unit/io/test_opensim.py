"""OpenSim's .mot and .sto: headers old and new, units only where the header states them."""

from pathlib import Path

import numpy as np
import pytest

from jointz.core.acquisition import Acquisition, Signal
from jointz.core.errors import DataError
from jointz.core.study import FilesSpec
from jointz.io.formats.registry import read_acquisition

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

    assert [name for name, signal in found.items() if signal.unit] == ["knee_angle_r"]
    assert found["knee_angle_r"].unit == "deg"


MUSCLES = (
    *("glut_med1_r", "semimem_r", "bifemlh_r", "sar_r", "add_long_r", "add_brev_r", "add_mag1_r"),
    *("tfl_r", "pect_r", "grac_r", "iliacus_r", "quad_fem_r", "rect_fem_r", "vas_med_r"),
    *("med_gas_r", "soleus_r", "tib_post_r", "flex_dig_r", "flex_hal_r", "tib_ant_r"),
    *("per_brev_r", "ext_dig_r", "ext_hal_r", "ercspn_r", "intobl_r", "extobl_r"),
)
ROTATIONS = (
    *("pelvis_tilt", "pelvis_list", "pelvis_rotation", "hip_flexion_r", "hip_adduction_r"),
    *("hip_rotation_r", "knee_angle_r", "ankle_angle_r", "subtalar_angle_r", "mtp_angle_r"),
    *("lumbar_extension", "lumbar_bending", "lumbar_rotation", "arm_flex_r", "arm_add_r"),
    *("arm_rot_r", "elbow_flex_r", "pro_sup_r", "wrist_flex_r", "wrist_dev_r"),
)


def test_muscles_of_gait2392_are_no_angles(tmp_path):
    names = ["time", "pelvis_tx", *MUSCLES, *ROTATIONS]
    rows = ["\t".join([str(time), *["0.5"] * (len(names) - 1)]) for time in (0.0, 0.1)]
    head = STATES.partition("time")[0]

    found = signals(read(tmp_path, "\n".join([head + "\t".join(names), *rows, ""]), "a.sto"))

    assert {name for name, signal in found.items() if signal.unit} == set(ROTATIONS)


def test_states_have_radians_and_speeds(tmp_path):
    found = signals(read(tmp_path, STATES, "a.sto"))

    assert [signal.unit for signal in found.values()] == ["rad", "rad/s", ""]


def test_without_in_degrees_the_unit_of_an_angle_is_open(tmp_path):
    found = signals(read(tmp_path, MOTION.replace("inDegrees=yes\n", "")))

    assert found["knee_angle_r"].unit == ""


SENTENCE = "Angles are in degrees."


@pytest.mark.parametrize(
    ("header", "unit"),
    [
        (SENTENCE, "deg"),
        ("Units are S.I. units. angles are in radians", "rad"),
        (f"inDegrees=yes\n{SENTENCE}", "deg"),
        (f"inDegrees=no\n{SENTENCE}", "rad or deg"),
    ],
)
def test_the_sentence_in_the_header_states_the_unit_of_angles(tmp_path, header, unit):
    text = MOTION.replace("inDegrees=yes", header)
    found = signals(read(tmp_path, text))
    units = found["knee_angle_r"].unit
    assert sorted(units.split(" or ")) == sorted(unit.split(" or "))
    assert found["hip_flexion_r_moment"].unit == ""


def test_decimal_commas_are_read_if_they_are_stated(tmp_path):
    file = tmp_path / "a.mot"
    head, table = MOTION.split("vy\n")
    file.write_text(f"{head}vy\n{table.replace('.', ',')}")
    with pytest.raises(DataError, match=r"row 12: expected a number .*--decimal ,"):
        read_acquisition(file)
    content = read_acquisition(file, FilesSpec(decimal=","))
    np.testing.assert_array_equal(signals(content)["knee_angle_r"].values, [-5.0, -6.0, -7.5])


@pytest.mark.parametrize(
    ("row", "message"),
    [(2, "the time 0.01000000 s of the row above repeats .* write 2 there"), (1, "rate as time")],
)
def test_a_time_that_repeats_at_the_digits_printed_is_explained(tmp_path, row, message):
    stamps = ["0.00000000", "0.01000000", "0.02000000"]
    text = MOTION.replace(f"{stamps[row]}\t ", f"{stamps[row - 1]}\t ")
    with pytest.raises(DataError, match=message):
        read(tmp_path, text)
    lines = text.replace("nRows=3", "nRows=2").splitlines(keepends=True)
    del lines[11 + row]  # as the message advises
    assert signals(read(tmp_path, "".join(lines)))["knee_angle_r"].values.size == 2


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
    ("old", "new", "place"),
    [
        ("nRows=3", "nRows=4", "4 rows"),
        ("nColumns=5", "nColumns=6", "row 11"),
        ("nRows=3", "nRows=three", "row 3"),
        ("endheader", "end of header", "endheader"),
        ("13.0\tnan", "13.0", "row 13"),
        ("13.0\tnan", "1_3\tnan", "row 13"),
        ("0.02000000\t", "0.01000000\t", "row 14"),
        ("time\t", "frame\t", "row 11"),
        ("pelvis_tx", "knee_angle_r", "knee_angle_r"),
    ],
)
def test_what_is_wrong_is_told_with_its_row(tmp_path, old, new, place):
    with pytest.raises(DataError, match=rf"a\.mot.*{place}"):
        read(tmp_path, MOTION.replace(old, new))


def test_a_last_line_without_an_end_is_told_of_where_it_may_be_whole(tmp_path):
    content = read(tmp_path, MOTION[:-1])

    assert signals(content)["ground_force_vy"].values[-1] == 702.0
    assert "702.0" in content.metadata["reading.end"]
    assert "reading.end" not in read(tmp_path, MOTION).metadata


def test_cut_off_anywhere_it_is_refused_or_a_note_tells_it(tmp_path):
    whole = read(tmp_path, MOTION)
    for at in {*range(0, len(MOTION), 7), *range(len(MOTION) - 20, len(MOTION))}:
        try:
            found = read(tmp_path, MOTION[:at])
        except DataError:
            continue
        assert "reading.end" in found.metadata, at
        assert at >= len(MOTION) - 1
        assert signals(found).keys() == signals(whole).keys()


@pytest.mark.parametrize(
    ("name", "unit"), [("Speeds", "deg/s"), ("Accelerations", "deg/s^2"), ("Coordinates", "deg")]
)
def test_the_first_line_tells_speeds_and_accelerations_from_angles(tmp_path, name, unit):
    found = signals(read(tmp_path, MOTION.replace("Coordinates", name, 1), "a.sto"))

    assert found["knee_angle_r"].unit == unit
