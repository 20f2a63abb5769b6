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
from jointz.io.study_files import data_file, needed_channels
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
    directions = (spec.positive, spec.torque_acts_on)
    assert (spec.joint, spec.kind, *directions) == ("knee", "walking", "flexion", "joint")
    assert spec.sample_rate_hz == 1000.0
    assert spec.channels["angle"].column == "knee_angle_deg"
    assert spec.channels["contact"].kind == "contact"
    assert spec.participant("S01").mass_kg == 72.4
    assert [r.condition for r in spec.recordings] == ["unperturbed", "perturbed"]
    points = {"LRE": 7.0, "MST": 21.5, "TST": 40.5, "PSW": 56.0, "ISW": 68.5, "MSW": 81.0}
    assert spec.perturbations.timing_points == points
    assert spec.perturbations.baseline == "pre_pulse"
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


@pytest.mark.parametrize("alias", ["NPC", "Enp", " ENP "])
def test_names_of_the_dissertation_stand_for_conditions(study, alias):
    study.edit('condition = "unperturbed" ', f'condition = "{alias}" ')

    assert study.open().spec.recordings[0].condition == "unperturbed"


def test_a_number_as_id_is_the_same_as_its_text(study):
    study.edit('id = "S01"', "id = 1").edit('participant = "S01"', 'participant = "1"')

    assert study.open().spec.participants[0].id == "1"


def test_edges_of_groups_are_taken_to_si(study):
    study.edit('edges = [-0.45, -0.15, -0.03], unit = "rad"', 'edges = [-90, 0, 180], unit = "deg"')

    assert study.open().group_edges == pytest.approx((-np.pi / 2, 0.0, np.pi))


def test_torque_may_come_from_current_and_a_torque_model(study):
    study.text = without(study.text, "channels.torque")
    study.channel("current", 'unit = "mA"', column="torque_nm")
    study.refused("channels.torque: missing; give it, or channels.current and [torque_model].")

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


def test_what_a_file_must_hold_depends_on_its_condition():
    names = ["time", "angle", "torque", "condition", "trial", "emg"]

    assert needed_channels(names, None) == names
    assert needed_channels(names, "perturbed") == ["time", "angle", "torque", "trial", "emg"]
    assert needed_channels(names, "no_device") == ["time", "angle", "trial"]


# --- files and variables -------------------------------------------------------------------------


def test_variables_of_the_environment_expand_in_file_names(study, monkeypatch, tmp_path_factory):
    elsewhere = tmp_path_factory.mktemp("elsewhere")
    shutil.move(study.root / "S01_enp.csv", elsewhere / "S01_enp.csv")
    study.edit('file = "S01_enp.csv"', 'file = "${LAB_DATA}/S01_enp.csv"')
    monkeypatch.delenv("LAB_DATA", raising=False)
    study.refused(
        "recordings[1].file: '${LAB_DATA}/S01_enp.csv': the environment variable LAB_DATA is not "
        "set. Set it."
    )

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

    problems = study.refused("2 problems").problems

    assert problems[0].startswith("recordings[2].file: file '")
    assert problems[0].endswith("S01_ewp.csv' does not exist. Correct the name or bring the file.")
    assert problems[1].startswith("recordings[2].perturbations: file '")


@pytest.mark.parametrize(
    ("name", "problem"), [("x" * 300, "does not exist"), (".", "is a folder; expected a file")]
)
def test_a_name_no_file_can_have_is_told_as_what_it_is(study, name, problem):
    study.edit('file = "S01_enp.csv"', f'file = "{name}"')

    assert problem in study.sole_problem()


def test_missing_columns_are_one_problem_a_file_with_a_guess_and_those_there_are(study):
    study.edit('"torque_nm"', '"torque_mn"').edit('"footswitch"', '"qqq"')

    first, second = study.refused().problems

    assert first == (
        "recordings[1].file: S01_enp.csv has no column 'torque_mn' for channel 'torque' (did you "
        "mean 'torque_nm'?), no column 'qqq' for channel 'contact'. It has: time_s, "
        "knee_angle_deg, torque_nm, commanded_torque_nm, footswitch, ankle_position."
    )
    assert second.startswith("recordings[2].file: S01_ewp.csv has no column")


