"""The chain of thigh and leg against the energies of point masses in Cartesian coordinates.

The masses are placed so that they have mass, centre and inertia of the segments. Their Lagrangian,
differentiated numerically, moves both links without any linearization; the hip stays where it is,
and its moment that of the unperturbed path.
"""

import numpy as np
import pytest

from jointz.core.gait_phases import TIMING_POINTS
from jointz.rig.sim.people import draw_person
from jointz.rig.sim.presets import preset
from jointz.rig.sim.walking.impedance_curves import (
    chain_terms,
    impedance_over_cycle,
    leg_of,
    thigh_share,
)
from jointz.rig.sim.walking.knee_joint import knee_angle, respond

G = 9.81
PERSON = draw_person(1, seed=4)
REALISTIC = preset("realistic")
LEG = leg_of(PERSON, REALISTIC.body)
STRIDE_S = PERSON.stride_time_s
STEP = 1e-3


def masses():
    """(mass, on the shank, distance from the segment's upper joint)."""
    reach = LEG.thigh_inertia / LEG.thigh_moment
    radius = np.sqrt(LEG.inertia / LEG.mass_kg - LEG.centre_m**2)
    half = LEG.mass_kg / 2.0
    return (
        (LEG.thigh_moment / reach, False, reach),
        (half, True, LEG.centre_m - radius),
        (half, True, LEG.centre_m + radius),
    )


def lagrangian(angles, rates):
    """Kinetic less potential energy; angles are those of thigh and knee, flexion."""
    (thigh, knee), (thigh_rate, knee_rate) = angles, rates
    energy = 0.0
    for mass, below, distance in masses():
        arm = LEG.thigh_length_m if below else distance
        place = arm * np.exp(1j * (thigh - np.pi / 2))  # forward is real, up imaginary
        velocity = 1j * thigh_rate * place
        if below:
            own = distance * np.exp(1j * (thigh - knee - np.pi / 2))
            place, velocity = place + own, velocity + 1j * (thigh_rate - knee_rate) * own
        energy += mass * (abs(velocity) ** 2 / 2.0 - G * place.imag)
    return energy


def gradient(angles, rates, which):
    unit = STEP * np.eye(2)
    point = (angles, rates)

    def at(change):
        moved = list(point)
        moved[which] = moved[which] + change
        return lagrangian(*moved)

    return np.array([(at(e) - at(-e)) / (2.0 * STEP) for e in unit])


def mass_matrix(angles):
    # The energy is a quadratic form of the rates: its differences are exact.
    zero = np.zeros(2)
    return np.array([gradient(angles, e, 1) - gradient(angles, zero, 1) for e in np.eye(2)])


def bias(angles, rates):
    """What is left of the Euler-Lagrange equations without accelerations."""
    ahead = gradient(angles + STEP * rates, rates, 1) - gradient(angles - STEP * rates, rates, 1)
    return ahead / (2.0 * STEP) - gradient(angles, rates, 0)


def path(t):
    def angles(time):
        cycles = np.array([time / STRIDE_S])
        thigh = impedance_over_cycle(PERSON, REALISTIC, np.mod(cycles, 1.0))[3]
        return np.array([thigh[0], knee_angle(cycles)[0]])

    h = 1e-4
    before, now, after = angles(t - h), angles(t), angles(t + h)
    return now, (after - before) / (2.0 * h), (after - 2.0 * now + before) / h**2


def pushed(onset_s, torque_nm, *, duration_s, h=2e-3):
    """Return the deviation of thigh and knee, every h, while a torque acts on the knee."""

    def slope(t, state):
        angles, rates, bends = path(t)
        moments = mass_matrix(angles) @ bends + bias(angles, rates)
        x, v = state
        rest = moments + np.array([0.0, torque_nm]) - bias(angles + x, rates + v)
        return np.array([v, np.linalg.solve(mass_matrix(angles + x), rest) - bends])

    state, rows = np.zeros((2, 2)), [np.zeros(2)]
    for i in range(round(duration_s / h)):
        t = onset_s + i * h
        k1 = slope(t, state)
        k2 = slope(t + h / 2, state + h / 2 * k1)
        k3 = slope(t + h / 2, state + h / 2 * k2)
        k4 = slope(t + h, state + h * k3)
        state = state + h / 6 * (k1 + 2 * k2 + 2 * k3 + k4)
        rows.append(state[0])
    return np.array(rows)


def predicted(onset_s, torque_nm, *, duration_s, terms=True, h=2e-3):
    phase = np.mod((onset_s + np.arange(round(duration_s / h) + 1) * h) / STRIDE_S, 1.0)
    _, _, inertia, thigh = impedance_over_cycle(PERSON, REALISTIC, phase)
    chain = chain_terms(PERSON, REALISTIC, phase)
    damping, stiffness = chain.inertia_rate, chain.stiffness
    if not terms:
        damping, stiffness = 0.0 * damping, 0.0 * stiffness
    stiffness = stiffness + LEG.gravity_nm * np.cos(knee_angle(phase) - thigh)
    torque = np.full(phase.size, torque_nm)
    return respond(torque, stiffness, damping, inertia, rate_hz=1.0 / h)[0]


@pytest.mark.parametrize("pct", [70.0, 75.0, 81.0])
def test_knee_in_swing_deviates_as_the_chain_of_two_links(pct):
    true = pushed(pct / 100.0 * STRIDE_S, 0.5, duration_s=0.1)
    with_terms = predicted(pct / 100.0 * STRIDE_S, 0.5, duration_s=0.1)
    without = predicted(pct / 100.0 * STRIDE_S, 0.5, duration_s=0.1, terms=False)
    error = abs(with_terms[-1] / true[-1, 1] - 1.0)
    assert error < 0.02
    assert error < abs(without[-1] / true[-1, 1] - 1.0)


def test_thigh_follows_by_its_share_in_swing():
    onset_s = 0.75 * STRIDE_S
    true = pushed(onset_s, 0.5, duration_s=0.02)
    share = thigh_share(PERSON, REALISTIC, np.array([0.75]))[0]
    assert true[-1, 0] / true[-1, 1] == pytest.approx(share, rel=0.05)


def test_apparent_inertia_is_that_of_the_energies():
    for knee in (0.1, 0.6, 1.1):
        matrix = mass_matrix(np.array([0.3, knee]))
        apparent = matrix[1, 1] - matrix[0, 1] ** 2 / matrix[0, 0]
        assert LEG.free_inertia(np.array(knee)) == pytest.approx(apparent, rel=1e-6)
        assert LEG.free_share(np.array(knee)) == pytest.approx(-matrix[0, 1] / matrix[0, 0])


def test_standing_share_keeps_the_hip_on_its_line_to_the_ankle():
    thigh_m, shank_m = LEG.thigh_length_m, LEG.shank_length_m

    def thigh_to_line(knee):
        # Hip at the origin, thigh along x; the angle of the line to the ankle.
        return np.angle(thigh_m + shank_m * np.exp(-1j * knee))

    for knee in (0.1, 0.6):
        slope = (thigh_to_line(knee + 1e-5) - thigh_to_line(knee - 1e-5)) / 2e-5
        assert LEG.standing_share(np.array(knee)) == pytest.approx(-slope, rel=1e-6)


def test_only_bodies_with_a_chain_have_its_terms():
    cycles = np.array(list(TIMING_POINTS.values())) / 100.0
    for name in ("nominal", "anthropometric"):
        terms = chain_terms(PERSON, preset(name), cycles)
        assert not terms.inertia_rate.any()
        assert not terms.stiffness.any()
