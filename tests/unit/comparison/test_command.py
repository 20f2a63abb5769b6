"""``jointz compare``: a table of one's own, results folders, and what is neither."""

import json

import numpy as np
import pandas as pd
import pytest

from jointz.stats import mixed_model

COLUMNS = ("--response", "stiffness", "--within", "point", "--participant", "who")


def long_table():
    rng = np.random.default_rng(2)
    rows = [(f"S{k}", point) for k in range(6) for point in ("TST", "LRE", "MST")]
    table = pd.DataFrame(rows, columns=["who", "point"])
    table["stiffness"] = rng.normal(0.0, 1.0, 18).round(4) + np.tile([3.0, 1.0, 0.0], 6)
    table["damping"] = rng.normal(5.0, 1.0, 18).round(4)
    return table


@pytest.fixture
def table(tmp_path):
    file = tmp_path / "table.csv"
    long_table().to_csv(file, index=False)
    return file


# --- a table -------------------------------------------------------------------------------------


def test_a_table_gives_the_figures_of_the_mixed_model(jointz, table):
    outcome = jointz("compare", table, *COLUMNS, "--json")

    fit = mixed_model(long_table(), response="stiffness", within="point", participant="who")
    made = outcome.json
    assert (outcome.code, outcome.err, made["status"]) == (0, "", "ok")
    for name in ("F", "df_num", "df_den", "p"):
        assert made["f_test"][name] == pytest.approx(getattr(fit.f_test, name))
    assert made["variances"]["residual"] == pytest.approx(fit.variances.residual)
    assert made["levels"] == ["TST", "LRE", "MST"]
    assert [p["p_adjusted"] for p in made["pairs"]] == pytest.approx(
        list(fit.pairs()["p_adjusted"])
    )


@pytest.mark.real_data
def test_the_published_table_gives_its_known_numbers(jointz, real_data):
    file = real_data / "dissertation" / "knee_impedance_60.csv"
    names = ("stiffness_Nm_per_rad_per_kg", "damping_Nms_per_rad_per_kg", "inertia_kgm2")
    responses = [word for name in names for word in ("--response", name)]
    columns = ("--within", "timing_point", "--participant", "subject")

    made = jointz("compare", file, *responses, *columns, "--json").json["responses"]

    found = [made[name]["f_test"]["F"] for name in names]
    assert found == pytest.approx([6.83472, 1.98101, 1.07921], abs=5e-6)
    below = {(p["first"], p["second"]): p["p_adjusted"] for p in made[names[0]]["pairs"]
             if p["p_adjusted"] < 0.05}  # fmt: skip
    assert below == {
        ("LRE", "MST"): pytest.approx(0.0025, abs=5e-5),
        ("LRE", "ISW"): pytest.approx(0.00017, abs=5e-6),
        ("LRE", "MSW"): pytest.approx(0.00031, abs=2e-5),
    }


def test_the_choices_reach_the_model(jointz, table):
    options = ("--df", "satterthwaite", "--adjust", "holm", "--error", "paired")
    made = jointz("compare", table, *COLUMNS, *options, "--json").json

    fit = mixed_model(
        long_table(), response="stiffness", within="point", participant="who", df="satterthwaite"
    )
    known = fit.pairs("holm", error="paired")
    assert made["df_method"] == "satterthwaite"
    assert [p["p_adjusted"] for p in made["pairs"]] == pytest.approx(list(known["p_adjusted"]))


def test_a_table_is_told_in_words(jointz, table):
    outcome = jointz("compare", table, *COLUMNS, "--response", "damping")

    assert outcome.code == 0
    for words in ("stiffness ~ point + (1 | who): 18 rows of 6 participants", "Kenward-Roger",
                  "Greenhouse-Geisser", "intraclass correlation", "damping ~ point",
                  "Means of stiffness", "TST - LRE", "p (bonferroni)"):  # fmt: skip
        assert words in outcome.out
    assert jointz("compare", table, *COLUMNS, "--quiet").out == ""


def test_an_empty_cell_is_missing_and_named(jointz, table):
    lines = table.read_text().splitlines()
    lines[2] = ",".join([*lines[2].split(",")[:2], "", "5.0"])
    table.write_text("\n".join(lines) + "\n")

    made = jointz("compare", table, *COLUMNS, "--json").json

    assert made["missing"] == [["S0", "LRE"]]
    assert made["n_rows"] == 17


@pytest.mark.parametrize(
    ("name", "options"),
    [("t.csv", {"sep": ";"}), ("t.csv", {"sep": ";", "decimal": ","}), ("t.txt", {"sep": "\t"})],
)
def test_a_table_may_have_other_delimiters(jointz, table, tmp_path, name, options):
    other = tmp_path / name
    long_table().to_csv(other, index=False, **options)

    made, known = (jointz("compare", f, *COLUMNS, "--json").json for f in (other, table))

    assert made["f_test"] == known["f_test"]


