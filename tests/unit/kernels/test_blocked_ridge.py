"""Ridge regression of many targets, validated on blocks left out."""

import numpy as np
import pytest

from jointz.kernels.blocked_ridge import fit_blocked_ridge

N, FEATURES, TARGETS = 90, 4, 3


@pytest.fixture(scope="module")
def rows() -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    rng = np.random.default_rng(5)
    features = rng.standard_normal((N, FEATURES)) * [1.0, 10.0, 0.1, 3.0] + [0.0, 5.0, -2.0, 1.0]
    slopes = rng.standard_normal((FEATURES, TARGETS))
    targets = features @ slopes + 7.0 + 0.3 * rng.standard_normal((N, TARGETS))
    return features, targets, np.arange(N) // 9


def slow_fit(features: np.ndarray, targets: np.ndarray, strength: float) -> np.ndarray:
    """Least squares on rows stacked with those of the penalty; the constant is free."""
    design = np.column_stack([np.ones(len(features)), features])
    penalty = np.sqrt(strength) * np.eye(design.shape[1])
    penalty[0] = 0.0
    stacked = np.vstack([design, penalty])
    padded = np.vstack([targets, np.zeros((design.shape[1], targets.shape[1]))])
    return np.asarray(np.linalg.lstsq(stacked, padded, rcond=None)[0])


def slow_left_out(
    features: np.ndarray, targets: np.ndarray, blocks: np.ndarray, penalty: float
) -> np.ndarray:
    out = np.empty_like(targets)
    scaled = (features - features.mean(axis=0)) / features.std(axis=0)
    for name in np.unique(blocks):
        held = blocks == name
        found = slow_fit(scaled[~held], targets[~held], penalty * len(features))
        out[held] = targets[held] - np.column_stack([np.ones(held.sum()), scaled[held]]) @ found
    return out


@pytest.mark.parametrize("penalty", [1e-6, 10.0])
def test_fit_and_left_out_errors_are_those_of_stacked_least_squares(rows, penalty):
    features, targets, blocks = rows
    fit = fit_blocked_ridge(features, targets, blocks, penalties=(penalty,))
    scaled = (features - features.mean(axis=0)) / features.std(axis=0)
    assert np.allclose(fit.coefficients, slow_fit(scaled, targets, penalty * N), atol=1e-9)
    assert np.allclose(fit.left_out, slow_left_out(features, targets, blocks, penalty), atol=1e-9)


def test_penalty_is_the_one_with_the_smallest_median_error_left_out(rows):
    features, targets, blocks = rows
    penalties = (1e-6, 1e-3, 1e-1, 10.0)
    noisy = targets + 30.0 * np.random.default_rng(1).standard_normal(targets.shape)
    fit = fit_blocked_ridge(features, noisy, blocks, penalties=penalties)
    scores = [
        np.median((slow_left_out(features, noisy, blocks, p) ** 2).mean(axis=1)) for p in penalties
    ]
    assert fit.penalty == penalties[int(np.argmin(scores))]
    assert fit.penalty > 1e-6


def test_penalty_is_judged_by_the_targets_asked_for(rows):
    features, targets, blocks = rows
    noise = np.random.default_rng(2).standard_normal((N, 1))
    both = np.hstack([targets[:, :1], noise])
    penalties = [
        fit_blocked_ridge(features, both, blocks, penalties=(1e-6, 100.0), judged=judged).penalty
        for judged in (slice(0, 1), slice(1, 2))
    ]
    assert penalties == [1e-6, 100.0]


def test_a_feature_that_stands_still_changes_nothing(rows):
    features, targets, blocks = rows
    still = np.column_stack([features, np.full(N, 3.0)])
    plain = fit_blocked_ridge(features, targets, blocks, penalties=(1e-4,))
    fit = fit_blocked_ridge(still, targets, blocks, penalties=(1e-4,))
    assert np.allclose(fit.predict(still), plain.predict(features), atol=1e-9)
    assert np.isfinite(fit.left_out).all()


@pytest.mark.parametrize(
    ("features", "targets", "blocks"),
    [
        (np.zeros((4, 1)), np.zeros((3, 1)), np.arange(4)),
        (np.zeros((4, 1)), np.zeros((4, 1)), np.arange(3)),
        (np.zeros((4, 1)), np.zeros((4, 1)), np.zeros(4)),
    ],
)
def test_rows_that_do_not_fit_together_are_refused(features, targets, blocks):
    with pytest.raises(ValueError, match="as many targets and blocks"):
        fit_blocked_ridge(features, targets, blocks)
