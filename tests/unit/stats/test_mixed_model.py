"""The mixed model of a table: against R, the published table, and what it refuses."""

import json
import os
import shutil
import subprocess
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from scipy.stats import binom

from jointz.core.errors import DataError, EstimationError
from jointz.kernels.statistics.mixed_model_likelihood import (
    fit_random_intercept,
    satterthwaite_test,
)
from jointz.stats import mixed_model

HERE = Path(__file__).parent
ORACLE = json.loads((HERE / "mixed_model_oracle.json").read_text(encoding="utf-8"))
MADE_UP = [name for name in ORACLE if not name.startswith("published")]
PUBLISHED = {
    "K": "stiffness_Nm_per_rad_per_kg",
    "B": "damping_Nms_per_rad_per_kg",
    "J": "inertia_kgm2",
}
METHODS = ("kenward-roger", "satterthwaite")


def oracle_table(name):
    table = pd.read_csv(HERE / "mixed_model_oracle.csv").query("set == @name")
    return table[["participant", "level", "y"]]


def fit_of(table, **options):
    options.setdefault("nested", bool(table.duplicated(["participant", "level"]).any()))
    return mixed_model(table, response="y", within="level", participant="participant", **options)


def made_up(rng, *, people=8, levels=4, rows=1, person_sd=1.0, cell_sd=0.0, shift=0.0):
    """People by levels, normal, the levels spread over ``shift``."""
    person, level, _ = np.indices((people, levels, rows)).reshape(3, -1)
    y = person_sd * rng.standard_normal(people)[person] + shift * level / levels
    y += cell_sd * rng.standard_normal((people, levels))[person, level]
    y += rng.standard_normal(y.size)
    labels = {"participant": [f"S{i:02d}" for i in person], "level": [f"L{j}" for j in level]}
    return pd.DataFrame(labels | {"y": y})


# --- other programs ------------------------------------------------------------------------------


def numbers(values):
    return np.array([np.nan if v is None else v for v in values], dtype=float)


def assert_is_that_of_r(fit, known, df):
    f = fit.f_test
    np.testing.assert_allclose([f.F, f.df_num, f.df_den, f.p], known[df], rtol=1e-6)
    v = fit.variances
    variances = [v.participant, *([v.cell] if fit.nested else []), v.residual]
    # lme4 may stop at 1e-16 of the whole instead of 0.
    np.testing.assert_allclose(variances, known["variances"], rtol=1e-6, atol=1e-15 * v.residual)
    means, pairs, holm = fit.to_frame(), fit.pairs("bonferroni"), fit.pairs("holm")
    names = {"mean": "emmean", "se": "SE", "df": "df", "ci_low": "lower.CL", "ci_high": "upper.CL"}
    for ours, theirs in names.items():
        np.testing.assert_allclose(means[ours], known[f"means_{df}"][theirs], rtol=1e-6)
    names = {"difference": "estimate", "se": "SE", "df": "df", "t": "t.ratio", "p": "p.value"}
    names |= {"p_adjusted": "bonferroni", "ci_low": "low", "ci_high": "high"}
    for ours, theirs in names.items():
        np.testing.assert_allclose(pairs[ours], known[f"pairs_{df}"][theirs], rtol=1e-6)
    np.testing.assert_allclose(holm["p_adjusted"], known[f"pairs_{df}"]["holm"], rtol=1e-6)


def assert_exact_tests_are_those_of_r(fit, known):
    ratios = [test.likelihood_ratio for test in fit.random_effects]
    np.testing.assert_allclose(ratios, known["ranova"], rtol=1e-6, atol=1e-12)
    person = fit.random_effects[0]
    for name in {"exact", "participants"} & set(known):
        found = [person.F, person.df_num, person.df_den, person.p]
        np.testing.assert_allclose(found, known[name], rtol=1e-6)
    rm = fit.repeated_measures
    assert (rm is not None) == ("spherical" in known)
    if rm is not None:
        found = [rm.F, rm.df_num, rm.df_den, rm.p, rm.p_epsilon]
        np.testing.assert_allclose(found, known["spherical"], rtol=1e-6)
    if "paired" in known:
        paired = fit.pairs(error="paired")
        for name in ("t", "df", "p"):
            np.testing.assert_allclose(paired[name], numbers(known["paired"][name]), rtol=1e-6)


