"""People together: R's metafor and lme4, singular likelihoods, draws."""

import json
from pathlib import Path

import numpy as np
import pytest
from scipy.optimize import minimize

from jointz.kernels.statistics.people_model import (
    PeopleData,
    PeopleVariances,
    correlation_of,
    draw_people,
    people_evidence,
)

#: Written by make_people_reference.R.
ORACLE = json.loads((Path(__file__).parents[1] / "stats" / "people_reference.json").read_text())
POINTS = ORACLE["points"]


def data_of(values, errors, kinds=1, **more):
    """Return people with independent errors, one row a person."""
    values, errors = np.asarray(values), np.asarray(errors)
    d = values.shape[1]
    precision = np.array([np.diag(1.0 / own**2) for own in errors])
    return PeopleData(
        precision=precision,
        weighted=np.einsum("ide,ie->id", precision, values),
        kinds=np.repeat(np.arange(kinds), d // kinds),
        places=np.tile(np.arange(d // kinds), kinds),
        level_sd=np.full(kinds, 0.35),
        place_sd=np.full(kinds, 0.25),
        **more,
    )


def likeliest(data):
    """Return the variances of the largest restricted likelihood, and what holds there."""
    k = data.n_kinds

    def variances(x):
        sds = np.exp(x[: 2 * k])
        return PeopleVariances(
            sds[:k], sds[k:], correlation_of(np.tanh(x[2 * k :]), k), np.zeros(k)
        )

    start = np.concatenate([np.full(2 * k, np.log(0.2)), np.zeros(k * (k - 1) // 2)])
    found = minimize(
        lambda x: -people_evidence(data, variances(x)).log_evidence,
        start, method="BFGS", options={"gtol": 1e-7},
    )  # fmt: skip
    return variances(found.x), people_evidence(data, variances(found.x))


def test_at_the_largest_likelihood_it_is_the_model_of_metafor():
    oracle = ORACLE["metafor"]
    values, errors = (
        np.reshape(oracle[key], (ORACLE["people"], 2 * POINTS)) for key in ("values", "errors")
    )
    variances, found = likeliest(data_of(values, errors, kinds=2))
    assert found.mean == pytest.approx(oracle["mean"], rel=1e-3)
    assert np.sqrt(np.diag(found.covariance)) == pytest.approx(oracle["se"], rel=1e-3)
    assert variances.level_sd == pytest.approx(oracle["level_sd"], rel=1e-3)
    assert variances.place_sd == pytest.approx(oracle["place_sd"], rel=1e-3)
    assert variances.correlation[0, 1] == pytest.approx(oracle["correlation"][0], rel=1e-3)


def test_with_equal_errors_it_is_the_model_of_lme4():
    oracle, error = ORACLE["lme4"], 0.01
    values = np.reshape(oracle["values"], (ORACLE["people"], POINTS))
    variances, found = likeliest(data_of(values, np.full(values.shape, error)))
    assert found.mean == pytest.approx(oracle["mean"], rel=1e-3)
    assert np.sqrt(np.diag(found.covariance)) == pytest.approx(oracle["se"], rel=1e-3)
    assert variances.level_sd == pytest.approx(oracle["level_sd"], rel=1e-3)
    # lme4 has no errors of measurement beside its residuals.
    residual = np.hypot(variances.place_sd, error)
    assert residual == pytest.approx(oracle["place_sd"], rel=1e-3)


def values_of(n, d=3, *, seed=1, sd=0.2):
    rng = np.random.default_rng(seed)
    return rng.normal(1.0, sd, (n, d)), np.full((n, d), 0.1)


def test_a_person_without_data_changes_nothing():
    values, errors = values_of(8)
    data = data_of(values, errors)
    silent = data_of(np.vstack([values, values[:1]]), np.vstack([errors, np.full((1, 3), 1e9)]))
    variances = PeopleVariances(np.array([0.2]), np.array([0.1]), np.eye(1), np.zeros(1))
    with_all, without = people_evidence(silent, variances), people_evidence(data, variances)
    assert with_all.mean == pytest.approx(without.mean)
    assert with_all.log_evidence == pytest.approx(without.log_evidence)


def test_draws_are_reproducible_and_spread_as_a_mean_of_people():
    values, errors = values_of(12)
    first, again = (draw_people(data_of(values, errors)) for _ in range(2))
    assert (first.mean == again.mean).all()
    assert first.mean.mean(axis=0) == pytest.approx(values.mean(axis=0), abs=0.03)
    expected = values.std(ddof=1) / np.sqrt(12)
    assert first.mean.std(axis=0) == pytest.approx([expected] * 3, rel=0.3)


def test_a_slope_that_people_have_is_found_and_leaves_less_spread():
    rng = np.random.default_rng(2)
    x = np.linspace(-0.3, 0.3, 15)
    values = 1.0 + 1.4 * x[:, None] + rng.normal(0.0, 0.05, (15, 3))
    more = {"covariate": x, "slope": np.array([1.0]), "slope_sd": 0.5}
    with_slope = draw_people(data_of(values, np.full(values.shape, 0.03), **more))
    without = draw_people(data_of(values, np.full(values.shape, 0.03)))
    assert with_slope.slope.mean() == pytest.approx(1.4, abs=0.1)
    assert np.median(with_slope.variance) < 0.1 * np.median(without.variance)


def test_correlations_stay_correlations():
    partial = np.tanh(np.random.default_rng(3).normal(0.0, 1.5, (50, 3)))
    for row in partial:
        found = correlation_of(row, 3)
        assert np.diag(found) == pytest.approx([1.0] * 3)
        assert np.linalg.eigvalsh(found).min() >= -1e-12
    assert correlation_of(np.array([0.3, 0.0, 0.0]), 3)[0, 1] == pytest.approx(0.3)
