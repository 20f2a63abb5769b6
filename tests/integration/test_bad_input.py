"""Every kind of bad input of the issue: what stops the job, what excludes what it touches."""

from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from jointz.analysis.analyze import analyze as analyze_study
from jointz.analysis.results_folder import write_results
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


def cell_without_a_number(study):
    path = study.root / PERTURBED
    lines = path.read_text().splitlines(keepends=True)
    cells = lines[1233].split(",")
    lines[1233] = ",".join([*cells[:2], "abc", *cells[3:]])
    path.write_text("".join(lines))


def cut_in_a_row(study):
    path = study.root / PERTURBED
    text = path.read_text()
    path.write_text(text[: text.index(",", len(text) // 2) + 3])


def times_swapped(table):
    time = table["time"].to_numpy().copy()
    time[[500, 501]] = time[[501, 500]]
    return table.assign(time=time)


def time_repeated(table):
    return table.assign(time=table["time"].where(table.index != 501, table["time"][500]))


def listed_twice(study):
    entry = f'\n[[recordings]]\nparticipant = "S01"\ncondition = "ewp"\nfile = "{PERTURBED}"\n'
    study.edit_toml(study.toml, study.toml + entry)


@pytest.mark.parametrize(
    ("spoil", "words"),
    [
        (lambda s: (s.root / PERTURBED).unlink(), (PERTURBED, "does not exist")),
        (lambda s: (s.root / PERTURBED).write_text(""), (PERTURBED, "empty")),
        (cut_in_a_row, (PERTURBED, "cut off")),
        (cell_without_a_number, (PERTURBED, "1234", "'torque'", "'abc'")),
        (
            lambda s: s.edit_table(PERTURBED, times_swapped),
            (PERTURBED, "goes back", "row 503"),
        ),
        (lambda s: s.edit_table(PERTURBED, time_repeated), (PERTURBED, "repeats", "row 503")),
        (
            lambda s: s.edit_table(PERTURBED, lambda t: t.assign(angle=np.rad2deg(t["angle"]))),
            (PERTURBED, "full turn", "unit"),
        ),
        (
            lambda s: s.edit_toml('column = "torque"', 'column = "torq"'),
            ("'torq'", "did you mean 'torque'", PERTURBED),
        ),
        (
            lambda s: s.edit_toml('joint = "knee"', 'joint = "knee"\nsmaple_rate_hz = 1000'),
            ("smaple_rate_hz", "sample_rate_hz"),
        ),
        (
            lambda s: s.edit_toml('unit = "rad"', 'unit = "furlong_x"'),
            ("channels.angle.unit", "furlong_x"),
        ),
        (lambda s: s.edit_toml('unit = "rad"', 'unit = "kg"'), ("channels.angle.unit",)),
        (
            lambda s: s.edit_toml(f'file = "{PERTURBED}"', f'file = "${{NO_DISK}}/{PERTURBED}"'),
            ("NO_DISK", "not set"),
        ),
        (listed_twice, ("S01", "perturbed", "session")),
    ],
)
def test_a_problem_stops_the_job_and_is_named_with_its_place(
    small_study, analyze, tmp_path, spoil, words
):
    spoil(small_study)

    assert_refused(analyze(small_study), tmp_path, *words)


def test_all_problems_of_a_study_stand_in_one_message(small_study, analyze, tmp_path):
    small_study.edit_toml('unit = "rad"', 'unit = "N*m"')
    small_study.edit_toml('kind = "walking"', 'kind = "wlaking"')
    small_study.edit_toml('joint = "knee"', 'joint = "knee"\nfoo = 1')
    (small_study.root / UNPERTURBED).unlink()

    assert_refused(
        analyze(small_study), tmp_path, "4 problems", "wlaking", "foo", "angle.unit", UNPERTURBED
    )


def first_pulse(tmp_path: Path) -> float:
    pulses = pd.read_csv(tmp_path / "results" / "pulses.csv")
    return float(pulses.query("participant == 'S01'")["onset_s"].iloc[3])


@pytest.fixture(scope="module")
def onset_s(small_study_source, tmp_path_factory):
    """When the fourth pulse of S01 begins."""
    out = tmp_path_factory.mktemp("whole") / "results"
    write_results(analyze_study(small_study_source, resamples=2), out)
    return first_pulse(out.parent)


@pytest.mark.parametrize(
    ("spoil", "from_s", "until_s", "code"),
    [
        (lambda t, hole: t.assign(angle=t["angle"].mask(hole)), 0.02, 0.05, "not_finite"),
        (lambda t, hole: t[~hole], 0.03, 0.06, "gap"),
        (
            lambda t, hole: t.assign(contact=t["contact"].mask(hole, 0.0)),
            -4.5,
            0.5,
            "missing_strike",
        ),
    ],
    ids=["no numbers", "gap", "no heel strikes"],
)
def test_a_hole_excludes_the_pulse_that_it_touches(
    small_study, analyze, tmp_path, onset_s, spoil, from_s, until_s, code
):
    small_study.edit_table(
        PERTURBED, lambda t: spoil(t, t["time"].between(onset_s + from_s, onset_s + until_s))
    )

    assert analyze(small_study).code == 0
    assert codes_at(tmp_path, onset_s) == [code]
    strides = set(excluded(tmp_path).query("kind == 'stride'")["code"])
    assert code != "missing_strike" or code in strides
    assert_counts_add_up(tmp_path)


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


def test_a_missing_mass_fails_only_the_values_per_kg(small_study, analyze, tmp_path):
    mass = next(line for line in small_study.toml.splitlines() if line.startswith("mass_kg"))
    small_study.edit_toml(mass + "\n", "", 1)

    outcome = analyze(small_study)

    assert outcome.code == 0
    mine = estimates(tmp_path).query("participant == 'S01'").set_index("parameter")["status"]
    assert set(mine["stiffness_per_mass"]) == {"failed:mass_missing"}
    assert set(mine["stiffness"]) <= {"ok", "at_bound", "undecided"}


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
