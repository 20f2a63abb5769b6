"""Kenward and Roger's test: exact where it must be, and as its formulas say elsewhere."""

import numpy as np
import pytest
from scipy import stats

from jointz.kernels.statistics.kenward_roger import (
    adjusted_covariance,
    kenward_roger_test,
    single_contrasts,
)
from jointz.kernels.statistics.mixed_model_components import fit_participants
from jointz.kernels.statistics.mixed_model_likelihood import satterthwaite_test
from jointz.kernels.statistics.repeated_measures import paired_t_test, repeated_measures_anova


def complete(seed, people=6, levels=4, person_sd=2.0):
    rng = np.random.default_rng(seed)
    # People evenly apart: their variance is above 0.
    table = person_sd * np.arange(people)[:, None] + rng.standard_normal((people, levels))
    person, level = np.indices(table.shape).reshape(2, -1)
    X = (level[:, None] == np.arange(levels)).astype(float)
    X[:, 0] = 1.0
    return table, X, table.ravel(), person


@pytest.mark.parametrize(("people", "levels"), [(6, 4), (2, 3), (3, 2), (2, 2), (2, 6), (10, 6)])
def test_a_complete_table_has_the_analysis_of_variance(people, levels):
    table, X, y, person = complete(0, people, levels, person_sd=5.0)
    fit = fit_participants(X, y, person)

    test = kenward_roger_test(fit, np.eye(levels)[1:])

    known = repeated_measures_anova(table).test
    assert test.df_den == pytest.approx(known.df_den)
    assert test.statistic == pytest.approx(known.statistic)
    assert test.p == pytest.approx(known.p)


def test_the_basis_of_the_contrasts_does_not_matter():
    _, X, y, person = complete(1)
    keep = np.random.default_rng(1).random(y.size) > 0.25
    fit = fit_participants(X[keep], y[keep], person[keep])
    turned = np.random.default_rng(2).standard_normal((3, 3)) @ np.eye(4)[1:]

    one, other = kenward_roger_test(fit, np.eye(4)[1:]), kenward_roger_test(fit, turned)

    assert other.statistic == pytest.approx(one.statistic)
    assert other.df_den == pytest.approx(one.df_den)


@pytest.mark.parametrize("kenward_roger", [True, False])
def test_a_single_contrast_is_the_root_of_the_f_test(kenward_roger):
    _, X, y, person = complete(3)
    keep = np.random.default_rng(5).random(y.size) > 0.3
    fit = fit_participants(X[keep], y[keep], person[keep])
    L = np.array([[0.0, 1.0, -1.0, 0.0]])

    single = single_contrasts(fit, L, kenward_roger=kenward_roger)

    test = kenward_roger_test(fit, L) if kenward_roger else satterthwaite_test(fit, L)
    assert (single.estimate / single.se) ** 2 == pytest.approx(test.statistic)
    assert single.df == pytest.approx(test.df_den)


def test_two_levels_are_a_paired_t_test():
    table, X, y, person = complete(4, people=7, levels=2)

    single = single_contrasts(fit_participants(X, y, person), [[0.0, -1.0]], kenward_roger=True)

    known = paired_t_test(table[:, 0], table[:, 1])
    assert (single.estimate[0], single.se[0], single.df[0]) == pytest.approx(
        (known.difference, known.se, known.df)
    )
    assert known.p == pytest.approx(stats.ttest_rel(table[:, 0], table[:, 1]).pvalue)


def test_taking_variances_as_estimated_never_narrows_the_standard_errors():
    _, X, y, person = complete(6)
    keep = np.random.default_rng(6).random(y.size) > 0.3
    fit = fit_participants(X[keep], y[keep], person[keep])

    assert (np.diag(adjusted_covariance(fit)) >= np.diag(fit.covariance) * (1 - 1e-12)).all()


def test_contrasts_that_depend_on_each_other_are_refused():
    _, X, y, person = complete(7)
    fit = fit_participants(X, y, person)

    with pytest.raises(ValueError, match="do not depend on each other"):
        kenward_roger_test(fit, np.array([[0.0, 1, -1, 0], [0, 0, 1, -1], [0, 1, 0, -1]]))
