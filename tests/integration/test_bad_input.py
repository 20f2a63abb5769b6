"""Bad input of a whole analysis: what stops the job, what excludes only what it touches.

Single files and keys are refused by the readers' own tests.
"""

import shutil
from pathlib import Path

import pandas as pd
import pytest

from jointz.tasks.task_store import TaskStore

PERTURBED = "S01_perturbed.csv"
UNPERTURBED = "S01_unperturbed.csv"


def excluded(tmp_path: Path) -> pd.DataFrame:
    return pd.read_csv(tmp_path / "results" / "excluded.csv", keep_default_na=False)


def estimates(tmp_path: Path) -> pd.DataFrame:
    return pd.read_csv(tmp_path / "results" / "estimates.csv")


def onsets(results: Path, point: str) -> list[float]:
    """Return when the pulses of S01 at a timing point begin."""
    pulses = pd.read_csv(results / "pulses.csv")
    return pulses.query("participant == 'S01' and timing_point == @point")["onset_s"].tolist()


def test_a_study_in_order_is_analysed(small_results):
    table = estimates(small_results.parent)

    assert list(table["timing_point"].unique()) == ["LRE", "MST", "TST", "PSW", "ISW", "MSW"]
    assert (table["n_used"] + table["n_excluded"] == 4).all()
    # Four pulses a point decide most, not all.
    assert set(table["status"]) <= {"ok", "at_bound", "undecided"}
    assert len(table) == 2 * 6 * 7
    assert table["value"].notna().sum() > 30


# --- what stops the job --------------------------------------------------------------------------


def assert_refused(outcome, tmp_path: Path, *words: str) -> None:
    assert outcome.code == 2
    for word in words:
        assert word in outcome.err, outcome.err
    assert "Traceback" not in outcome.err
    assert outcome.json["status"] == "error"
    assert {p.name for p in tmp_path.iterdir()} == {"study"}


def test_all_problems_of_a_study_stand_in_one_message(small_study, analyze, tmp_path):
    small_study.edit_toml('unit = "rad"', 'unit = "N*m"')
    small_study.edit_toml('kind = "walking"', 'kind = "wlaking"')
    small_study.edit_toml('joint = "knee"', 'joint = "knee"\nfoo = 1')
    (small_study.root / UNPERTURBED).unlink()

    assert_refused(
        analyze(small_study), tmp_path, "4 problems", "kind", "foo", "angle.unit", UNPERTURBED
    )


def test_a_bad_cell_stops_the_job_and_keeps_who_is_done(small_study, analyze, tmp_path):
    path = small_study.root / PERTURBED
    lines = path.read_text().splitlines(keepends=True)
    cells = lines[1233].split(",")
    lines[1233] = ",".join([*cells[:2], "abc", *cells[3:]])
    path.write_text("".join(lines))

    outcome = analyze(small_study)

    assert_refused(outcome, tmp_path, PERTURBED, "row 1234", "'torque'")
    # Who is done need not be done again once the input is mended, and the error says so.
    store = TaskStore(tmp_path / "results")
    assert store.folder.exists() == ("What is done is kept in" in outcome.err)
    store.clear()


@pytest.mark.parametrize("more", [(), ("--overwrite",)])
def test_a_folder_that_jointz_did_not_make_is_never_replaced(small_study, analyze, tmp_path, more):
    thesis = tmp_path / "results" / "thesis.doc"
    thesis.parent.mkdir()
    thesis.write_text("years of work")

    assert analyze(small_study, *more).code == 2
    assert thesis.read_text() == "years of work"


def test_a_results_folder_that_exists_is_kept_unless_overwrite(
    small_study, analyze, tmp_path, small_results
):
    shutil.copytree(small_results, tmp_path / "results")
    before = (small_results / "report.html").read_bytes()

    assert analyze(small_study).code == 2
    assert (tmp_path / "results" / "report.html").read_bytes() == before


# --- what excludes what it touches ---------------------------------------------------------------


def alone(study) -> None:
    """Leave S01 only."""
    head, first, rest = study.toml.split("[[participants]]")
    people = rest.index("[[recordings]]")
    tables = rest[people:].split("[[recordings]]")
    kept = [table for table in tables if '"S02"' not in table]
    text = "[[participants]]".join([head, first]) + "[[recordings]]".join(kept)
    (study.root / "study.toml").write_text(text)


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


