"""The footswitch: what it shows of a heel strike."""

import numpy as np
import pytest

from jointz.rig.sim.presets import FootswitchSettings, preset
from jointz.rig.sim.sensors.footswitch_model import ContactMaker

N = 20000


def maker(settings, seed=1):
    return ContactMaker(settings, contact_share=0.62, rng=np.random.default_rng(seed))


def test_a_perfect_switch_closes_at_heel_strike_and_opens_at_62_percent():
    switch = maker(preset("clean").footswitch)
    assert switch.toggles(3.0, 1.1) == pytest.approx([3.0, 3.0 + 0.62 * 1.1])


def test_a_switch_jitters_misses_and_closes_falsely_as_often_as_stated():
    settings = FootswitchSettings(jitter_sd_s=0.01, bounce_s=0.0, missed=0.02, false=0.03)
    switch = maker(settings)
    shown = [np.array(switch.toggles(10.0, 1.1)) - 10.0 for _ in range(N)]
    contacts = [s[s < 0.7] for s in shown]
    missed = np.mean([c.size == 0 for c in contacts])
    false = np.mean([(s > 0.7).any() for s in shown])
    # 20000 strides: a share of 0.02 or 0.03 is known to 0.001; four of these.
    assert missed == pytest.approx(0.02, abs=0.004)
    assert false == pytest.approx(0.03, abs=0.005)
    late = np.array([c[0] for c in contacts if c.size])
    assert late.mean() == pytest.approx(0.0, abs=0.0003)
    assert late.std() == pytest.approx(0.01, rel=0.03)  # clipped at 3 sd
    assert np.abs(late).max() <= 0.03
    lengths = {round(s[-1] - s[-2], 9) for s in shown if (s > 0.7).any()}
    assert lengths == {0.03}


def test_bounce_ends_after_its_time_with_the_switch_closed():
    switch = maker(FootswitchSettings(jitter_sd_s=0.0, bounce_s=0.004, missed=0.0, false=0.0))
    for _ in range(200):
        closes, *chatter, opens = switch.toggles(0.0, 1.0)
        assert closes == 0.0
        assert opens == 0.62
        assert len(chatter) == 6
        assert chatter == sorted(chatter)
        assert 0.0 <= chatter[0] < chatter[-1] <= 0.004
