"""Motion of a joint from rest, and a late sensor."""

import numpy as np
import pytest
from scipy.signal import TransferFunction, lsim

from jointz.identify.calibration.late_sensor import joint_motion, sensed

STEP_S = 0.001
STEPS_S = np.arange(131) * STEP_S
SHAPE = np.sin(25.0 * STEPS_S) ** 2 + 3.0 * STEPS_S


def shown(**chain: float) -> np.ndarray:
    sensor = dict.fromkeys(("delay_s", "lag_s", "resonance_hz", "damping_ratio"), 0.0) | chain
    return sensed(SHAPE, step_s=STEP_S, samples_s=STEPS_S, **sensor)


def by_lsim(numerator: list[float], denominator: list[float]) -> np.ndarray:
    system = TransferFunction(numerator, denominator)
    # lsim with linear interpolation is exact for signals that are straight between steps.
    return np.asarray(lsim(system, SHAPE, STEPS_S, interp=True)[1])


@pytest.mark.parametrize("stiffness", [80.0, 0.0, -30.0])
def test_motion_is_that_of_lsim(stiffness):
    motion = joint_motion(SHAPE, stiffness, 2.5, 0.06, STEP_S)
    assert motion == pytest.approx(by_lsim([1.0], [0.06, 2.5, stiffness]), abs=1e-7)


@pytest.mark.parametrize("lag_s", [0.0005, 0.3])
def test_a_first_order_lag_is_that_of_lsim(lag_s):
    assert shown(lag_s=lag_s) == pytest.approx(by_lsim([1.0], [lag_s, 1.0]), abs=1e-9)


@pytest.mark.parametrize(("hz", "ratio"), [(20.0, 0.3), (40.0, 0.05), (140.0, 0.9)])
def test_a_resonance_is_that_of_lsim(hz, ratio):
    rate = 2.0 * np.pi * hz
    expected = by_lsim([rate**2], [1.0, 2.0 * ratio * rate, rate**2])
    assert shown(resonance_hz=hz, damping_ratio=ratio) == pytest.approx(expected, abs=1e-9)


def test_resonance_lag_and_delay_act_one_after_the_other():
    rate = 2.0 * np.pi * 30.0
    both = np.polymul([1.0 / rate**2, 0.6 / rate, 1.0], [0.005, 1.0])
    late = shown(resonance_hz=30.0, damping_ratio=0.3, lag_s=0.005, delay_s=0.003)
    # The lag takes what resonates as straight between steps: 1e-4 of what is shown.
    assert late[3:] == pytest.approx(by_lsim([1.0], both.tolist())[:-3], abs=1.5e-4)
    assert not late[:4].any()


@pytest.mark.parametrize("delay_s", [0.002, 0.0037, 0.2])
def test_a_delay_shows_the_straight_lines_between_steps_later(delay_s):
    earlier = STEPS_S - delay_s
    expected = np.where(earlier > 0.0, np.interp(earlier, STEPS_S, SHAPE), 0.0)
    assert shown(delay_s=delay_s) == pytest.approx(expected, abs=1e-12)


def test_a_negative_delay_shows_the_future_and_goes_on_straight_at_the_end():
    ahead = shown(delay_s=-0.003)
    assert ahead[:-3] == pytest.approx(SHAPE[3:], abs=1e-12)
    slope = SHAPE[-1] - SHAPE[-2]
    assert ahead[-3:] == pytest.approx(SHAPE[-1] + slope * np.array([1.0, 2.0, 3.0]), abs=1e-12)
