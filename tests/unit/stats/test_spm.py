"""SPM against spm1d (stored numbers), scipy, and smooth noise without any effect."""

import json
import runpy
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from scipy import stats
from scipy.ndimage import gaussian_filter1d

from jointz.core.errors import DataError
from jointz.stats.sign_flip import sign_flip_max_t
from jointz.stats.spm import spm_paired_t, spm_unpaired_t

HERE = Path(__file__).parent
MADE = runpy.run_path(str(HERE / "spm_oracle.py"))
ORACLE = json.loads((HERE / "spm_oracle.json").read_text(encoding="utf-8"))["spm"]
DESIGNS = {"paired": spm_paired_t, "unpaired": spm_unpaired_t}
#: spm1d makes p as one minus a number near one: below, its digits are rounding.
LAST_DIGIT = 4e-16


def noise(n_sets: int, n: int, fwhm_nodes: float, *, seed: int) -> np.ndarray:
    """Return smooth noise, (set, participant, 101 nodes)."""
    rng = np.random.default_rng(seed)
    white = rng.standard_normal((n_sets, n, 101 + 120))
    return gaussian_filter1d(white, fwhm_nodes / 2.3548, axis=2)[:, :, 60:-60]


# --- spm1d ---------------------------------------------------------------------------------------


@pytest.mark.parametrize("name", ORACLE)
def test_numbers_are_those_of_spm1d(name):
    expected = ORACLE[name]
    test = DESIGNS[MADE["CASES"][name][0]](
        *MADE["curves"](name), alpha=MADE["ALPHA"].get(name, 0.05)
    )

    np.testing.assert_allclose(test.t, expected["t"], rtol=1e-6, atol=1e-10)
    assert test.df == expected["df"]
    for field in ("fwhm_nodes", "resels", "threshold"):
        assert getattr(test, field) == pytest.approx(expected[field], rel=1e-6)
    if expected["p_set"] is None:
        assert test.p_set is None
    else:
        assert test.p_set == pytest.approx(expected["p_set"], rel=1e-6, abs=LAST_DIGIT)
    assert len(test.clusters) == len(expected["clusters"])
    for cluster, other in zip(test.clusters, expected["clusters"], strict=True):
        ends = (cluster.start_node, cluster.end_node)
        assert ends == pytest.approx(other["ends"], rel=1e-6, abs=1e-6)
        assert cluster.extent_resels == pytest.approx(other["extent_resels"], rel=1e-6)
        assert cluster.p == pytest.approx(other["p"], rel=1e-6, abs=LAST_DIGIT)


# --- closed forms ----------------------------------------------------------------------


def test_the_band_is_the_threshold_times_the_standard_error():
    a, b = noise(2, 9, 10.0, seed=1)
    test = spm_paired_t(a, b)
    half = test.threshold * stats.sem(a - b, axis=0)
    np.testing.assert_allclose(np.subtract(test.ci_high, test.ci_low), 2 * half)
    np.testing.assert_allclose(np.add(test.ci_high, test.ci_low) / 2, (a - b).mean(axis=0))


def test_a_node_differs_exactly_where_its_band_leaves_out_zero_and_its_p_is_small():
    for seed in range(5):
        a, b = noise(2, 9, 10.0, seed=seed)
        test = spm_paired_t(a + 2 * a.std(), b)
        outside = (np.array(test.ci_low) > 0) | (np.array(test.ci_high) < 0)
        assert test.different == tuple(outside)
        assert test.different == tuple(p < test.alpha for p in test.p)
    assert any(test.different)


def test_swapping_the_sets_swaps_the_sign_and_the_unit_changes_nothing_else():
    a, b = noise(2, 8, 10.0, seed=3)
    test, swapped = spm_paired_t(a + 0.3, b), spm_paired_t(100 * b, 100 * (a + 0.3))
    np.testing.assert_allclose(swapped.t, np.negative(test.t))
    np.testing.assert_allclose(swapped.ci_low, -100 * np.array(test.ci_high))
    assert swapped.threshold == pytest.approx(test.threshold)
    assert swapped.p_value == pytest.approx(test.p_value)


# --- what is equal, and what is not found --------------------------------------------------------


def test_nodes_where_nobody_differs_are_left_out():
    a, b = noise(2, 8, 10.0, seed=3)
    b[:, :4] = a[:, :4]
    b[:, 50] = a[:, 50]
    test = spm_paired_t(a, b)

    assert test.untested_nodes == (0, 1, 2, 3, 50)
    assert test.t[50] == test.ci_low[50] == test.ci_high[50] == 0.0
    assert test.p[50] == 1.0
    assert not any(test.different[i] for i in test.untested_nodes)
    assert test.resels == pytest.approx((45 + 49) / test.fwhm_nodes)


def test_not_found_is_undecided_until_a_margin_holds_the_band():
    a, b = noise(2, 12, 20.0, seed=5)
    plain = spm_paired_t(a, b)
    assert plain.verdict == "undecided"
    assert plain.equivalent is None

    wide = spm_paired_t(a, b, equivalence_margin=1.001 * plain.largest_open_difference)
    assert wide.verdict == "equivalent"
    narrow = spm_paired_t(a, b, equivalence_margin=0.999 * plain.largest_open_difference)
    assert narrow.verdict == "undecided"
    assert narrow.equivalent.count(False) >= 1