def test_one_file_of_two_recordings_is_checked_once(study):
    study.edit('file = "S01_ewp.csv"', 'file = "S01_enp.csv"').edit('"torque_nm"', '"xyz"')

    assert "recordings[1].file" in study.sole_problem()


@pytest.mark.parametrize(("mark", "name"), [(";", "a semicolon"), ("\t", "a tab")])
def test_another_delimiter_is_guessed(study, mark, name):
    for file in study.root.glob("S01_e*.csv"):
        file.write_text(file.read_text().replace(",", mark))

    study.refused(f"The columns seem to be separated by {name}: set delimiter under [files].")
    study.text += f"delimiter = '{mark}'\n"
    study.open()


def test_a_file_of_an_unknown_kind_is_a_problem_of_its_recording(study):
    (study.root / "S01.docx").write_text("no")
    study.edit("S01_enp.csv", "S01.docx")

    assert study.sole_problem().startswith("recordings[1].file: S01.docx: no format for this kind")


# --- the text itself -----------------------------------------------------------------------------


def test_a_missing_folder_says_what_to_give(tmp_path):
    for path in (tmp_path / "absent", tmp_path, tmp_path / ("x" * 300)):
        with pytest.raises(DataError, match=r"no study\.toml found\. Give the folder that holds"):
            open_study(path)


@pytest.mark.parametrize("content", [b"a = 1\na = 2", b"x = [{ y = 0x1ffffffffffffffff }]"])
def test_text_that_is_not_toml_is_refused(tmp_path, content):
    (tmp_path / "study.toml").write_bytes(content)

    with pytest.raises(StudyError, match=r"toml: 1 problem\n  - not valid TOML: \S") as caught:
        open_study(tmp_path)

    assert caught.value.path == str(tmp_path / "study.toml")


def test_an_empty_file_names_what_is_required(tmp_path):
    (tmp_path / "study.toml").write_text("")

    with pytest.raises(StudyError) as caught:
        open_study(tmp_path)

    assert caught.value.problems == tuple(
        f"{key}: missing; it is required."
        for key in ("jointz", "joint", "kind", "channels", "participants", "recordings")
    )


@pytest.mark.parametrize("version", ["2", "true", "1.0"])
def test_another_schema_version_is_refused(study, version):
    study.edit("jointz = 1 ", f"jointz = {version} ")

    assert "is not one this version reads (1)." in study.sole_problem()


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


@pytest.mark.parametrize(("old", "new", "problem"), problem_rows())
def test_a_problem_is_named_with_its_key_what_was_expected_and_what_was_found(
    study, old, new, problem
):
    study.edit(old, new)

    text, begins = study.sole_problem(), problem.endswith("...")
    assert text.startswith(problem.removesuffix("...")) if begins else text == problem


@pytest.mark.parametrize(
    ("key", "value", "expected"),
    [
        ("channels", '{ angle = "col" }', "channels.angle: expected a table; got 'col'."),
        ("participants", "5", "participants: expected a list; got 5."),
        ("participants", "[5]", "participants[1]: expected a table; got 5."),
        ("participants", "[]", "participants: expected at least 1 of them; got []."),
        ("participants", '[{ id = "" }]', "participants[1].id: expected text that is not empty"),
        ("perturbations", "[]", "perturbations: expected a table; got []."),
        ("perturbations", "{ group = 1 }", "perturbations.group: expected a table; got 1."),
        ("perturbations", "{ timing_points = 1 }", "perturbations.timing_points: expected a table"),
        ("perturbations", '{ source = ["a"] }', "perturbations.source: expected 'command',"),
        ("calibration", "1979-05-27", "calibration: expected a table; got datetime.date(1979"),
        ("torque_model", "true", "torque_model: expected a table; got True."),
    ],
)
def test_something_else_in_place_of_a_table_is_named(study, key, value, expected):
    channels = '{ time = { column = "time_s" }, angle = { column = "a" } }'
    good = {"channels": channels, "participants": '[{ id = "S01" }]', "recordings": "[]"}
    tables = good | {key: value}
    study.text = 'jointz = 1\njoint = "knee"\nkind = "walking"\n'
    study.text += "".join(f"{k} = {v}\n" for k, v in tables.items())

    problems = study.refused().problems

    assert any(p.startswith(expected) for p in problems), problems


