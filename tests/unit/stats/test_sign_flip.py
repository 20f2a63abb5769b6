"""The sign-flip test against spm1d's flips (stored numbers), its definition, and smooth noise."""

import json
import runpy
from pathlib import Path

import numpy as np
import pytest
from scipy import stats
from scipy.ndimage import gaussian_filter1d

from jointz.core.errors import DataError
from jointz.kernels.statistics.sign_flip_distribution import (
    all_signs,
    cosine_to_t,
    cosines,
    largest_cosines,
)
from jointz.stats.sign_flip import sign_flip_max_t
from jointz.stats.spm import spm_paired_t

HERE = Path(__file__).parent
MADE = runpy.run_path(str(HERE / "spm_oracle.py"))
ORACLE = json.loads((HERE / "spm_oracle.json").read_text(encoding="utf-8"))["flips"]


def noise(n_sets: int, n: int, fwhm_nodes: float, *, seed: int) -> np.ndarray:
    """Return smooth noise, (set, participant, 101 nodes)."""
    rng = np.random.default_rng(seed)
    white = rng.standard_normal((n_sets, n, 101 + 120))
    return gaussian_filter1d(white, fwhm_nodes / 2.3548, axis=2)[:, :, 60:-60]


@pytest.mark.parametrize("name", ORACLE)
def test_the_largest_t_of_every_flip_is_that_of_spm1d(name):
    a, b = MADE["curves"](name)
    n = a.shape[0]
    largest = cosine_to_t(largest_cosines(cosines(a - b), all_signs(n)), n)
    np.testing.assert_allclose(np.sort(largest), ORACLE[name], rtol=1e-6)


@pytest.mark.parametrize("name", ORACLE)
def test_the_threshold_is_the_first_of_the_flips_that_too_many_would_exceed(name):
    test = sign_flip_max_t(*MADE["curves"](name))
    flips = np.repeat(ORACLE[name], 2)
    allowed = int(0.05 * flips.size)
    assert test.threshold == pytest.approx(np.sort(flips)[-1 - allowed], rel=1e-6)


def test_p_of_clusters_is_that_of_their_peak():
    test = sign_flip_max_t(*MADE["curves"]("one bump"))
    assert test.clusters
    for cluster in test.clusters:
        assert cluster.p == test.p[cluster.peak_node] == min(test.p)
        assert cluster.p == (np.array(ORACLE["one bump"]) >= abs(cluster.peak_t) - 1e-9).mean()
        assert cluster.extent_resels is None


def test_t_and_difference_are_those_of_the_paired_t_test():
    a, b = noise(2, 10, 15.0, seed=1)
    flip, field = sign_flip_max_t(a, b), spm_paired_t(a, b)
    assert (flip.t, flip.difference, flip.df) == (field.t, field.difference, field.df)
    assert flip.fwhm_nodes is flip.resels is flip.p_set is None


def test_what_is_found_has_a_small_p_and_zero_is_only_left_out_where_something_is_found():
    for seed in range(20):
        a, b = noise(2, 8, 15.0, seed=seed)
        test = sign_flip_max_t(a + a.std() * (seed % 4), b)
        assert test.different == tuple(p <= test.alpha for p in test.p)
        outside = (np.array(test.ci_low) > 0) | (np.array(test.ci_high) < 0)
        assert not (outside & ~np.array(test.different)).any()


def test_swapping_the_sets_changes_only_signs():
    a, b = noise(2, 9, 15.0, seed=4)
    test, swapped = sign_flip_max_t(a + 0.2, b), sign_flip_max_t(b, a + 0.2)
    assert swapped.p == pytest.approx(test.p)
    assert swapped.threshold == pytest.approx(test.threshold)
    np.testing.assert_allclose(swapped.ci_low, np.negative(test.ci_high))


def test_up_to_14_people_all_flips_are_done_and_beyond_they_are_drawn():
    a, b = noise(2, 15, 15.0, seed=1)
    few, many = sign_flip_max_t(a[:14], b[:14]), sign_flip_max_t(a, b, seed=3)
    assert few.settings["exact"]
    assert (few.settings["n_flips"], few.settings["seed"]) == (2**14, None)
    assert not many.settings["exact"]
    assert (many.settings["n_flips"], many.settings["seed"]) == (2**14, 3)


