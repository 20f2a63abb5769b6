"""Random intercepts of participants and cells against dense likelihoods and closed form."""

import numpy as np
import pytest
from scipy.optimize import minimize

from jointz.kernels.statistics.mixed_model_components import (
    cell_blocks,
    evaluate_components,
    fit_components,
    fit_participants,
    likelihood_ratio,
)
from jointz.kernels.statistics.mixed_model_likelihood import fit_random_intercept


def layout(seed, *, people=5, levels=3, cell_sd=1.0, person_sd=1.0, most=4, drop=0.2):
    rng = np.random.default_rng(seed)
    keep = rng.random((people, levels)) >= drop
    keep[0] = True
    rows = rng.integers(1, most + 1, (people, levels)) * keep
    person = np.repeat(np.repeat(np.arange(people), levels), rows.ravel())
    level = np.repeat(np.tile(np.arange(levels), people), rows.ravel())
    person = np.unique(person, return_inverse=True)[1]
    cell = np.unique(person * levels + level, return_inverse=True)[1]
    y = person_sd * rng.standard_normal(people)[person] + rng.standard_normal(person.size)
    y += cell_sd * rng.standard_normal(cell.max() + 1)[cell]
    X = (level[:, None] == np.arange(levels)).astype(float)
    X[:, 0] = 1.0
    return X, y, person, cell


class Dense:
    """The same model with n x n matrices, every formula as in the books."""

    def __init__(self, X, y, person, cell):
        self.X, self.y = X, y
        same = [person, cell, np.arange(y.size)]
        self.G = [(index[:, None] == index).astype(float) for index in same]

    def parts(self, v):
        V = sum(value * G for value, G in zip(v, self.G, strict=True))
        Vi = np.linalg.inv(V)
        C = np.linalg.inv(self.X.T @ Vi @ self.X)
        return V, Vi, C, Vi - Vi @ self.X @ C @ self.X.T @ Vi

    def deviance(self, v):
        V, _, C, P = self.parts(v)
        return np.linalg.slogdet(V)[1] - np.linalg.slogdet(C)[1] + self.y @ P @ self.y

    def score(self, v):
        P = self.parts(v)[3]
        return [(self.y @ P @ G @ P @ self.y - np.trace(P @ G)) / 2 for G in self.G]

    def expected(self, v):
        P = self.parts(v)[3]
        return [[np.trace(P @ G @ P @ H) / 2 for H in self.G] for G in self.G]

    def observed(self, v):
        P = self.parts(v)[3]
        twice = [[self.y @ P @ G @ P @ H @ P @ self.y for H in self.G] for G in self.G]
        return np.array(twice) - self.expected(v)


@pytest.mark.parametrize("seed", range(5))
def test_every_part_is_that_of_dense_matrices(seed):
    X, y, person, cell = layout(seed)
    dense, v = Dense(X, y, person, cell), np.array([0.7, 0.4, 1.3])

    step = evaluate_components(cell_blocks(X, y, person, cell=cell), v)

    _, Vi, C, _ = dense.parts(v)
    np.testing.assert_allclose(step.beta, C @ X.T @ Vi @ y, rtol=1e-10)
    np.testing.assert_allclose(step.covariance, C, rtol=1e-10, atol=1e-14)
    np.testing.assert_allclose(step.score, dense.score(v), rtol=1e-9)
    np.testing.assert_allclose(step.expected_information, dense.expected(v), rtol=1e-9)
    np.testing.assert_allclose(step.observed_information, dense.observed(v), rtol=1e-8)
    for a, G in enumerate(dense.G):
        P = -X.T @ Vi @ G @ Vi @ X
        np.testing.assert_allclose(step.information_gradient[a], P, rtol=1e-9, atol=1e-12)
        for b, H in enumerate(dense.G):
            Q = X.T @ Vi @ G @ Vi @ H @ Vi @ X
            np.testing.assert_allclose(step.information_products[a, b], Q, rtol=1e-9, atol=1e-12)


def test_deviances_differ_as_those_of_dense_matrices():
    X, y, person, cell = layout(6)
    dense, blocks = Dense(X, y, person, cell), cell_blocks(X, y, person, cell=cell)
    pairs = [np.array([0.7, 0.4, 1.3]), np.array([0.0, 2.0, 0.5])]

    ours = [evaluate_components(blocks, v).deviance for v in pairs]

    assert ours[0] - ours[1] == pytest.approx(dense.deviance(pairs[0]) - dense.deviance(pairs[1]))