def test_a_long_value_is_shortened(study):
    study.edit('positive = "flexion"', f'positive = "{"x" * 500}"')

    assert len(study.sole_problem().rpartition("; got ")[2]) < 100


# --- units ---------------------------------------------------------------------------------------


def test_a_reference_may_be_an_angle_or_a_torque(study):
    text = study.text
    for unit, si_unit in (("deg", "rad"), ("Nm", "N*m")):
        study.text = text
        study.channel("reference", f'unit = "{unit}"', column="ankle_position")
        assert study.open().units["reference"][0] == si_unit

    study.edit('"Nm"', '"kg"')
    assert study.sole_problem().startswith("channels.reference.unit: 'kg' measures mass")


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


@pytest.mark.parametrize(
    ("lines", "problem"),
    [
        ('kind = "pulse"\nunit = "V"', "'V' measures voltage, expected a pure number"),
        ('unit = "V"', "'V' measures voltage, expected a pure number"),
        ('kind = "voltage"\nunit = "N"', "'N' measures force, expected a voltage such as V or mV"),
        ('kind = "voltage"\nunit = "Vv"', "'Vv' is not a unit that can be read"),
    ],
)
def test_another_unit_of_a_contact_is_refused(study, lines, problem):
    study.edit('kind = "contact"', lines)

    found = study.sole_problem()
    assert found.startswith(f"channels.contact.unit: {problem}")
    assert ('kind = "voltage"' in found) == ("voltage" not in lines)


# --- names that nothing stands behind -------------------------------------------------------------


def test_groups_by_a_channel_of_labels_are_refused(study):
    study.channel("trial", column="footswitch")
    study.edit('channel = "ankle_position"', 'channel = "trial"')

    study.refused("perturbations.group.channel: 'trial' is not among the channels of numbers")


def test_time_or_a_sample_rate_is_needed(study):
    study.text = without(study.text, "channels.time")
    study.open()

    study.edit("sample_rate_hz = 1000.0 ", "# ")

    assert study.sole_problem().startswith(
        "channels.time: missing; without a time column sample_rate_hz is needed: give it"
    )


def test_angle_and_torque_are_always_needed(study):
    start, stop = study.text.index("[channels.time]"), study.text.index("[[participants]]")
    study.text = study.text[:start] + "[channels]\n" + study.text[stop:]

    study.refused(
        "channels.angle: missing; every study needs the joint's angle.", "channels.torque: missing"
    )


@pytest.mark.parametrize("condition", ["perturbed", " ewp "])
def test_two_recordings_of_one_cell_are_refused(study, condition):
    study.edit("[perturbations] ", SECOND.format(condition=condition) + "[perturbations] ")

    assert study.sole_problem() == (
        "recordings: 2 recordings for participant 'S01', condition 'perturbed'. One cell has one "
        "recording: join its trials into one file (where time begins again, [channels.trial] names "
        "the column that tells them apart), or remove the others. Another session is another day "
        "(on a bench another case) and is estimated apart."
    )


@pytest.mark.parametrize("own", ['side = "left"', "session = 2"])
def test_a_session_or_side_of_its_own_makes_a_cell(study, own):
    study.edit("[perturbations] ", f"{SECOND.format(condition='ewp')}{own}\n[perturbations] ")

    assert len(study.open().spec.recordings) == 3


def test_two_recordings_of_one_session_are_refused_by_its_name(study):
    study.edit('condition = "unperturbed" ', 'session = "a"\ncondition = "unperturbed" ')
    again = SECOND.format(condition="ENP") + 'session = "a"\n[perturbations] '
    study.edit("[perturbations] ", again)

    assert "condition 'unperturbed', session 'a'." in study.sole_problem()


