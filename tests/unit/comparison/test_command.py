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


@pytest.mark.parametrize("chosen", [False, True])
def test_a_table_gives_the_figures_of_the_mixed_model(jointz, table, chosen):
    df, adjust = ("satterthwaite", "holm") if chosen else ("kenward-roger", "bonferroni")
    options = ("--df", df, "--adjust", adjust, "--error", "paired") if chosen else ()
    outcome = jointz("compare", table, *COLUMNS, *options, "--json")

    fit = mixed_model(long_table(), response="stiffness", within="point", participant="who", df=df)
    pairs = fit.pairs(adjust, error="paired") if chosen else fit.pairs()
    made = outcome.json
    assert (outcome.code, outcome.err, made["status"]) == (0, "", "ok")
    assert made["df_method"] == df
    for name in ("F", "df_num", "df_den", "p"):
        assert made["f_test"][name] == pytest.approx(getattr(fit.f_test, name))
    assert made["variances"]["residual"] == pytest.approx(fit.variances.residual)
    assert made["levels"] == ["TST", "LRE", "MST"]
    assert [p["p_adjusted"] for p in made["pairs"]] == pytest.approx(list(pairs["p_adjusted"]))


def test_an_empty_cell_is_missing_and_named(jointz, table):
    lines = table.read_text().splitlines()
    lines[2] = ",".join([*lines[2].split(",")[:2], "", "5.0"])
    table.write_text("\n".join(lines) + "\n")

    made = jointz("compare", table, *COLUMNS, "--json").json

    assert made["missing"] == [["S0", "LRE"]]
    assert made["n_rows"] == 17


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
    ("change", "place"),
    [
        (lambda t: t.replace("stiffness,damping", "stiffness,stiffness"), "columns 3 and 4"),
        (lambda t: t.replace("S1,TST,", 'S1,TST,"3,5"#'), "3,5"),
        (lambda _: "1,1,0.5,2\n1,2,0.6,3\n2,1,0.7,4\n2,2,0.8,5\n", "names of the columns"),
        (lambda t: t.replace(",", ";").replace("S0;TST;", "S0;TST;1,2;1\nX;TST;", 1), "decimal"),
        (lambda _: long_table().assign(stiffness="True").to_csv(index=False), "found 'True'"),
        (lambda t: t.replace("who,", "person,"), "no column 'who'"),
        (lambda t: t.replace("S1,TST,", "S1,TST,stiff"), "row 5, column 'stiffness'"),
        (lambda t: t.replace("S1,TST", ",TST"), "column 'who'"),
    ],
)
def test_a_table_that_cannot_be_trusted_is_refused_with_the_place(jointz, table, change, place):
    table.write_text(change(table.read_text()))

    outcome = jointz("compare", table, *COLUMNS)

    assert outcome.code == 2
    assert place in " ".join(outcome.err.split())


def test_pulses_are_no_people(jointz, table, tmp_path):
    pulses = tmp_path / "pulses.csv"
    rng = np.random.default_rng(0)
    repeated = pd.concat([long_table() for _ in range(4)])
    repeated["stiffness"] += rng.normal(0.0, 0.1, len(repeated))
    repeated.to_csv(pulses, index=False)

    refused = jointz("compare", pulses, *COLUMNS)
    nested = jointz("compare", pulses, *COLUMNS, "--nested", "--json")

    assert refused.code == 2
    assert "replicates" in refused.err
    assert nested.json["variances"]["cell"] > 0.0


# --- results folders -----------------------------------------------------------------------------


def test_the_published_tables_need_no_folder(jointz, tmp_path):
    out = tmp_path / "comparison"

    told = jointz("compare", "published", "--out", out)
    made = jointz("compare", "published", "--json").json

    assert told.code == 0
    assert str(out / "comparison.html") in told.out
    assert (made["status"], made["schema"]) == ("ok", "jointz.Comparison/1")
    assert json.loads((out / "comparison.json").read_text())["differences"] == made["differences"]
    assert jointz("compare", "published", "--out", out).code == 2
    assert jointz("compare", "published", "--out", out, "--overwrite", "--quiet").out == ""


def test_where_nothing_stands_the_exit_status_is_1(jointz, tmp_path):
    header = (
        "participant,timing_point,onset_gait_pct,parameter,value,unit,ci_low,ci_high,method,status"
    )
    rows = [f"S{k},LRE,7,stiffness,,N*m/rad,,,rigid,undecided" for k in (1, 2)]
    (tmp_path / "estimates.csv").write_text("\n".join([header, *rows]) + "\n")
    study = {"study": {"kind": "walking", "joint": "knee"}}
    (tmp_path / "provenance.json").write_text(json.dumps(study))

    outcome = jointz("compare", tmp_path, "--json")

    assert (outcome.code, outcome.json["status"]) == (1, "nothing_stands")
    assert jointz("compare", tmp_path, "--out", tmp_path / "out").code == 1


def test_a_comparison_does_not_replace_what_it_compares(jointz, tmp_path):
    folder = tmp_path / "a"
    folder.mkdir()
    files = {"files": ["estimates.csv"], "study": {"kind": "walking", "joint": "knee"}}
    (folder / "estimates.csv").write_text("x")
    (folder / "provenance.json").write_text(json.dumps(files))

    own = jointz("compare", folder, "--out", f"{folder}/../a", "--overwrite")
    other = jointz("compare", "published", "--out", folder, "--overwrite")

    assert (own.code, other.code) == (2, 2)
    assert (folder / "estimates.csv").read_text() == "x"


@pytest.mark.parametrize(
    ("arguments", "named"),
    [
        (("nowhere",), "nowhere"),
        (("published", *COLUMNS), "published"),
        (("published", "more", *COLUMNS), "--response"),
        (("published", "--nested"), "--nested"),
        (("published", "--days"), "--days"),
        (("published", "--groups"), "--groups"),
        (("table.csv", *COLUMNS[:4]), "--participant"),
        (("table.csv", *COLUMNS, "--margin", "10"), "--margin"),
        (("table.csv", *COLUMNS[:-1], "stiffness"), "different columns"),
    ],
)
@pytest.mark.usefixtures("table")
def test_what_cannot_be_compared_is_refused(jointz, tmp_path, monkeypatch, arguments, named):
    monkeypatch.chdir(tmp_path)

    outcome = jointz("compare", *arguments)

    assert outcome.code == 2
    assert named in " ".join(outcome.err.split())


def test_a_second_factor_within_people_is_refused_with_the_call_of_r(jointz, table):
    outcome = jointz("compare", table, *COLUMNS, "--within", "load")

    assert outcome.code == 2
    assert "got point, load" in outcome.err
    assert "lmer(stiffness ~ point * load + (1 | who)" in outcome.err