def test_drawn_flips_repeat_with_their_seed_and_are_near_all_of_them():
    a, b = noise(2, 13, 15.0, seed=1)
    every = sign_flip_max_t(a, b)
    drawn = sign_flip_max_t(a, b, n_flips=4000, seed=1)
    assert drawn == sign_flip_max_t(a, b, n_flips=4000, seed=1)
    assert drawn != sign_flip_max_t(a, b, n_flips=4000, seed=2)
    # Four binomial standard deviations of a share of 4000.
    assert np.max(np.abs(np.subtract(drawn.p, every.p))) < 4 * 0.5 / np.sqrt(4000)


def test_with_five_people_no_p_is_below_one_in_sixteen():
    a, b = noise(2, 5, 15.0, seed=1)
    test = sign_flip_max_t(a + 1e3, b)
    assert (test.verdict, test.p_value) == ("undecided", 1 / 16)
    assert sign_flip_max_t(a + 1e3, b, alpha=0.07).verdict == "different"


def test_nodes_where_nobody_differs_are_left_out():
    a, b = noise(2, 8, 15.0, seed=1)
    b[:, 10] = a[:, 10]
    test = sign_flip_max_t(a, b)
    cut = sign_flip_max_t(np.delete(a, 10, axis=1), np.delete(b, 10, axis=1))
    assert test.untested_nodes == (10,)
    assert (test.t[10], test.p[10]) == (0.0, 1.0)
    assert test.threshold == cut.threshold


def test_a_margin_that_holds_the_band_makes_curves_equivalent():
    a, b = noise(2, 10, 15.0, seed=2)
    margin = 1.01 * sign_flip_max_t(a, b).largest_open_difference
    assert sign_flip_max_t(a, b, equivalence_margin=margin).verdict == "equivalent"


GOOD = np.random.default_rng(0).standard_normal((6, 20)).cumsum(axis=1)


@pytest.mark.parametrize(
    ("a", "b", "settings", "message"),
    [
        (GOOD, -GOOD[:5], {}, "shape"),
        (GOOD, GOOD, {}, "everywhere"),
        (GOOD, -GOOD, {"alpha": 1.0}, "alpha"),
        (GOOD, -GOOD, {"n_flips": 1}, "n_flips"),
        (GOOD, -GOOD, {"seed": -1}, "seed"),
        (GOOD, -GOOD, {"equivalence_margin": -1.0}, "equivalence_margin"),
    ],
)
def test_what_cannot_be_tested_is_refused(a, b, settings, message):
    with pytest.raises(DataError, match=f"sign_flip_max_t: .*{message}"):
        sign_flip_max_t(a, b, **settings)


# --- calibration ---------------------------------------------------------------------------------


def false_findings(n_sets: int, n: int, fwhm_nodes: float) -> int:
    curves = noise(n_sets, n, fwhm_nodes, seed=29)
    return sum(bool(sign_flip_max_t(c, 0 * c).clusters) for c in curves)


def test_few_sets_of_smooth_noise_are_seldom_different():
    assert stats.binom.cdf(false_findings(200, 8, 15.0) - 1, 200, 0.05) < 0.999


@pytest.mark.slow
@pytest.mark.parametrize("fwhm_nodes", [2.0, 12.0, 40.0])
def test_the_false_positive_rate_is_5_pct_however_smooth_the_curves(fwhm_nodes):
    low, high = stats.binom.interval(0.95, 2000, 0.05)
    assert low <= false_findings(2000, 10, fwhm_nodes) <= high


@pytest.mark.slow
@pytest.mark.parametrize("n", [6, 8, 10])
def test_the_band_holds_a_true_difference_in_95_pct_of_studies(n):
    truth = 3 * np.sin(np.arange(101) / 15)
    curves = noise(2000, n, 12.0, seed=41)
    curves /= curves.std()
    missed = 0
    for c in curves:
        test = sign_flip_max_t(c + truth, 0 * c)
        missed += bool(((truth < test.ci_low) | (truth > test.ci_high)).any())
    assert missed <= stats.binom.ppf(0.975, 2000, 0.05)
