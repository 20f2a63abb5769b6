"""What a lag alone does to a regression of torque on angle."""

import numpy as np
import pytest
from scipy.signal import lsim

from jointz.analysis.page.method_differences import fit_with_lag
from jointz.kernels.derivatives import derivative
from jointz.kernels.filtering import lowpass_zero_phase
from jointz.results.estimates import Response

JOINT = (50.0, 1.5, 0.05)
TIME = np.arange(131) * 1e-3
TORQUE = 17.0 * np.clip(TIME / 0.075, 0.0, 1.0)
PULSE = Response(TIME, np.zeros_like(TIME), TORQUE, TORQUE)


def read(lag_s, *, pulse=PULSE, joint=JOINT, cutoff_hz=20.0):
    return fit_with_lag(pulse, joint, lag_s=lag_s, cutoff_hz=cutoff_hz, window_s=0.1)


def test_without_a_lag_the_joint_is_read_as_it_is():
    # The differences over 1 ms leave two tenths of a percent.
    np.testing.assert_allclose(read(0.0), JOINT, rtol=3e-3)


def test_a_late_angle_raises_inertia_and_an_early_one_lowers_it():
    late, early = read(0.005)[2], read(-0.005)[2]
    assert early < JOINT[2] < late


def test_a_small_lag_on_slow_motion_reads_as_damping_of_stiffness_times_lag():
    # B + K T and J + B T to first order, where the motion is too slow for a third derivative.
    slow = Response(TIME, np.zeros_like(TIME), 1.0 - np.cos(np.pi * TIME / 0.13), TIME)
    k, b, j = read(0.0005, pulse=slow, joint=(50.0, 3.0, 0.002), cutoff_hz=100.0)
    assert k == pytest.approx(50.0, rel=0.01)
    assert b - 3.0 == pytest.approx(50.0 * 0.0005, rel=0.25)
    assert j > 0.002


def test_no_value_is_below_zero():
    assert min(read(0.015)) == 0.0


def test_the_low_pass_is_that_of_the_estimators():
    late_s, cutoff_hz = 0.005, 10.0
    time = np.arange(-600, 800) * 1e-3
    torque = np.interp(time, TIME, TORQUE, left=0.0)
    _, angle, _ = lsim(([1.0], JOINT[::-1]), torque, time - time[0])
    seen = np.interp(time - late_s, time, angle, left=0.0)
    angle, torque = (
        lowpass_zero_phase(x, cutoff_hz=cutoff_hz, rate_hz=1e3) for x in (seen, torque)
    )
    velocity = derivative(angle, rate_hz=1e3)
    motion = np.stack([angle, velocity, derivative(velocity, rate_hz=1e3)], axis=1)[600:701]
    expected = np.linalg.lstsq(motion, torque[600:701], rcond=None)[0]
    # That of half the order reads a J one percent larger.
    np.testing.assert_allclose(read(late_s, cutoff_hz=cutoff_hz), expected, rtol=4e-3)
