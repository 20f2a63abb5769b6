"""Calibration files, and entries put into a study.toml without touching anything else."""

import tomllib

import pytest
from hypothesis import given
from hypothesis import strategies as st

from jointz.core.errors import DataError, StudyError
from jointz.core.study import Calibrated, CalibrationSpec
from jointz.io.calibration_file import (
    calibration_toml,
    into_study,
    read_calibration,
    write_into_study,
)
from jointz.io.toml_text import statements, written_table

STUDY = """\
# my study  [[participants]] is no header here
jointz = 1
joint = "knee"   # left
kind = "walking"
note = '''
[[participants]]
id = "S09"
'''

[channels.time]
column = "time_s"

[[participants]]          # first
id = "S01"
mass_kg = 72.4            # scale in the corridor

# second one
[[participants]]
id = "S02"
calibration = { torque_gain = { value = 1.02, sd = 0.01 }, angle_gain = {value=1.0, sd=0.02} } # old
group = "a # b"

[[recordings]]
participant = "S01"
file = "a.csv"
"""


def known(**entries):
    return CalibrationSpec(**{n: Calibrated(value=v, sd=s) for n, (v, s) in entries.items()})


LAG = known(angle_lag_s=(0.0065, 0.0005))
BOTH = {"S01": LAG, "S02": known(angle_gain=(1.013, 0.002), angle_zero_rad=(-0.05, 0.001))}


def test_entries_are_put_in_and_nothing_else_changes() -> None:
    after = into_study(STUDY, BOTH)
    lines = set(STUDY.splitlines())
    assert [line for line in after.splitlines() if line not in lines] == [
        "calibration = { angle_lag_s = { value = 0.0065, sd = 0.0005 } }",
        "calibration = { torque_gain = { value = 1.02, sd = 0.01 }, "
        "angle_gain = { value = 1.013, sd = 0.002 }, "
        "angle_zero_rad = { value = -0.05, sd = 0.001 } } # old",
    ]
    assert into_study(after, BOTH) == after  # putting in twice is putting in once
    before, now = tomllib.loads(STUDY), tomllib.loads(after)
    people = [p.pop("calibration") for p in now["participants"]]
    del before["participants"][1]["calibration"]
    assert now == before
    assert CalibrationSpec.model_validate(people[0]) == LAG
    assert people[1]["torque_gain"] == {"value": 1.02, "sd": 0.01}  # stays
    assert people[1]["angle_gain"] == {"value": 1.013, "sd": 0.002}  # replaced


def test_ends_of_lines_and_a_missing_last_one_are_kept() -> None:
    windows = STUDY.replace("\n", "\r\n")
    assert into_study(windows, BOTH) == into_study(STUDY, BOTH).replace("\n", "\r\n")
    bare = 'jointz = 1\n[[participants]]\nid = "S01"'
    assert into_study(bare, {"S01": LAG}).startswith(bare + "\ncalibration = { angle_lag_s")


ONE, TWO = '[[participants]]\nid = "S01"\n', '[[participants]]\nid = "S02"\n'
GAIN = "angle_gain = { value = 1.0, sd = 0.1 }\n"


@pytest.mark.parametrize(
    ("text", "place"),
    [
        (STUDY.replace('"S01"\nmass', '"S05"\nmass'), "'S01'"),
        ('participants = [{ id = "S01" }, { id = "S02" }]\n', "[[participants]]"),
        (f"{ONE}[participants.calibration]\n{GAIN}{TWO}", "'[participants.calibration]'"),
        (f"{ONE}calibration.{GAIN}{TWO}", "'calibration.angle_gain"),
        ("a = [", "TOML"),
    ],
)
def test_a_text_that_cannot_be_edited_is_refused(text: str, place: str) -> None:
    with pytest.raises(StudyError) as caught:
        into_study(text, BOTH)
    assert place in str(caught.value)


def test_a_refused_study_is_left_as_it_was_and_an_edited_one_kept(tmp_path) -> None:
    file = tmp_path / "study.toml"
    file.write_bytes(STUDY.encode())
    with pytest.raises(StudyError):
        write_into_study(tmp_path, {"S07": LAG})
    assert [p.name for p in tmp_path.iterdir()] == ["study.toml"]
    assert file.read_bytes() == STUDY.encode()
    gains = (1.1, 1.2, 1.3)
    kept = [write_into_study(tmp_path, {"S01": known(angle_gain=(g, 0.0))}) for g in gains]
    names = ["study.toml.before-calibration" + end for end in ("", "-2", "-3")]
    assert [k.name for k in kept] == names
    assert kept[0].read_bytes() == STUDY.encode()
    assert "value = 1.2" in kept[2].read_text()
    assert "value = 1.3" in file.read_text()
    with pytest.raises(DataError, match="expected a text file"):
        write_into_study(tmp_path / "nowhere", {"S01": LAG})