@pytest.mark.parametrize("df", METHODS)
@pytest.mark.parametrize("name", MADE_UP)
def test_every_number_is_that_of_r(name, df):
    fit = fit_of(oracle_table(name), df=df)

    assert_is_that_of_r(fit, ORACLE[name], df)
    assert_exact_tests_are_those_of_r(fit, ORACLE[name])


@pytest.mark.slow
def test_r_still_gives_the_stored_numbers(tmp_path):
    rscript = shutil.which("Rscript")
    if rscript is None:
        pytest.skip("Rscript is not installed")
    wanted = "for (p in c('lmerTest', 'pbkrtest', 'emmeans')) stopifnot(requireNamespace(p))"
    if subprocess.run([rscript, "-e", wanted], capture_output=True, check=False).returncode:
        pytest.skip("R has not all of lmerTest, pbkrtest and emmeans")
    out = tmp_path / "again.json"
    environment = {k: v for k, v in os.environ.items() if k != "JOINTZ_DATA"}

    subprocess.run(
        [rscript, "mixed_model_oracle.R", str(out)],
        cwd=HERE,
        env=environment,
        check=True,
        capture_output=True,
    )

    again = json.loads(out.read_text(encoding="utf-8"))
    assert list(again) == MADE_UP
    for name in MADE_UP:
        assert_same_numbers(again[name], ORACLE[name])


def assert_same_numbers(found, known):
    assert found.keys() == known.keys()
    for key, value in known.items():
        if isinstance(value, dict):
            assert_same_numbers(found[key], value)
        else:
            np.testing.assert_allclose(numbers(found[key]), numbers(value), rtol=1e-6, atol=1e-12)


# --- the published table -------------------------------------------------------------------------


@pytest.fixture(scope="module")
def published(real_data):
    file = real_data / "dissertation" / "knee_impedance_60.csv"
    return pd.read_csv(file).rename(columns={"subject": "participant", "timing_point": "level"})


def published_fit(published, name, **options):
    return mixed_model(
        published, response=PUBLISHED[name], within="level", participant="participant", **options
    )


@pytest.mark.real_data
@pytest.mark.parametrize(
    ("name", "f", "p_person"),
    [("K", 6.83472, 0.020), ("B", 1.98101, 0.013), ("J", 1.07921, 0.033)],
)
def test_the_published_table_gives_the_known_tests(published, name, f, p_person):
    fit = published_fit(published, name)

    np.testing.assert_allclose(fit.f_test.F, f, atol=5e-6)
    assert (fit.f_test.df_num, fit.f_test.df_den) == pytest.approx((5, 45))
    assert fit.random_effects[0].p == pytest.approx(p_person, abs=5e-4)
    np.testing.assert_allclose(fit.repeated_measures.F, fit.f_test.F, rtol=1e-6)
    assert fit.levels == ("LRE", "MST", "TST", "PSW", "ISW", "MSW")


@pytest.mark.real_data
@pytest.mark.parametrize("df", METHODS)
@pytest.mark.parametrize("name", PUBLISHED)
def test_the_published_table_is_as_in_r(published, name, df):
    fit = published_fit(published, name, df=df)

    assert_is_that_of_r(fit, ORACLE[f"published {PUBLISHED[name]}"], df)
    assert_exact_tests_are_those_of_r(fit, ORACLE[f"published {PUBLISHED[name]}"])


@pytest.mark.real_data
def test_three_pairs_of_the_published_stiffness_differ(published):
    pairs = published_fit(published, "K").pairs(adjust="bonferroni")

    below = pairs[pairs["p_adjusted"] < 0.05]
    found = {(a, b): p for a, b, p in zip(below["first"], below["second"], below["p_adjusted"],
                                          strict=True)}  # fmt: skip
    assert found == {
        ("LRE", "MST"): pytest.approx(0.0025, abs=5e-5),
        ("LRE", "ISW"): pytest.approx(0.00017, abs=5e-6),
        ("LRE", "MSW"): pytest.approx(0.00031, abs=5e-6),
    }


# --- what must not matter ------------------------------------------------------------------------


