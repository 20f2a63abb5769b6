"""Fits with instruments, and the motion that the current alone would give."""

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from jointz.identify.calibration.spring import Instruments, driven_velocity


def test_a_regressor_that_moves_with_the_error_is_fitted_without_bias():
    scores, by_least_squares = [], []
    for seed in range(40):
        rng = np.random.default_rng([8, seed])
        time = np.arange(3000) * 0.01
        given, error = rng.standard_normal((2, time.size))
        regressor = given + 0.5 * error
        y = 2.0 * regressor + error
        ones = np.ones(time.size)
        columns = np.column_stack([regressor, ones])
        instruments = Instruments(time, y, np.column_stack([given, given**3, ones]))
        instruments.weigh(instruments.fit(columns).residual, fitted=2)
        fit = instruments.fit(columns)
        scores.append((fit.values[0] - 2.0) / instruments.sds(columns)[0])
        by_least_squares.append(np.linalg.lstsq(columns, y, rcond=None)[0][0])

    assert abs(np.mean(scores)) < 3.3 / np.sqrt(40)
    assert 0.75 < np.std(scores) < 1.3
    assert np.mean(by_least_squares) > 2.3


def test_the_driven_motion_is_that_of_the_differential_equation():
    time = np.arange(0.0, 12.0, 0.002)
    drive = 15.0 * np.sin(2.0 * np.pi * 0.1 * time)
    hold = np.full(time.size, 1.2)

    found = driven_velocity(time, drive, hold, stiffness=60.0, smooth_rad_s=0.05)

    def slope(t, angle):
        share = (15.0 * np.sin(2.0 * np.pi * 0.1 * t) - 60.0 * angle) / 1.2
        return 0.05 * np.arctanh(np.clip(share, -1.0 + 1e-12, 1.0 - 1e-12))

    exact = solve_ivp(slope, (0.0, 12.0), [0.0], "LSODA", t_eval=time, rtol=1e-8, max_step=0.01)
    velocity = slope(time, exact.y[0])
    assert np.std(found - velocity) < 0.02 * np.std(velocity)
    assert np.std(velocity) == pytest.approx(15.0 / 60.0 * 0.2 * np.pi / np.sqrt(2.0), rel=0.1)