def test_a_hole_excludes_the_pulse_that_it_touches(small_study, analyze, tmp_path, small_results):
    every = sorted(
        t for point in ("LRE", "MST", "TST", "PSW") for t in onsets(small_results, point)
    )
    numbers, gap, strikes = every[2], every[7], every[12]

    def spoil(table):
        time = table["time"]
        angle = table["angle"].mask(time.between(numbers + 0.02, numbers + 0.05))
        contact = table["contact"].mask(time.between(strikes - 4.5, strikes + 0.5), 0.0)
        hole = time.between(gap + 0.03, gap + 0.06)
        return table.assign(angle=angle, contact=contact)[~hole]

    alone(small_study)
    small_study.edit_table(PERTURBED, spoil)

    assert analyze(small_study).code == 0
    assert codes_at(tmp_path, numbers) == ["not_finite"]
    assert codes_at(tmp_path, gap) == ["gap"]
    assert codes_at(tmp_path, strikes) == ["missing_strike"]
    assert "missing_strike" in set(excluded(tmp_path).query("kind == 'stride'")["code"])
    assert_counts_add_up(tmp_path)


def test_one_pulse_at_a_timing_point_is_left_out_with_a_code(
    small_study, analyze, tmp_path, small_results
):
    first, *others = onsets(small_results, "MST")

    def quiet(table):
        command = table["command"].to_numpy().copy()
        for onset in others:
            command[table["time"].between(onset - 0.01, onset + 0.3)] = 0.0
        return table.assign(command=command)

    alone(small_study)
    small_study.edit_table(PERTURBED, quiet)
    shutil.copytree(small_results, tmp_path / "results")
    outcome = analyze(small_study, "--overwrite", "--method", "dissertation")

    assert outcome.code == 0
    assert outcome.json["n_standing"] == estimates(tmp_path)["value"].notna().sum()
    assert sorted(p.name for p in tmp_path.iterdir()) == ["results", "study"]
    cell = estimates(tmp_path).query("timing_point == 'MST'")
    assert set(cell["status"]) == {"failed:too_few_pulses"}
    assert set(cell["n_used"]) == {0}
    assert set(cell["n_excluded"]) == {1}
    assert codes_at(tmp_path, first) == ["lone_pulse"]


# --- what fails with a reason --------------------------------------------------------------------


def test_what_one_person_lacks_fails_there_only(small_study, analyze, tmp_path):
    """S01 has no heel strikes; S02 has no mass."""
    small_study.edit_table(PERTURBED, lambda t: t.assign(contact=0.0))
    mass = [line for line in small_study.toml.splitlines() if line.startswith("mass_kg")][-1]
    small_study.edit_toml(mass + "\n", "")

    assert analyze(small_study).code == 0
    lame = estimates(tmp_path).query("participant == 'S01'")
    assert len(lame) == 6 * 5
    assert set(lame["status"]) == {"failed:no_heel_strikes"}
    assert lame["value"].isna().all()
    assert set(excluded(tmp_path).query("kind == 'pulse'")["code"]) == {"no_heel_strikes"}
    other = estimates(tmp_path).query("participant == 'S02'").set_index("parameter")["status"]
    assert set(other["stiffness_per_mass"]) == {"failed:mass_missing"}
    assert set(other["stiffness"]) <= {"ok", "at_bound", "undecided"}


def test_where_nothing_stands_each_has_its_reason_and_the_exit_status_is_1(
    small_study, analyze, tmp_path
):
    small_study.edit_table(PERTURBED, lambda t: t.assign(command=0.0))
    for condition in ("perturbed", "unperturbed"):
        small_study.edit_table(f"S02_{condition}.csv", lambda t: t.assign(angle=0.5))

    outcome = analyze(small_study)

    assert outcome.code == 1
    assert outcome.json["status"] == "nothing_stands"
    statuses = estimates(tmp_path).groupby("participant")["status"].agg(set).to_dict()
    assert statuses == {"S01": {"failed:no_pulses"}, "S02": {"failed:constant_angle"}}