def test_rough_curves_use_bonferroni():
    rng = np.random.default_rng(0)
    test = spm_paired_t(rng.standard_normal((9, 101)), rng.standard_normal((9, 101)))
    assert test.threshold == pytest.approx(stats.t.isf(0.025 / 101, 8))


# --- bad input -----------------------------------------------------------------------------------

GOOD = np.random.default_rng(0).standard_normal((6, 20)).cumsum(axis=1)


def with_value(value: float) -> np.ndarray:
    curves = GOOD.copy()
    curves[2, 5] = value
    return curves


@pytest.mark.parametrize(
    ("a", "b", "message"),
    [
        (GOOD, -GOOD[:5], "shape"),
        (GOOD[:2], -GOOD[:2], "participants"),
        (GOOD[:, :4], -GOOD[:, :4], "nodes in a"),
        (with_value(np.nan), GOOD, "row 2 at node 5"),
        (GOOD, with_value(np.inf), " b"),
        (GOOD[0], GOOD[0], "dimensions"),
        ([["x"] * 5] * 4, GOOD, "a is"),
        (GOOD, GOOD, "everywhere"),
        (GOOD, GOOD + 1.0, "first at node 0"),
        (np.outer(np.arange(6.0), np.ones(20)), np.zeros((6, 20)), "t test"),
    ],
)
def test_what_cannot_be_paired_is_refused(a, b, message):
    with pytest.raises(DataError, match=message):
        spm_paired_t(a, b)


@pytest.mark.parametrize(
    ("a", "b", "message"),
    [
        (GOOD, -GOOD[:, :19], "got 20 and 19"),
        (GOOD, -GOOD[:1], "in b, got 1"),
        (GOOD * 0.0, GOOD * 0.0 + 1.0, "20 nodes"),
        (GOOD, with_value(np.nan), " b"),
    ],
)
def test_groups_that_cannot_be_compared_are_refused(a, b, message):
    with pytest.raises(DataError, match=message):
        spm_unpaired_t(a, b)


@pytest.mark.parametrize("test", DESIGNS.values())
def test_levels_and_margins_are_checked(test):
    for alpha in (1e-7, 0.6, np.nan):
        with pytest.raises(DataError, match=r"alpha of 1e-06 to 0\.5"):
            test(GOOD, -GOOD, alpha=alpha)
    for margin in (0.0, np.inf, np.nan):
        with pytest.raises(DataError, match="positive equivalence_margin"):
            test(GOOD, -GOOD, equivalence_margin=margin)


def test_tables_must_name_their_rows_alike():
    people = [f"S{i}" for i in range(6)]
    a, b = pd.DataFrame(GOOD, index=people), pd.DataFrame(-GOOD, index=people)
    assert spm_paired_t(a, b) == spm_paired_t(GOOD, -GOOD)
    with pytest.raises(DataError, match="same participants in the same order"):
        spm_paired_t(a, b.iloc[::-1])


# --- calibration ---------------------------------------------------------------------------------


def false_findings(design: str, n_sets: int, fwhm_nodes: float) -> int:
    curves = noise(n_sets, 20, fwhm_nodes, seed=17)
    test = DESIGNS[design]
    return sum(bool(test(c[:10], c[10:]).clusters) for c in curves)


@pytest.mark.slow
@pytest.mark.parametrize("design", DESIGNS)
def test_the_false_positive_rate_on_curves_as_smooth_as_gait_is_5_pct(design):
    low, high = stats.binom.interval(0.95, 2000, 0.05)
    assert low <= false_findings(design, 2000, 20.0) <= high


@pytest.mark.slow
@pytest.mark.parametrize("design", DESIGNS)
def test_a_difference_as_large_as_the_margin_is_seldom_called_equivalent(design):
    """The worst case: the margin is met at one node, elsewhere there is nothing."""
    bump = np.exp(-(((np.arange(101) - 50) / 20) ** 2))
    curves = noise(1000, 20, 20.0, seed=23)
    curves /= curves.std()
    called = sum(
        all(DESIGNS[design](3 * bump + c[:10], c[10:], equivalence_margin=3.0).equivalent)
        for c in curves
    )
    assert called <= stats.binom.ppf(0.975, 1000, 0.05)


@pytest.mark.parametrize("test", [spm_paired_t, spm_unpaired_t, sign_flip_max_t])
def test_nodes_in_rows_are_refused_and_people_in_rows_are_not(test):
    for a, b in zip(noise(20, 12, 15.0, seed=3), noise(20, 12, 15.0, seed=4), strict=True):
        with pytest.raises(DataError, match=r"got 101 rows .*Pass a\.T"):
            test(a.T, b.T)
    assert test(a, b).verdict
    rough = np.random.default_rng(5).standard_normal((2, 30, 20))  # people or nodes, none smooth
    assert test(*rough).verdict
    assert test(np.sort(a, axis=0), np.sort(b, axis=0)).verdict  # people in an order


def test_few_people_beside_nodes_in_rows_are_refused_with_the_way_out():
    a, b = noise(2, 4, 15.0, seed=3)
    with pytest.raises(DataError, match=r"pass a\.T"):
        spm_paired_t(a.T, b.T)
