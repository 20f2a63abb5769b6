"""Type and direction of pulses: tests, confounding, counts, and false positives."""

import json

import numpy as np
import pandas as pd
import pytest
from scipy import stats

from jointz.core.errors import DataError
from jointz.results.statistics.pulse_effect_tests import Undecided
from jointz.stats.pulse_effects import pulse_effects

# --- tables --------------------------------------------------------------------------------------

ONSETS = np.array([0.1, 0.4, 0.6, 0.9])


def cell(rng, *, case="1", trajectory="A", slope=(1, -1, -1, 1), n_trials=7, **effects):
    """Seven trials of eight pulses: both signs at four onsets, the slope there given."""
    rows = [
        {
            "case": case,
            "trajectory": trajectory,
            "trial": trial,
            "sign": sign,
            "direction": "with" if sign * slope[k] > 0 else "against",
        }
        for trial in range(n_trials)
        for sign in (1, -1)
        for k in range(len(ONSETS))
    ]
    table = pd.DataFrame(rows)
    along = np.where(table["direction"] == "with", 1.0, -1.0)
    of_trial = effects.get("trial_sd", 0.5) * rng.standard_normal(n_trials)
    table["stiffness"] = (
        168.0
        + effects.get("type", 0.0) / 2 * table["sign"]
        + effects.get("direction", 0.0) / 2 * along
        + of_trial[table["trial"]]
        + rng.standard_normal(len(table))
    )
    table["inertia"] = 0.03 + 1e-3 * rng.standard_normal(len(table))
    return table


def found(effects, effect, *, analysis="mixed", response="stiffness"):
    (test,) = [
        t
        for t in effects.tests
        if (t.effect, t.analysis, t.response) == (effect, analysis, response)
    ]
    return test


@pytest.fixture
def rng():
    return np.random.default_rng(11)


# --- the tests -----------------------------------------------------------------------------------


def test_one_way_tests_are_those_of_scipy_on_pulses(rng):
    table = cell(rng, type=1.0, direction=0.5)
    effects = pulse_effects(table)

    for effect, column, level in (("type", "sign", 1), ("direction", "direction", "with")):
        up = table[column] == level
        for response in ("stiffness", "inertia"):
            expected = stats.f_oneway(table[response][up], table[response][~up])
            test = found(effects, effect, analysis="one_way", response=response)
            assert test.statistic == pytest.approx(expected.statistic, rel=1e-9)
            assert test.p == pytest.approx(expected.pvalue, rel=1e-9)
            assert (test.df_num, test.df_den, test.n_pulses, test.n_trials) == (1, 54, 56, 7)
            difference = table[response][up].mean() - table[response][~up].mean()
            assert test.difference == pytest.approx(difference)
            assert test.ci_low is None


def test_balanced_pulses_are_tested_against_the_error_inside_trials(rng):
    table = cell(rng, type=1.0, trial_sd=2.0)
    test = found(pulse_effects(table), "type")

    # Classical two-way layout: trial as a block, type x direction inside.
    blocks = pd.get_dummies(table["trial"], dtype=float).to_numpy()
    along = np.where(table["direction"] == "with", 1.0, -1.0)
    sign = table["sign"].to_numpy(float)
    design = np.column_stack([blocks, sign, along, sign * along])
    beta, residual, *_ = np.linalg.lstsq(design, table["stiffness"].to_numpy(), rcond=None)
    df = 56 - 7 - 3
    error = residual[0] / df
    assert test.df_den == pytest.approx(df, rel=1e-6)
    assert test.statistic == pytest.approx(beta[7] ** 2 * 56 / error, rel=1e-6)
    assert test.difference == pytest.approx(2 * beta[7], rel=1e-9)
    half = stats.t.ppf(0.975, df) * 2 * np.sqrt(error / 56)
    assert (test.ci_low, test.ci_high) == pytest.approx(
        (test.difference - half, test.difference + half), rel=1e-6
    )


def test_missing_estimates_are_left_out_and_counted(rng):
    table = cell(rng, type=2.0)
    table.loc[[3, 17, 40], "stiffness"] = [np.nan, np.inf, np.nan]
    table["direction"] = table["direction"].astype(object)
    table.loc[5, "direction"] = None
    effects = pulse_effects(table)

    stiffness, inertia = effects.means
    assert (stiffness.n_used, stiffness.n_excluded) == (52, 4)
    assert (inertia.n_used, inertia.n_excluded) == (55, 1)
    assert found(effects, "type").n_pulses == 52
    assert len(effects.notes) == 2