def test_labels_that_are_numbers_stay_labels(jointz, tmp_path):
    table = long_table()
    table["who"] = table["who"].str.lstrip("S").astype(int)
    table.to_csv(tmp_path / "t.csv", index=False)

    assert jointz("compare", tmp_path / "t.csv", *COLUMNS, "--json").json["n_participants"] == 6


def test_labels_are_kept_as_they_are_written(jointz, tmp_path):
    table = long_table()
    names = {"S0": "NA", "S1": "nan", "S2": "1", "S3": "1.0", "S4": "1e3", "S5": "None"}
    table["who"] = table["who"].map(names)
    table.to_csv(tmp_path / "t.csv", index=False)

    made = jointz("compare", tmp_path / "t.csv", *COLUMNS, "--json").json

    assert (made["n_participants"], made["missing"]) == (6, [])
    assert made["notes"][0].startswith("'1' and '1.0' of who are taken as 2 different labels")


def test_an_empty_last_cell_without_a_line_end_is_missing(jointz, table):
    text = table.read_text()[: table.read_text().rstrip().rindex(",")]
    table.write_text(text.rsplit(",", 1)[0] + ",,5.0\n")
    known = jointz("compare", table, *COLUMNS, "--json").json
    lines = [",".join([who, point, damping, stiffness]) for who, point, stiffness, damping in
             (line.split(",") for line in table.read_text().split())]  # fmt: skip
    table.write_text("\n".join(lines))

    made = jointz("compare", table, *COLUMNS, "--json").json

    assert made["missing"] == known["missing"] == [["S5", "MST"]]
    table.write_text("\n".join(lines).rsplit(",", 1)[0])
    cut = jointz("compare", table, *COLUMNS)
    assert (cut.code, "cut off" in cut.err) == (2, True)


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (("stiffness,damping", "stiffness,stiffness"), "columns 3 and 4. Rename or remove one."),
        (("S1,TST,", 'S1,TST,"3,5"#'), "Correct the cell"),
    ],
)
def test_advice_is_what_can_be_done(jointz, table, change, words):
    table.write_text(table.read_text().replace(*change))

    outcome = jointz("compare", table, *COLUMNS)

    assert outcome.code == 2
    assert words in outcome.err
    assert not any(word in outcome.err for word in ("[files]", "jointz identify", "--decimal"))


def test_a_table_without_names_of_columns_is_told(jointz, tmp_path):
    (tmp_path / "t.csv").write_text("1,1,0.5,2\n1,2,0.6,3\n2,1,0.7,4\n2,2,0.8,5\n")

    outcome = jointz("compare", tmp_path / "t.csv", *COLUMNS)

    assert (outcome.code, "[files]" in outcome.err) == (2, False)
    assert "Write the names of the columns above them." in outcome.err


def test_decimal_commas_among_points_are_told(jointz, tmp_path):
    text = long_table().to_csv(index=False, sep=";")
    (tmp_path / "t.csv").write_text(text.replace("S0;TST;", "S0;TST;1,2;1\nX;TST;", 1))

    outcome = jointz("compare", tmp_path / "t.csv", *COLUMNS)

    assert outcome.code == 2
    assert "Write all decimals alike" in outcome.err
    assert "[files]" not in outcome.err


@pytest.mark.parametrize("word", ["True", "FALSE"])
def test_true_and_false_are_no_numbers(jointz, table, word):
    whole = long_table().assign(stiffness=word)
    whole.to_csv(table, index=False)

    outcome = jointz("compare", table, *COLUMNS)

    assert outcome.code == 2
    assert f"expected a number, found '{word}'" in outcome.err


def test_pulses_are_no_people(jointz, table, tmp_path):
    pulses = tmp_path / "pulses.csv"
    rng = np.random.default_rng(0)
    repeated = pd.concat([long_table() for _ in range(4)])
    repeated["stiffness"] += rng.normal(0.0, 0.1, len(repeated))
    repeated.to_csv(pulses, index=False)

    refused = jointz("compare", pulses, *COLUMNS)
    nested = jointz("compare", pulses, *COLUMNS, "--nested", "--json")

    assert refused.code == 2
    assert "replicates, not people" in refused.err
    assert nested.json["variances"]["cell"] > 0.0


def test_a_column_that_is_not_there_is_told_with_those_that_are(jointz, table):
    outcome = jointz("compare", table, *COLUMNS[:-1], "person")

    assert outcome.code == 2
    assert "no column 'person'. The file has: who, point, stiffness, damping" in outcome.err


