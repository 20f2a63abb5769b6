"""Names that spreadsheets would run, and variables whose values nobody is told."""

import pytest

from jointz.core.errors import DataError

FORMULA = '=HYPERLINK("http://x")'
#: What is edited, and where the problem is said to be.
PLACES = [
    ('id = "S01"', "id = {}", "participants[1].id"),
    ("mass_kg = 72.4", "group = {}", "participants[1].group"),
    ('participant = "S01"', "participant = {}", "recordings[1].participant"),
    ('file = "S01_enp.csv"', 'file = "S01_enp.csv"\nsession = {}', "recordings[1].session"),
    ('file = "S01_enp.csv"', "file = {}", "recordings[1].file"),
    ('perturbations = "S01_pulses.csv"', "perturbations = {}", "recordings[2].perturbations"),
    ("LRE = 7.0", "{} = 7.0", "timing_points"),
    ('joint = "knee"', "joint = {}", "joint"),
    ("[channels.ankle_position]", "[channels.{}]", "channels"),
    (
        "[[participants]]",
        '[channels.trial]\ncolumn = "trial"\nvalues = {{ "1" = {} }}\n[[participants]]',
        "channels.trial.values",
    ),
]


@pytest.mark.parametrize(("old", "new", "place"), PLACES, ids=[new for _, new, _ in PLACES])
def test_a_name_that_a_spreadsheet_would_run_is_refused(study, old, new, place):
    study.edit(old, new.format(f"'{FORMULA}'"))

    study.refused(place, "begin with '='")


@pytest.mark.parametrize(
    "name", ["+1", "-2", "@SUM(A1)", " =1+1", "a;=1+1", "\\tS01", "S\\u000101"]
)
def test_signs_that_begin_a_formula_and_control_characters_are_refused(study, name):
    study.edit('id = "S01"', f'id = "{name}"').edit(
        'participant = "S01"', f'participant = "{name}"'
    )

    study.refused("participants[1].id")


def test_names_with_signs_inside_stay(study):
    study.edit('"S01"', '"S-01 + a@b = c"')

    assert study.open().spec.participants[0].id == "S-01 + a@b = c"


def test_a_timing_point_of_a_pulse_table_is_refused_with_its_row(study):
    study.table("S01_pulses.csv", lambda t: t.assign(timing_point=FORMULA))

    assert study.sole_problem().startswith("S01_pulses.csv, row 2, column 'timing_point': ")


@pytest.mark.parametrize(("label", "refused"), [(FORMULA, True), ("-1", False)])
def test_a_trial_of_a_file_is_refused_unless_it_is_a_number(study, label, refused):
    study.table("S01_enp.csv", lambda t: t.assign(trial=label))
    study.table("S01_ewp.csv", lambda t: t.assign(trial="1"))
    study.edit("[[participants]]", '[channels.trial]\ncolumn = "trial"\n[[participants]]')

    if refused:
        with pytest.raises(DataError, match=r"S01_enp.csv, column 'trial': "):
            study.read()
    else:
        assert study.read()[0].attrs["trial"] == "-1"


def test_a_reason_that_a_spreadsheet_would_run_is_refused(study):
    (study.root / "exclusions.csv").write_text(
        "participant,recording,onset_s,action,reason\nS01,S01_ewp.csv,0.021,exclude,@SUM(A1)\n"
    )

    study.refused("exclusions.csv, row 2, column 'reason': ")


@pytest.mark.parametrize("damage", [None, "t\n1\n", "x,y\n"])
def test_what_a_variable_holds_is_never_told(study, monkeypatch, damage):
    monkeypatch.setenv("TOKEN", "hunter2")
    study.edit('file = "S01_enp.csv"', 'file = "${TOKEN}.csv"')
    if damage:
        (study.root / "hunter2.csv").write_text(damage)

    error = study.refused("recordings[1].file", "${TOKEN}.csv")

    assert "hunter2" not in str(error)


def test_what_a_variable_holds_is_not_told_of_a_bad_row_either(study, monkeypatch):
    monkeypatch.setenv("TOKEN", "hunter2")
    study.edit('file = "S01_enp.csv"', 'file = "${TOKEN}.csv"')
    (study.root / "S01_enp.csv").rename(study.root / "hunter2.csv")
    study.table("hunter2.csv", lambda t: t.astype(object).replace(3.0, "#N/A!"))

    with pytest.raises(DataError, match=r"^\$\{TOKEN\}.csv, row 2, column 'torque_nm'") as caught:
        study.read()

    assert "hunter2" not in str(caught.value)


@pytest.mark.parametrize("value", ["1e160", "-1e308"])
@pytest.mark.parametrize("column", ["torque_nm", "time_s", "footswitch"])
def test_a_number_that_no_sensor_gives_is_bad_input_with_row_and_column(study, value, column):
    def spoil(table):
        table = table.astype({column: object})
        table.loc[49, column] = value
        return table

    study.table("S01_enp.csv", spoil)

    with pytest.raises(DataError, match=f"S01_enp.csv, row 51, column '{column}'"):
        study.read()