@pytest.mark.parametrize("sds", [(1.0, 1.0), (0.0, 1.0), (1.0, 0.0), (0.0, 0.0), (5.0, 0.2)])
@pytest.mark.parametrize("seed", range(4))
def test_no_start_of_another_search_finds_a_larger_likelihood(seed, sds):
    X, y, person, cell = layout(seed, person_sd=sds[0], cell_sd=sds[1])
    dense, blocks = Dense(X, y, person, cell), cell_blocks(X, y, person, cell=cell)

    fit = fit_components(blocks)

    def deviance(roots):
        return dense.deviance(np.array([roots[0] ** 2, roots[1] ** 2, np.exp(roots[2])]))

    found = [
        minimize(deviance, start, method="Nelder-Mead", options={"xatol": 1e-5, "fatol": 1e-9})
        for start in ([1.0, 1.0, 0.0], [0.1, 2.0, 0.0], [3.0, 0.1, 0.0])
    ]
    assert dense.deviance(fit.variances) <= min(one.fun for one in found) + 1e-9
    assert np.abs(fit.score[fit.variances > 0]).max() < 1e-6
    assert (fit.score[fit.variances == 0] <= 1e-9).all()


def test_one_random_intercept_is_that_of_the_root_of_the_score():
    for seed in range(10):
        X, y, person, _ = layout(seed)
        known = fit_random_intercept(X, y, person)
        by_root = fit_participants(X, y, person)
        by_scoring = fit_components(cell_blocks(X, y, person, cell=None))

        variances = [known.variance_group, known.variance_residual]
        np.testing.assert_array_equal(by_root.variances, variances)
        np.testing.assert_allclose(by_scoring.variances, variances, rtol=1e-9, atol=1e-12)
        np.testing.assert_allclose(by_root.covariance, known.covariance, rtol=1e-9, atol=1e-14)


def test_balanced_replicates_have_the_variances_of_the_mean_squares():
    rng = np.random.default_rng(2)
    people, levels, rows = 7, 4, 3
    person, level, _ = np.indices((people, levels, rows)).reshape(3, -1)
    y = 2 * rng.standard_normal(people)[person] + rng.standard_normal(person.size)
    y += rng.standard_normal((people, levels))[person, level]
    X = (level[:, None] == np.arange(levels)).astype(float)

    v = fit_components(cell_blocks(X, y, person, cell=person * levels + level)).variances

    table = y.reshape(people, levels, rows)
    means = table.mean(axis=2)
    within = table.var(axis=2, ddof=1).mean()
    rest = means - means.mean(axis=0) - means.mean(axis=1, keepdims=True) + means.mean()
    of_cell = rows * (rest**2).sum() / (people - 1) / (levels - 1)
    of_person = rows * levels * means.mean(axis=1).var(ddof=1)
    known = [(of_person - of_cell) / levels / rows, (of_cell - within) / rows, within]
    np.testing.assert_allclose(v, known, rtol=1e-9)


def test_a_variance_at_0_gains_no_likelihood():
    for seed in range(30):
        X, y, person, cell = layout(seed, person_sd=0.0, cell_sd=0.0)
        blocks = cell_blocks(X, y, person, cell=cell)
        fit = fit_components(blocks)
        for component in (0, 1):
            gain = likelihood_ratio(blocks, fit, component)
            assert (gain == 0) == (fit.variances[component] == 0)


def test_cells_of_two_people_or_of_two_levels_are_refused():
    X, y, person, cell = layout(3)
    with pytest.raises(ValueError, match="cells of one participant and one set of fixed effects"):
        cell_blocks(X, y, person, cell=np.zeros_like(cell))
    with pytest.raises(ValueError, match="cells of one participant"):
        cell_blocks(X, y, np.zeros_like(person), cell=X[:, 1].astype(int) * 0)


def test_two_people_at_two_levels_are_enough():
    y = np.array([1.3, -4.3, 1.5, -1.3])
    X = np.array([[1.0, 0], [1, 1], [1, 0], [1, 1]])

    fit = fit_random_intercept(X, y, np.array([0, 0, 1, 1]))

    between, inside = 2 * 2 * 0.8**2, 1.4**2
    assert fit.variance_residual == pytest.approx(inside)
    assert fit.variance_group == pytest.approx((between - inside) / 2)
