"""Motion of a joint from rest, its derivatives, and a late sensor."""

from itertools import pairwise

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.signal import TransferFunction, lsim

from jointz.kernels.joint_response import (
    DAMPING,
    DAMPING_SLOPE,
    INERTIA,
    INERTIA_SLOPE,
    MOTION,
    SHARE,
    STIFFNESS,
    STIFFNESS_SLOPE,
    joint_motion,
    sensed,
)

PERIOD_S = 0.002
N = 66
TIME_S = np.arange(N) * PERIOD_S
#: K, its slope, B, its slope, J, its slope.
IMPEDANCE = np.array([80.0, 400.0, 2.5, -8.0, 0.06, 0.1])
MIDDLE_S = np.array([0.062, 0.05, 0.04])
RISE = 17.0 * (1.0 - np.exp(-TIME_S / 0.012))
TORQUE = np.stack([RISE, 1.5 * np.sin(40.0 * TIME_S)])


def moved(
    impedance: np.ndarray = IMPEDANCE, *, share: float = 1.2, substeps: int = 2
) -> np.ndarray:
    return joint_motion(TORQUE, share, impedance, MIDDLE_S, PERIOD_S, substeps)[::substeps]


def by_scipy(impedance: np.ndarray, share: float) -> np.ndarray:
    def rates(t: float, state: np.ndarray) -> list[float]:
        K, B, J = impedance[::2] + impedance[1::2] * (t - MIDDLE_S)
        torque = np.interp(t, TIME_S, TORQUE[0] + share * TORQUE[1])
        return [state[1], (torque - B * state[1] - K * state[0]) / J]

    out, state = [0.0], np.zeros(2)
    for start, end in pairwise(TIME_S):
        state = solve_ivp(rates, (start, end), state, rtol=1e-11, atol=1e-14).y[:, -1]
        out.append(float(state[0]))
    return np.array(out)


@pytest.mark.parametrize("impedance", [IMPEDANCE, np.array([-30.0, 0.0, 1.0, 0.0, 0.06, 0.0])])
def test_motion_solves_the_equation_with_slopes_of_all_three(impedance):
    # A microradian at 0.2 rad: a thousandth of a goniometer's noise.
    assert moved(impedance)[:, MOTION] == pytest.approx(by_scipy(impedance, 1.2), abs=1e-6)


@pytest.mark.parametrize(
    ("column", "place", "step"),
    [
        (STIFFNESS, 0, 1e-2),
        (STIFFNESS_SLOPE, 1, 1.0),
        (DAMPING, 2, 1e-3),
        (DAMPING_SLOPE, 3, 1e-1),
        (INERTIA, 4, 1e-5),
        (INERTIA_SLOPE, 5, 1e-4),
    ],
)
def test_derivatives_are_those_of_finite_differences(column, place, step):
    change = np.zeros(6)
    change[place] = step
    difference = (moved(IMPEDANCE + change) - moved(IMPEDANCE - change))[:, MOTION] / (2.0 * step)
    found = moved()[:, column]
    assert found == pytest.approx(difference, abs=1e-5 * np.abs(difference).max())


def test_derivative_with_respect_to_the_share_is_the_motion_by_that_torque():
    alone = joint_motion(np.stack([TORQUE[1], np.zeros(N)]), 0.0, IMPEDANCE, MIDDLE_S, PERIOD_S, 2)[
        ::2, MOTION
    ]
    assert moved()[:, SHARE] == pytest.approx(alone, abs=1e-12)
    assert moved(share=0.0)[:, MOTION] + 1.2 * alone == pytest.approx(moved()[:, MOTION], abs=1e-12)


# --- sensor ---------------------------------------------------------------------------------------

STEP_S = 0.001
STEPS_S = np.arange(131) * STEP_S
SHAPE = np.sin(25.0 * STEPS_S) ** 2 + 3.0 * STEPS_S


def shown(**chain: float) -> np.ndarray:
    sensor = dict.fromkeys(("delay_s", "lag_s", "resonance_hz", "damping_ratio"), 0.0) | chain
    return sensed(SHAPE[:, None], step_s=STEP_S, samples_s=STEPS_S, **sensor)[:, 0]


def by_lsim(numerator: list[float], denominator: list[float]) -> np.ndarray:
    system = TransferFunction(numerator, denominator)
    # lsim with linear interpolation is exact for signals that are straight between steps.
    return np.asarray(lsim(system, SHAPE, STEPS_S, interp=True)[1])


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
