"""The mixed model of a table: against R, the published table, and what it refuses."""

import json
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from scipy.stats import binom

from jointz.core.errors import DataError, EstimationError
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


# --- what must not matter ------------------------------------------------------------------------


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
    dropped = fit_of(table[~table["participant"].isin(["S01", "S03"])])
    assert by_nan.f_test.df_den > dropped.f_test.df_den


def test_a_variance_at_the_bound_is_zero():
    fit = fit_of(oracle_table("boundary"))

    assert fit.variances.participant == 0
    assert fit.icc.value == 0
    assert fit.icc.ci_low == 0
    assert fit.random_effects[0].likelihood_ratio == 0
    assert (fit.random_effects[0].p_chi2, fit.random_effects[0].p_mixture) == (1, 1)


# --- pairs ---------------------------------------------------------------------------------------


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
    with pytest.raises(DataError, match=r"adjust|error"):
        fit_of(oracle_table("balanced")).pairs(**options)


# --- refusals ------------------------------------------------------------------------------------


def test_replicates_and_copied_rows_are_refused():
    table = made_up(np.random.default_rng(5), rows=3)
    with pytest.raises(DataError, match="'S00' at 'L0'"):
        fit_of(table, nested=False)
    cells = made_up(np.random.default_rng(6))
    with pytest.raises(DataError, match="2 rows"):
        fit_of(pd.concat([cells, cells.iloc[:2]], ignore_index=True), nested=False)
    pulses = table.reset_index(names="pulse")
    with pytest.raises(DataError, match="1 rows"):
        fit_of(pd.concat([pulses, pulses.iloc[:1]]))


def scaled(size):
    return made_up(np.random.default_rng(9)).assign(y=lambda t: size * t["y"])


def changed(rows, column, value):
    table = made_up(np.random.default_rng(8))
    table[column] = table[column].astype(object if isinstance(value, str) else table[column].dtype)
    table.loc[rows, column] = value
    return table


@pytest.mark.parametrize(
    ("table", "message"),
    [
        (changed(slice(0, 3), "y", np.nan), "participant S00"),
        (changed(slice(2, None, 4), "y", np.nan), "level L2"),
        (changed(slice(None), "level", "LRE"), "'level'"),
        (changed(slice(None), "participant", "S1"), "participants"),
        (changed(slice(None), "y", 3.5), "'y' is constant"),
        (changed(slice(None), "y", np.nan), "'y'"),
        (changed(3, "y", np.inf), "infinite"),
        (changed(3, "level", None), "'level'"),
        (changed(3, "y", "3,5"), "'y'"),
        (made_up(np.random.default_rng(8)).iloc[::5], "told apart"),
        (made_up(np.random.default_rng(8)).rename(columns={"y": "K"}), "'y'"),
        (made_up(np.random.default_rng(8)).iloc[:0], "found none"),
        (scaled(1e300), "'y'"),
        (scaled(1e-200), "'y'"),
        (scaled(1j), "'y'"),
        (scaled(1.0).assign(y=True), "'y'"),
        (pd.concat([scaled(1.0), scaled(1.0)[["y"]]], axis=1), "'y'"),
        (scaled(1.0).replace({"level": {"L0": 1, "L1": "1"}}), "'1'"),
    ],
)  # fmt: skip
def test_what_cannot_be_tested_is_refused_by_name(table, message):
    with pytest.raises(DataError, match=message):
        fit_of(table, nested=False)


def test_nothing_left_beside_people_and_levels_is_refused():
    table = made_up(np.random.default_rng(10))
    level, person = table["level"].str[1:].astype(float), table["participant"].str[1:].astype(float)

    with pytest.raises(DataError, match="'y'"):
        fit_of(table.assign(y=level**2 + 3 * person), nested=False)
    repeated = pd.concat([table, table])
    with pytest.raises(DataError, match="cells"):
        fit_of(repeated)


@pytest.mark.parametrize(
    ("option", "value"), [("df", "containment"), ("ci_level", 95), ("nested", True)]
)
def test_options_that_do_not_fit_are_refused(option, value):
    with pytest.raises(DataError, match=option):
        fit_of(oracle_table("balanced"), **{option: value})


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

    with pytest.raises(EstimationError) as caught:
        fit_of(table)

    assert caught.value.code == "too_few_participants"
    assert 0 < fit_of(table, df="satterthwaite").f_test.p <= 1


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


@pytest.mark.parametrize("n_studies", [60, pytest.param(2000, marks=pytest.mark.slow)])
def test_false_positives_are_five_percent(n_studies):
    exact, cautious = (*EXACT, "anova"), (*CAUTIOUS, "greenhouse-geisser")
    assert_calibrated(rejections(n_studies), n_studies, exact=exact, cautious=cautious)


def test_several_factors_within_people_are_sent_to_r():
    table = pd.DataFrame({"who": list("aabb"), "point": [1, 2, 1, 2], "load": [1, 1, 2, 2], "y": 1})
    with pytest.raises(
        DataError, match=r"got point, load\. .*lmer\(y ~ point \* load \+ \(1 \| who\)"
    ):
        mixed_model(table, response="y", within=["point", "load"], participant="who")


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
def test_intervals_of_the_intraclass_correlation_hold_in_95_percent():
    rng = np.random.default_rng(12)
    inside = 0
    for _ in range(1000):
        table = made_up(rng, people=10, levels=6)
        icc = fit_of(table[rng.random(len(table)) > 0.2]).icc
        inside += icc.ci_low <= 0.5 <= icc.ci_high

    low, high = binom.interval(0.998, 1000, 0.95)
    assert low <= inside <= high
