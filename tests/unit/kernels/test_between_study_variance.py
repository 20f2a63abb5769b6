"""Random effects over studies: closed forms, a slow obvious implementation, coverage."""

import numpy as np
import pytest

from jointz.kernels.statistics.between_study_variance import random_effects
from jointz.kernels.statistics.multivariate_random_effects import multivariate_random_effects


def test_one_outcome_of_the_many_is_the_univariate_fit() -> None:
    y, v = np.array([10.0, 12, 17, 11, 9]), np.array([1.0, 2, 0.5, 3, 1])
    one, many = random_effects(y, v), multivariate_random_effects(y[:, None], v[:, None, None])
    for name in ("mean", "low", "high", "prediction_low", "prediction_high", "df"):
        assert getattr(many, name)[0] == pytest.approx(getattr(one, name), rel=1e-7)
    assert many.between[0, 0] == pytest.approx(one.tau2, rel=1e-7)
    assert (many.q, many.log_likelihood) == pytest.approx((one.q, one.log_likelihood))


@pytest.mark.parametrize(
    ("values", "variances"),
    [([1.0], [1.0]), ([1.0, np.nan], [1.0, 1.0]), ([1.0, 2.0], [1.0, 0.0]), ([1.0, 2.0], [1.0])],
)
def test_what_cannot_be_pooled_is_refused(values: list[float], variances: list[float]) -> None:
    with pytest.raises(ValueError, match="expected"):
        random_effects(np.array(values), np.array(variances))


def test_covariances_that_are_none_are_refused() -> None:
    y, v = np.ones((3, 2)), np.tile(np.eye(2), (3, 1, 1))
    wrong = v.copy()
    wrong[1, 0, 1] = wrong[1, 1, 0] = 1.5
    with pytest.raises(ValueError, match=r"study 2: expected a positive definite covariance"):
        multivariate_random_effects(y, wrong)
    y[1:, 1] = np.nan
    with pytest.raises(ValueError, match=r"every outcome in 2 studies or more, got \[3, 1\]"):
        multivariate_random_effects(y, v)
    with pytest.raises(ValueError, match=r"covariances \(k, p, p\)"):
        multivariate_random_effects(y, v[:, :1])


@pytest.mark.slow
@pytest.mark.parametrize("k", [3, 6, 20])
@pytest.mark.parametrize("tau2", [0.0, 0.3, 3.0])
def test_intervals_hold_mean_and_spread_as_often_as_they_say(k: int, tau2: float) -> None:
    """Those of mean and spread hold; prediction is the textbook's, short where tau is small."""
    rng = np.random.default_rng([k, int(10 * tau2)])
    n, held, next_held, spread_held = 1500, 0, 0, 0
    for _ in range(n):
        v = rng.uniform(0.3, 3.0, size=k)
        fit = random_effects(rng.normal(0.0, np.sqrt(v + tau2)), v, modified=True)
        held += fit.low <= 0.0 <= fit.high
        next_held += fit.prediction_low <= rng.normal(0.0, np.sqrt(tau2)) <= fit.prediction_high
        spread_held += fit.tau2_low <= tau2 <= fit.tau2_high
    error = 3.0 * np.sqrt(0.95 * 0.05 / n)
    assert held / n >= 0.95 - error
    assert abs(spread_held / n - 0.95) <= error + 0.025 * (tau2 == 0.0)
    assert next_held / n >= 0.80
