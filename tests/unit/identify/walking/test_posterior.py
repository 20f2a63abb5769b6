"""Intervals of the method on legs drawn from its own priors."""

from dataclasses import replace

import numpy as np
import pytest
from tests.unit.identify.walking.prior_draws import (
    DOUBLET,
    PHASES,
    PULSES,
    simulated_person,
    standardised_errors,
)

from jointz.core.study import Calibrated, CalibrationSpec
from jointz.identify.walking.checks import differs_with_size
from jointz.identify.walking.coupling import STRAP
from jointz.identify.walking.instruments import lags_of_instruments
from jointz.identify.walking.posterior import explain

STUDIES = {
    "doublet": {"shapes": (DOUBLET,), "n_pulses": 30, "window_s": 0.2},
    "two sizes and signs": {"shapes": PULSES, "n_pulses": 8, "window_s": 0.15},
}
FEW = ("LRE", "TST", "MSW")
THREE_SENSORS = {
    "shapes": (DOUBLET, tuple((0.7 * a, 0.6 * s) for a, s in DOUBLET)),
    "n_pulses": 12,
    "window_s": 0.15,
    "sensors": ("joint_encoder", "joint_velocity"),
}


@pytest.mark.parametrize("study", [STUDIES["doublet"], THREE_SENSORS | {"labels": FEW}])
def test_a_leg_from_the_priors_lies_within_its_intervals(study):
    errors = standardised_errors(0, **study)

    assert np.abs(errors).max() < 4.0
    assert 0.3 < np.sqrt((errors[:3] ** 2).mean()) < 2.0


@pytest.mark.parametrize(
    ("given", "differs", "seed", "labels"),
    [
        (1.0, False, 4, FEW),
        (0.4, True, 4, FEW),
        pytest.param(0.6, True, 2, tuple(PHASES), marks=pytest.mark.slow),
    ],
)
def test_large_pulses_that_were_not_given_in_full_are_noticed(given, differs, seed, labels):
    model, priors, _ = simulated_person(seed, **STUDIES["two sizes and signs"], labels=labels)
    points = [
        replace(
            point,
            shapes=tuple(
                replace(s, sensor_signals=given * s.sensor_signals)
                if np.abs(s.torque).max() > 9.0
                else s
                for s in point.shapes
            ),
        )
        for point in model.points
    ]

    assert (
        differs_with_size(explain(model.with_points(points), priors, STRAP.hypotheses[2:3]))
        is differs
    )


def test_a_calibrated_lag_binds_the_sum_of_delay_and_first_order_lag():
    model, priors, _ = simulated_person(3, **THREE_SENSORS, labels=FEW)
    free = explain(model, priors, STRAP.hypotheses[2:3]).lag_moments()
    stated = Calibrated(value=free[0] + 5e-4, sd=1e-5)
    bound = explain(model, replace(priors, lag=stated), STRAP.hypotheses[2:3])

    # With the model's error of 1 ms, about the precision-weighted mean of fit and calibration.
    share = free[1] ** 2 / (free[1] ** 2 + 1e-6)
    assert bound.lag_moments()[0] == pytest.approx(free[0] + share * 5e-4, abs=5e-5)
    assert bound.lag_moments()[1] < 1.05 * free[1]
    (lag, *_) = lags_of_instruments(bound, CalibrationSpec(angle_lag_s=stated))
    assert lag.value == pytest.approx(stated.value, abs=1e-6)
    assert lag.ci_high - lag.ci_low == pytest.approx(2 * 1.96e-5, rel=0.02)


def test_the_normal_of_a_prior_with_a_lag_is_that_of_its_misfit():
    model, priors, _ = simulated_person(3, **STUDIES["doublet"], labels=FEW)
    lag = Calibrated(value=0.008, sd=0.002)
    prior = replace(priors, lag=lag).build(model, STRAP.hypotheses[2])
    theta = prior.mean + 0.1 * np.sin(np.arange(prior.mean.size))
    step = 1e-5 * np.eye(theta.size)

    slope = [(prior.misfit(theta + s) - prior.misfit(theta - s)) / 2e-5 for s in step]
    np.testing.assert_allclose(prior.normal(theta)[1], -0.5 * np.array(slope), rtol=1e-4, atol=1e-4)


@pytest.mark.slow
@pytest.mark.timeout(1500)
@pytest.mark.parametrize("study", [*STUDIES.values(), THREE_SENSORS])
def test_intervals_of_48_legs_include_the_truth(study):
    errors = np.array([standardised_errors(seed, **study) for seed in range(48)])

    inside = (np.abs(errors[:, :3]) < 1.96).mean(axis=(0, 2))  # K, B, J
    # Errors of J are alike at all points of a leg: of 48 legs, 0.95 is known to 0.03 (sd).
    assert np.all((inside > [0.92, 0.88, 0.85]) & (inside < 0.995)), inside
