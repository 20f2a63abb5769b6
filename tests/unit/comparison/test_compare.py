"""Results folders compared: who with whom, in what, with which warnings."""

import json

import numpy as np
import pandas as pd
import pytest
from scipy import stats

from jointz.comparison.compare import compare_results, write_comparison
from jointz.comparison.comparison_result import Comparison
from jointz.core.errors import DataError, OutputError
from jointz.reference.chapter4 import participant_table

from .results_folders import POINTS, STUDY, UNDECIDED, changed, estimates, said


def of(table, parameter, point):
    rows = table.query("parameter == @parameter and timing_point == @point")
    return rows.set_index("participant")["value"]


def row(made, parameter, point):
    (found,) = (d for d in made.differences if (d.parameter, d.timing_point) == (parameter, point))
    return found


# --- designs -------------------------------------------------------------------------------------


def test_the_same_people_are_compared_with_themselves(results):
    before, after = estimates(), estimates(seed=1, scale=1.1)
    made = compare_results([results("after", table=after), results("before", table=before)])

    found = row(made, "stiffness_per_mass", "MST")
    known = stats.ttest_rel(
        of(after, "stiffness_per_mass", "MST"), of(before, "stiffness_per_mass", "MST")
    )
    assert (found.first, found.second, found.design) == ("after", "before", "paired")
    assert (found.t, found.p) == pytest.approx((known.statistic, known.pvalue))
    assert (found.n_first, found.effect) == (5, "g_z")


def test_other_people_are_compared_as_groups(results):
    mine, others = estimates(), estimates("VWXYZ", seed=1, scale=1.3)
    made = compare_results([results("a", table=mine), results("b", table=others)])

    found = row(made, "damping_per_mass", "LRE")
    known = stats.ttest_ind(
        of(mine, "damping_per_mass", "LRE"), of(others, "damping_per_mass", "LRE"), equal_var=False
    )
    assert (found.design, found.effect) == ("groups", "g")
    assert (found.t, found.df, found.p) == pytest.approx((known.statistic, known.df, known.pvalue))


def test_people_in_one_folder_only_ask_for_a_decision(results):
    sources = [results("a", "ABCD"), results("b", "BCDE", seed=1)]

    with pytest.raises(DataError, match=r"share 3 of 5 participants .A, E "):
        compare_results(sources)

    paired, apart = (compare_results(sources, paired=choice) for choice in (True, False))
    assert {d.n_first for d in paired.differences} == {3}
    assert said(paired, "A, E")
    assert {(d.design, d.n_first) for d in apart.differences} == {("groups", 4)}


def test_holm_counts_the_timing_points_of_a_parameter(results):
    made = compare_results([results("a", scale=1.02), results("b", seed=1)])

    own = sorted(d.p for d in made.differences if d.parameter == "inertia")
    adjusted = sorted(d.p_adjusted for d in made.differences if d.parameter == "inertia")
    steps = np.maximum.accumulate(np.multiply(own, [3, 2, 1])).clip(max=1.0)
    np.testing.assert_allclose(adjusted, steps)


# --- one folder ----------------------------------------------------------------------------------


def test_the_published_tables_give_their_known_tests():
    made = compare_results(["published"], error="pooled")

    assert [test.fit.f_test.F for test in made.tests] == pytest.approx(
        [6.83472, 1.98101, 1.07921], abs=5e-6
    )
    below = {(d.first, d.second) for d in made.differences if d.p_adjusted < 0.05}
    assert below == {("LRE", "MST"), ("LRE", "ISW"), ("LRE", "MSW")}
    assert len(made.at_bound) == 7
    assert {d.n_at_bound for d in made.differences if "LRE" in (d.first, d.second)} >= {1, 2, 3}
    assert said(made, "S5 LRE")


