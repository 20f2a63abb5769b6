"""Random effects over studies: closed forms, a slow obvious implementation, coverage."""

import numpy as np
import pytest
from scipy.optimize import minimize_scalar
from scipy.special import stdtrit
from scipy.stats import multivariate_normal

from jointz.kernels.statistics.between_study_variance import random_effects
from jointz.kernels.statistics.multivariate_random_effects import multivariate_random_effects


def slow_log_likelihood(values: np.ndarray, covariances: np.ndarray, between: np.ndarray) -> float:
    """Return the restricted likelihood from whole matrices: y ~ N(X mu, V + I x T)."""
    k, p = values.shape
    design = np.tile(np.eye(p), (k, 1))
    total = np.zeros((k * p, k * p))
    for i in range(k):
        total[i * p : (i + 1) * p, i * p : (i + 1) * p] = covariances[i] + between
    held = np.isfinite(values.ravel())
    y, design, total = values.ravel()[held], design[held], total[np.ix_(held, held)]
    information = design.T @ np.linalg.solve(total, design)
    mean = np.linalg.solve(information, design.T @ np.linalg.solve(total, y))
    log_density = multivariate_normal(design @ mean, total).logpdf(y)
    extra = p * np.log(2 * np.pi) - np.linalg.slogdet(information)[1]
    return float(log_density + 0.5 * (extra + np.linalg.slogdet(design.T @ design)[1]))


def test_with_equal_variances_it_is_student_and_the_sample_variance() -> None:
    y, v = np.array([3.0, 5.0, 4.0, 8.0, 1.0, 6.0]), 0.7
    fit = random_effects(y, np.full(6, v))
    se = y.std(ddof=1) / np.sqrt(6)
    assert fit.tau2 == pytest.approx(y.var(ddof=1) - v, rel=1e-12)
    assert fit.se == pytest.approx(se, rel=1e-12)
    assert fit.high - fit.mean == pytest.approx(stdtrit(5, 0.975) * se, rel=1e-12)
    assert fit.weights == pytest.approx(np.full(6, 1 / 6))


def test_tau_maximises_the_restricted_likelihood() -> None:
    rng = np.random.default_rng(4)
    for _ in range(20):
        v = 10 ** rng.uniform(-2, 1, size=6)
        y = 10 + rng.normal(size=6) * np.sqrt(v + 0.5)

        def loss(log_tau2: float, y: np.ndarray = y, v: np.ndarray = v) -> float:
            return -slow_log_likelihood(y[:, None], v[:, None, None], np.exp([[log_tau2]]))

        starts = np.linspace(-12.0, 6.0, 60)
        best = min(starts, key=loss)
        best = minimize_scalar(loss, bounds=(best - 0.4, best + 0.4), method="bounded").fun
        fit = random_effects(y, v)
        assert fit.log_likelihood >= -best - 1e-6
        own = slow_log_likelihood(y[:, None], v[:, None, None], np.array([[fit.tau2]]))
        assert fit.log_likelihood == pytest.approx(own, abs=1e-9)


def test_studies_that_agree_have_no_spread_and_the_modified_interval_is_the_wider_one() -> None:
    y, v = np.array([60.0, 60.1, 59.9, 60.05]), np.array([4.0, 9.0, 1.0, 2.0])
    plain, modified = random_effects(y, v), random_effects(y, v, modified=True)
    assert plain.tau2 == plain.tau2_low == plain.i2_pct == 0.0
    assert plain.scale < 0.01
    assert modified.se == pytest.approx(1.0 / np.sqrt((1.0 / v).sum()))
    assert plain.se < 0.1 * modified.se
    unequal = np.array([0.01, 4.0, 0.01, 9.0])
    for apart in (y + np.array([-20.0, 0.0, 20.0, 40.0]), np.array([60.0, 70.0, 60.5, 85.0])):
        plain, modified = (random_effects(apart, unequal, modified=m) for m in (False, True))
        assert modified.se == pytest.approx(plain.se * np.sqrt(max(1.0, 1.0 / plain.scale)))