@pytest.mark.parametrize("df", METHODS)
@pytest.mark.parametrize("name", ["unbalanced", "nested_unbalanced", "boundary_unbalanced"])
def test_unit_origin_order_of_rows_and_names_of_people_do_not_matter(name, df):
    table = oracle_table(name)
    table["level"] = pd.Categorical(table["level"], categories=table["level"].unique())
    fit = fit_of(table, df=df)
    other = table.sample(frac=1.0, random_state=1).assign(
        y=lambda t: 1e-7 * t["y"] + 1.0, participant=lambda t: t["participant"].str[::-1]
    )

    again = fit_of(other, df=df)

    # The origin costs the values half of their digits.
    np.testing.assert_allclose(again.f_test.F, fit.f_test.F, rtol=1e-6)
    assert again.f_test.df_den == pytest.approx(fit.f_test.df_den, rel=1e-6)
    assert again.variances.residual == pytest.approx(1e-14 * fit.variances.residual, rel=1e-6)
    assert again.icc.ci_high == pytest.approx(fit.icc.ci_high, rel=1e-6)
    np.testing.assert_allclose(again.pairs()["difference"], 1e-7 * fit.pairs()["difference"],
                               rtol=1e-5, atol=1e-14)  # fmt: skip


def test_kenward_roger_does_not_depend_on_the_order_of_levels():
    table = oracle_table("unbalanced")
    other = pd.Categorical(table["level"], categories=table["level"].unique()[::-1])

    one, two = fit_of(table), fit_of(table.assign(level=other))

    assert two.levels == one.levels[::-1]
    np.testing.assert_allclose(two.f_test.F, one.f_test.F, rtol=1e-6)
    assert two.f_test.df_den == pytest.approx(one.f_test.df_den)


def test_equal_replicates_test_levels_as_their_means_do():
    table = oracle_table("nested")
    averaged = table.groupby(["participant", "level"], sort=False, as_index=False).mean()

    whole, means = fit_of(table), fit_of(averaged)

    np.testing.assert_allclose(whole.f_test.F, means.f_test.F, rtol=1e-6)
    assert whole.f_test.df_den == pytest.approx(means.f_test.df_den)
    assert whole.icc.value == pytest.approx(means.icc.value)
    assert whole.icc.ci_low == pytest.approx(means.icc.ci_low)


def test_the_interval_of_the_intraclass_correlation_is_that_of_shrout_and_fleiss():
    # Table 2 of Shrout and Fleiss 1979: ICC(3,1) is .71.
    scores = [[9, 2, 5, 8], [6, 1, 3, 2], [8, 4, 6, 8], [7, 1, 2, 6], [10, 5, 6, 9], [6, 2, 4, 7]]
    rows = [(f"S{i}", f"J{j}", y) for i, row in enumerate(scores) for j, y in enumerate(row)]

    icc = fit_of(pd.DataFrame(rows, columns=["participant", "level", "y"])).icc

    assert icc.exact
    assert icc.value == pytest.approx(0.7148, abs=5e-5)
    assert (icc.ci_low, icc.ci_high) == pytest.approx((0.3425, 0.9459), abs=5e-5)


# --- missing cells and the bound -----------------------------------------------------------------


def test_missing_cells_are_named_and_the_others_of_the_person_used():
    table = made_up(np.random.default_rng(1))
    full = fit_of(table)
    empty = table.copy()
    empty.loc[[5, 14], "y"] = np.nan

    by_nan, by_absence = fit_of(empty), fit_of(table.drop([5, 14]))

    assert by_nan.missing == by_absence.missing == (("S01", "L1"), ("S03", "L2"))
    assert by_nan.n_rows == full.n_rows - 2
    assert by_nan.n_participants == full.n_participants
    assert by_nan.f_test == by_absence.f_test
    assert by_nan.repeated_measures is None
    assert "S01 at L1, S03 at L2" in by_nan.summary()
    dropped = fit_of(table[~table["participant"].isin(["S01", "S03"])])
    assert by_nan.f_test.df_den > dropped.f_test.df_den


def test_a_variance_at_the_bound_is_said():
    fit = fit_of(oracle_table("boundary"))

    assert fit.variances.participant == 0
    assert fit.icc.value == 0
    assert fit.icc.ci_low == 0
    assert fit.random_effects[0].likelihood_ratio == 0
    assert (fit.random_effects[0].p_chi2, fit.random_effects[0].p_mixture) == (1, 1)
    assert any("participant is 0, at its bound" in note for note in fit.notes)