def test_every_pair_of_timing_points_has_an_error_of_its_own():
    made = compare_results(["published"])

    table = participant_table().pivot_table(
        "stiffness_per_mass", "participant", "timing_point", observed=True
    )
    own = [d for d in made.differences if d.parameter == "stiffness_per_mass"]
    known = [stats.ttest_rel(table[d.first], table[d.second]) for d in own]
    assert {(d.design, d.effect, d.n_first) for d in own} == {("paired", "g_z", 10)}
    assert [d.p for d in own] == pytest.approx([k.pvalue for k in known])
    ranked = sorted(k.pvalue for k in known)
    steps = np.maximum.accumulate(np.multiply(ranked, range(15, 0, -1))).clip(max=1.0)
    assert sorted(d.p_adjusted for d in own) == pytest.approx(steps)
    assert (made.settings["error"], made.settings["adjust"]) == ("paired", "holm")


def test_timing_points_that_do_not_vary_alike_are_told():
    made = compare_results(["published"])

    (test, *_) = made.tests
    rm = test.fit.repeated_measures
    assert rm.epsilon < 0.75
    frame = made.to_frame().query("parameter == 'stiffness_per_mass'")
    assert frame["epsilon"].to_list() == pytest.approx([rm.epsilon] * 15)
    assert frame["p_epsilon"].to_list() == pytest.approx([rm.p_epsilon] * 15)
    (note,) = (n for n in said(made, "unequal variances") if "stiffness" in n)
    assert f"epsilon {rm.epsilon:.2f}" in note


def test_one_folder_may_be_given_the_choices_of_a_table(results):
    made = compare_results(
        [results("own")], df="satterthwaite", adjust="bonferroni", error="pooled"
    )

    fit = made.tests[0].fit
    own = [d for d in made.differences if d.parameter == fit.response]
    assert fit.df_method == "satterthwaite"
    assert {d.design for d in own} == {"pooled"}
    assert [d.p_adjusted for d in own] == pytest.approx(list(fit.pairs()["p_adjusted"]))
    alone = compare_results(["published"], adjust="none")
    assert [d.p_adjusted for d in alone.differences] == [d.p for d in alone.differences]


def test_several_folders_have_no_choices_of_a_model(results):
    for option, choice in (("df", "satterthwaite"), ("adjust", "holm"), ("error", "paired")):
        with pytest.raises(DataError, match=f"--{option}"):
            compare_results([results(f"{option}/a"), results(f"{option}/b")], **{option: choice})
        with pytest.raises(DataError, match=f"--{option} .*'most'"):
            compare_results(["published"], **{option: "most"})


def test_one_folder_has_no_other_to_be_paired_with_or_alike():
    for option in ({"margin_pct": 10.0}, {"paired": False}):
        with pytest.raises(DataError, match="for two or more results only"):
            compare_results(["published"], **option)


def test_one_folder_is_beside_the_published_values(results):
    made = compare_results([results("own")])

    means = participant_table().groupby("timing_point", observed=True)["stiffness_per_mass"].mean()
    beside = {r.timing_point: r.value for r in made.references
              if (r.name, r.parameter) == ("published", "stiffness_per_mass")}  # fmt: skip
    assert beside == pytest.approx(means[list(POINTS)].to_dict())


def test_one_person_has_no_statistics_but_is_no_error(results):
    made = compare_results([results("one", "A")])

    assert not made.available
    assert all(test.fit is None and test.reason for test in made.tests)


# --- more folders --------------------------------------------------------------------------------


def test_three_conditions_are_first_tested_together(results):
    made = compare_results([results(n, seed=k) for k, n in enumerate("abc")])

    assert {(t.factor, t.fit.levels) for t in made.tests} == {("condition", ("a", "b", "c"))}
    assert len(made.differences) == 3 * 3 * 3


def test_two_conditions_and_the_published_people_are_compared_each_as_it_is(results):
    made = compare_results([results("a"), results("b", seed=1), "published"])

    designs = {(d.first, d.second): d.design for d in made.differences}
    assert designs == {
        ("a", "b"): "paired", ("a", "published"): "groups", ("b", "published"): "groups",
    }  # fmt: skip
    assert said(made, "published has PSW, ISW, MSW, which another result lacks")


