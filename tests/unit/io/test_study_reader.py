"""Opening a study: the example opens, and every problem is named, all of them at once."""

import hashlib
import shutil
from dataclasses import replace
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from jointz.core.errors import DataError, StudyError
from jointz.core.study import UserExclusion
from jointz.io.study_files import data_file
from jointz.io.study_reader import open_study

SECOND = """[[recordings]]
participant = "S01"
condition = "{condition}"
file = "S01_enp.csv"
"""


def without(text: str, table: str) -> str:
    """Remove one ``[table]`` of a text, down to the next."""
    start = text.index(f"[{table}]")
    return text[:start] + text[text.index("[", text.index("\n", start)) :]


# --- what opens ----------------------------------------------------------------------------------


def test_the_example_of_the_format_opens(study):
    opened = study.open()

    spec = opened.spec
    assert (spec.positive, spec.torque_acts_on) == ("flexion", "joint")
    assert spec.participant("S01").mass_kg == 72.4
    assert opened.units["angle"] == ("rad", pytest.approx(np.pi / 180), 0.0)
    assert opened.units["torque"] == ("N*m", 1.0, 0.0)
    assert opened.units["contact"] == ("1", 1.0, 0.0)
    assert opened.group_edges == (-0.45, -0.15, -0.03)
    assert opened.user_exclusions == ()
    assert opened.root == study.root
    assert opened.sha256 == hashlib.sha256(study.text.encode()).hexdigest()


def test_a_study_opens_by_its_folder_its_file_and_as_text(study):
    study.open()

    for path in (study.root, study.root / "study.toml", str(study.root)):
        assert open_study(path).root == study.root


def test_a_byte_order_mark_and_windows_line_ends_are_read(study):
    content = b"\xef\xbb\xbf" + study.text.replace("\n", "\r\n").encode()
    (study.root / "study.toml").write_bytes(content)

    assert open_study(study.root).spec.joint == "knee"


def test_edges_of_groups_are_taken_to_si(study):
    study.edit('edges = [-0.45, -0.15, -0.03], unit = "rad"', 'edges = [-90, 0, 180], unit = "deg"')

    assert study.open().group_edges == pytest.approx((-np.pi / 2, 0.0, np.pi))


def test_torque_may_come_from_current_and_a_torque_model(study):
    study.text = without(study.text, "channels.torque")
    study.channel("current", 'unit = "mA"', column="torque_nm")
    study.refused("channels.torque: ")

    study.text += "[torque_model]\ngear_ratio = 50.0\ntorque_constant = 0.14\n"

    assert study.open().spec.torque_model.gear_ratio == 50.0


def test_torque_may_be_absent_where_no_device_is_worn(study):
    text = without(without(study.text, "channels.torque"), "channels.command")
    start, stop = text.index("[[recordings]]"), text.index("[perturbations]")
    study.text = text[:start] + SECOND.format(condition="NWC") + text[stop:]
    study.edit('source = "command"', "")

    assert study.open().spec.recordings[0].condition == "no_device"


def test_a_file_without_device_needs_no_columns_of_the_device(study):
    kinematics = ["time_s", "knee_angle_deg", "footswitch"]
    table = pd.read_csv(study.root / "S01_enp.csv")[kinematics]
    table.to_csv(study.root / "S01_nwc.csv", index=False)
    nwc = SECOND.format(condition="no_device").replace("_enp", "_nwc")
    study.edit("[perturbations] ", nwc + "[perturbations] ")
    study.channel("condition", column="phase")  # nor one of conditions where it states its own

    assert len(study.open().spec.recordings) == 3


# --- files and variables -------------------------------------------------------------------------


def test_variables_of_the_environment_expand_in_file_names(study, monkeypatch, tmp_path_factory):
    elsewhere = tmp_path_factory.mktemp("elsewhere")
    shutil.move(study.root / "S01_enp.csv", elsewhere / "S01_enp.csv")
    study.edit('file = "S01_enp.csv"', 'file = "${LAB_DATA}/S01_enp.csv"')
    monkeypatch.delenv("LAB_DATA", raising=False)
    study.refused("recordings[1].file: ", "LAB_DATA")

    monkeypatch.setenv("LAB_DATA", str(elsewhere))

    assert study.open().spec.recordings[0].file == "${LAB_DATA}/S01_enp.csv"


@pytest.mark.parametrize(
    ("name", "found"),
    [
        ("${LAB}/a.csv", "set/a.csv"),
        ("${LAB:-other}/a.csv", "set/a.csv"),
        ("${ABSENT:-other}/a.csv", "other/a.csv"),
        ("${ABSENT:-}a.csv", "a.csv"),
        ("no$.csv", "no$.csv"),
    ],
)
def test_a_variable_may_have_a_default(monkeypatch, name, found):
    monkeypatch.setenv("LAB", "set")
    monkeypatch.delenv("ABSENT", raising=False)

    assert data_file(Path("study"), name) == Path("study") / found


