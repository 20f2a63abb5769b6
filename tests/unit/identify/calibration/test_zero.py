"""The angle shown at the true zero."""

import numpy as np
import pytest

from jointz.core.errors import DataError
from jointz.identify.calibration.zero import fit_zero


def still(make, seed=0, zero=0.04, duration_s=20.0):
    rng = np.random.default_rng([1, seed])
    time = make.clock(duration_s, 500.0, rng)
    return time, zero + make.goniometer_noise(time, rng)


def test_the_mean_of_a_still_record_is_the_zero(make):
    entry = fit_zero(*still(make)).entry("angle_zero_rad")

    assert entry.status == "ok"
    assert abs(entry.value - 0.04) < 3.0 * entry.sd
    assert np.degrees(entry.sd) < 0.05


@pytest.mark.slow
def test_intervals_cover(make):
    def find(seed):
        entry = fit_zero(*still(make, seed)).entry("angle_zero_rad")
        return entry.value, entry.sd, 0.04

    make.check_coverage(find)


def test_a_drift_is_refused(make):
    time, angle = still(make)

    fit = fit_zero(time, angle + np.radians(2.0) * time / time[-1])

    assert fit.status == "failed:drift"
    assert "2 deg" in fit.entries[0].reason


def test_a_joint_that_moved_is_refused(make):
    time, angle = still(make)
    moved = np.where((time > 9.0) & (time < 11.0), np.radians(3.0), 0.0)

    assert fit_zero(time, angle + moved).status == "failed:not_still"


def test_a_record_without_numbers_is_refused(make):
    time, angle = still(make)
    angle[: angle.size // 4] = np.nan

    assert fit_zero(time, angle).status == "failed:not_finite"


def test_a_short_record_is_refused(make):
    assert fit_zero(*still(make, duration_s=0.4)).status == "failed:too_short"


def test_unsorted_time_is_an_error(make):
    time, angle = still(make)

    with pytest.raises(DataError, match="increase"):
        fit_zero(time[::-1], angle)
    with pytest.raises(DataError, match="one length"):
        fit_zero(time, angle[1:])