def test_days_tell_how_well_people_repeat(results):
    days = [estimates(seed=k) for k in (0, 1)]
    made = compare_results([results(f"d{k}", table=t) for k, t in enumerate(days)], days=True)

    (found,) = (r for r in made.repeatability
                if (r.parameter, r.timing_point) == ("inertia", "TST"))  # fmt: skip
    apart = of(days[0], "inertia", "TST") - of(days[1], "inertia", "TST")
    assert found.sem == pytest.approx(apart.std() / np.sqrt(2))
    assert found.icc_consistency > 0.8
    assert (found.n, found.k) == (5, 2)
    assert found.mdc == pytest.approx(2.776445 * np.sqrt(2) * found.sem)  # Student's t, 4 df
    assert found.mdc_high / found.mdc == pytest.approx(found.sem_high / found.sem)


def test_conditions_that_are_nearly_equal_are_shown_to_be(results):
    made = compare_results([results("a"), results("b", seed=1)], margin_pct=20.0)

    found = row(made, "stiffness_per_mass", "LRE")
    assert found.margin == pytest.approx(0.2 * found.mean_second)
    assert found.p_equivalence < 0.05 < found.p


@pytest.mark.parametrize("paired", [True, False])
def test_two_people_have_no_mean_and_are_not_shown_to_be_equal(results, paired):
    folders = [results("a", "AB"), results("b", "AB", seed=1)]
    made = compare_results(folders, paired=paired, margin_pct=1000.0)

    assert not made.available
    assert {(d.status, d.difference, d.p_equivalence) for d in made.differences} == {
        ("failed:too_few_participants", None, None)
    }
    assert {(m.n, m.mean, m.status) for m in made.means} == {
        (2, None, "failed:too_few_participants")
    }


@pytest.mark.parametrize("margin", [0.0, -5.0, float("nan")])
def test_a_margin_is_above_zero(results, margin):
    with pytest.raises(DataError, match="margin above 0"):
        compare_results([results("a"), results("b")], margin_pct=margin)


# --- what is missing or unlike -------------------------------------------------------------------


def test_a_missing_value_is_counted_and_named_and_costs_nobody_else(results):
    where = "participant == 'B' and timing_point == 'MST' and parameter == 'stiffness_per_mass'"
    table = changed(estimates(), where, **UNDECIDED)
    made = compare_results([results("a", table=table), results("b", seed=1)])

    assert row(made, "stiffness_per_mass", "MST").n_first == 4
    assert row(made, "stiffness_per_mass", "LRE").n_first == 5
    assert row(made, "damping_per_mass", "MST").n_first == 5
    (mean,) = (m for m in made.means if (m.source, m.parameter, m.timing_point)
               == ("a", "stiffness_per_mass", "MST"))  # fmt: skip
    assert (mean.n, mean.n_missing) == (4, 1)
    (note,) = said(made, "missing")
    assert "a stiffness_per_mass (undecided): B MST" in note


def test_a_value_at_its_bound_is_used_and_named(results):
    table = estimates()
    at = table.index[table["parameter"] == "damping_per_mass"][0]
    table.loc[at, ["value", "ci_low"]] = 0.0
    table.loc[at, "status"] = "at_bound"
    made = compare_results([results("a", table=table), results("b", seed=1)])

    found = row(made, "damping_per_mass", "LRE")
    assert (found.n_first, found.n_at_bound) == (5, 1)
    assert found.mean_first == pytest.approx(of(table, "damping_per_mass", "LRE").mean())
    (note,) = said(made, "1 value is at its bound")
    assert "a damping_per_mass (at_bound): A LRE" in note


def test_without_masses_stiffness_itself_is_compared(results):
    where = "parameter in ['stiffness_per_mass', 'damping_per_mass']"
    missing = UNDECIDED | {"status": "failed:mass_missing"}
    folder = results("light", table=changed(estimates(), where, **missing))

    made = compare_results([folder, results("b", seed=1)])
    beside = compare_results([folder, "published"])

    assert made.parameters == ("stiffness", "damping", "inertia")
    assert beside.parameters == ("inertia",)
    assert said(beside, "WARNING: light:")