def test_holm_runs_over_each_analysis_of_the_whole_study(rng):
    table = pd.concat([cell(rng, case=c, trajectory=t, type=1.0) for c in "12" for t in "AB"])
    effects = pulse_effects(table)

    assert effects.means[0].confounding == pytest.approx(0.0)
    assert not [t for t in effects.tests if t.status != "ok" or t.effect == "joint"]
    for analysis, n in (("one_way", 16), ("mixed", 24)):
        family = [t for t in effects.tests if t.analysis == analysis]
        assert len(family) == n
        smallest = min(family, key=lambda t: t.p)
        assert smallest.p_holm == pytest.approx(min(1.0, n * smallest.p))
        ordered = sorted(family, key=lambda t: t.p)
        assert [t.p_holm for t in ordered] == sorted(t.p_holm for t in ordered)


# --- confounding and what cannot be told ---------------------------------------------------------


def reference_e_slopes():
    a, b, t = 2 * np.pi * 1.4, 2 * np.pi * 2.0, 5.0 * ONSETS
    return np.sign(5 * a * np.cos(a * t) + 6 * b * np.cos(b * t))


def test_reference_e_confounds_type_and_direction_so_that_only_their_joint_effect_is_told(rng):
    table = cell(rng, trajectory="E", slope=reference_e_slopes(), type=2.0)
    effects = pulse_effects(table)

    for effect in ("type", "direction", "type:direction"):
        test = found(effects, effect)
        assert (test.status, test.code, test.p) == ("undecided", Undecided.CONFOUNDED, None)
    joint = found(effects, "joint")
    assert (joint.status, joint.df_num) == ("ok", 1.0)
    assert joint.p < 1e-4
    # As printed, one test stands there twice.
    one_way = [found(effects, e, analysis="one_way") for e in ("type", "direction")]
    assert one_way[0].statistic == one_way[1].statistic
    assert effects.means[0].confounding == pytest.approx(1.0)


def test_near_confounding_counts_as_confounding(rng):
    table = cell(rng, slope=(1, 1, 1, 1), direction=2.0)
    table.loc[0, "direction"] = "against"
    effects = pulse_effects(table)

    assert 0.95 < effects.means[0].confounding < 1.0
    assert found(effects, "type").code == Undecided.CONFOUNDED
    joint = found(effects, "joint")
    assert joint.status == "ok"
    assert joint.df_num == 2.0


def test_one_level_of_type_leaves_direction_to_be_tested(rng):
    table = cell(rng).query("sign == 1")
    effects = pulse_effects(table)

    for analysis in ("one_way", "mixed"):
        assert found(effects, "type", analysis=analysis).code == Undecided.ONE_LEVEL
        assert found(effects, "direction", analysis=analysis).status == "ok"
    assert effects.means[0].negative is None
    assert effects.means[0].confounding is None


def test_a_missing_combination_leaves_the_single_effects(rng):
    table = cell(rng).query("not (sign == 1 and direction == 'with')")
    effects = pulse_effects(table)
    assert found(effects, "type").status == found(effects, "direction").status == "ok"
    assert found(effects, "type:direction").code == Undecided.MISSING_COMBINATION


@pytest.mark.parametrize(
    ("change", "code"),
    [
        (lambda t: t.assign(stiffness=np.nan), Undecided.TOO_FEW_PULSES),
        (lambda t: t.assign(stiffness=None), Undecided.TOO_FEW_PULSES),
        (lambda t: t.iloc[[0, 4]], Undecided.TOO_FEW_PULSES),
        (lambda t: t.assign(stiffness=168.0), Undecided.NO_VARIATION),
    ],
    ids=["not finite", "no estimate", "two pulses", "constant"],
)
def test_a_cell_without_answer_is_a_value_not_a_crash(rng, change, code):
    effects = pulse_effects(change(cell(rng)))
    for analysis in ("one_way", "mixed"):
        test = found(effects, "type", analysis=analysis)
        assert (test.status, test.code, test.p, test.p_holm) == ("undecided", code, None, None)
    assert json.dumps(effects.to_dict(), allow_nan=False)


def test_differences_between_trials_that_the_type_takes_up_leave_it_undecided(rng):
    table = cell(rng, n_trials=2)
    table["sign"] = np.where(table["trial"] == 0, 1, -1)
    table = table.query("direction == 'with'")
    assert found(pulse_effects(table), "type").code == Undecided.TOO_FEW_TRIALS


def test_one_trial_is_tested(rng):
    effects = pulse_effects(cell(rng, n_trials=1))
    assert found(effects, "type").status == "ok"
    assert found(effects, "type").df_den == pytest.approx(4.0)