@pytest.mark.parametrize("side", ["", 'side = "right"\n'])
def test_pulses_of_an_unknown_side_beside_both_unperturbed_legs_are_refused(study, side):
    study.edit('condition = "unperturbed" ', 'side = "left"\ncondition = "unperturbed" ')
    other = SECOND.format(condition="ENP") + 'side = "right"\n'
    study.edit("[perturbations] ", other + "[perturbations] ")
    study.edit('condition = "perturbed"', f'{side}condition = "perturbed"')

    if side:
        study.open()
    else:
        assert study.sole_problem() == (
            "recordings[2].side: missing, and 'S01' has unperturbed recordings of both sides: "
            "state the side of S01_ewp.csv."
        )


def test_every_perturbed_recording_needs_its_table_where_tables_are_the_source(study):
    study.edit('source = "command"', 'source = "table"')
    study.open()

    study.edit('perturbations = "S01_pulses.csv"', "#")

    assert study.sole_problem() == (
        'recordings[2].perturbations: missing; perturbations.source is "table".'
    )


@pytest.mark.parametrize("condition", ["perturbed", " E-APC "])
def test_something_must_say_when_the_pulses_are(study, condition):
    study.text = without(study.text, "channels.command")
    study.edit('source = "command"', "").edit('perturbations = "S01_pulses.csv"', "#")
    study.edit('condition = "perturbed"', f'condition = "{condition}"')

    assert study.sole_problem() == (
        "recordings[2]: nothing says when the pulses are. Give [channels.command], a table "
        '(perturbations = "FILE.csv"), or perturbations.source.'
    )


def test_a_source_without_its_channel_is_refused(study):
    study.text = without(study.text, "channels.command")

    assert study.sole_problem() == "perturbations.source: 'command' needs [channels.command]."


def test_all_problems_stand_in_one_message(study):
    (study.root / "S01_pulses.csv").unlink()
    (study.root / "exclusions.csv").write_text("participant\nS01\n")
    study.edit('joint = "knee"', "joint = 3\nsmaple_rate_hz = 3")
    study.edit('unit = "deg"', 'unit = "degg"').edit('column = "torque_nm"', 'column = "tau"')
    study.edit('id = "S01"', 'id = "S09"')

    error = study.refused(
        "joint: expected text",
        "smaple_rate_hz: unknown key. Did you mean 'sample_rate_hz'?",
        "channels.angle.unit: 'degg'",
        "recordings[1].participant: 'S01' is not among the participants (S09).",
        "recordings[2].participant",
        "recordings[1].file: S01_enp.csv has no column 'tau'",
        "recordings[2].file",
        "recordings[2].perturbations: file",
        "exclusions.csv: missing column(s) recording, onset_s, action.",
    )

    assert len(error.problems) == 9
    assert str(error).splitlines()[0] == f"{study.root / 'study.toml'}: 9 problems"


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
    ("text", "problem"),
    [
        (b"", ": not a readable table: No columns to parse from file."),
        (b"participant,recording\n", ": missing column(s) onset_s, action."),
        (b"S01,f,1,exclude,,\nS01,f,soon,exclude,,\n", ", row 3, column 'onset_s': expected a"),
        (b"S01,f,nan,exclude,,\n", ", row 2, column 'onset_s': expected a number, found 'nan'."),
        (b"S01,f,1,drop,,\n", ": action 'drop'; expected exclude or restore."),
        (b"S01,f,1\n", ": action ''; expected exclude or restore."),
        (b"S01,f,1,exclude,a,b,c\n", ", row 2: more values than the header has columns."),
        (b"S01,f,1,exclude,a,b\nS01,f,1,exclude,a,b,c\n", ": not a readable table: Error token"),
        (b"\xff,f,1,exclude,,\n", ": not a readable table: 'utf-8' codec"),
    ],
)
def test_exclusions_that_cannot_be_read_are_refused(study, text, problem):
    head = EXCLUSIONS.encode() if text.startswith((b"S", b"\xff")) else b""
    (study.root / "exclusions.csv").write_bytes(head + text)

    assert study.sole_problem().startswith(f"exclusions.csv{problem}")
