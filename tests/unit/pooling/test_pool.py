"""Pooled studies: means as metafor has them, conditions, refusals, files and page."""

import json
import re
import sys

import numpy as np
import pandas as pd
import pytest

import jointz
from jointz.cli.command_line import command_line
from jointz.core.errors import DataError, OutputError
from jointz.pooling.pooled_result import PooledStudies
from jointz.results.estimates import ESTIMATE_COLUMNS

pytest.importorskip("pyarrow")

PEOPLE = {"a": (60, 66, 72, 58), "b": (50, 55, 61), "c": (74, 80, 69, 77, 71)}
UNITS = {"stiffness": "N*m/rad", "damping": "N*m*s/rad"}
STUDY = {"joint": "knee", "kind": "walking", "positive": "flexion"}
SETTINGS = {
    "method": "bayesian", "coupling": "rigid", "baseline": "predicted", "window_s": 0.1
}  # fmt: skip
UNDECIDED = {"value": np.nan, "status": "undecided"}


def estimates(values, *, scale=1.0, sides=("",), **columns):
    """Return estimates of people whose stiffness is given; the damping is a twentieth of it."""
    rows = []
    for k, stiffness in enumerate(values):
        for side in sides:
            for name, unit in UNITS.items():
                value = scale * stiffness / (1.0 if name == "stiffness" else 20.0)
                row = (f"S{k}", "MST", 21.5, name, value, unit, 0.99 * value, 1.01 * value, 0.95)
                rows.append((*row, 99.0, 50, 0, "bayesian", "ok", "", side))
    return pd.DataFrame(rows, columns=list(ESTIMATE_COLUMNS)).assign(**columns)


@pytest.fixture
def folder(tmp_path):
    """Write a results folder as jointz analyze leaves it, as far as pooling reads it."""

    def write(name, table, *, settings=None, inputs=None, sha256=None, calibration=None, **study):
        path = tmp_path / name
        path.mkdir(parents=True)
        table.to_csv(path / "estimates.csv", index=False)
        people = [{"id": person} for person in table["participant"].unique()]
        recordings = [
            {"participant": person["id"], "condition": "perturbed", "file": f"{k}.csv"}
            for k, person in enumerate(people)
        ]
        sums = inputs or [f"of {name}, {k}" for k in range(len(people))]
        content = {
            "jointz": "1.0",
            "study": STUDY | {"participants": people, "recordings": recordings,
                              "calibration": calibration or {}} | study,
            "study_sha256": sha256 or name,
            "settings": SETTINGS | (settings or {}),
            "inputs": [{"file": "exclusions.csv", "sha256": "always the same"}]
            + [{"file": f"{k}.csv", "sha256": sha256} for k, sha256 in enumerate(sums)],
        }  # fmt: skip
        (path / "provenance.json").write_text(json.dumps(content))
        return path

    return write


@pytest.fixture
def labs(folder):
    return [folder(name, estimates(values)) for name, values in PEOPLE.items()]


@pytest.fixture
def table_of(tmp_path):
    def write(text):
        file = tmp_path / "conditions.csv"
        file.write_text(text)
        return file

    return write


def of(pooled, parameter="stiffness", **columns):
    table = pooled.table[pooled.table["parameter"] == parameter]
    for name, value in columns.items():
        table = table[table[name] == value]
    (row,) = table.to_dict("records")
    return row


def refused(results, **options):
    with pytest.raises(DataError) as caught:
        jointz.pool(results, **options)
    return str(caught.value)


# --- means ---------------------------------------------------------------------------------------

# By metafor 3.8.1:
#   people <- list(a = c(60, 66, 72, 58), b = c(50, 55, 61), c = c(74, 80, 69, 77, 71))
#   y <- sapply(people, mean); se <- sapply(people, function(x) sd(x) / sqrt(length(x)))
#   fit <- rma(y, sei = se, method = "REML", test = "adhoc",
#              control = list(threshold = 1e-14, maxiter = 10000))
#   c(fit$beta, fit$ci.lb, fit$ci.ub, sqrt(fit$tau2), fit$I2, fit$QE, unlist(predict(fit)[5:6]))
METAFOR = {
    "value": 64.7335076473, "ci_low": 40.9805028729, "ci_high": 88.4865124218,
    "tau": 9.1381203079, "i2_pct": 91.7601605766, "q": 27.2106411030,
    "prediction_low": 18.7974346008, "prediction_high": 110.6695806938,
}  # fmt: skip
WEIGHTS = (32.5933169162, 32.5546326531, 34.8520504307)  # weights(fit), %