def test_text_among_numbers_is_told_with_its_row(jointz, table):
    table.write_text(table.read_text().replace("S1,TST,", "S1,TST,stiff"))

    outcome = jointz("compare", table, *COLUMNS)

    assert outcome.code == 2
    assert "row 5, column 'stiffness': expected a number, found 'stiff" in outcome.err


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (COLUMNS[:4], "needs --participant too"),
        ((), "needs --response, --within, --participant too"),
        ((*COLUMNS, "--margin", "10"), "are of results folders"),
        ((*COLUMNS, "--out", "somewhere"), "are of results folders"),
        ((*COLUMNS[:-1], "point"), "expected unlike columns"),
        ((*COLUMNS[:-1], "stiffness"), "expected unlike columns"),
    ],
)
def test_options_that_do_not_fit_are_refused(jointz, table, arguments, words):
    outcome = jointz("compare", table, *arguments)

    assert outcome.code == 2
    assert words in " ".join(outcome.err.split())


def test_a_blank_label_is_refused(jointz, table):
    table.write_text(table.read_text().replace("S1,TST", ",TST"))

    outcome = jointz("compare", table, *COLUMNS)

    assert outcome.code == 2
    assert "column 'who' must name every row, 1 have none" in outcome.err


# --- results folders -----------------------------------------------------------------------------


def test_the_published_tables_need_no_folder(jointz, tmp_path):
    out = tmp_path / "comparison"

    told = jointz("compare", "published", "--out", out)
    made = jointz("compare", "published", "--json").json

    assert told.code == 0
    assert "F\tdf\tp" in told.out
    assert f"Page: {out / 'comparison.html'}" in told.out
    assert (made["status"], made["schema"]) == ("ok", "jointz.Comparison/1")
    assert json.loads((out / "comparison.json").read_text())["differences"] == made["differences"]
    assert jointz("compare", "published", "--out", out).code == 2
    assert jointz("compare", "published", "--out", out, "--overwrite", "--quiet").out == ""


def test_where_nothing_stands_the_exit_status_is_1(jointz, tmp_path):
    header = (
        "participant,timing_point,onset_gait_pct,parameter,value,unit,ci_low,ci_high,method,status"
    )
    rows = [f"S{k},LRE,7,stiffness,,N*m/rad,,,recommended,undecided" for k in (1, 2)]
    (tmp_path / "estimates.csv").write_text("\n".join([header, *rows]) + "\n")
    study = {"study": {"kind": "walking", "joint": "knee"}}
    (tmp_path / "provenance.json").write_text(json.dumps(study))

    outcome = jointz("compare", tmp_path, "--json")

    assert (outcome.code, outcome.json["status"]) == (1, "nothing_stands")
    assert jointz("compare", tmp_path, "--out", tmp_path / "out").code == 1
    assert "Timing points of" in (tmp_path / "out" / "comparison.html").read_text()


def test_where_no_difference_stands_the_exit_status_is_1(jointz, tmp_path):
    header = (
        "participant,timing_point,onset_gait_pct,parameter,value,unit,ci_low,ci_high,method,status"
    )
    study = {"study": {"kind": "walking", "joint": "knee"}}
    for name, people in (("a", "ABC"), ("b", "A")):
        rows = [
            f"{name}{k},LRE,7,inertia,0.0{k},kg*m^2,,,recommended,ok" for k in range(len(people))
        ]
        (tmp_path / name).mkdir()
        (tmp_path / name / "estimates.csv").write_text("\n".join([header, *rows]) + "\n")
        (tmp_path / name / "provenance.json").write_text(json.dumps(study))

    alone = jointz("compare", tmp_path / "a", "--json")
    both = jointz("compare", tmp_path / "a", tmp_path / "b", "--json")

    assert (alone.code, alone.json["status"]) == (0, "ok")
    assert (both.code, both.json["status"]) == (1, "nothing_stands")


def test_a_comparison_does_not_replace_what_it_compares(jointz, tmp_path):
    folder = tmp_path / "a"
    folder.mkdir()
    files = {"files": ["estimates.csv"], "study": {"kind": "walking", "joint": "knee"}}
    (folder / "estimates.csv").write_text("x")
    (folder / "provenance.json").write_text(json.dumps(files))

    own = jointz("compare", folder, "--out", f"{folder}/../a", "--overwrite")
    other = jointz("compare", "published", "--out", folder, "--overwrite")

    assert (own.code, other.code) == (2, 2)
    assert "is what is compared" in own.err
    assert "made it as analysis, not as comparison" in other.err
    assert (folder / "estimates.csv").read_text() == "x"


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (("nowhere",), "nowhere: is not there"),
        (("published", "published"), "given twice"),
        (("published", *COLUMNS), "no format for this kind of file"),
        (("published", "more", *COLUMNS), "--response is of one table"),
        (("published", "--nested"), "--nested is of a table"),
        (("published", "--days"), "days are two or more results"),
        (("published", "--margin", "10"), "of two or more results only: --margin"),
        (("published", "--groups"), "of two or more results only: --paired and --groups"),
        (("published", "nowhere", "--df", "satterthwaite"), "one results folder only: --df"),
    ],
)
def test_what_cannot_be_compared_is_refused(jointz, arguments, words):
    outcome = jointz("compare", *arguments)

    assert outcome.code == 2
    assert words in " ".join(outcome.err.split())
