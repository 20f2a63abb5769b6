"""Bounded least squares: scipy's solvers, a slow bootstrap, degenerate systems, properties."""

from itertools import product

import hypothesis.strategies as st
import numpy as np
import pytest
from hypothesis import given, settings
from scipy.optimize import lsq_linear

from jointz.kernels import bounded_lsq
from jointz.kernels.bounded_lsq import (
    bootstrap_fits,
    condition_numbers,
    least_squares,
    nonnegative_least_squares,
    normal_equations,
)
from jointz.kernels.resampling import resample_weights

PARAMETERS = np.array([100.0, 1.0, 0.02])  # N*m/rad, N*m*s/rad, kg*m^2
AMPLITUDES = np.array([0.1, 3.0, 100.0])  # rad, rad/s, rad/s^2


def motions(n_problems, n_samples, rng):
    """Angle, velocity and acceleration of the same smooth random motion, as sizes in a pulse."""
    time = np.linspace(0.0, 0.1, n_samples)
    omega = 2 * np.pi * rng.uniform(3.0, 15.0, size=(n_problems, 3, 1))
    phase = rng.uniform(0.0, 2 * np.pi, size=(n_problems, 3, 1))
    angle = np.sin(omega * time + phase).sum(axis=1)
    velocity = (omega * np.cos(omega * time + phase)).sum(axis=1)
    acceleration = (-(omega**2) * np.sin(omega * time + phase)).sum(axis=1)
    columns = np.stack([angle, velocity, acceleration], axis=1)
    return columns * (AMPLITUDES[:, None] / np.abs(columns).max(axis=2, keepdims=True))


def problems_of_all_signs(n_each, rng):
    """Problems whose true K, B, J take every combination of signs."""
    signs = np.array(list(product([1.0, -1.0], repeat=3))).repeat(n_each, axis=0)
    motion = motions(len(signs), 100, rng)
    # In every other problem the columns are independent: smooth motion rarely holds K and J.
    motion[::2] = rng.normal(size=motion[::2].shape) * AMPLITUDES[:, None]
    parameters = signs * PARAMETERS * rng.uniform(0.2, 2.0, size=signs.shape)
    torque = np.einsum("rc,rct->rt", parameters, motion)
    torque += rng.normal(scale=0.5, size=torque.shape)
    return np.concatenate([motion, torque[:, None]], axis=1)


def contributions(solution, averages):
    """Parameters in N*m: each times the length of its column, so that all weigh alike."""
    return solution * np.linalg.norm(averages[:, :3], axis=2)


def bits(active):
    return (np.asarray(active)[:, None] >> np.arange(3)) & 1


@pytest.fixture(scope="module")
def problems():
    return problems_of_all_signs(40, np.random.default_rng(11))


def test_every_active_set_agrees_with_bvls_to_1e_9(problems):
    gram, moment, _ = normal_equations(problems)
    solution, active = nonnegative_least_squares(gram, moment)
    fits = [lsq_linear(p[:3].T, p[3], bounds=(0, np.inf), method="bvls") for p in problems]
    expected = contributions(np.array([fit.x for fit in fits]), problems)
    error = np.abs(contributions(solution, problems) - expected).max(axis=1)
    assert (error <= 1e-9 * expected.max(axis=1)).all()
    np.testing.assert_array_equal(bits(active), [fit.active_mask == -1 for fit in fits])
    assert (np.bincount(active, minlength=8) >= 10).all()


def test_condition_numbers_are_those_of_the_columns_at_unit_length(problems):
    gram, _, _ = normal_equations(problems)
    columns = problems[:, :3] / np.linalg.norm(problems[:, :3], axis=2, keepdims=True)
    expected = np.array([np.linalg.cond(c.T) for c in columns])
    np.testing.assert_allclose(condition_numbers(gram), expected, rtol=1e-9)


def singular_grams():
    rng = np.random.default_rng(2)
    columns = rng.normal(size=(5, 3, 20))
    columns[0, 1] = 0.0
    columns[1, 2] = -3.0 * columns[1, 0]
    columns[2, 0] = columns[2, 1] + 2.0 * columns[2, 2]
    columns[3, 1:] = columns[3, 0]
    columns[4] = 0.0
    return columns @ columns.transpose(0, 2, 1)


def test_columns_that_cannot_be_told_apart_give_nan_beside_sound_rows():
    gram = np.concatenate([singular_grams(), np.eye(3)[None]])
    moment = np.tile([1.0, -2.0, 3.0], (6, 1))
    solution, active = nonnegative_least_squares(gram, moment)
    assert np.isnan(solution[:5]).all()
    assert np.isnan(least_squares(gram, moment)[:5]).all()
    np.testing.assert_array_equal(active, [0, 0, 0, 0, 0, 2])
    np.testing.assert_array_equal(solution[5], [1.0, 0.0, 3.0])
    condition = condition_numbers(gram)
    assert (condition[:5] > 1e6).all()
    assert condition[5] == 1.0