def test_means_are_those_of_metafor(labs):
    pooled = jointz.pool(labs)
    row = of(pooled)
    assert {name: row[name] for name in METAFOR} == pytest.approx(METAFOR, rel=1e-6)
    weights = pooled.studies.query("parameter == 'stiffness'")["weight_pct"]
    assert weights.tolist() == pytest.approx(WEIGHTS, rel=1e-6)
    damping = of(pooled, "damping")
    assert [20.0 * damping[name] for name in ("value", "ci_low", "prediction_high")] == (
        pytest.approx([row[name] for name in ("value", "ci_low", "prediction_high")])
    )
    assert (row["n_studies"], row["n_people"], row["status"]) == (3, 12, "ok")


def test_one_study_has_the_t_interval_over_its_people(labs):
    row = of(jointz.pool(labs[:1]))
    sd = np.std(PEOPLE["a"], ddof=1)
    assert row["status"] == "one_study"
    assert row["ci_high"] - row["value"] == pytest.approx(3.182446305 * sd / 2.0)


def test_one_study_of_two_people_is_undecided(folder):
    row = of(jointz.pool([folder("two", estimates((20.0, 20.2)))]))
    assert row["ci_low"] > 0.0
    assert (row["n_people"], row["status"]) == (2, "undecided")


def test_a_mean_whose_interval_reaches_zero_is_undecided_and_keeps_its_numbers(folder):
    soft, stiff = folder("soft", estimates((20, 21, 22))), folder("stiff", estimates((60, 61, 62)))
    pooled = jointz.pool([soft, stiff])
    row = of(pooled)
    assert row["status"] == "undecided"
    assert row["ci_low"] < 0.0 < row["value"] == pytest.approx(41.0, abs=0.1)
    assert not pooled.available
    assert "0 of 2 means are available" in pooled.summary()


def test_sides_of_a_person_are_averaged_first(folder):
    both = folder("both", estimates(PEOPLE["a"], sides=("left", "right")))
    one = folder("one", estimates(PEOPLE["a"]))
    means = [jointz.pool([path]).table for path in (both, one)]
    pd.testing.assert_frame_equal(*means)


def test_undecided_failed_and_bounded_people_are_counted(folder, labs):
    table = estimates(PEOPLE["a"], sides=("left", "right"))
    is_s0 = (table["participant"] == "S0") & (table["side"] == "left")
    table.loc[is_s0, list(UNDECIDED)] = list(UNDECIDED.values())
    failed = table["participant"] == "S1"
    table.loc[failed, ["value", "status"]] = [np.nan, "failed:too_few_pulses"]
    bound = table["participant"] == "S2"
    table.loc[bound, ["ci_low", "status"]] = [0.0, "at_bound"]
    row = of(pooled := jointz.pool([folder("mixed", table), *labs[1:]]))
    counts = ("n_people", "n_undecided", "n_failed", "n_at_bound")
    assert [row[name] for name in counts] == [2 + 3 + 5, 1, 1, 1]
    mixed = pooled.studies.query("study == 'mixed' and parameter == 'stiffness'")
    assert mixed["value"].item() == pytest.approx((72 + 58) / 2)
    assert "2 undecided, 2 failed, 2 at their bound" in pooled.notes[0]  # of K and of B


def test_studies_without_error_are_left_out_with_the_reason(folder, labs):
    lone = folder("lone", estimates((64,)))
    silent = folder("silent", estimates((64, 65)).assign(**UNDECIDED))
    pooled = jointz.pool([*labs, lone, silent])
    by_study = pooled.studies.query("parameter == 'stiffness'").set_index("study")["status"]
    assert (by_study["lone"], by_study["silent"]) == ("one_person", "no_value")
    row = of(pooled)
    assert (row["n_studies"], row["n_left_out"]) == (3, 2)
    assert row["value"] == pytest.approx(METAFOR["value"], rel=1e-6)
    assert any("lone" in note for note in pooled.notes)
    nothing = jointz.pool([silent])
    assert not nothing.available
    assert nothing.table["status"].unique().tolist() == ["failed:too_few_studies"]


