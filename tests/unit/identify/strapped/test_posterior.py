"""Intervals of the method on legs drawn from its own priors."""

from dataclasses import replace

import numpy as np
import pytest
from tests.unit.identify.strapped.prior_draws import (
    DOUBLET,
    PHASES,
    PULSES,
    simulated_person,
    standardised_errors,
)

from jointz.identify.strapped.checks import differs_with_size
from jointz.identify.strapped.posterior import explain

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
                replace(s, shown=given * s.shown) if np.abs(s.torque).max() > 9.0 else s
                for s in point.shapes
            ),
        )
        for point in model.points
    ]

    assert differs_with_size(explain(model.with_points(points), priors, (0.0,))) is differs


@pytest.mark.slow
@pytest.mark.timeout(1500)
@pytest.mark.parametrize("study", [*STUDIES.values(), THREE_SENSORS])
def test_errors_of_24_legs_are_as_large_as_their_sds_say(study):
    errors = np.array([standardised_errors(seed, **study) for seed in range(24)])

    sds = errors[:, :3].std(axis=(0, 2))  # K, B, J
    # Errors of J are alike at all points of a leg: of 24 legs their sd is known to 1 / sqrt(48).
    assert np.all((sds > [0.8, 0.8, 0.7]) & (sds < [1.25, 1.25, 1.3])), sds