def test_a_calibration_file_comes_back_and_is_added_to(tmp_path) -> None:
    file = tmp_path / "calibration.toml"
    file.write_text(calibration_toml(BOTH))
    found = read_calibration(file)
    assert {name: found.of(name) for name in BOTH} == BOTH
    assert found.of("S03") == CalibrationSpec()
    more = {"S02": known(angle_gain=(1.02, 0.001)), 'S"3': known(tissue_hz=(24.0, 1.0))}
    noted = file.read_text().replace("[[part", "# by Ada\n[[part", 1)
    file.write_text(calibration_toml(more, earlier=noted))
    again = read_calibration(file)
    assert again.of("S01") == LAG
    assert again.of("S02") == BOTH["S02"].overridden_by(more["S02"])
    assert again.of('S"3') == more['S"3']
    assert "# by Ada" in file.read_text()


def test_entries_for_everybody_give_way_to_a_persons_own(tmp_path) -> None:
    file = tmp_path / "calibration.toml"
    file.write_text(
        "[calibration]\ntorque_gain = { value = 1.05, sd = 0.01 }\n"
        "angle_gain = { value = 1.0, sd = 0.1 }\n"
        '[[participants]]\nid = "S01"\ncalibration = { angle_gain = { value = 1.2, sd = 0.0 } }\n'
    )
    found = read_calibration(file)
    assert found.of("S01") == known(torque_gain=(1.05, 0.01), angle_gain=(1.2, 0.0))
    assert found.of("S02") == known(torque_gain=(1.05, 0.01), angle_gain=(1.0, 0.1))


@pytest.mark.parametrize(
    ("text", "key"),
    [
        ("jointz_calibration = 2\n", "jointz_calibration"),
        ("[calibration]\nangle_lag = { value = 1.0, sd = 0.0 }\n", "calibration.angle_lag"),
        ('[[participants]]\nid = "A"\n', "participants[1].calibration"),
        ('[[participants]]\nid = "A"\ncalibration = {}\n' * 2, "participants"),
        (GAIN.replace("angle_gain", "calibration.contact_threshold_v"), "contact_release_v"),
    ],
)
def test_a_calibration_file_with_problems_is_refused(tmp_path, text, key) -> None:
    file = tmp_path / "calibration.toml"
    file.write_text(text)
    with pytest.raises(StudyError) as caught:
        read_calibration(file)
    assert f"{key}: " in str(caught.value)
    with pytest.raises(DataError, match="no such file"):
        read_calibration(tmp_path / "none.toml")


VALUES = st.one_of(
    st.floats(allow_nan=False, allow_infinity=False),
    st.text(st.characters(exclude_categories=["Cs", "Cc"])),
)


@given(st.dictionaries(st.text(st.characters(exclude_categories=["Cs", "Cc"])), VALUES))
def test_a_written_table_is_read_back(values) -> None:
    assert tomllib.loads(f"t = {written_table(values)}")["t"] == values


STATEMENTS = ["# [x]\n", "\n", 'a = "[b] # \\" c"\n', "[t]\n", "[[l]] # y\n"]
STATEMENTS += ["c = [ # [\n 1,\n]\n", "d = '''\n[no]\n'''\n", "f = { g = '[' }\r\n"]
STATEMENTS += ['e = """\n# "" [n]\\""""\n']


@given(st.lists(st.sampled_from(STATEMENTS)))
def test_the_statements_are_the_text_without_blanks_and_comments(parts) -> None:
    text = "".join(parts)
    found = list(statements(text))
    wanted = [p for p in parts if p.strip() and not p.startswith("#")]
    assert len(found) == len(wanted)
    assert all(w.startswith(f.text) for f, w in zip(found, wanted, strict=True))
    assert all(text[s.start : s.end] == s.text for s in found)
    assert [s.is_header for s in found] == [w.startswith("[") for w in wanted]