def test_the_error_of_a_shared_gain_does_not_average_out(folder):
    gain = {"torque_gain": {"value": 1.0, "sd": 0.1}}
    plain, shared = (
        jointz.pool([folder(name, estimates(PEOPLE["a"]), calibration=calibration)]).studies
        for name, calibration in (("plain", {}), ("shared", gain))
    )
    added = shared["se"] ** 2 - plain["se"] ** 2
    assert added.tolist() == pytest.approx((0.01 * plain["value"] ** 2).tolist())


def test_people_alike_by_chance_gain_no_more_weight_than_their_own_errors_allow(folder):
    table = estimates((60.0, 60.1, 59.9)).query("parameter == 'stiffness'")
    (study,) = jointz.pool([folder("alike", table.assign(ci_low=50.0, ci_high=70.0))]).studies["se"]
    assert study == pytest.approx(10.0 / 1.959964 / np.sqrt(3.0), rel=1e-6)


# --- conditions ----------------------------------------------------------------------------------


def test_a_study_over_two_conditions_has_a_row_of_each(folder, table_of):
    paths = [
        folder(f"{lab}/{slope}", estimates(PEOPLE[lab], scale=scale))
        for lab in "ab" for slope, scale in (("level", 1.0), ("up", 1.5))
    ]  # fmt: skip
    file = table_of(
        "results,study,condition,walking_speed_m_s,slope_deg,surface,group\n"
        "a/level,lab-a,level,1.2,-0,treadmill,\n"
        "a/up,lab-a,up,1.2,5,treadmill,\n"
        "b/level,lab-b,level,1.2,0,treadmill,\n"
        "b/up,lab-b,up,1.2,5,treadmill,\n"
    )
    pooled = jointz.pool(paths, conditions=file)
    level, up = (of(pooled, condition=name) for name in ("level", "up"))
    assert up["value"] == pytest.approx(1.5 * level["value"])
    assert (level["slope_deg"], up["slope_deg"], level["n_studies"]) == (0.0, 5.0, 2)
    assert any("lab-a; lab-b: in several conditions" in note for note in pooled.notes)
    assert set(pooled.estimates["walking_speed_m_s"]) == {1.2}


def test_a_folder_is_named_by_its_last_part_and_only_that_is_required(labs, table_of):
    pooled = jointz.pool(labs, conditions=table_of("results\na\nb\nc\n"))
    assert pooled.studies["study"].unique().tolist() == ["a", "b", "c"]
    semicolons = table_of("results;walking_speed_m_s\na;1,2\nb;1,2\nc;1,2\n")
    assert set(jointz.pool(labs, conditions=semicolons).table["walking_speed_m_s"]) == {1.2}


def test_groups_of_the_study_file_are_kept_apart(folder):
    table = estimates((60, 62, 70, 72))
    people = [{"id": f"S{k}", "group": "old" if k > 1 else "young"} for k in range(4)]
    pooled = jointz.pool([folder("a", table, participants=people)])
    assert [of(pooled, group=g)["value"] for g in ("young", "old")] == pytest.approx([61, 71])


def test_conditions_that_are_only_written_differently_are_named(labs, table_of):
    file = table_of("results,surface\na,treadmill\nb,Treadmill\nc,belt\n")
    pooled = jointz.pool(labs, conditions=file)
    assert set(pooled.table["status"]) == {"one_study"}
    assert any("surface: Treadmill, belt, treadmill" in note for note in pooled.notes)


def test_tables_as_spreadsheets_write_them_are_read(labs, table_of):
    for text in (
        "results\tsurface\t\na\tx\t\nb\tx\t\nc\tx\t\n",
        "results;surface;\na;x;\nb;x;\nc;x;\n",
    ):
        assert set(jointz.pool(labs, conditions=table_of(text)).table["surface"]) == {"x"}
    message = refused(labs, conditions=table_of('results,study\na,"x\ny"\nb,1\nc,2\n'))
    assert "row 2: a cell holds a line break" in message
    message = refused(labs, conditions=table_of("results,walking_speed_m_s\na,1_0\nb,\nc,\n"))
    assert "expected a number such as 1.2; found '1_0'" in message


def test_all_problems_of_conditions_are_in_one_message(labs, table_of):
    file = table_of("results,slope_deg,walking_speed_m_s\na,steep,-1\na,0,1\nelsewhere,0,1\n\n")
    message = refused(labs, conditions=file)
    assert message.startswith("pool: 6 problems\n")
    for words in (
        "row 2, column slope_deg: expected a number such as 1.2; found 'steep'",
        "row 2, column walking_speed_m_s: expected a number such as 1.2; found '-1'",
        "row 3: a second row of a, after row 2",
        "row 4: expected a results folder by its path or name; found 'elsewhere'",
        "no row of b",
        "no row of c",
    ):
        assert words in message
    assert "Correct 'speed'" in refused(labs, conditions=table_of("results,speed\na,1\n"))
    assert "expected 1 cells, found 2" in refused(labs, conditions=table_of("results\na,1\n"))
    assert "cannot be read" in refused(labs, conditions=labs[0])


