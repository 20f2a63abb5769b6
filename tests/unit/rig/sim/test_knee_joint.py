"""The simulated knee against scipy's integrator, its matrix exponential and energy."""

from itertools import pairwise

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.linalg import expm

from jointz.core.errors import DataError
from jointz.core.gait_phases import TIMING_POINTS
from jointz.rig.sim.walking.knee_joint import impedance_curve, knee_angle, respond

RATE_HZ = 1000.0
PHYSICS_HZ = 4000.0
INERTIA = 0.05
PER_MASS = dict(zip(TIMING_POINTS, (2.0, 0.65, 1.15, 1.15, 0.32, 0.38), strict=True))


def exact_by_expm(torque, stiffness, damping, inertia, *, rate_hz):
    """Walk with scipy's matrix exponential of the joint and its held torque."""
    system = np.zeros((3, 3))
    system[0, 1] = 1.0
    system[1] = [-stiffness / inertia, -damping / inertia, 1.0 / inertia]
    step = expm(system / rate_hz)[:2]
    state, states = np.zeros(2), [np.zeros(2)]
    for before, after in pairwise(torque):
        state = step @ [*state, 0.5 * (before + after)]
        states.append(state)
    return np.array(states).T


def integrate(torque_at, stiffness_at, damping_at, *, seconds):
    """Integrate the joint in continuous time and return it at PHYSICS_HZ."""

    def rate(t, state):
        x, v = state
        return v, (torque_at(t) - damping_at(t) * v - stiffness_at(t) * x) / INERTIA

    time = np.arange(round(seconds * PHYSICS_HZ)) / PHYSICS_HZ
    solution = solve_ivp(
        rate, (0.0, time[-1]), (0.0, 0.0), method="DOP853", t_eval=time, rtol=1e-10, atol=1e-12
    )
    return time, solution.y


@pytest.mark.parametrize("rate_hz", [2.0, 50.0, 4000.0])
@pytest.mark.parametrize(
    ("stiffness", "damping"),
    [
        (146.0, 2.6),  # under-damped: a knee in stance
        (5.0, 8.0),  # over-damped
        (80.0, 4.0),  # critically damped: 4 K J = B^2
        (80.0, 4.0 + 1e-9),
        (0.0, 2.0),
        (1e-9, 2.0),
        (0.0, 0.0),
        (50.0, 0.0),
        (-6.0, 2.0),
        (-1e-9, 0.0),
        (-6.0, 0.0),
        (20.0, -0.1),
        (0.0, -0.1),
        (1.0, -1.0),
    ],
)
def test_a_held_step_equals_the_matrix_exponential(stiffness, damping, rate_hz):
    torque = np.random.default_rng(0).normal(size=9)
    got = respond(torque, stiffness, damping, INERTIA, rate_hz=rate_hz, substeps=1)
    want = exact_by_expm(torque, stiffness, damping, INERTIA, rate_hz=rate_hz)
    for ours, theirs in zip(got, want, strict=True):
        # Far into a decay the peer's own rounding shows: 1e-14 rad is nothing.
        atol = 1e-14 + 1e-9 * np.abs(theirs).max()
        np.testing.assert_allclose(ours, theirs, rtol=1e-9, atol=atol)


def raised_cosine(t):
    return 8.5 * (1.0 - np.cos(2 * np.pi * 2.0 * t))


def test_impedance_that_varies_over_the_cycle_agrees_with_solve_ivp_to_a_microradian():
    def stiffness(t):
        return 80.0 + 55.0 * np.cos(2 * np.pi * t / 1.1)

    def damping(t):
        return 2.5 + 0.9 * np.sin(2 * np.pi * t / 1.1)

    time, (angle, velocity) = integrate(raised_cosine, stiffness, damping, seconds=1.1)
    K, B = stiffness(time), damping(time)
    got = respond(raised_cosine(time), K, B, INERTIA, rate_hz=PHYSICS_HZ, substeps=1)
    np.testing.assert_allclose(got[0], angle, rtol=0, atol=1e-6)
    np.testing.assert_allclose(got[1], velocity, rtol=0, atol=1e-4)


def test_a_record_at_1_khz_with_four_substeps_is_as_good_as_its_straight_lines():
    time, (angle, _) = integrate(raised_cosine, lambda _: 140.0, lambda _: 2.6, seconds=1.0)
    at_1_khz = slice(None, None, 4)
    got, _ = respond(raised_cosine(time[at_1_khz]), 140.0, 2.6, INERTIA, rate_hz=RATE_HZ)
    # A chord lies below a curve by w^2 h^2 / 12 on average: 1.3e-5 of a response of 0.12 rad.
    np.testing.assert_allclose(got, angle[at_1_khz], rtol=0, atol=1.6e-6)


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"torque": np.zeros((2, 3))}, "one dimension"),
        ({"torque": np.array([0.0, np.nan])}, "torque must be finite"),
        ({"stiffness": np.zeros(3)}, r"stiffness must be one number or one per sample \(10\)"),
        ({"damping": np.nan}, "damping must be finite"),
        ({"inertia": 0.0}, "inertia must be positive"),
        ({"rate_hz": 0.0}, "rate_hz > 0"),
        ({"substeps": 0}, "substeps >= 1"),
    ],
)
def test_what_cannot_be_simulated_is_refused(changes, message):
    arguments = {
        "torque": np.zeros(10),
        "stiffness": 1.0,
        "damping": 1.0,
        "inertia": 1.0,
        "rate_hz": RATE_HZ,
        "substeps": 4,
    } | changes
    with pytest.raises(DataError, match=message):
        respond(**arguments)


def test_the_knee_bends_18_degrees_in_loading_response_and_62_in_swing():
    cycles = np.linspace(0.0, 1.0, 2001)
    degrees = np.degrees(knee_angle(cycles))
    early, late = cycles < 0.3, cycles > 0.5
    assert degrees[early].max() == pytest.approx(18.0, abs=0.5)
    assert cycles[early][degrees[early].argmax()] == pytest.approx(0.135, abs=0.015)
    assert degrees[late].max() == pytest.approx(62.0, abs=0.5)
    assert cycles[late][degrees[late].argmax()] == pytest.approx(0.72, abs=0.01)
    assert degrees.min() > 0.0
    np.testing.assert_allclose(knee_angle(cycles + 3.0), knee_angle(cycles), atol=1e-12)


def test_impedance_stands_still_around_each_timing_point_and_is_smooth_between():
    for name, at in TIMING_POINTS.items():
        around = np.linspace(at - 0.499, at + 10.999, 400) / 100.0
        assert (impedance_curve(PER_MASS, around) == PER_MASS[name]).all()
        assert (impedance_curve(PER_MASS, around + 7.0) == PER_MASS[name]).all()
    curve = impedance_curve(PER_MASS, np.linspace(0.0, 2.0, 20001))
    assert curve.min() >= min(PER_MASS.values())
    assert curve.max() <= max(PER_MASS.values())
    # The steepest smooth step: 0.83 in 1 % has slope 1.5 x 0.83 / 1 %, and 0.01 % is a sample.
    assert np.abs(np.diff(curve)).max() <= 1.5 * 0.83 / 1.0 * 0.01 * (1 + 1e-9)
