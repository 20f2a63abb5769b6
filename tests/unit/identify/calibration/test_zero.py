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


def test_unsorted_time_is_an_error(make):
    time, angle = still(make)

    with pytest.raises(DataError, match="increase"):
        fit_zero(time[::-1], angle)
    with pytest.raises(DataError, match="one length"):
        fit_zero(time, angle[1:])


@pytest.mark.parametrize(
    ("moved", "code"),
    [
        (lambda time: np.radians(2.0) * time / time[-1], "drift"),
        (lambda time: np.radians(3.0) * (abs(time - 10.0) < 1.0), "not_still"),
        (lambda time: np.where(time < 5.0, np.nan, 0.0), "not_finite"),
    ],
)
def test_a_record_of_no_rest_is_refused(make, moved, code):
    time, angle = still(make)

    assert fit_zero(time, angle + moved(time)).status == f"failed:{code}"


def test_a_short_record_is_refused(make):
    assert fit_zero(*still(make, duration_s=4.0)).status == "failed:too_short"
