"""Thresholds of a footswitch in volts."""

import numpy as np
import pytest

from jointz.identify.calibration.footswitch_levels import fit_footswitch

OPEN_V, CONTACT_V = 0.3, 2.7


def walk(make, seed=0, noise_v=0.03, share=0.62, contact_v=CONTACT_V, creep=0.02, duration_s=60.0):
    rng = np.random.default_rng([2, seed])
    time = make.clock(duration_s, 500.0, rng)
    phase = np.mod(time / 1.1, 1.0)
    closed = phase < share
    bounce = (phase < 0.01) & (rng.random(time.size) < 0.4)
    level = np.where(closed & ~bounce, contact_v, OPEN_V)
    slow = make.coloured(time.size, sd=creep, time_s=20.0, period_s=time[1] - time[0], rng=rng)
    return time, level * (1.0 + slow) + noise_v * rng.standard_normal(time.size)


def test_thresholds_lie_between_the_levels(make):
    fit = fit_footswitch(*walk(make))

    for name, share in (("contact_threshold_v", 0.6), ("contact_release_v", 0.4)):
        entry = fit.entry(name)
        truth = OPEN_V + share * (CONTACT_V - OPEN_V)
        assert entry.status == "ok"
        assert abs(entry.value - truth) < 3.0 * entry.sd
        assert entry.sd < 0.2


@pytest.mark.slow
def test_intervals_cover_levels_that_creep(make):
    def find(seed):
        entry = fit_footswitch(*walk(make, seed)).entry("contact_level_v")
        return entry.value, entry.sd, CONTACT_V

    make.check_coverage(find)


@pytest.mark.parametrize(
    ("world", "spoil", "code"),
    [
        ({"contact_v": OPEN_V}, lambda volts: volts, "one_level"),
        ({}, lambda volts: np.full(volts.size, 3.3), "one_level"),
        # A few spikes are no second level.
        (
            {"contact_v": OPEN_V},
            lambda volts: np.where(np.arange(volts.size) % 500, volts, 3.0),
            "one_level",
        ),
        ({"noise_v": 0.6}, lambda volts: volts, "overlapping_levels"),
        ({}, lambda volts: 3.0 - volts, "inverted_levels"),
        ({"duration_s": 8.0}, lambda volts: volts, "too_short"),
    ],
)
def test_a_record_without_two_clear_levels_is_refused(make, world, spoil, code):
    time, volts = walk(make, **world)

    assert fit_footswitch(time, spoil(volts)).status == f"failed:{code}"