@pytest.mark.parametrize("unit", [1e-4, 1.0, 1e5])
def test_a_change_of_unit_and_origin_changes_nothing_else(unit: float) -> None:
    y, v = np.array([62.1, 55.4, 70.8, 48.0]), np.array([12.0, 5.0, 20.0, 9.0])
    one, other = random_effects(y, v), random_effects(unit * (y + 100.0), unit**2 * v)
    assert other.mean / unit - 100.0 == pytest.approx(one.mean, rel=1e-9)
    assert other.se / unit == pytest.approx(one.se, rel=1e-9)
    assert other.tau2_high / unit**2 == pytest.approx(one.tau2_high, rel=1e-8)
    assert other.q == pytest.approx(one.q, rel=1e-9)
    both = multivariate_random_effects(unit * y[:, None], unit**2 * v[:, None, None])
    assert both.mean[0] / unit == pytest.approx(one.mean, rel=1e-8)


def test_the_interval_of_the_spread_is_where_q_is_as_unlikely_as_asked() -> None:
    y, v = np.array([10.0, 12, 17, 11, 9]), np.array([1.0, 2, 0.5, 3, 1])
    fit = random_effects(y, v)
    for tau2, wanted in ((fit.tau2_low, 11.143286781877796), (fit.tau2_high, 0.48441855708792)):
        w = 1.0 / (v + tau2)
        assert w @ (y - w @ y / w.sum()) ** 2 == pytest.approx(wanted, rel=1e-9)


def test_one_outcome_of_the_many_is_the_univariate_fit() -> None:
    y, v = np.array([10.0, 12, 17, 11, 9]), np.array([1.0, 2, 0.5, 3, 1])
    one, many = random_effects(y, v), multivariate_random_effects(y[:, None], v[:, None, None])
    for name in ("mean", "low", "high", "prediction_low", "prediction_high", "df"):
        assert getattr(many, name)[0] == pytest.approx(getattr(one, name), rel=1e-7)
    assert many.between[0, 0] == pytest.approx(one.tau2, rel=1e-7)
    assert (many.q, many.log_likelihood) == pytest.approx((one.q, one.log_likelihood))


def test_outcomes_that_do_not_depend_on_one_another_change_little() -> None:
    rng = np.random.default_rng(7)
    v = rng.uniform(0.5, 2.0, size=(60, 2))
    y = rng.normal(size=(60, 2)) * np.sqrt(v + np.array([3.0, 1.0]))
    y += [60.0, 1.5]
    both = multivariate_random_effects(y, v[:, :, None] * np.eye(2))
    for j in range(2):
        one = random_effects(y[:, j], v[:, j])
        assert both.mean[j] == pytest.approx(one.mean, abs=0.1 * one.se)
        assert both.between[j, j] == pytest.approx(one.tau2, abs=0.1 * one.tau2_se)


def test_the_multivariate_optimum_holds_with_absent_outcomes_and_cannot_be_bettered() -> None:
    rng = np.random.default_rng(5)
    a = rng.normal(size=(9, 3, 5))
    v = a @ a.transpose(0, 2, 1) / 5.0 + 0.1 * np.eye(3)
    y = rng.multivariate_normal([60, 1.5, 0.2], np.diag([2.0, 0.5, 0.3]), size=9)
    y[1, 0] = y[4, 2] = y[5, 1] = y[5, 2] = np.nan
    fit = multivariate_random_effects(y, v)
    best = slow_log_likelihood(y, v, fit.between)
    assert fit.log_likelihood == pytest.approx(best, abs=1e-9)
    root = np.linalg.cholesky(fit.between + 1e-9 * np.eye(3))
    for _ in range(200):
        near = root + 0.05 * rng.normal(size=(3, 3))
        assert slow_log_likelihood(y, v, near @ near.T) <= best + 1e-9
    assert fit.df.tolist() == [7.0, 7.0, 6.0]


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


@pytest.mark.slow
def test_joint_intervals_hold_the_means_as_often_as_they_say() -> None:
    rng = np.random.default_rng(8)
    spread = np.array([[2.0, 0.5, 0.0], [0.5, 1.0, 0.2], [0.0, 0.2, 0.5]])
    n, held = 300, np.zeros(3)
    for _ in range(n):
        a = rng.normal(size=(8, 3, 6))
        v = a @ a.transpose(0, 2, 1) / 6.0
        y = np.array([rng.multivariate_normal(np.zeros(3), one + spread) for one in v])
        fit = multivariate_random_effects(y, v, modified=True)
        held += (fit.low <= 0.0) & (fit.high >= 0.0)
    assert (np.abs(held / n - 0.95) <= 3.0 * np.sqrt(0.95 * 0.05 / n)).all()
