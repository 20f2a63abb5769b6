"""Angle shown per torque on a joint that is locked."""

import numpy as np
import pytest

from jointz.core.study import Calibrated
from jointz.identify.calibration.torsion import fit_torsion

TORSION = np.radians(0.5) / 17.0


def locked(make, seed=0, torsion=TORSION, motion=0.0, gain=1.0):
    rng = np.random.default_rng([4, seed])
    time = make.clock(60.0, 500.0, rng)
    torque = 12.0 * np.sin(2.0 * np.pi * 0.1 * time)
    encoder = motion * torque
    angle = 0.35 + torsion * torque + encoder + make.goniometer_noise(time, rng)
    return time, angle, gain * torque, encoder


def test_the_torsion_comes_back(make):
    time, angle, torque, encoder = locked(make, gain=1.02)
    known = Calibrated(value=1.02, sd=0.01)

    fit = fit_torsion(time, angle, torque, motor_angle=encoder, torque_gain=known)

    entry = fit.entry("angle_per_torque")
    assert entry.status == "ok"
    assert abs(entry.value - TORSION) < 3.0 * entry.sd
    assert entry.uncertainty["torque_gain"] == pytest.approx(0.01 / 1.02 * entry.value)


@pytest.mark.slow
def test_intervals_cover(make):
    def find(seed):
        time, angle, torque, encoder = locked(make, seed)
        entry = fit_torsion(time, angle, torque, motor_angle=encoder).entry("angle_per_torque")
        return entry.value, entry.sd, TORSION

    make.check_coverage(find)


def test_what_the_joint_moved_is_in_the_sd(make):
    time, angle, torque, encoder = locked(make, motion=0.3 * TORSION)

    entry = fit_torsion(time, angle, torque, motor_angle=encoder).entry("angle_per_torque")

    assert entry.uncertainty["joint_motion"] == pytest.approx(0.3 * TORSION / np.sqrt(12.0))
    assert abs(entry.value - TORSION) < 1.96 * entry.sd


@pytest.mark.parametrize("motion", [0.0, 1.0])
def test_where_a_strap_gives_way_too_the_sd_says_what_the_joint_may_have_moved(make, motion):
    """Of what the angle shows, torsion may be all or nothing; the encoder cannot tell."""
    time, angle, torque, _ = locked(make, torsion=(1.0 - motion) * TORSION, motion=motion * TORSION)

    fit = fit_torsion(time, angle, torque, motor_angle=5.0 * TORSION * torque)

    entry = fit.entry("angle_per_torque")
    assert entry.status == "ok"
    assert entry.uncertainty["joint_motion"] == pytest.approx(TORSION / np.sqrt(12.0), rel=0.15)
    assert abs(entry.value - (1.0 - motion) * TORSION) < 1.96 * entry.sd


def test_torque_one_way_or_none_and_a_joint_that_moved_back_are_refused(make):
    time, angle, torque, _ = locked(make)

    against = fit_torsion(time, angle, torque, motor_angle=-5.0 * TORSION * torque)
    assert against.status == "failed:joint_moved"
    assert fit_torsion(time, angle, np.abs(torque)).status == "failed:one_direction"
    assert fit_torsion(time, angle, 0.01 * torque).status == "failed:no_torque"