def test_a_missing_file_is_named(study):
    (study.root / "S01_ewp.csv").unlink()
    (study.root / "S01_pulses.csv").unlink()

    first, second = study.refused().problems

    assert first.startswith("recordings[2].file: ")
    assert "S01_ewp.csv" in first
    assert second.startswith("recordings[2].perturbations: ")


def test_missing_columns_are_one_problem_a_file_with_a_guess_and_those_there_are(study):
    study.edit('"torque_nm"', '"torque_mn"').edit('"footswitch"', '"qqq"')

    first, second = study.refused().problems

    assert first.startswith("recordings[1].file: S01_enp.csv ")
    assert "'torque_mn' for channel 'torque'" in first
    assert "'qqq' for channel 'contact'" in first
    assert second.startswith("recordings[2].file: S01_ewp.csv ")


def test_one_file_of_two_recordings_is_checked_once(study):
    study.edit('file = "S01_ewp.csv"', 'file = "S01_enp.csv"').edit('"torque_nm"', '"xyz"')

    assert "recordings[1].file" in study.sole_problem()


@pytest.mark.parametrize("mark", [";", "\t"])
def test_another_delimiter_is_asked_for(study, mark):
    for file in study.root.glob("S01_e*.csv"):
        file.write_text(file.read_text().replace(",", mark))

    study.refused("set delimiter under [files]")
    study.text += f"delimiter = '{mark}'\n"
    study.open()


def test_a_file_of_an_unknown_kind_is_a_problem_of_its_recording(study):
    (study.root / "S01.docx").write_text("no")
    study.edit("S01_enp.csv", "S01.docx")

    assert study.sole_problem().startswith("recordings[1].file: S01.docx: ")


# --- the text itself -----------------------------------------------------------------------------


def test_a_missing_folder_says_what_to_give(tmp_path):
    for path in (tmp_path / "absent", tmp_path, tmp_path / ("x" * 300)):
        with pytest.raises(DataError, match=r"study\.toml"):
            open_study(path)


@pytest.mark.parametrize("content", [b"a = 1\na = 2", b"x = [{ y = 0x1ffffffffffffffff }]"])
def test_text_that_is_not_toml_is_refused(tmp_path, content):
    (tmp_path / "study.toml").write_bytes(content)

    with pytest.raises(StudyError, match="1 problem") as caught:
        open_study(tmp_path)

    assert caught.value.path == str(tmp_path / "study.toml")


def test_an_empty_file_names_what_is_required(tmp_path):
    (tmp_path / "study.toml").write_text("")

    with pytest.raises(StudyError) as caught:
        open_study(tmp_path)

    missing = [problem.partition(":")[0] for problem in caught.value.problems]
    assert missing == ["jointz", "joint", "kind", "channels", "participants", "recordings"]


# --- keys and values -----------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("old", "new"), [("sample_rate_hz = 1000.0 ", "# "), ('perturbations = "S01_pulses.csv"', "#")]
)
def test_what_is_optional_may_be_left_out(study, old, new):
    study.edit(old, new)

    study.open()


def problem_rows() -> list[list[str]]:
    lines = (Path(__file__).parent / "study_problems.txt").read_text().splitlines()
    rows = [line.replace("\\n", "\n") for line in lines if line and not line.startswith("#")]
    return [row.split(" => ") for row in rows]


@pytest.mark.parametrize(("old", "new", "key"), problem_rows())
def test_a_problem_is_named_by_its_key(study, old, new, key):
    study.edit(old, new)

    assert study.sole_problem().startswith(f"{key}: ")


# --- units ---------------------------------------------------------------------------------------


def test_a_reference_may_be_an_angle_or_a_torque(study):
    text = study.text
    for unit, si_unit in (("deg", "rad"), ("Nm", "N*m")):
        study.text = text
        study.channel("reference", f'unit = "{unit}"', column="ankle_position")
        assert study.open().units["reference"][0] == si_unit


def test_a_channel_of_the_users_own_keeps_its_name_and_gets_an_si_unit(study):
    study.channel("emg", 'unit = "mV"', column="footswitch")

    assert study.open().units["emg"] == ("V", 0.001, 0.0)


@pytest.mark.parametrize(
    ("kind", "unit", "si"),
    [("pulse", "1", ("1", 1.0, 0.0)), ("voltage", "mV", ("V", 0.001, 0.0))],
)
def test_the_unit_of_a_contact_is_that_of_its_kind(study, kind, unit, si):
    study.edit('kind = "contact"', f'kind = "{kind}"\nunit = "{unit}"')

    assert study.open().units["contact"] == si


# --- names that refer to nothing -------------------------------------------------------------


def test_time_or_a_sample_rate_is_needed(study):
    study.text = without(study.text, "channels.time")
    study.open()

    study.edit("sample_rate_hz = 1000.0 ", "# ")

    assert study.sole_problem().startswith("channels.time: ")