def test_a_missing_value_gives_nan_and_not_a_fit():
    gram, moment = np.tile(np.eye(3), (3, 1, 1)), np.ones((3, 3))
    gram[0, 0, 1] = gram[0, 1, 0] = np.nan
    moment[1, 2] = np.nan
    solution, active = nonnegative_least_squares(gram, moment)
    np.testing.assert_array_equal(np.isnan(solution), [[True] * 3, [True] * 3, [False] * 3])
    np.testing.assert_array_equal(active, 0)
    np.testing.assert_array_equal(condition_numbers(gram), [np.nan, 1.0, 1.0])


@given(
    correlations=st.lists(st.floats(-0.49, 0.49), min_size=3, max_size=3),
    moment=st.lists(st.sampled_from([0.0, 1.0, -1.0, 0.25, -1e-17, 1e-17]), min_size=3, max_size=3),
)
@settings(deadline=None, max_examples=300)
def test_the_conditions_of_an_optimum_hold_even_at_ties(correlations, moment):
    p, q, r = correlations
    gram = np.array([[[1.0, p, q], [p, 1.0, r], [q, r, 1.0]]])
    solution, active = nonnegative_least_squares(gram, np.array([moment]))
    gradient = gram[0] @ solution[0] - moment
    assert (solution >= 0.0).all()
    assert (gradient > -1e-13).all()
    assert np.abs(gradient * solution[0]).max() < 1e-13
    assert (solution[0][bits(active)[0] == 1] == 0.0).all()


def naive_bootstrap(weights, trials):
    """Average by loops; of all feasible subsets of parameters keep the least residual."""
    solutions, masks = [], []
    for row in weights:
        average = sum(w * trial for w, trial in zip(row, trials, strict=True))
        X, y = average[:3].T, average[3]
        best = (np.inf, None, None)
        for held in product([False, True], repeat=3):
            free = ~np.array(held)
            b = np.zeros(3)
            if free.any():
                b[free] = np.linalg.lstsq(X[:, free], y, rcond=None)[0]
            cost = ((X @ b - y) ** 2).sum()
            if (b >= 0).all() and cost < best[0]:
                best = (cost, b, held)
        solutions.append(best[1])
        masks.append(best[2])
    return np.array(solutions), np.array(masks)


@pytest.mark.parametrize("n_samples", [60, 10])  # more samples than trials, and fewer
@pytest.mark.parametrize("stiffness", [100.0, -50.0])
def test_bootstrap_fits_equal_the_slow_implementation(stiffness, n_samples, monkeypatch):
    monkeypatch.setattr(bounded_lsq, "BLOCK_ROWS", 16)  # several blocks and a short last one
    rng = np.random.default_rng(12)
    motion = motions(1, n_samples, rng) * rng.uniform(0.8, 1.2, size=(12, 1, 1))
    torque = np.einsum("c,pct->pt", [stiffness, 1.0, 0.02], motion)
    torque += rng.normal(scale=1.0, size=torque.shape)
    trials = np.concatenate([motion, torque[:, None]], axis=1)
    weights = resample_weights(12, 50, rng)
    fits = bootstrap_fits(weights, trials)
    solutions, masks = naive_bootstrap(weights, trials)
    averages = np.einsum("rp,pct->rct", weights, trials)
    error = np.abs(contributions(fits.bounded - solutions, averages))
    assert (error < 1e-9 * np.linalg.norm(averages[:, 3], axis=1)[:, None]).all()
    np.testing.assert_array_equal(bits(fits.active), masks)
    unbounded = np.array([np.linalg.lstsq(a[:3].T, a[3], rcond=None)[0] for a in averages])
    error = np.abs(contributions(fits.unbounded - unbounded, averages))
    assert (error < 1e-9 * np.linalg.norm(averages[:, 3], axis=1)[:, None]).all()


def test_trials_that_cancel_in_their_average_lose_no_digits():
    rng = np.random.default_rng(14)
    sign = np.where(np.arange(50) % 2, 1.0, -1.0)[:, None, None]
    motion = motions(1, 100, rng) * sign * rng.uniform(0.999, 1.001, size=(50, 1, 1))
    torque = np.einsum("c,pct->pt", PARAMETERS, motion)
    trials = np.concatenate([motion, torque[:, None]], axis=1)
    balanced = np.full((1, 50), 1.0 / 50)
    fits = bootstrap_fits(balanced, trials)
    # The average is 1e-4 of a trial: its rounding leaves 1e-12, and four digits less if squared.
    np.testing.assert_allclose(fits.bounded[0], PARAMETERS, rtol=1e-9)


def test_a_trial_with_a_gap_is_refused_by_its_number():
    trials = np.ones((3, 4, 10))
    trials[2, 1, 5] = np.nan
    with pytest.raises(ValueError, match=r"NaN or infinity in trial\(s\) \[2\]"):
        bootstrap_fits(np.ones((1, 3)), trials)