def test_the_mixture_halves_the_p_of_chi_squared():
    test = fit_of(oracle_table("balanced")).random_effects[0]

    assert test.p_mixture == pytest.approx(test.p_chi2 / 2)


# --- pairs ---------------------------------------------------------------------------------------


def test_intervals_agree_with_adjusted_p():
    for error in ("pooled", "paired"):
        for adjust in ("bonferroni", "none"):
            pairs = fit_of(made_up(np.random.default_rng(2), shift=2.5, people=12)).pairs(
                adjust, error=error
            )
            outside = (pairs["ci_low"] > 0) | (pairs["ci_high"] < 0)

            assert 0 < outside.sum() < len(pairs)
            assert (outside == (pairs["p_adjusted"] < 0.05)).all()
            assert set(pairs["adjust"]) == {adjust}
            assert set(pairs["error"]) == {error}


def test_holm_is_never_less_powerful_than_bonferroni():
    fit = fit_of(made_up(np.random.default_rng(3), shift=2.0))

    holm, bonferroni = fit.pairs("holm")["p_adjusted"], fit.pairs("bonferroni")["p_adjusted"]

    assert (holm <= bonferroni + 1e-15).all()
    assert (holm < bonferroni).any()


def test_a_pair_without_a_test_does_not_count_in_the_adjustment():
    table = made_up(np.random.default_rng(4), people=3, levels=3).drop([1, 3])
    fit = fit_of(table)

    paired = fit.pairs(error="paired")

    lone = paired[(paired["first"] == "L0") & (paired["second"] == "L1")].iloc[0]
    assert lone["n_participants"] == 1
    assert lone[["se", "t", "p", "p_adjusted", "ci_low"]].isna().all()
    tested = paired[paired["p"].notna()]
    assert len(tested) == 2
    np.testing.assert_allclose(tested["p_adjusted"], np.minimum(2 * tested["p"], 1.0))


@pytest.mark.parametrize("options", [{"adjust": "tukey"}, {"error": "own"}])
def test_an_unknown_adjustment_or_error_is_refused(options):
    with pytest.raises(DataError, match=r"MixedModelFit\.pairs: expected (adjust|error)"):
        fit_of(oracle_table("balanced")).pairs(**options)


# --- refusals ------------------------------------------------------------------------------------


def test_replicates_are_refused_with_an_explanation():
    table = made_up(np.random.default_rng(5), rows=3)

    with pytest.raises(DataError, match="replicates, not people") as caught:
        fit_of(table, nested=False)

    assert "'S00' at 'L0' has 3 (96 rows in 32 cells)" in str(caught.value)
    assert "Average them" in str(caught.value)
    assert "nested=True" in str(caught.value)


def test_copied_rows_are_refused():
    table = made_up(np.random.default_rng(6))
    copied = pd.concat([table, table.iloc[:2]], ignore_index=True)

    with pytest.raises(DataError, match="2 rows repeat another: drop them if they are copies"):
        fit_of(copied, nested=False)
    pulses = made_up(np.random.default_rng(6), rows=3).reset_index(names="pulse")
    with pytest.raises(DataError, match="1 rows repeat another in all 4 columns"):
        fit_of(pd.concat([pulses, pulses.iloc[:1]]))


def test_nested_without_replicates_is_refused():
    with pytest.raises(DataError, match="nested=True expects replicates"):
        fit_of(made_up(np.random.default_rng(7)), nested=True)


def changed(rows, column, value):
    table = made_up(np.random.default_rng(8))
    table[column] = table[column].astype(object if isinstance(value, str) else table[column].dtype)
    table.loc[rows, column] = value
    return table


@pytest.mark.parametrize(
    ("table", "message"),
    [
        (changed(slice(0, 3), "y", np.nan), "participant S00 of 'participant' has no value"),
        (changed(slice(2, None, 4), "y", np.nan), "unused"),
        (changed(slice(None), "level", "LRE"), "two or more levels in column 'level', found only"),
        (changed(slice(None), "participant", "S1"), "two or more participants"),
        (changed(slice(None), "y", 3.5), "column 'y' is constant, all 32 values are 3.5"),
        (changed(slice(None), "y", np.nan), "has no value of 'y'"),
        (changed(3, "y", np.inf), "1 infinite values"),
        (changed(3, "level", None), "'level' must name every row, 1 have none"),
        (changed(3, "y", "3,5"), "column 'y' must hold numbers, it holds text or a mix of kinds"),
        (made_up(np.random.default_rng(8)).iloc[::5], "cannot be told apart"),
        (made_up(np.random.default_rng(8)).rename(columns={"y": "K"}), "missing \\['y'\\]"),
        (made_up(np.random.default_rng(8)).iloc[:0], "found none"),
    ],
)  # fmt: skip
def test_what_cannot_be_tested_is_refused_by_name(table, message):
    if message == "unused":
        message = "level L2 of 'level' has no value of 'y'"
    with pytest.raises(DataError, match=message):
        fit_of(table, nested=False)


