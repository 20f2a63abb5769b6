"""Strides without end: smooth, and as variable as their settings say."""

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest

from jointz.rig.sim.presets import GaitSettings, preset
from jointz.rig.sim.walking.gait_motion import ConditionShift, GaitMotion, draw_shift, knee_size_at
from jointz.rig.sim.walking.knee_joint import knee_angle
from jointz.rig.sim.walking.layout import HARMONICS, Gait
from jointz.rig.sim.walking.path import path

STILL = preset("clean").gait
MEAN_S = 1.1


def motion(settings, *, shift=None, seed=1, stumbles=None, knee_size=1.0):
    return GaitMotion(
        settings,
        stride_time_s=MEAN_S,
        knee_size=knee_size,
        shift=shift or ConditionShift(),
        rng=np.random.default_rng(seed),
        stumbles=stumbles,
    )


def strides(settings, n, **kwargs):
    walk = motion(settings, **kwargs)
    return [walk.next() for _ in range(n)]


def test_path_is_twice_continuously_differentiable_over_heel_strikes():
    walk = strides(preset("hard").gait, 50)
    for one, following in pairwise(walk):
        before, after = path(one.row, one.end_s), path(following.row, following.start_s)
        np.testing.assert_allclose(before, after, rtol=0, atol=1e-9)


def test_phase_goes_from_heel_strike_to_heel_strike_and_never_back():
    for stride in strides(preset("hard").gait, 200, stumbles={20: 1.8, 40: 0.6}):
        cycles = stride.cycles(np.linspace(stride.start_s, stride.end_s, 101))
        assert cycles[0] == 0.0
        assert cycles[-1] == pytest.approx(1.0, abs=1e-12)
        assert (np.diff(cycles) > 0).all()


def test_the_knee_bends_more_in_faster_walking():
    sizes = [knee_size_at(speed) for speed in (0.3, 1.2, 2.2)]
    assert sizes == pytest.approx([0.865, 1.0, 1.15])
    (usual,), (small,) = (strides(STILL, 1, knee_size=size) for size in (1.0, 0.8))
    for t in np.linspace(usual.start_s, usual.end_s, 7):
        np.testing.assert_allclose(path(small.row, t)[0], 0.8 * path(usual.row, t)[0], atol=1e-12)


def test_without_variability_the_knee_is_the_mean_knee():
    stride = strides(STILL, 4)[3]
    share = np.linspace(0.0, 0.99, 50)
    got = [path(stride.row, stride.start_s + s * MEAN_S)[0] for s in share]
    assert stride.duration_s == MEAN_S
    np.testing.assert_allclose(got, knee_angle(share), rtol=0, atol=1e-12)


def test_a_shift_moves_scales_and_advances_the_knee():
    stride = strides(STILL, 2, shift=ConditionShift(0.02, 0.1, 0.01))[1]
    share = np.linspace(0.0, 0.99, 50)
    got = [path(stride.row, stride.start_s + s * MEAN_S)[0] for s in share]
    np.testing.assert_allclose(got, 0.02 + 1.1 * knee_angle(share + 0.01), rtol=0, atol=1e-12)


def test_two_conditions_differ_by_the_stated_shift():
    settings = GaitSettings()
    rng = np.random.default_rng(4)
    pairs = [(draw_shift(settings, rng), draw_shift(settings, rng)) for _ in range(2000)]
    for name, sd in (
        ("offset_rad", settings.condition_offset_sd_rad),
        ("amplitude", settings.condition_amplitude_sd),
        ("phase_cycles", settings.condition_phase_sd),
    ):
        apart = np.std([getattr(a, name) - getattr(b, name) for a, b in pairs])
        assert apart == pytest.approx(sd, rel=0.06)  # 2000 pairs know an sd to 1.6 %


def test_durations_vary_and_drift_as_stated():
    quick = np.array([s.duration_s for s in strides(GaitSettings(duration_drift_sd=0.0), 4000)])
    # 4000 strides know an sd to 1.1 %; clipping at 3 sd takes 0.7 %.
    assert quick.mean() == pytest.approx(MEAN_S, rel=0.002)
    assert quick.std() / MEAN_S == pytest.approx(0.025, rel=0.04)
    assert abs(np.corrcoef(quick[1:], quick[:-1])[0, 1]) < 0.06
    drift = [
        [s.duration_s for s in strides(replace(STILL, duration_drift_sd=0.01), 152, seed=seed)]
        for seed in range(400)
    ]
    drift = np.array(drift) / MEAN_S - 1.0
    assert drift.std() == pytest.approx(0.01, rel=0.1)
    memory = np.mean(drift[:, 0] * drift[:, 150]) / drift.var()
    assert memory == pytest.approx(np.exp(-1.0), abs=0.15)  # 400 walks: sd 0.05


def test_amplitude_offset_and_shape_vary_as_stated():
    def series(stride):
        row = stride.row
        return np.array([row[Gait.COSINES :][:HARMONICS], row[Gait.SINES :][:HARMONICS]])

    base = series(strides(STILL, 1)[0])
    loud = np.array([series(s) for s in strides(replace(STILL, amplitude_sd=0.03), 4000)])
    size = loud[:, 1, 1] / base[1, 1]
    assert size.std() == pytest.approx(0.03, rel=0.06)  # correlated strides know it to 1.5 %
    assert np.corrcoef(size[1:], size[:-1])[0, 1] == pytest.approx(0.5, abs=0.05)
    offset = np.array([series(s)[0, 0] for s in strides(replace(STILL, offset_sd_rad=0.02), 4000)])
    assert offset.std() == pytest.approx(0.02, rel=0.06)
    drift = [
        series(strides(replace(STILL, offset_drift_sd_rad=0.03), 1, seed=seed)[0])[0, 0]
        for seed in range(2000)
    ]
    assert np.std(drift) == pytest.approx(0.03, rel=0.06)
    shape = np.array([series(s) for s in strides(replace(STILL, shape_sd_rad=0.01), 4000)]) - base
    # RMS over the cycle: half the sum of squares of the coefficients.
    rms = np.sqrt(0.5 * (shape**2).sum(axis=(1, 2)).mean())
    assert rms == pytest.approx(0.01, rel=0.03)


def test_a_stumble_lengthens_its_stride_and_no_other():
    plain, stumbled = strides(STILL, 9), strides(STILL, 9, stumbles={5: 1.6})
    factors = [b.duration_s / a.duration_s for a, b in zip(plain, stumbled, strict=True)]
    assert factors == [1.0] * 5 + [1.6] + [1.0] * 3
