"""How often the tests of ``jointz.stats`` find what is not there, where no unit test counts it.

Studies of ten people by six timing points without an effect, at 5 %, all seeds fixed. A test that
is exact must lie inside the central 99.8 % of the binomial about 5 %, as in the unit tests of the
mixed model; one that is cautious by construction must not lie above it.
"""

from collections import Counter

import numpy as np
import pandas as pd
import pytest
from scipy.ndimage import gaussian_filter1d
from scipy.stats import binom

from jointz.kernels.statistics.repeated_measures import repeated_measures_anova
from jointz.stats import compare_quasi_stiffness, mixed_model, spm_unpaired_t

PEOPLE, POINTS = 10, 6
LEVEL = 0.05
#: Of timing points whose spread over people differs as that of stiffness in table 4.1.
UNEQUAL_SD = np.array([1.9, 0.5, 0.7, 0.75, 0.3, 0.25])


def band(n):
    return binom.interval(0.998, n, LEVEL)


def assert_exact(found, n):
    low, high = band(n)
    assert low <= found <= high, (found, low, high)


def assert_cautious(found, n):
    assert found <= band(n)[1], (found, band(n))


def table_of(cells):
    """One row a value of (people, points, rows)."""
    person, point, _ = np.indices(cells.shape).reshape(3, -1)
    return pd.DataFrame({"who": person, "point": point, "y": cells.ravel()})


def fitted(table, **options):
    return mixed_model(table, response="y", within="point", participant="who", **options)


def drawn(rng, *, person=1.0, cell=0.0, rows=1):
    """Normal: people, cells and rows."""
    y = person * rng.standard_normal((PEOPLE, 1, 1))
    return (
        y
        + cell * rng.standard_normal((PEOPLE, POINTS, 1))
        + rng.standard_normal((PEOPLE, POINTS, rows))
    )


# --- timing points -------------------------------------------------------------------------------


@pytest.mark.slow
def test_greenhouse_and_geisser_hold_the_level_where_differences_vary_unalike():
    """The F test itself does not: that is what its correction is for."""
    rng, n = np.random.default_rng(201), 20000
    tables = rng.standard_normal((n, PEOPLE, 1)) + UNEQUAL_SD * rng.standard_normal(
        (n, PEOPLE, POINTS)
    )
    made = [repeated_measures_anova(table) for table in tables]
    corrected = sum(m.p_epsilon < LEVEL for m in made)
    assert sum(m.test.p < LEVEL for m in made) > band(n)[1]
    assert corrected > 0.5 * LEVEL * n
    assert_cautious(corrected, n)


@pytest.mark.slow
def test_where_differences_vary_unalike_only_paired_pairs_hold_the_level():
    rng, n = np.random.default_rng(202), 1000
    found = Counter()
    for _ in range(n):
        cells = drawn(rng) * UNEQUAL_SD[:, None]
        fit = fitted(table_of(cells))
        rm = fit.repeated_measures
        found["greenhouse-geisser"] += rm.p_epsilon < LEVEL
        found["f"] += fit.f_test.p < LEVEL
        for error in ("pooled", "paired"):
            found[f"{error} pair"] += fit.pairs("none", error=error)["p_adjusted"].iloc[0] < LEVEL
            for adjust in ("bonferroni", "holm"):
                found[f"{error} {adjust}"] += fit.pairs(adjust, error=error)["p_adjusted"].min() < (
                    LEVEL
                )
    assert_exact(found["paired pair"], n)
    for name in ("paired bonferroni", "paired holm", "greenhouse-geisser"):
        assert_cautious(found[name], n)
    for name in ("f", "pooled pair", "pooled bonferroni", "pooled holm"):
        assert found[name] > band(n)[1], (name, found[name])


@pytest.mark.slow
@pytest.mark.parametrize("missing", [0.0, 0.3])
def test_satterthwaite_holds_the_level_with_replicates(missing):
    rng, n = np.random.default_rng(203), 1000
    found = 0
    for _ in range(n):
        table = table_of(drawn(rng, cell=1.0, rows=4))
        kept = table[rng.random(len(table)) >= missing]
        found += fitted(kept, nested=True, df="satterthwaite").f_test.p < LEVEL
    assert_exact(found, n)


# --- random effects ------------------------------------------------------------------------------


@pytest.mark.slow
@pytest.mark.parametrize("missing", [0.0, 0.2])
def test_cells_without_a_variance_are_found_to_have_one_as_often_as_stated(missing):
    rng, n = np.random.default_rng(204), 1000
    exact = mixture = squared = 0
    for _ in range(n):
        table = table_of(drawn(rng, rows=4))
        test = fitted(table[rng.random(len(table)) >= missing], nested=True).random_effects[1]
        assert test.effect == "cell"
        exact += test.p < LEVEL
        mixture += test.p_mixture < LEVEL
        squared += test.p_chi2 < LEVEL
    assert_exact(exact, n)
    assert_cautious(mixture, n)
    assert squared <= mixture


@pytest.mark.slow
def test_people_without_a_variance_are_found_to_have_one_as_often_with_missing_cells():
    rng, n = np.random.default_rng(205), 1000
    exact = mixture = 0
    for _ in range(n):
        table = table_of(drawn(rng, person=0.0))
        test = fitted(table[rng.random(len(table)) >= 0.2]).random_effects[0]
        exact += test.p < LEVEL
        mixture += test.p_mixture < LEVEL
    assert_exact(exact, n)
    assert_cautious(mixture, n)


# --- curves and quasi-stiffness ------------------------------------------------------------------


@pytest.mark.slow
@pytest.mark.parametrize("sizes", [(6, 14), (3, 5)])
def test_groups_of_unequal_size_are_not_found_different_more_often(sizes):
    rng, n = np.random.default_rng(206), 1000
    white = rng.standard_normal((n, sum(sizes), 101 + 120))
    curves = gaussian_filter1d(white, 20.0 / 2.3548, axis=2)[:, :, 60:-60]
    assert_cautious(
        sum(bool(spm_unpaired_t(c[: sizes[0]], c[sizes[0] :]).clusters) for c in curves), n
    )


def compared(q, k):
    names = [f"P{i}" for i in range(POINTS)]
    return compare_quasi_stiffness(
        dict(zip(names, q.tolist(), strict=True)), dict(zip(names, k.tolist(), strict=True))
    )


@pytest.mark.slow
@pytest.mark.parametrize("sd", [1.0, 2.0])
def test_welchs_test_holds_the_level_on_independent_values(sd):
    """At six against six, of equal or unequal variance, Welch's df are nearly exact."""
    rng, n = np.random.default_rng(207), 4000
    found = sum(
        compared(sd * rng.standard_normal(POINTS), rng.standard_normal(POINTS)).p < LEVEL
        for _ in range(n)
    )
    assert_exact(found, n)


@pytest.mark.slow
def test_welchs_test_as_published_hardly_ever_finds_anything_over_timing_points():
    """Both kinds follow the gait cycle alike, and the test takes that as error."""
    rng, n = np.random.default_rng(208), 1000
    over_the_cycle = np.array([2.13, 0.62, 1.15, 1.16, 0.31, 0.38])
    noise = 0.2 * rng.standard_normal((n, 2, POINTS))
    null = sum(compared(over_the_cycle + a, over_the_cycle + b).p < LEVEL for a, b in noise)
    apart = sum(compared(over_the_cycle + 0.4 + a, over_the_cycle + b).p < LEVEL for a, b in noise)
    assert null == 0
    # A difference of 0.4, twice the noise of a value, is missed nearly always.
    assert apart < 0.05 * n
