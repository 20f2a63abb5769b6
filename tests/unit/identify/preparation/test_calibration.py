"""Calibrations of several recordings in one cell, against errors drawn one by one."""

import numpy as np
import pytest

from jointz.core.study import Calibrated, CalibrationSpec
from jointz.identify.preparation.calibration import joint_angle, pooled_calibration, twist_sd


def of(**entries):
    return CalibrationSpec(**{n: Calibrated(value=v, sd=s) for n, (v, s) in entries.items()})


def test_one_calibration_of_all_pulses_stays_as_it_is():
    own = of(angle_lag_s=(0.0065, 0.0005), torque_gain=(1.1, 0.02), intrinsic_inertia=(0.1, 0.01))
    assert pooled_calibration([own, own.model_copy(), own]) == own
    assert pooled_calibration([CalibrationSpec()] * 2) == CalibrationSpec()


def test_every_recording_counts_by_its_pulses_whatever_their_order():
    a, b = of(intrinsic_stiffness=(10.0, 2.0)), of(intrinsic_stiffness=(20.0, 1.0))
    found = pooled_calibration([a, b, b, b]).intrinsic_stiffness
    assert found.value == pytest.approx(17.5)
    assert found.sd == pytest.approx(np.hypot(0.25 * 2.0, 0.75 * 1.0))
    assert pooled_calibration([b, a, b, b]).intrinsic_stiffness == found


def test_equal_entries_share_their_error_and_a_missing_one_is_perfect():
    lag, other = of(angle_lag_s=(0.006, 1e-3)), of(angle_lag_s=(0.009, 1e-3))
    shared = pooled_calibration([lag, lag, other]).angle_lag_s
    assert shared.sd == pytest.approx(1e-3 * np.hypot(2 / 3, 1 / 3))
    half = pooled_calibration([lag, CalibrationSpec()])
    assert (half.angle_lag_s.value, half.angle_lag_s.sd) == pytest.approx((0.003, 0.5e-3))
    gain = pooled_calibration([of(torque_gain=(1.2, 0.1)), CalibrationSpec()]).torque_gain
    assert gain.value == pytest.approx(1.1)


def test_the_relative_error_of_gains_is_that_of_the_mean_of_errors_drawn():
    rng = np.random.default_rng(0)
    gains = [(0.8, 0.04), (1.0, 0.01), (2.0, 0.06)]
    shares = np.array([0.5, 0.25, 0.25])
    relative = np.array([sd / value for value, sd in gains])
    drawn = rng.standard_normal((100_000, 3)) * relative * shares
    pulses = [of(torque_gain=g) for g in (gains[0], gains[0], gains[1], gains[2])]

    found = pooled_calibration(pulses).torque_gain

    assert found.sd / found.value == pytest.approx(drawn.sum(axis=1).std(), rel=0.01)


def test_the_joints_angle_is_without_what_torque_showed_and_without_the_gain():
    rng = np.random.default_rng(0)
    angle, torque = rng.standard_normal((2, 50))
    shown = 1.04 * angle + 5e-4 * torque  # of the mount: not seen through the sensor's gain
    known = of(angle_gain=(1.04, 0.02), angle_per_torque=(5e-4, 3e-5), torque_gain=(0.9, 0.0))

    assert joint_angle(shown, 0.9 * torque, known) == pytest.approx(angle, abs=1e-12)
    assert twist_sd(known) == pytest.approx(3e-5 / 1.04)
    assert joint_angle(shown, torque, CalibrationSpec()) is shown
    assert twist_sd(CalibrationSpec()) == 0.0


def test_twist_and_zero_err_as_other_entries_do_and_levels_are_not_averaged():
    levels = {"contact_threshold_v": (2.0, 0.1), "contact_release_v": (1.0, 0.1)}
    told = of(angle_per_torque=(4e-4, 2e-5), angle_zero_rad=(0.1, 0.01), tissue_hz=(25.0, 2.0))
    other = of(angle_per_torque=(6e-4, 2e-5), **levels)

    found = pooled_calibration([told, other])

    assert found.angle_per_torque.value == pytest.approx(5e-4)
    assert found.angle_per_torque.sd == pytest.approx(2e-5 / np.sqrt(2.0))
    assert found.angle_zero_rad.sd == pytest.approx(0.005)
    assert found.contact_levels_v is found.tissue_hz is None
    assert pooled_calibration([other, other]) == other
