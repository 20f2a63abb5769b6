"""Every kind of bad input of the issue: what stops the job, what excludes what it touches."""

from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from jointz.tasks.task_store import TaskStore

PERTURBED = "S01_perturbed.csv"
UNPERTURBED = "S01_unperturbed.csv"


def excluded(tmp_path: Path) -> pd.DataFrame:
    return pd.read_csv(tmp_path / "results" / "excluded.csv", keep_default_na=False)


def estimates(tmp_path: Path) -> pd.DataFrame:
    return pd.read_csv(tmp_path / "results" / "estimates.csv")


def assert_refused(outcome, tmp_path: Path, *words: str) -> None:
    assert outcome.code == 2
    for word in words:
        assert word in outcome.err, outcome.err
    assert "Traceback" not in outcome.err
    assert outcome.json["status"] == "error"
    assert {p.name for p in tmp_path.iterdir()} == {"study"}
    # Who is done need not be done again once the input is mended, and the error says so.
    store = TaskStore(tmp_path / "results")
    assert store.folder.exists() == ("What is done is kept in" in outcome.err)
    store.clear()


def test_a_study_in_order_is_analysed(small_study, analyze, tmp_path):
    outcome = analyze(small_study)

    assert outcome.code == 0
    table = estimates(tmp_path)
    assert list(table["timing_point"].unique()) == ["LRE", "MST", "TST", "PSW", "ISW", "MSW"]
    assert (table["n_used"] + table["n_excluded"] == 4).all()
    # Four pulses a point decide most, not all.
    assert set(table["status"]) <= {"ok", "at_bound", "undecided"}
    assert len(table) == 2 * 6 * 5
    assert outcome.json["n_standing"] == table["value"].notna().sum() > 30


def test_a_missing_file_stops_the_job(small_study, analyze, tmp_path):
    (small_study.root / PERTURBED).unlink()

    assert_refused(analyze(small_study), tmp_path, PERTURBED, "does not exist")


def test_a_missing_column_stops_the_job_and_lists_the_columns(small_study, analyze, tmp_path):
    small_study.edit_toml('column = "torque"', 'column = "torq"')

    assert_refused(analyze(small_study), tmp_path, "'torq'", "did you mean 'torque'", PERTURBED)


def test_an_unknown_key_stops_the_job(small_study, analyze, tmp_path):
    small_study.edit_toml('joint = "knee"', 'joint = "knee"\nsmaple_rate_hz = 1000')

    assert_refused(analyze(small_study), tmp_path, "smaple_rate_hz", "sample_rate_hz")


@pytest.mark.parametrize(
    ("unit", "word"), [("furlong_x", "furlong_x"), ("N*m", "angle"), ("kg", "angle")]
)
def test_an_unknown_or_wrong_unit_stops_the_job(small_study, analyze, tmp_path, unit, word):
    small_study.edit_toml('unit = "rad"', f'unit = "{unit}"')

    assert_refused(analyze(small_study), tmp_path, "channels.angle.unit", word)


def test_all_problems_of_a_study_stand_in_one_message(small_study, analyze, tmp_path):
    small_study.edit_toml('unit = "rad"', 'unit = "N*m"')
    small_study.edit_toml('kind = "walking"', 'kind = "wlaking"')
    small_study.edit_toml('joint = "knee"', 'joint = "knee"\nfoo = 1')
    (small_study.root / UNPERTURBED).unlink()

    assert_refused(
        analyze(small_study), tmp_path, "4 problems", "wlaking", "foo", "angle.unit", UNPERTURBED
    )


def test_degrees_declared_as_radians_stop_the_job(small_study, analyze, tmp_path):
    def to_degrees(table):
        return table.assign(angle=np.rad2deg(table["angle"]))

    small_study.edit_table(PERTURBED, to_degrees)

    assert_refused(analyze(small_study), tmp_path, PERTURBED, "full turn", "unit")


def test_a_cell_that_is_no_number_stops_the_job_with_row_and_column(small_study, analyze, tmp_path):
    path = small_study.root / PERTURBED
    lines = path.read_text().splitlines(keepends=True)
    cells = lines[1233].split(",")
    cells[2] = "abc"
    lines[1233] = ",".join(cells)
    path.write_text("".join(lines))

    assert_refused(analyze(small_study), tmp_path, PERTURBED, "1234", "'torque'", "'abc'")