def test_a_person_with_nothing_is_found_whatever_the_labels_are():
    table = made_up(np.random.default_rng(9))
    table["participant"] = table["participant"].astype("category")
    table.loc[table["participant"] == "S03", "y"] = np.nan

    with pytest.raises(DataError, match="participant S03"):
        fit_of(table)


def test_labels_of_a_categorical_without_rows_are_said():
    table = made_up(np.random.default_rng(9))
    table["level"] = pd.Categorical(table["level"], categories=["L9", "L3", "L2", "L1", "L0"])

    fit = fit_of(table)

    assert fit.levels == ("L3", "L2", "L1", "L0")
    assert fit.notes == ("no row has L9 of level",)


@pytest.mark.parametrize("size", [1e300, 1e-200])
def test_values_whose_squares_are_no_numbers_are_refused(size):
    table = made_up(np.random.default_rng(9))

    with pytest.raises(DataError, match="column 'y' has values of the size of"):
        fit_of(table.assign(y=size * table["y"]), nested=False)


@pytest.mark.parametrize("kind", [bool, complex, object])
def test_a_response_is_of_real_numbers(kind):
    table = made_up(np.random.default_rng(9))

    with pytest.raises(DataError, match="column 'y' must hold numbers, it holds"):
        fit_of(table.assign(y=(table["y"] > 0) if kind is bool else table["y"].astype(kind)))


def test_a_column_twice_is_refused():
    table = made_up(np.random.default_rng(9))

    with pytest.raises(DataError, match="several columns 'y'; rename or drop all but one"):
        fit_of(pd.concat([table, table[["y"]]], axis=1))


def test_labels_that_are_nearly_the_same_are_said():
    table = made_up(np.random.default_rng(9))
    table["level"] = table["level"].replace({"L1": "l0"})

    (note,) = fit_of(table, nested=False).notes

    assert note.startswith("'L0' and 'l0' of level are taken as 2 different labels")


def test_a_number_and_its_text_are_not_two_levels():
    table = made_up(np.random.default_rng(9))
    table["level"] = table["level"].astype(object).replace({"L0": 1, "L1": "1"})

    with pytest.raises(DataError, match="two labels written '1'"):
        fit_of(table)


def test_nothing_left_beside_people_and_levels_is_refused():
    table = made_up(np.random.default_rng(10))
    level, person = table["level"].str[1:].astype(float), table["participant"].str[1:].astype(float)

    with pytest.raises(DataError, match="mixed model of 'y': participants and levels explain"):
        fit_of(table.assign(y=level**2 + 3 * person), nested=False)
    repeated = pd.concat([table, table])
    with pytest.raises(DataError, match="participants and levels, or their cells, explain every"):
        fit_of(repeated)


@pytest.mark.parametrize("options", [{"df": "containment"}, {"ci_level": 95}])
def test_unknown_options_are_refused(options):
    with pytest.raises(DataError, match=r"mixed_model: expected (df|0 < ci_level)"):
        fit_of(oracle_table("balanced"), **options)


def test_too_few_people_for_kenward_roger_have_a_code():
    one = {"L0": [-0.2], "L1": [-0.4, -1.3], "L2": [0.9], "L3": [-0.3]}
    other = {"L0": [-1.2, -1.3], "L1": [-0.8], "L3": [-0.6]}
    rows = [
        (person, level, y)
        for person, levels in (("S1", one), ("S2", other))
        for level, values in levels.items()
        for y in values
    ]
    table = pd.DataFrame(rows, columns=["participant", "level", "y"])

    with pytest.raises(EstimationError, match="use Satterthwaite's") as caught:
        fit_of(table)

    assert caught.value.code == "too_few_participants"
    assert 0 < fit_of(table, df="satterthwaite").f_test.p <= 1