def test_an_empty_table_has_no_tests(rng):
    effects = pulse_effects(cell(rng).iloc[:0])
    assert (effects.tests, effects.means, effects.notes) == ((), (), ())
    assert effects.count("significant", "mixed", "all", "all").share_pct is None


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (lambda t: t.drop(columns=["trial", "sign"]), "trial, sign"),
        (lambda t: t.assign(sign=0), "'sign'.*row 0"),
        (lambda t: t.assign(direction="up"), "'direction'.*row 0"),
        (lambda t: t.assign(case=None), "'case'.*row 0"),
        (lambda t: t.assign(inertia="0.03"), "'inertia'"),
        (lambda t: t.assign(sign=2, direction="up"), r"sign.*direction"),
    ],
)
def test_a_table_that_cannot_be_trusted_is_refused(rng, change, message):
    with pytest.raises(DataError, match=message):
        pulse_effects(change(cell(rng)))


@pytest.mark.parametrize("alpha", [0.0, 1.0, float("nan")])
def test_alpha_is_a_level(rng, alpha):
    with pytest.raises(DataError, match="0 < alpha < 1"):
        pulse_effects(cell(rng), alpha=alpha)


# --- counts and doors ----------------------------------------------------------------------------


@pytest.fixture
def study(rng):
    cells = [
        cell(rng, case=c, trajectory="A", type=d, direction=-2.0)
        for c, d in (("1", 3.0), ("2", 3.0), ("3", 3.0), ("4", -3.0))
    ]
    cells.append(cell(rng, case="1", trajectory="E", slope=reference_e_slopes(), type=3.0))
    return pulse_effects(pd.concat(cells, ignore_index=True))


def test_counts_are_those_of_the_text(study):
    def share(*key):
        c = study.count(*key)
        return c.count, c.of

    assert share("significant", "one_way", "stiffness", "type") == (5, 5)
    assert share("significant", "one_way", "stiffness", "all") == (10, 10)
    # The confounded cell has neither test in the recommended analysis, but a joint one.
    assert share("significant", "mixed", "stiffness", "type") == (4, 4)
    assert share("significant", "mixed", "stiffness", "joint") == (1, 1)
    assert share("positive_larger", "means", "stiffness", "type") == (4, 5)
    # In cell E with the trajectory means positive.
    assert share("with_larger", "means", "stiffness", "direction") == (1, 5)
    assert study.count("positive_larger", "means", "stiffness", "type").share_pct == 80.0
    with pytest.raises(KeyError, match="no count"):
        study.count("significant", "means", "stiffness", "type")
    for analysis in ("one_way", "mixed"):
        both = [share("significant", analysis, r, "all") for r in ("stiffness", "inertia")]
        total = share("significant", analysis, "all", "all")
        assert total == (both[0][0] + both[1][0], both[0][1] + both[1][1])


# --- calibration ---------------------------------------------------------------------------------


def null_study(rng, n_cells, *, between, trial_sd):
    """Cells without any effect; the type varies inside trials, or only between them."""
    cells = []
    for k in range(n_cells):
        table = cell(rng, case=str(k), n_trials=8, trial_sd=trial_sd)
        if between:
            table["sign"] = np.where(table["trial"] % 2, 1, -1)
        cells.append(table.drop(columns="inertia").assign(inertia=np.nan))
    return pulse_effects(pd.concat(cells, ignore_index=True))


def false_positives(effects, analysis):
    c = effects.count("significant", analysis, "stiffness", "type")
    return c.count, c.of


def within(count, of, rate):
    """Whether a count lies in the central 99.9 % of a binomial."""
    low, high = stats.binom.interval(0.999, of, rate)
    return low <= count <= high


@pytest.mark.slow
@pytest.mark.parametrize("trial_sd", [0.0, 1.0])
def test_false_positives_of_the_mixed_model_are_alpha_inside_trials(trial_sd):
    rng = np.random.default_rng(101)
    effects = null_study(rng, 1000, between=False, trial_sd=trial_sd)
    assert within(*false_positives(effects, "mixed"), 0.05)
    count, of = false_positives(effects, "one_way")
    if trial_sd:
        # Balanced inside trials, their variance only swells the error: too timid.
        assert count / of < 0.02
    else:
        assert within(count, of, 0.05)


@pytest.mark.slow
def test_false_positives_of_the_mixed_model_are_alpha_between_trials_and_one_way_ones_are_not():
    rng = np.random.default_rng(102)
    effects = null_study(rng, 1000, between=True, trial_sd=1.0)
    assert within(*false_positives(effects, "mixed"), 0.05)
    count, of = false_positives(effects, "one_way")
    # Per group of 4 trials x 8 pulses the mean has variance 1/4 + 1/32; the test sees an error
    # of (27 + 28) / 31 over 32 pulses: 5.07 times too small, so p(|z| > 1.96 / 2.25) = 0.38.
    assert within(count, of, 0.38)