def test_a_run_without_numbers_excludes_the_pulses_it_touches(small_study, analyze, tmp_path):
    whole = analyze(small_study)
    onset = first_pulse(tmp_path)

    def hole(table):
        touched = table["time"].between(onset + 0.02, onset + 0.05)
        return table.assign(angle=table["angle"].mask(touched))

    small_study.edit_table(PERTURBED, hole)
    outcome = analyze(small_study, "--overwrite")

    assert whole.code == outcome.code == 0
    assert codes_at(tmp_path, onset) == ["not_finite"]
    assert_counts_add_up(tmp_path)


def first_pulse(tmp_path: Path) -> float:
    pulses = pd.read_csv(tmp_path / "results" / "pulses.csv")
    return float(pulses.query("participant == 'S01'")["onset_s"].iloc[3])


def codes_at(tmp_path: Path, onset_s: float) -> list[str]:
    rows = excluded(tmp_path).query("kind == 'pulse' and participant == 'S01'")
    return list(rows.loc[(rows["onset_s"] - onset_s).abs() < 0.01, "code"])


def assert_counts_add_up(tmp_path: Path) -> None:
    table = estimates(tmp_path)
    pulses = pd.read_csv(tmp_path / "results" / "pulses.csv", keep_default_na=False)
    for (person, point), rows in pulses.groupby(["participant", "timing_point"]):
        cell = table[(table["participant"] == person) & (table["timing_point"] == point)].iloc[0]
        assert cell["n_used"] == (rows["code"] == "").sum()
        assert cell["n_excluded"] == (rows["code"] != "").sum()


@pytest.mark.parametrize(("how", "word"), [("goes back", "goes back"), ("repeats", "repeats")])
def test_unsorted_or_repeated_time_stops_the_job_with_the_row(
    small_study, analyze, tmp_path, how, word
):
    def spoil(table):
        time = table["time"].to_numpy().copy()
        if how == "goes back":
            time[[500, 501]] = time[[501, 500]]
        else:
            time[501] = time[500]
        return table.assign(time=time)

    small_study.edit_table(PERTURBED, spoil)

    assert_refused(analyze(small_study), tmp_path, PERTURBED, word, "row 503")


def test_a_gap_inside_a_pulse_excludes_the_pulse(small_study, analyze, tmp_path):
    analyze(small_study)
    onset = first_pulse(tmp_path)
    small_study.edit_table(PERTURBED, lambda t: t[~t["time"].between(onset + 0.03, onset + 0.06)])

    outcome = analyze(small_study, "--overwrite")

    assert outcome.code == 0
    assert codes_at(tmp_path, onset) == ["gap"]
    assert_counts_add_up(tmp_path)


def test_no_heel_strike_at_all_leaves_no_estimate_for_that_participant(
    small_study, analyze, tmp_path
):
    small_study.edit_table(PERTURBED, lambda t: t.assign(contact=0.0))

    outcome = analyze(small_study)

    assert outcome.code == 0  # the other participant's estimates stand
    mine = estimates(tmp_path).query("participant == 'S01'")
    assert len(mine) == 6 * 5
    assert set(mine["status"]) == {"failed:no_heel_strikes"}
    assert mine["value"].isna().all()
    assert set(excluded(tmp_path).query("kind == 'pulse'")["code"]) == {"no_heel_strikes"}


def test_five_seconds_without_heel_strikes_exclude_the_pulses_inside(
    small_study, analyze, tmp_path
):
    analyze(small_study)
    onset = first_pulse(tmp_path)

    def silence(table):
        silent = table["time"].between(onset - 4.5, onset + 0.5)
        return table.assign(contact=table["contact"].mask(silent, 0.0))

    small_study.edit_table(PERTURBED, silence)
    outcome = analyze(small_study, "--overwrite")

    assert outcome.code == 0
    assert codes_at(tmp_path, onset) == ["missing_strike"]
    strides = excluded(tmp_path).query("kind == 'stride'")
    assert "missing_strike" in set(strides["code"])
    assert_counts_add_up(tmp_path)


def test_no_pulse_leaves_no_estimate_and_exits_1(small_study, analyze, tmp_path):
    for person in ("S01", "S02"):
        small_study.edit_table(f"{person}_perturbed.csv", lambda t: t.assign(command=0.0))

    outcome = analyze(small_study)

    assert outcome.code == 1
    assert set(estimates(tmp_path)["status"]) == {"failed:no_pulses"}
    assert outcome.json["status"] == "nothing_stands"


