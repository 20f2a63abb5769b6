"""Lag and gain of a goniometer on a rigid hinge."""

import numpy as np
import pytest
from scipy.signal import cont2discrete, lfilter

from jointz.identify.calibration.hinge import fit_hinge

DELAY_S, FILTER_S, GAIN = 0.002, 0.006, 1.03


def swing(
    make, seed=0, size_deg=20.0, speed=1.0, delay_s=DELAY_S, filter_s=FILTER_S, length_s=60.0
):
    """A chirp by hand, its exact lagged copy by scipy on a fine clock, read at jittered times."""
    rng = np.random.default_rng([3, seed])
    time = make.clock(length_s, 500.0, rng)
    fine = np.arange(0.0, length_s + 1.0, 2e-4)
    rate = 0.5 * 6.0 ** (0.5 - 0.5 * np.cos(2.0 * np.pi * fine / 20.0))
    turns = speed * np.cumsum(rate) * 2e-4 + rng.random()
    path = np.radians(size_deg) * (np.sin(2 * np.pi * turns) + 0.05 * np.sin(4 * np.pi * turns))
    shown = path
    if filter_s > 0.0:
        exact = cont2discrete(([1.0], [filter_s, 1.0]), 2e-4, method="foh")
        shown = path[0] + lfilter(np.ravel(exact[0]), exact[1], path - path[0])
    angle = 0.1 + GAIN * np.interp(time - delay_s, fine, shown) + make.goniometer_noise(time, rng)
    step = 2.0 * np.pi / (9 * 16384)
    encoder = np.round(np.interp(time, fine, path) / step) * step
    return time, angle, encoder


def test_lag_and_gain_come_back(make):
    fit = fit_hinge(*swing(make))

    lag, gain = fit.entry("angle_lag_s"), fit.entry("angle_gain")
    assert fit.status == "ok"
    assert abs(lag.value - 0.008) < 3.0 * lag.sd
    assert lag.sd < 1e-4
    assert abs(gain.value - GAIN) < 3.0 * gain.sd
    assert gain.sd < 0.005


@pytest.mark.parametrize(("delay_s", "filter_s"), [(0.008, 0.0), (0.0, 0.020)])
def test_the_total_lag_does_not_depend_on_its_kind(make, delay_s, filter_s):
    lag = fit_hinge(*swing(make, delay_s=delay_s, filter_s=filter_s)).entry("angle_lag_s")

    assert abs(lag.value - delay_s - filter_s) < 3.0 * lag.sd


@pytest.mark.slow
@pytest.mark.parametrize(("delay_s", "filter_s"), [(DELAY_S, FILTER_S), (DELAY_S, 0.018)])
@pytest.mark.parametrize("name", ["angle_lag_s", "angle_gain"])
def test_intervals_cover(make, name, delay_s, filter_s):
    def find(seed):
        entry = fit_hinge(*swing(make, seed, delay_s=delay_s, filter_s=filter_s)).entry(name)
        return entry.value, entry.sd, GAIN if name == "angle_gain" else delay_s + filter_s

    make.check_coverage(find, seeds=60)


def test_a_slow_small_swing_decides_nothing(make):
    fit = fit_hinge(*swing(make, size_deg=2.5, speed=0.15))

    assert fit.entry("angle_lag_s").status == "undecided"


@pytest.fixture(scope="module")
def short(make):
    return swing(make, length_s=20.0)


def clipped(angle):
    return np.minimum(angle, angle.min() + 0.75 * np.ptp(angle))


def played(time, encoder):
    return np.radians(1.0) * np.sign(np.gradient(encoder, time))


@pytest.mark.parametrize(
    ("spoil", "code"),
    [
        (lambda _time, angle, encoder: (-angle, encoder), "opposite_sign"),
        (lambda _time, angle, encoder: (encoder, angle), "swapped_channels"),
        (lambda _time, angle, encoder: (0.0 * angle, encoder), "no_motion"),
        (lambda _time, angle, encoder: (clipped(angle), encoder), "clipped"),
        (lambda time, angle, encoder: (angle - played(time, encoder), encoder), "play"),
        (lambda time, angle, encoder: (angle + 0.05 * (time > 10.0), encoder), "slip"),
        (lambda _time, angle, encoder: (np.degrees(angle), encoder), "gain_out_of_range"),
    ],
)
def test_a_record_of_no_rigid_hinge_is_refused(short, spoil, code):
    time, angle, encoder = short

    assert fit_hinge(time, *spoil(time, angle, encoder)).status == f"failed:{code}"
