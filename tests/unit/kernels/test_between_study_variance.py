"""Random effects over studies: closed forms, a slow obvious implementation, coverage."""

import numpy as np
import pytest

from jointz.kernels.statistics.between_study_variance import random_effects


@pytest.mark.parametrize(
    ("values", "variances"),
    [([1.0], [1.0]), ([1.0, np.nan], [1.0, 1.0]), ([1.0, 2.0], [1.0, 0.0]), ([1.0, 2.0], [1.0])],
)
def test_what_cannot_be_pooled_is_refused(values: list[float], variances: list[float]) -> None:
    with pytest.raises(ValueError, match="expected"):
        random_effects(np.array(values), np.array(variances))


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