def test_one_pulse_at_a_timing_point_is_left_out_with_a_code(small_study, analyze, tmp_path):
    analyze(small_study)
    pulses = pd.read_csv(tmp_path / "results" / "pulses.csv").query("participant == 'S01'")
    at_point = pulses.query("timing_point == 'MST'")["onset_s"]

    def quiet(table):
        command = table["command"].to_numpy().copy()
        for onset in at_point.iloc[1:]:
            command[table["time"].between(onset - 0.01, onset + 0.3)] = 0.0
        return table.assign(command=command)

    small_study.edit_table(PERTURBED, quiet)
    outcome = analyze(small_study, "--overwrite", "--method", "dissertation")

    assert outcome.code == 0
    cell = estimates(tmp_path).query("participant == 'S01' and timing_point == 'MST'")
    assert set(cell["status"]) == {"failed:too_few_pulses"}
    assert set(cell["n_used"]) == {0}
    assert set(cell["n_excluded"]) == {1}
    assert codes_at(tmp_path, float(at_point.iloc[0])) == ["lone_pulse"]


def test_a_constant_angle_is_a_failure_with_a_reason(small_study, analyze, tmp_path):
    for person in ("S01", "S02"):
        for condition in ("perturbed", "unperturbed"):
            small_study.edit_table(f"{person}_{condition}.csv", lambda t: t.assign(angle=0.5))

    outcome = analyze(small_study)

    assert outcome.code == 1
    assert set(estimates(tmp_path)["status"]) == {"failed:constant_angle"}


@pytest.mark.parametrize("cut", [0.5, 0.8123])
def test_a_recording_cut_off_in_a_row_stops_the_job(small_study, analyze, tmp_path, cut):
    path = small_study.root / PERTURBED
    text = path.read_text()
    end = text.index(",", int(cut * len(text))) + 3
    path.write_text(text[:end])

    assert_refused(analyze(small_study), tmp_path, PERTURBED, "cut off")


def test_an_empty_file_stops_the_job(small_study, analyze, tmp_path):
    (small_study.root / PERTURBED).write_text("")

    assert_refused(analyze(small_study), tmp_path, PERTURBED, "empty")


def test_a_missing_mass_fails_only_the_values_per_kg(small_study, analyze, tmp_path):
    mass = next(line for line in small_study.toml.splitlines() if line.startswith("mass_kg"))
    small_study.edit_toml(mass + "\n", "", 1)

    outcome = analyze(small_study)

    assert outcome.code == 0
    mine = estimates(tmp_path).query("participant == 'S01'").set_index("parameter")["status"]
    assert set(mine["stiffness_per_mass"]) == {"failed:mass_missing"}
    assert set(mine["stiffness"]) <= {"ok", "at_bound", "undecided"}


def test_two_recordings_for_one_cell_stop_the_job(small_study, analyze, tmp_path):
    entry = f'\n[[recordings]]\nparticipant = "S01"\ncondition = "ewp"\nfile = "{PERTURBED}"\n'
    small_study.edit_toml(small_study.toml, small_study.toml + entry)

    assert_refused(analyze(small_study), tmp_path, "S01", "perturbed", "session")


def test_a_results_folder_that_exists_is_kept_unless_overwrite(small_study, analyze, tmp_path):
    first = analyze(small_study)
    report = tmp_path / "results" / "report.html"
    before = report.read_bytes()
    again = analyze(small_study)

    assert first.code == 0
    assert again.code == 2
    assert "--overwrite" in again.err
    assert report.read_bytes() == before

    assert analyze(small_study, "--overwrite").code == 0
    assert sorted(p.name for p in tmp_path.iterdir()) == ["results", "study"]


def test_a_folder_that_jointz_did_not_make_is_never_replaced(small_study, analyze, tmp_path):
    thesis = tmp_path / "results" / "thesis.doc"
    thesis.parent.mkdir()
    thesis.write_text("years of work")

    outcome = analyze(small_study, "--overwrite")

    assert outcome.code == 2
    assert "did not make it" in outcome.err
    assert thesis.read_text() == "years of work"


def test_a_study_that_is_not_there_stops_the_job(jointz, tmp_path):
    outcome = jointz("analyze", tmp_path / "nowhere", "--out", tmp_path / "results")

    assert outcome.code == 2
    assert "no study.toml" in outcome.err


def test_an_unset_variable_in_a_file_name_is_named(small_study, analyze, tmp_path, monkeypatch):
    monkeypatch.delenv("LAB_DISK", raising=False)
    small_study.edit_toml(f'file = "{PERTURBED}"', f'file = "${{LAB_DISK}}/{PERTURBED}"')

    assert_refused(analyze(small_study), tmp_path, "LAB_DISK", "not set")
