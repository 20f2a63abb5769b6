"""Gain of the torque and friction against a known spring."""

from math import tanh

import numpy as np
import pytest

from jointz.core.study import Calibrated, TorqueModelSpec
from jointz.identify.calibration.spring import fit_spring

MODEL = TorqueModelSpec(
    gear_ratio=9.0, torque_constant=0.11, coulomb_friction=0.38, gear_friction=0.09
)
SPRING, GAIN, FRICTION = 60.0, 1.04, 1.15
STEP_S = 2e-4
STATED = Calibrated(value=SPRING, sd=0.0)


def push(make, seed=0, spring=SPRING, amplitude=15.0, slack=0.0, sign=1.0, smooth=0.03):
    """A spring, inertia and friction that grows with tanh(v / smooth), Euler's method."""
    rng = np.random.default_rng([5, seed])
    time = make.clock(60.0, 500.0, rng)
    fine = np.arange(0.0, time[-1] + 0.01, STEP_S)
    drive = amplitude * np.sin(2.0 * np.pi * 0.1 * fine)
    size = FRICTION * (0.38 + 0.09 * np.abs(drive) / (9.0 * 0.11))
    error = make.coloured(fine.size, sd=0.25, time_s=0.25, period_s=STEP_S, rng=rng)
    path, x, v = [], 0.0, 0.0
    for pushed, held in zip((drive / GAIN + error).tolist(), size.tolist(), strict=True):
        stiffness = spring * (1.0 + slack) if x > 0.0 else spring
        v += STEP_S / 0.05 * (pushed - held * tanh(v / smooth) - stiffness * x)
        x += STEP_S * v
        path.append(x)
    step = 2.0 * np.pi / (9 * 16384)
    angle = 0.9 + sign * np.interp(time, fine, path)
    current = np.interp(time, fine, drive) / (9.0 * 0.11)
    return time, np.round(angle / step) * step, current


@pytest.mark.parametrize("smooth", [0.03, 0.08])
def test_gain_and_friction_come_back(make, smooth):
    """Error of the torque turns the motion about; least squares loses 9 % of slow friction."""
    fit = fit_spring(*push(make, smooth=smooth), model=MODEL, stiffness=STATED)

    gain, friction = fit.entry("torque_gain"), fit.entry("friction_gain")
    assert fit.status == "ok"
    assert abs(gain.value - GAIN) < 3.0 * gain.sd
    assert gain.sd < 0.01
    assert abs(friction.value - FRICTION) < 1.96 * friction.sd
    assert friction.sd < 0.1
    assert fit.entry("torque_constant").value == pytest.approx(0.11 / gain.value, rel=0.01)


@pytest.mark.slow
@pytest.mark.parametrize("smooth", [0.01, 0.08])
@pytest.mark.parametrize(("name", "truth"), [("torque_gain", GAIN), ("friction_gain", FRICTION)])
def test_intervals_cover(make, name, truth, smooth):
    def find(seed):
        record = push(make, seed, smooth=smooth)
        entry = fit_spring(*record, model=MODEL, stiffness=STATED).entry(name)
        return entry.value, entry.sd, truth

    make.check_coverage(find)


@pytest.mark.slow
def test_intervals_of_the_gain_cover_with_a_spring_known_to_2_pct(make):
    def find(seed):
        true = SPRING * (1.0 + 0.02 * np.random.default_rng(seed).standard_normal())
        known = Calibrated(value=SPRING, sd=0.02 * SPRING)
        record = push(make, seed, spring=true)
        entry = fit_spring(*record, model=MODEL, stiffness=known).entry("torque_gain")
        return entry.value, entry.sd, GAIN

    make.check_coverage(find)


def test_the_sd_of_the_spring_is_carried_into_both_gains_and_one_direction_is_refused(make):
    record = push(make)
    fit = fit_spring(*record, model=MODEL, stiffness=Calibrated(value=SPRING, sd=1.2))

    for entry in fit.entries:
        assert entry.uncertainty["spring"] == pytest.approx(0.02 * entry.value)

    sign_aligned = (*record[:2], np.abs(record[2]))
    assert fit_spring(*sign_aligned, model=MODEL, stiffness=STATED).status == "failed:one_direction"


@pytest.mark.parametrize(
    ("change", "code"),
    [
        ({"amplitude": 0.5}, "no_torque"),
        ({"spring": 6e3}, "no_motion"),
        ({"sign": -1.0}, "opposite_sign"),
        ({"slack": 0.3}, "not_linear"),
        ({"spring": 200.0}, "gain_out_of_range"),
    ],
)
def test_bad_input_is_refused(make, change, code):
    fit = fit_spring(*push(make, **change), model=MODEL, stiffness=STATED)

    assert fit.status == f"failed:{code}"
