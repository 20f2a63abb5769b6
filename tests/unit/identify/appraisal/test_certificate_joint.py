"""The injected joint against an adaptive solver that shares nothing with it."""

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from jointz.identify.appraisal.certificate_joint import InjectedJoint, injected_response

PERIOD_S = 0.002
TIMES = np.arange(66) * PERIOD_S
TORQUE = 17.0 * (1.0 - np.exp(-TIMES / 0.012)) + 0.5 * np.sin(90.0 * TIMES)
PLAIN = InjectedJoint(60.0, 2.0, 0.06)
#: Angles of 0.3 rad to a millionth.
ANGLE_TOLERANCE_RAD = 3e-7


def solved(joint: InjectedJoint) -> np.ndarray:
    """Return what the sensor shows, by an adaptive Runge-Kutta method."""
    rate = 2.0 * np.pi * joint.resonance_hz

    def slopes(t, state):
        x, v, y, yd, z = state
        stiffness = joint.stiffness + joint.stiffness_slope * (t - joint.stiffness_at_s)
        damping = joint.damping + joint.damping_slope * (t - joint.damping_at_s)
        bend = (np.interp(t, TIMES, TORQUE) - damping * v - stiffness * x) / joint.inertia
        tissue = rate**2 * (x - y) - 2.0 * joint.resonance_damping * rate * yd
        before = y if rate else x
        lagging = (before - z) / joint.lag_s if joint.lag_s else 0.0
        return [v, bend, yd, tissue, lagging]

    done = solve_ivp(
        slopes, (0.0, TIMES[-1]), np.zeros(5), rtol=1e-9, atol=1e-12, dense_output=True,
        max_step=PERIOD_S / 2,
    )  # fmt: skip
    place = 4 if joint.lag_s else (2 if rate else 0)
    late = TIMES - joint.delay_s
    angle = np.where(late > 0.0, done.sol(np.maximum(late, 0.0))[place], 0.0)
    return joint.angle_gain * (angle + joint.cross_talk * TORQUE)


@pytest.mark.parametrize(
    "joint",
    [
        PLAIN,
        InjectedJoint(0.0, 0.5, 0.03),
        InjectedJoint(60.0, 2.0, 0.06, lag_s=0.005, delay_s=0.0031),
        InjectedJoint(60.0, 2.0, 0.06, resonance_hz=30.0, resonance_damping=0.3, lag_s=0.002),
        InjectedJoint(60.0, 2.0, 0.06, delay_s=0.002, cross_talk=3e-4, angle_gain=1.02),
    ],
    ids=["plain", "no stiffness", "late", "tissue", "instruments"],
)
def test_the_angle_is_that_of_an_adaptive_solver(joint):
    found = injected_response(TORQUE, joint, period_s=PERIOD_S, window_s=0.1)

    np.testing.assert_allclose(found.shown, solved(joint), atol=ANGLE_TOLERANCE_RAD)


def test_stiffness_and_damping_that_drift_are_followed():
    joint = InjectedJoint(
        60.0, 2.0, 0.06, stiffness_slope=200.0, damping_slope=-8.0, stiffness_at_s=0.06,
        damping_at_s=0.05,
    )  # fmt: skip

    found = injected_response(TORQUE, joint, period_s=PERIOD_S, window_s=0.1)

    np.testing.assert_allclose(found.shown, solved(joint), atol=2e-6)


def test_the_mean_of_a_drift_is_what_least_squares_on_the_angle_finds():
    """Constant K and B are fitted to the angle under a small drift of K: the slope is told."""
    slope = 1.0
    joint = InjectedJoint(60.0, 2.0, 0.06, stiffness_slope=slope)
    window = slice(0, 51)
    shown = injected_response(TORQUE, joint, period_s=PERIOD_S, window_s=0.1)

    def angle(stiffness):
        other = InjectedJoint(stiffness, 2.0, 0.06)
        return injected_response(TORQUE, other, period_s=PERIOD_S, window_s=0.1).shown[window]

    derivative = (angle(60.1) - angle(59.9)) / 0.2
    moved = shown.shown[window] - angle(60.0)
    fitted = 60.0 + float(derivative @ moved / (derivative @ derivative))

    assert shown.stiffness - 60.0 == pytest.approx(fitted - 60.0, rel=0.03)
    assert 0.05 < shown.stiffness - 60.0 < 0.08  # late samples tell of K: s of a slope of 1
