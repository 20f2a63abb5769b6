"""Replicates as people: the arithmetic against rows one by one."""

import numpy as np
import pytest
from reproduction import printed_numbers
from reproduction.chapter4.replicates import (
    critical_difference,
    fitting_scatter,
    mean_squares,
    published_cells,
    replicates_as_people,
    replicates_published,
)
from reproduction.printed_numbers import PARAMETER_NAMES
from scipy.stats import binom, f_oneway
from scipy.stats import f as f_distribution

from jointz.kernels.statistics.kenward_roger import satterthwaite_test
from jointz.kernels.statistics.mixed_model_components import fit_random_intercept
from jointz.kernels.statistics.repeated_measures import repeated_measures_anova
from jointz.reference import chapter4

PEOPLE, POINTS, ROWS = 10, 6, 7


@pytest.fixture(scope="module")
def rows():
    """People by timing points by rows, all three random."""
    rng = np.random.default_rng(3)
    y = 0.6 * rng.standard_normal((PEOPLE, 1, 1)) + 0.3 * rng.standard_normal((PEOPLE, POINTS, 1))
    return y + rng.standard_normal((PEOPLE, POINTS, ROWS))


def sum_of_squares_left(y, *factors):
    """Of least squares on dummies of factors, the slow way."""
    design = np.hstack(
        [np.ones((y.size, 1)), *(f.ravel()[:, None] == np.unique(f) for f in factors)]
    )
    left = y.ravel() - design @ np.linalg.lstsq(design, y.ravel(), rcond=None)[0]
    return float(left @ left), y.size - np.linalg.matrix_rank(design)


def test_p_of_rows_is_that_of_least_squares_over_all_rows(rows):
    person, point, _ = np.indices(rows.shape)
    whole, df = sum_of_squares_left(rows, person, point)
    f = []
    for other in (person, point):
        less, df_less = sum_of_squares_left(rows, other)
        f.append((less - whole) / (df_less - df) / (whole / df))
    made = mean_squares(rows.mean(axis=2))
    scatter = float(rows.var(axis=2, ddof=1).mean())
    error = float(made.error_of_rows(scatter, ROWS))
    assert made.df_of_rows(ROWS) == df
    np.testing.assert_allclose(error, whole / df, rtol=1e-12)
    np.testing.assert_allclose(ROWS * made.point / error, f[0], rtol=1e-10)
    np.testing.assert_allclose(ROWS * made.participant / error, f[1], rtol=1e-10)
    assert made.p_of_rows(scatter, ROWS)[0] == pytest.approx(
        f_distribution.sf(f[0], POINTS - 1, df)
    )


def test_a_random_intercept_over_rows_has_the_same_p_of_timing_points(rows):
    person, point, _ = np.indices(rows.shape).reshape(3, -1)
    design = (point[:, None] == np.arange(POINTS)).astype(float)
    design[:, 0] = 1.0
    fit = fit_random_intercept(design, rows.ravel(), person)
    known = satterthwaite_test(fit, np.eye(POINTS)[1:]).p
    scatter = float(rows.var(axis=2, ddof=1).mean())
    p = mean_squares(rows.mean(axis=2)).p_of_rows(scatter, ROWS)[0]
    assert float(p) == pytest.approx(known, rel=1e-5)


def test_p_of_cells_is_that_of_repeated_measures_anova(rows):
    cells = rows.mean(axis=2)
    point, person = mean_squares(cells).p_of_cells()
    assert float(point) == pytest.approx(repeated_measures_anova(cells).test.p)
    assert float(person) == pytest.approx(repeated_measures_anova(cells.T).test.p)


# --- the published tables ------------------------------------------------------------------------


def claims_come_out(parameter, scatter, n_rows=50):
    """Run the analysis of rows on the published table, claim by claim."""
    cells = published_cells(parameter)
    squares = mean_squares(cells)
    means = dict(zip(chapter4.TABLES[parameter], cells.mean(axis=0), strict=True))
    least = critical_difference(parameter, scatter, n_rows)
    pairs = all(
        (abs(means[a] - means[b]) > least) == (claim == "different")
        for (a, b), claim in printed_numbers.PAIRS[parameter].items()
        if claim != "not stated"
    )
    p = squares.p_of_rows(scatter**2 * squares.error, n_rows)
    return pairs and max(map(float, p)) < 0.001


@pytest.mark.parametrize("parameter", PARAMETER_NAMES)
def test_all_printed_claims_come_out_in_the_range_and_not_beside_it(parameter):
    low, high = fitting_scatter(parameter)
    for inside in (low + 1e-6, 0.5 * (low + high), high - 1e-6):
        assert claims_come_out(parameter, inside)
    assert not claims_come_out(parameter, high + 1e-6)
    if low > 0:
        assert not claims_come_out(parameter, low - 1e-6)


def test_too_few_rows_do_not_give_the_printed_claims():
    assert fitting_scatter("stiffness_per_mass", 10) is None
    assert not any(claims_come_out("stiffness_per_mass", s, 10) for s in np.linspace(0, 5, 51))


def test_the_table_says_with_which_scatter_the_claims_come_out():
    table = replicates_published()
    assert [row.ours.partition("by ")[2] for row in table.rows] == [
        "0.00 to 1.29 residual SD", "0.45 to 2.92 residual SD", "0.00 to 0.43 residual SD",
    ]  # fmt: skip


# --- studies without an effect -------------------------------------------------------------------


@pytest.fixture(scope="module")
def simulated():
    return replicates_as_people(11, 1000)


def null_rates(curves):
    """Where there is no effect: by parameter, factor and level."""
    for found in curves["parameters"].values():
        for what, rates in found["rates"].items():
            if "as fitted" not in what:
                yield from rates


def test_rows_as_people_find_what_is_not_there_in_over_90_percent(simulated):
    found = [rate["rows"] for rate in null_rates(simulated[1])]
    assert len(found) == 12
    assert min(found) > 0.9


def test_one_value_a_cell_finds_it_as_often_as_stated(simulated):
    for rate in null_rates(simulated[1]):
        low, high = binom.interval(0.999, 1000, rate["level"])
        assert low <= 1000 * rate["cells"] <= high
        assert rate["cells_low"] <= rate["cells"] <= rate["cells_high"]


@pytest.mark.slow
def test_many_studies_without_an_effect_show_the_rates_closely():
    n = 20000
    for rate in null_rates(replicates_as_people(209, n)[1]):
        low, high = binom.interval(0.998, n, rate["level"])
        assert low <= rate["cells"] * n <= high, rate
        assert rate["rows"] > 0.9, rate


def test_the_seed_decides_all(simulated):
    assert replicates_as_people(11, 1000) == simulated
    assert replicates_as_people(12, 1000) != simulated


def test_more_scatter_of_rows_makes_false_findings_rarer_but_not_rare():
    """As one-way tests of a nested design do: scipy finds the same on drawn rows."""
    rate = next(null_rates(replicates_as_people(11, 400, scatter=4.0)[1]))
    rng = np.random.default_rng(5)
    y = rng.standard_normal((400, PEOPLE, POINTS, 1)) + 4.0 * rng.standard_normal(
        (400, PEOPLE, POINTS, 50)
    )
    # Without a variance of people the one-way test is the same but for 9 degrees of freedom.
    drawn = np.mean([f_oneway(*np.moveaxis(s, 1, 0).reshape(POINTS, -1)).pvalue < 0.05 for s in y])
    # Three standard errors of a difference of two shares of 400.
    assert rate["rows"] == pytest.approx(drawn, abs=3 * (2 * 0.25 / 400) ** 0.5)
