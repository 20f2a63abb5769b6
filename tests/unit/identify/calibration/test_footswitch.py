"""Thresholds of a footswitch in volts."""

import numpy as np
import pytest

from jointz.identify.calibration.footswitch_levels import fit_footswitch

OPEN_V, CONTACT_V = 0.3, 2.7


def walk(make, seed=0, noise_v=0.03, share=0.62, contact_v=CONTACT_V, creep=0.02):
    rng = np.random.default_rng([2, seed])
    time = make.clock(60.0, 500.0, rng)
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


def test_one_level_is_refused(make):
    time, volts = walk(make, contact_v=OPEN_V)

    assert fit_footswitch(time, volts).status == "failed:one_level"
    assert fit_footswitch(time, np.full(time.size, 3.3)).status == "failed:one_level"


def test_a_few_spikes_are_no_second_level(make):
    time, volts = walk(make, contact_v=OPEN_V)
    volts[::500] = 3.0

    assert fit_footswitch(time, volts).status == "failed:one_level"


def test_levels_that_run_into_each_other_are_refused(make):
    time, volts = walk(make, noise_v=0.6)

    assert fit_footswitch(time, volts).status == "failed:overlapping_levels"


def test_a_switch_that_is_wired_the_other_way_round_is_refused(make):
    time, volts = walk(make)

    assert fit_footswitch(time, 3.0 - volts).status == "failed:inverted_levels"


def test_a_few_strides_are_too_few(make):
    time, volts = walk(make)
    few = time < 8.0

    assert fit_footswitch(time[few], volts[few]).status == "failed:too_short"
