"""Unperturbed windows: which strides serve, and their weights under resampling."""

import numpy as np
import pytest

from jointz.identify.preparation.baselines import (
    MATCH_S,
    N_MATCHES,
    Baseline,
    StridePool,
    matched_strides,
    pre_pulse,
    unperturbed_mean,
)
from jointz.identify.preparation.conditioning import Conditioned, Stretch

RATE_HZ = 100.0
NONE = np.empty(0)


def conditioned(n=3000, *, seed=0, start_s=0.0) -> Conditioned:
    signals = np.random.default_rng(seed).standard_normal((4, n))
    time = start_s + np.arange(n) / RATE_HZ
    return Conditioned(
        (Stretch(time, signals),), RATE_HZ, 0.05, float(time[0]), float(time[-1]), np.empty((0, 2))
    )


def test_weights_follow_the_draws_and_sum_to_one():
    sources = np.array([[0, 1, 2], [2, 3, 3]])
    valid = np.array([[True, True, False], [True, True, False]])
    baseline = Baseline(np.zeros((2, 3, 4, 5)), sources, valid)

    weights = baseline.weights(np.array([[3.0, 1.0, 0.0, 0.0], [0.0, 0.0, 1.0, 3.0]]))

    np.testing.assert_allclose(weights[0, 0], [0.75, 0.25, 0])
    np.testing.assert_allclose(weights[1, 1], [0.25, 0.75, 0])
    np.testing.assert_allclose(weights.sum(axis=2), 1.0)


def test_a_draw_without_any_of_a_pulses_strides_falls_back_to_all_of_them():
    baseline = Baseline(
        np.zeros((1, 3, 4, 5)), np.array([[0, 1, 2]]), np.array([[True, True, False]])
    )

    weights = baseline.weights(np.array([[0.0, 0.0, 7.0]]))

    np.testing.assert_allclose(weights[0, 0], [0.5, 0.5, 0.0])


def test_a_pulse_without_a_window_has_a_code_and_zero_weights():
    baseline = Baseline(np.zeros((1, 2, 4, 2)), np.array([[0, 1]]), np.zeros((1, 2), bool))

    assert baseline.codes == ["no_baseline"]
    np.testing.assert_array_equal(baseline.weights(np.ones((3, 2))), 0.0)


def test_before_the_pulse_all_four_signals_lose_their_own_level():
    before = np.random.default_rng(0).standard_normal((3, 4, 50))
    before[1] = np.nan
    baseline = pre_pulse(before, n_samples=20)

    assert not baseline.has_strides
    assert baseline.codes == ["", "no_baseline", ""]
    np.testing.assert_allclose(
        baseline.mean()[0], np.repeat(before[0].mean(axis=1)[:, None], 20, axis=1)
    )


def test_the_unperturbed_mean_takes_every_stride_at_the_same_time_since_its_strike():
    first, second = conditioned(seed=1), conditioned(seed=2, start_s=7.0)
    starts = (np.array([2.0, 3.1, 4.2]), np.array([9.0, 29.9 + 7.0]))
    pool = StridePool((first, second), starts, (NONE, NONE))

    baseline = unperturbed_mean(pool, [0.3, 0.5], window_s=0.1)

    assert pool.size == 5
    assert baseline.valid[:, :4].all()
    assert not baseline.valid[:, 4].any()  # past the end of the record
    np.testing.assert_array_equal(baseline.windows[1, 2], first.stretches[0].signals[:, 470:480])
    np.testing.assert_array_equal(baseline.windows[0, 3], second.stretches[0].signals[:, 230:240])


def test_a_window_that_reaches_into_a_pulse_of_the_next_stride_does_not_serve():
    pool = StridePool((conditioned(),), (np.array([2.0, 3.0, 4.0]),), (np.array([4.01]),))

    baseline = unperturbed_mean(pool, [0.2, 0.95], window_s=0.1)

    np.testing.assert_array_equal(baseline.valid, [[True, True, False], [True, False, False]])


def smooth(n=6000) -> Conditioned:
    """Strides of 1 s whose angle has a level of its own: a sawtooth of levels."""
    time = np.arange(n) / RATE_HZ
    stride = np.floor(time + 1e-9)
    angle = np.mod(stride * 7.0, 60.0) + np.sin(2 * np.pi * time)
    signals = np.vstack([angle, np.zeros((2, n)), stride])
    return Conditioned(
        (Stretch(time, signals),), RATE_HZ, 0.05, 0.0, float(time[-1]), np.empty((0, 2))
    )


def test_the_strides_most_alike_before_the_onset_are_matched():
    record = smooth()
    starts = np.arange(2.0, 58.0)
    pool = StridePool((record,), (starts,), (NONE,))
    onset = 30.4
    before, _ = record.cut(np.array([onset]), before_s=MATCH_S, after_s=0.0)

    baseline = matched_strides(pool, np.array([onset]), [0.4], before[:, 0], window_s=0.1)

    assert baseline.valid.all()
    assert baseline.valid.shape == (1, N_MATCHES)
    # Torque holds the number of the stride.
    chosen = baseline.windows[0, :, 3, 0]
    np.testing.assert_array_equal(chosen, starts[baseline.sources[0]])
    apart = np.abs(np.mod(7.0 * starts, 60.0) - np.mod(7.0 * 30.0, 60.0))
    assert set(chosen) == set(starts[np.argsort(apart)[:N_MATCHES]])


def test_fewer_than_three_matches_are_no_baseline():
    record = smooth()
    before, _ = record.cut(np.array([30.4]), before_s=MATCH_S, after_s=0.0)
    onset = np.array([30.4])
    for starts, expected in (([2.0, 3.0], False), ([2.0, 3.0, 4.0], True)):
        pool = StridePool((record,), (np.array(starts),), (NONE,))
        found = matched_strides(pool, onset, [0.4], before[:, 0], window_s=0.1)
        assert bool(found.valid.any()) is expected


def test_a_stride_whose_window_meets_the_next_pulse_is_never_matched():
    record = smooth()
    starts = np.arange(2.0, 8.0)
    onset = np.array([20.95])
    before, _ = record.cut(onset, before_s=MATCH_S, after_s=0.0)
    pool = StridePool((record,), (starts,), (np.array([5.01, 8.01]),))

    found = matched_strides(pool, onset, [0.95], before[:, 0], window_s=0.1)

    # From 4 and from 5 s the pulse at 5.01 s is met, from 7 s the one at 8.01 s.
    assert set(starts[found.sources[found.valid]]) == {2.0, 3.0, 6.0}


@pytest.mark.parametrize("where", [1.0, 59.95])
def test_strides_at_the_edge_of_the_record_are_not_valid(where):
    pool = StridePool((smooth(),), (np.array([where]),), (NONE,))
    _, valid = pool.windows([0.9 if where < 2 else 0.0], window_s=0.1)
    assert bool(valid[0, 0]) is (where < 2)