# --- refusals ------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("words", "made"),
    [
        ("joint: expected one, found knee in a, b, c; ankle in z", {"joint": "ankle"}),
        ("kind of study: expected one, found walking in a, b, c; bench in z", {"kind": "bench"}),
        ("positive direction: expected one, found flexion in a, b, c; extension in z",
         {"positive": "extension"}),
        ("estimand: expected one, found mean over the first 100 ms, device included in a, b, c; "
         "mean over the first 120 ms, device included in z", {"settings": {"window_s": 0.12}}),
        ("stiffness of the device subtracted in z",
         {"calibration": {"intrinsic_stiffness": {"value": 3.0, "sd": 0.1}}}),
        ("coupling rigid, baseline pre_pulse) in z", {"settings": {"baseline": "pre_pulse"}}),
        ("method: expected one, found bayesian (coupling rigid, baseline predicted) in a, b, c; "
         "bayesian (coupling strap, baseline predicted) in z", {"settings": {"coupling": "strap"}}),
    ],
)  # fmt: skip
def test_another_kind_of_study_is_refused(folder, labs, words, made):
    message = refused([*labs, folder("z", estimates((61, 65)), **made)])
    assert message.startswith("pool: 1 problem\n")
    assert words in message


@pytest.mark.parametrize(
    ("words", "columns"),
    [
        ("; least_squares (coupling rigid, baseline predicted) in z", {"method": "least_squares"}),
        ("unit of damping: expected one, found N*m*s/rad in a, b, c; N*m/rad in z",
         {"unit": "N*m/rad"}),
        ("level of intervals (ci_level): expected one, found 0.95 in a, b, c; 0.9 in z",
         {"ci_level": 0.9}),
        ("timing point MST: expected onsets within 2 % of the gait cycle, found 21.5 % in a",
         {"onset_gait_pct": 30.0}),
    ],
)  # fmt: skip
def test_other_estimates_are_refused(folder, labs, words, columns):
    message = refused([*labs, folder("z", estimates((61, 65), **columns))])
    assert message.startswith("pool: 1 problem\n")
    assert words in message


def test_the_same_results_twice_are_refused_with_all_reasons(folder, labs):
    again = folder("copy", estimates(PEOPLE["a"]))
    same = folder("same", estimates((1, 2)), inputs=("of b, 1", "another"))
    other = folder("other", estimates((61, 62)), sha256="c", joint="hip")
    message = refused([*labs, labs[0], again, same, other])
    assert message.startswith("pool: 5 problems\n")
    assert f"{labs[0]}: named twice" in message
    assert "a and copy: estimates.csv is the same byte for byte. Name one of them." in message
    assert "b and same: 1 recording is in both, whose people would count twice." in message
    assert "c and other: analyses of the same study.toml, as the studies c and other" in message
    assert "joint: expected one" in message


@pytest.mark.parametrize(
    ("file", "text", "words"),
    [
        ("provenance.json", "{", "cannot be read as jointz analyze writes it"),
        ("provenance.json", '{"study": {}}', "cannot be read as jointz analyze writes it"),
        ("provenance.json", None, "contains no provenance.json"),
        ("provenance.json", '{"made_by": "pool", "settings": {}}', "Name its results folders"),
        ("estimates.csv", "participant\nS1\n", "no column"),
        ("estimates.csv", lambda t: t.assign(value=1e6), "a value without an interval around it"),
        ("estimates.csv", lambda t: t.assign(ci_low=np.nan), "a value without an interval around"),
        ("estimates.csv", lambda t: t.assign(status="banana"), "an unknown status"),
    ],
)
def test_a_folder_that_cannot_be_read_is_named(labs, file, text, words):
    if text is None:
        (labs[0] / file).unlink()
    elif callable(text):
        text(pd.read_csv(labs[0] / file)).to_csv(labs[0] / file, index=False)
    else:
        (labs[0] / file).write_text(text)
    message = refused([*labs, labs[0].parent / "nowhere"])
    assert words in message
    assert "nowhere: does not exist" in message


