"""Partial pooling against closed forms, a slow sampler, and simulated people."""

import numpy as np
import pytest
from scipy.stats import binom, norm
from scipy.stats import t as student_t

from jointz.kernels.statistics.pooling_posterior import partial_pooling

TAUS = (0.0, 0.3, 1.0, 3.0)


def people(rng, n, tau, *, groups):
    """Draw true values around 5, errors of unlike size around 1, and estimates."""
    true = 5.0 + tau * rng.standard_normal((groups, n))
    sds = np.exp(rng.normal(0.0, 0.5, (groups, n)))
    return true, sds, true + sds * rng.standard_normal((groups, n))


def covered(low, high, true):
    return (low <= true) & (true <= high)


def test_without_errors_the_interval_is_students():
    values = np.array([[10.0, 12.0, 17.0, 9.0]])
    pooled = partial_pooling(values, np.full((1, 4), 1e-4))
    low, high = student_t.interval(
        0.95, 3, loc=values.mean(), scale=values.std(ddof=1) / np.sqrt(4.0)
    )
    assert pooled.mean[0] == pytest.approx(12.0, abs=1e-3)
    assert pooled.mean_low[0] == pytest.approx(low, abs=0.01)
    assert pooled.mean_high[0] == pytest.approx(high, abs=0.01)
    np.testing.assert_allclose(pooled.value, values, atol=1e-6)


def test_the_moments_given_tau_are_those_of_a_linear_mixed_model():
    """Henderson's equations of the same model, solved as one dense system at every tau."""
    rng = np.random.default_rng(1)
    values, sds = rng.normal(3.0, 2.0, 6), rng.uniform(0.5, 2.0, 6)
    taus = np.geomspace(1e-3, 1e3, 4001)
    logs, means, variances = [], [], []
    for tau in taus:
        total = np.diag(sds**2 + tau**2)
        inverse, ones = np.linalg.inv(total), np.ones(6)
        information = ones @ inverse @ ones
        mu = ones @ inverse @ values / information
        off = values - mu
        prior = 0.5 * np.log(np.trace(inverse @ inverse)) + 2.0 * np.log(tau)
        log = -0.5 * np.linalg.slogdet(total)[1] - 0.5 * np.log(information)
        logs.append(log - 0.5 * off @ inverse @ off + prior)
        block = np.block(
            [
                [np.diag(1.0 / sds**2 + 1.0 / tau**2), -ones[:, None] / tau**2],
                [-ones[None] / tau**2, np.array([[6.0 / tau**2]])],
            ]
        )
        covariance = np.linalg.inv(block)
        means.append(covariance @ np.append(values / sds**2, 0.0))
        variances.append(np.diag(covariance))
    chance = np.exp(np.array(logs) - max(logs))
    chance /= chance.sum()
    mean = chance @ np.array(means)
    sd = np.sqrt(chance @ (np.array(variances) + (np.array(means) - mean) ** 2))

    pooled = partial_pooling(values[None], sds[None])
    np.testing.assert_allclose(pooled.value[0], mean[:-1], atol=2e-3)
    np.testing.assert_allclose(pooled.sd[0], sd[:-1], rtol=5e-3)
    assert pooled.mean[0] == pytest.approx(mean[-1], abs=2e-3)
    assert pooled.spread[0] == pytest.approx(np.interp(0.5, np.cumsum(chance), taus), rel=0.02)


def test_absent_people_change_nothing():
    values, sds = np.array([[3.0, 5.0, 9.0]]), np.array([[1.0, 2.0, 0.5]])
    more = np.array([[3.0, np.nan, 5.0, 9.0, np.nan]])
    pooled = partial_pooling(values, sds)
    padded = partial_pooling(more, np.array([[1.0, 7.0, 2.0, 0.5, np.nan]]))
    np.testing.assert_allclose(padded.value[0, [0, 2, 3]], pooled.value[0])
    np.testing.assert_allclose(padded.mean_low, pooled.mean_low)
    assert np.isnan(padded.value[0, [1, 4]]).all()
    assert np.isnan(padded.low[0, [1, 4]]).all()


def test_one_person_keeps_what_was_measured_and_nobody_has_no_mean():
    values = np.array([[4.0, np.nan], [np.nan, np.nan]])
    pooled = partial_pooling(values, np.array([[0.5, np.nan], [np.nan, np.nan]]))
    assert pooled.value[0, 0] == 4.0
    assert pooled.high[0, 0] == pytest.approx(4.0 + 0.5 * norm.ppf(0.975))
    assert np.isnan(pooled.mean).all()
    assert np.isnan(pooled.spread).all()
    assert np.isnan(pooled.value[1]).all()


@pytest.mark.parametrize(
    ("sds", "level"),
    [([1.0] * 3, 0.95), ([1.0] * 2, 1.0), ([1.0, 0.0], 0.95), ([1.0, -1.0], 0.95)],
)
def test_shapes_errors_and_level_are_checked(sds, level):
    with pytest.raises(ValueError, match="expected"):
        partial_pooling(np.ones((1, 2)), np.array([sds]), level=level)


@pytest.mark.parametrize("tau", TAUS)
def test_intervals_cover_in_a_quick_look(tau):
    groups = 150
    true, sds, values = people(np.random.default_rng(4), 10, tau, groups=groups)
    pooled = partial_pooling(values, sds)
    least = binom.ppf(0.001, groups, 0.95)
    assert covered(pooled.mean_low, pooled.mean_high, 5.0).sum() >= least
    assert covered(pooled.low, pooled.high, true).mean() >= least / groups
    # Together they are no worse than alone.
    assert ((pooled.value - true) ** 2).mean() < ((values - true) ** 2).mean()


@pytest.mark.slow
@pytest.mark.parametrize("tau", TAUS)
@pytest.mark.parametrize("n", [3, 5, 10, 20])
def test_intervals_cover_whatever_the_spread_of_people(n, tau):
    """Mean: never below the band; above it where Jeffreys' prior keeps tau away from zero."""
    groups = 1000
    true, sds, values = people(np.random.default_rng(1000 + n), n, tau, groups=groups)
    pooled = partial_pooling(values, sds)
    low, high = binom.ppf([0.005, 0.995], groups, 0.95) / groups
    mean = covered(pooled.mean_low, pooled.mean_high, 5.0).mean()
    assert mean >= low
    if tau == 3.0 and n > 3:
        assert mean <= high
    own = covered(pooled.low, pooled.high, true).mean(axis=1)
    # Clustered by group: people of one share its tau and mean.
    reach = 2.576 * own.std(ddof=1) / np.sqrt(groups)
    assert own.mean() >= 0.95 - max(reach, 0.01)