# --- the result ----------------------------------------------------------------------------------


# --- calibration ---------------------------------------------------------------------------------


def p_values(fit):
    rm, person = fit.repeated_measures, fit.random_effects[0]
    found = {"levels": fit.f_test.p, "person": person.p, "mixture": person.p_mixture}
    if rm is not None:
        found |= {"anova": rm.p, "greenhouse-geisser": rm.p_epsilon}
    for error in ("pooled", "paired"):
        found[f"{error} one pair"] = fit.pairs("none", error=error)["p_adjusted"].iloc[0]
        for adjust in ("bonferroni", "holm"):
            found[f"{error} {adjust}"] = fit.pairs(adjust, error=error)["p_adjusted"].min()
    return found


def rejections(n_studies, *, missing=0.0, df="kenward-roger", **design):
    rng = np.random.default_rng(11)
    found = []
    for _ in range(n_studies):
        table = made_up(rng, people=10, levels=6, **design)
        found.append(p_values(fit_of(table[rng.random(len(table)) >= missing], df=df)))
    return (pd.DataFrame(found) < 0.05).sum()


def assert_calibrated(rejected, n_studies, *, exact, cautious=()):
    low, high = binom.interval(0.998, n_studies, 0.05)
    for name in exact:
        assert low <= rejected[name] <= high, (name, rejected[name])
    for name in cautious:
        assert rejected[name] <= high, (name, rejected[name])


EXACT = ("levels", "pooled one pair", "paired one pair")
CAUTIOUS = ("pooled bonferroni", "pooled holm", "paired bonferroni", "paired holm")


def test_false_positives_are_five_percent():
    rejected = rejections(200)

    assert_calibrated(
        rejected, 200, exact=(*EXACT, "anova"), cautious=(*CAUTIOUS, "greenhouse-geisser")
    )


@pytest.mark.slow
def test_false_positives_are_five_percent_in_many_studies():
    rejected = rejections(2000)

    assert_calibrated(
        rejected, 2000, exact=(*EXACT, "anova"), cautious=(*CAUTIOUS, "greenhouse-geisser")
    )


@pytest.mark.slow
@pytest.mark.parametrize("df", METHODS)
def test_false_positives_are_five_percent_with_missing_cells(df):
    rejected = rejections(2000, missing=0.2, df=df)

    assert_calibrated(rejected, 2000, exact=EXACT, cautious=CAUTIOUS)


@pytest.mark.slow
@pytest.mark.parametrize("missing", [0.0, 0.3])
def test_false_positives_are_five_percent_with_replicates(missing):
    rejected = rejections(1000, missing=missing, rows=5, cell_sd=1.0)

    assert_calibrated(rejected, 1000, exact=EXACT, cautious=CAUTIOUS)


@pytest.mark.slow
def test_no_variance_of_people_is_found_in_five_percent_of_studies():
    rejected = rejections(2000, person_sd=0.0)

    assert_calibrated(rejected, 2000, exact=("person",), cautious=("mixture",))


@pytest.mark.slow
def test_intervals_of_the_intraclass_correlation_hold_in_95_percent():
    rng = np.random.default_rng(12)
    inside = 0
    for _ in range(1000):
        table = made_up(rng, people=10, levels=6)
        icc = fit_of(table[rng.random(len(table)) > 0.2]).icc
        inside += icc.ci_low <= 0.5 <= icc.ci_high

    low, high = binom.interval(0.998, 1000, 0.95)
    assert low <= inside <= high


@pytest.mark.slow
def test_replicates_taken_as_people_find_what_is_not_there_in_over_90_percent():
    rng = np.random.default_rng(13)
    n_studies = 40
    pseudo = honest = 0
    for _ in range(n_studies):
        table = made_up(rng, people=10, levels=6, rows=50, cell_sd=1.0)
        levels = pd.factorize(table["level"])[0]
        design = (levels[:, None] == np.arange(6)).astype(float)
        design[:, 0] = 1.0
        fit = fit_random_intercept(design, table["y"].to_numpy(), table["participant"].to_numpy())
        pseudo += satterthwaite_test(fit, np.eye(6)[1:]).p < 0.001
        honest += fit_of(table).f_test.p < 0.05

    assert pseudo / n_studies > 0.9
    assert honest <= binom.ppf(0.999, n_studies, 0.05)