def test_results_that_were_changed_after_the_analysis_are_refused(labs):
    provenance = json.loads((labs[0] / "provenance.json").read_text())
    provenance["sha256"] = {"estimates.csv": "0" * 64}
    (labs[0] / "provenance.json").write_text(json.dumps(provenance))
    assert "was changed after the analysis" in refused(labs)


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"value": np.nan}, "status and value disagree"),
        ({"value": np.inf}, "an infinite number"),
        ({"parameter": "compliance", "session": list("abcd")}, "a parameter that jointz does not"),
        ({"parameter": "stiffness"}, "a second row of the same estimate"),
    ],
)
def test_impossible_estimates_are_refused(folder, labs, change, words):
    broken = folder("z", estimates((61, 62)).assign(**change))
    assert words in refused([*labs, broken])


# --- files ---------------------------------------------------------------------------------------


def test_the_command_writes_tables_that_the_page_shows(labs, tmp_path, capsys):
    out = tmp_path / "pooled"
    arguments = ["pool", *map(str, labs), "--out", str(out)]
    assert command_line(arguments)([*arguments, "--json"], standalone_mode=False) == 0
    told = json.loads(capsys.readouterr().out)
    pooled, studies, table = (
        pd.read_csv(out / f"{name}.csv") for name in ("pooled", "studies", "estimates")
    )
    assert told["status"] == "ok"
    assert told["table"][0]["value"] == pooled["value"][0] == pytest.approx(METAFOR["value"])
    parquet = pd.read_parquet(out / "estimates.parquet")
    text = parquet.select_dtypes(exclude="number").columns
    table[text] = table[text].astype(object).fillna("")
    pd.testing.assert_frame_equal(parquet, table, check_dtype=False)
    assert len(table) == sum(2 * len(people) for people in PEOPLE.values())
    page = re.sub(r"<[^>]+>", "|", (out / "report.html").read_text())
    for row in (*pooled.to_dict("records"), *studies.to_dict("records")):
        shown = re.search(rf"\|{row['value']:#.3g}\d* \[?", page) or f"{row['value']:.3g}" in page
        assert shown, row["value"]
    assert "http" not in re.sub(r"http://www.w3.org\S+", "", page)
    provenance = json.loads((out / "provenance.json").read_text())
    assert provenance["settings"]["a"]["study"] == "a"
    assert provenance["inputs"][0]["file"] == "a/estimates.csv"
    svgs = {path.name for path in (out / "figures").iterdir()}
    assert svgs == {"forest_stiffness.svg", "forest_damping.svg"}


def test_a_folder_is_whole_or_not_there_and_kept(labs, tmp_path, monkeypatch):
    out = tmp_path / "pooled"
    with monkeypatch.context() as broken:
        broken.setattr("jointz.pooling.pool.render_pool", lambda *_: 1 / 0)
        with pytest.raises(ZeroDivisionError):
            jointz.pool(labs, out=out)
    assert not list(tmp_path.glob("*pooled*"))
    jointz.pool(labs, out=out)
    with pytest.raises(OutputError, match="exists and is kept"):
        jointz.pool(labs, out=out)
    jointz.pool(labs, out=out, overwrite=True)
    with pytest.raises(OutputError, match="one of the pooled folders"):
        jointz.pool(labs, out=labs[0], overwrite=True)


def test_missing_pyarrow_is_told_up_front(labs, tmp_path, monkeypatch):
    monkeypatch.setitem(sys.modules, "pyarrow", None)
    assert 'pip install "jointz[parquet]"' in refused(labs, out=tmp_path / "pooled")


def test_the_command_ends_1_without_a_mean(folder, tmp_path, capsys):
    silent = folder("silent", estimates((64, 65)).assign(**UNDECIDED))
    arguments = ["pool", str(silent), "--out", str(tmp_path / "pooled")]
    assert command_line(arguments)(arguments, standalone_mode=False) == 1
    assert "0 of 2 means are available" in capsys.readouterr().out
    assert "No mean is available" in (tmp_path / "pooled" / "report.html").read_text()


def test_a_result_comes_back_whole(labs):
    pooled = jointz.pool(labs)
    again = PooledStudies.from_dict(json.loads(json.dumps(pooled.to_dict(), allow_nan=False)))
    assert again == pooled
    assert "stiffness MST: 64." in pooled.summary()
    assert len(pooled.plot().get_yticklabels()) == 4