def test_angle_and_torque_are_always_needed(study):
    start, stop = study.text.index("[channels.time]"), study.text.index("[[participants]]")
    study.text = study.text[:start] + "[channels]\n" + study.text[stop:]

    study.refused("channels.angle: ", "channels.torque: ")


@pytest.mark.parametrize("own", ['side = "left"', "session = 2"])
def test_a_session_or_side_of_its_own_makes_a_cell(study, own):
    study.edit("[perturbations] ", f"{SECOND.format(condition='ewp')}{own}\n[perturbations] ")

    assert len(study.open().spec.recordings) == 3


@pytest.mark.parametrize("side", ["", 'side = "right"\n'])
def test_pulses_of_an_unknown_side_beside_both_unperturbed_legs_are_refused(study, side):
    study.edit('condition = "unperturbed" ', 'side = "left"\ncondition = "unperturbed" ')
    other = SECOND.format(condition="ENP") + 'side = "right"\n'
    study.edit("[perturbations] ", other + "[perturbations] ")
    study.edit('condition = "perturbed"', f'{side}condition = "perturbed"')

    if side:
        study.open()
    else:
        assert study.sole_problem().startswith("recordings[2].side: ")


GROUP_OF_LABELS = ('channel = "ankle_position"', 'channel = "trial"')
NO_TABLE = ('perturbations = "S01_pulses.csv"', "#")
IN_SESSION = ('condition = "unperturbed" ', 'session = "a"\ncondition = "unperturbed" ')
AGAIN = ("[perturbations] ", SECOND.format(condition="ENP") + 'session = "a"\n[perturbations] ')


@pytest.mark.parametrize(
    ("left_out", "edits", "key"),
    [
        ("", [GROUP_OF_LABELS], "perturbations.group.channel"),
        ("", [IN_SESSION, AGAIN], "recordings"),
        ("", [('source = "command"', 'source = "table"'), NO_TABLE], "recordings[2].perturbations"),
        ("channels.command", [('source = "command"', ""), NO_TABLE], "recordings[2]"),
        ("channels.command", [], "perturbations.source"),
    ],
)
def test_what_stands_for_nothing_is_refused_at_its_key(study, left_out, edits, key):
    study.channel("trial", column="footswitch")
    study.text = without(study.text, left_out) if left_out else study.text
    for edit in edits:
        study.edit(*edit)

    study.refused(f"  - {key}: ")


def test_all_problems_stand_in_one_message(study):
    (study.root / "S01_pulses.csv").unlink()
    (study.root / "exclusions.csv").write_text("participant\nS01\n")
    study.edit('joint = "knee"', "joint = 3\nsmaple_rate_hz = 3")
    study.edit('unit = "deg"', 'unit = "degg"').edit('column = "torque_nm"', 'column = "tau"')
    study.edit('id = "S01"', 'id = "S09"')

    places = {problem.partition(": ")[0] for problem in study.refused().problems}

    assert places == {
        *("joint", "smaple_rate_hz", "channels.angle.unit", "exclusions.csv"),
        *("recordings[1].participant", "recordings[1].file"),
        *("recordings[2].participant", "recordings[2].file", "recordings[2].perturbations"),
    }


# --- the user's own exclusions -------------------------------------------------------------------

EXCLUSIONS = "participant,recording,onset_s,action,reason,time\n"


def test_the_users_exclusions_are_read(study):
    file = study.root / "exclusions.csv"
    rows = "S01,S01_ewp.csv,1.25,exclude,stumbled,2024-05-01\nS01,S01_ewp.csv,1.25,restore,,\n"
    file.write_text("\ufeff" + EXCLUSIONS + rows, encoding="utf-8")
    stumbled = UserExclusion("S01", "S01_ewp.csv", 1.25, "exclude", "stumbled")

    assert study.open().user_exclusions == (
        stumbled,
        replace(stumbled, action="restore", reason=""),
    )

    file.write_text("participant,recording,onset_s,action\nS01,S01_ewp.csv,1.25,exclude\n")

    assert study.open().user_exclusions == (replace(stumbled, reason=""),)


@pytest.mark.parametrize(
    ("text", "place"),
    [
        (b"", ""),
        (b"participant,recording\n", ""),
        (b"S01,f,1,exclude,,\nS01,f,soon,exclude,,\n", ", row 3, column 'onset_s'"),
        (b"S01,f,nan,exclude,,\n", ", row 2, column 'onset_s'"),
        (b"S01,f,1,drop,,\n", ""),
        (b"S01,f,1\n", ""),
        (b"S01,f,1,exclude,a,b,c\n", ", row 2"),
        (b"S01,f,1,exclude,a,b\nS01,f,1,exclude,a,b,c\n", ""),
        (b"\xff,f,1,exclude,,\n", ""),
    ],
)
def test_exclusions_that_cannot_be_read_are_refused(study, text, place):
    head = EXCLUSIONS.encode() if text.startswith((b"S", b"\xff")) else b""
    (study.root / "exclusions.csv").write_bytes(head + text)

    assert study.sole_problem().startswith(f"exclusions.csv{place}: ")