def test_an_inertia_of_all_points_is_beside_the_mean_over_points(results):
    table = estimates()
    shared = table.query("parameter == 'inertia' and timing_point == 'LRE'")
    shared = shared.assign(timing_point="all", onset_gait_pct=np.nan, value=0.05 + shared["value"])
    rest = table[table["parameter"] != "inertia"]
    other = estimates(seed=1)
    made = compare_results(
        [results("one", table=pd.concat([rest, shared])), results("each", table=other)]
    )

    found = row(made, "inertia", "all")
    over_points = other.query("parameter == 'inertia'").groupby("participant")["value"].mean()
    assert found.mean_second == pytest.approx(over_points.mean())
    assert found.mean_first == pytest.approx(shared["value"].mean())
    assert {d.timing_point for d in made.differences if d.parameter == "inertia"} == {"all"}


def test_unlike_methods_and_equal_recordings_are_a_warning(results):
    other = estimates(seed=1).assign(method="dissertation")
    folders = [results("a"), results("b", table=other)]
    file = folders[1] / "provenance.json"
    settings = {"study": STUDY, "study_sha256": "a", "settings": {"window_s": 0.2}}
    file.write_text(json.dumps(settings))

    made = compare_results(folders)

    for named in ("(a by rigid; b by dissertation)", "same recordings", "window_s"):
        assert said(made, named)[0].startswith("WARNING: ")


def test_badly_measured_people_are_told(results):
    table = estimates()
    table["ci_low"], table["ci_high"] = 0.7 * table["value"], 1.3 * table["value"]

    told = "between-subject variance"
    assert said(compare_results([results("a", table=table)]), told)
    assert not said(compare_results([results("b")]), told)


# --- input that cannot be trusted ----------------------------------------------------------------


@pytest.mark.parametrize(
    ("change", "options", "place"),
    [
        (lambda t: t, {"kind": "bench"}, "loads"),
        (lambda t: t, {"joint": "ankle"}, "knee in a, ankle in b"),
        (lambda t: t.replace({"unit": {"N*m/rad": "N*m/deg"}}), {}, r"row 2: .*N.m/deg"),
        (lambda t: pd.concat([t, t[:1]]), {}, "row 77: "),
        (lambda t: t.assign(status="undecided"), {}, "row 2: status 'undecided'"),
        (
            lambda t: changed(t, "participant == 'B' and timing_point == 'MST'", value=1e300),
            {},
            r"row 22: stiffness 1e\+300",
        ),
        (
            lambda t: t.replace({"timing_point": dict(zip(POINTS, "xyz", strict=True))}),
            {},
            "a has LRE, MST, TST; b has x",
        ),
    ],
)
def test_results_that_cannot_be_compared_are_refused(results, change, options, place):
    with pytest.raises(DataError, match=place):
        compare_results([results("a"), results("b", table=change(estimates()), **options)])


def test_what_is_no_results_folder_is_refused(results, tmp_path):
    folder = results("a")
    (tmp_path / "empty").mkdir()
    with pytest.raises(DataError, match=r"contains no estimates\.csv"):
        compare_results([tmp_path / "empty"])
    with pytest.raises(DataError, match="does not exist"):
        compare_results([tmp_path / "nowhere"])
    with pytest.raises(DataError, match="given twice"):
        compare_results([folder, f"{folder}/."])
    (folder / "provenance.json").write_text("{")
    with pytest.raises(DataError, match="cannot be read"):
        compare_results([folder])


# --- what is written -----------------------------------------------------------------------------


def test_the_folder_holds_tables_figures_and_the_page(results, tmp_path):
    made = compare_results([results("a"), results("b", seed=1)], days=True, margin_pct=10.0)
    out = tmp_path / "comparison"

    page = write_comparison(made, out)

    names = {p.relative_to(out).as_posix() for p in out.rglob("*") if p.is_file()}
    assert names == {
        "comparison.csv", "means.csv", "repeatability.csv", "comparison.json", "comparison.html",
        "figures/means.svg", "figures/differences.svg", "provenance.json",
    }  # fmt: skip
    assert page == out / "comparison.html"
    again = Comparison.from_dict(json.loads((out / "comparison.json").read_text()))
    assert again == made
    written = json.loads((out / "provenance.json").read_text())
    assert [one["file"] for one in written["inputs"]] == [
        "a/estimates.csv", "a/provenance.json", "b/estimates.csv", "b/provenance.json",
    ]  # fmt: skip
    with pytest.raises(OutputError, match="exists and is kept"):
        write_comparison(made, out)
    write_comparison(made, out, overwrite=True)
