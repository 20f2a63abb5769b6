"""The independent simulator against closed forms and limits."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.integrate import odeint
from scipy.signal import lsim
from tests.unit.identify.strapped.independent_leg import IndependentLeg, independent_response

K, B, J1, J2 = 80.0, 3.0, 0.25, 0.05
TIME = np.arange(0, 0.1501, 0.002)
DOUBLET = 17.0 * (np.interp(TIME, [0, 0.01, 0.05, 0.06], [0, 1, 1, 0]))
DOUBLET = DOUBLET - np.interp(TIME - 0.06, [0, 0.01, 0.05, 0.06], [0, 17.0, 17.0, 0])
STRAPPED = IndependentLeg(J1, J2, strap_stiffness=650.0, strap_damping=3.0)
FULL = replace(
    STRAPPED,
    softening_angle=0.4,
    gravity_stiffness=20.0,
    reflex_gain=0.2,
    reflex_position_share=0.5,
    reflex_asymmetry=0.6,
    friction=1.0,
    load_friction=0.05,
    torque_gain_error=0.02,
    inertia_slope=1.0,
    skin_share=0.3,
    goniometer_lag=0.003,
    goniometer_delay=0.003,
)


def simulate(leg, *, torque=DOUBLET, time=TIME, stiffness=K, damping=B, velocity=0.0):
    return independent_response(
        time,
        torque,
        stiffness=lambda _t: stiffness,
        damping=lambda _t: damping,
        velocity=lambda _t: velocity,
        leg=leg,
    )


def linear_response(leg, torque, time, device_damping=0.0):
    """Closed form by state space: exact for a torque that is linear between samples."""
    ks, cs, J1, J2 = leg.strap_stiffness, leg.strap_damping, leg.inertia_limb, leg.inertia_device
    A = np.array(
        [
            [0, 1, 0, 0],
            [-(K + ks) / J1, -(B + cs) / J1, ks / J1, cs / J1],
            [0, 0, 0, 1],
            [ks / J2, cs / J2, -ks / J2, -(cs + device_damping) / J2],
        ]
    )
    system = (A, np.array([[0], [0], [0], [1 / J2]]), np.eye(4)[[0, 2]], np.zeros((2, 1)))
    return lsim(system, torque, time)[1].T


def worst(computed, expected):
    """Largest difference as a share of the peak."""
    return np.max(np.abs(computed - expected)) / np.max(np.abs(expected))


def test_a_rigid_linear_leg_is_a_single_mass_on_a_spring_and_a_damper():
    rigid = IndependentLeg(J1, J2, strap_stiffness=2e5, strap_damping=200.0)
    _, expected, _ = lsim(([1.0], [J1 + J2, B, K]), DOUBLET, TIME)
    response = simulate(rigid)
    assert worst(response["bone"], expected) < 1e-3
    assert worst(response["device"], expected) < 1e-3
    np.testing.assert_array_equal(response["goniometer"], response["bone"])


def test_two_linear_masses_follow_the_state_space():
    response = simulate(replace(STRAPPED, torque_gain_error=0.02))
    bone, device = linear_response(STRAPPED, DOUBLET / 1.02, TIME)
    assert worst(response["bone"], bone) < 1e-6
    assert worst(response["device"], device) < 1e-6


def test_reflex_and_goniometer_follow_their_transfer_functions():
    leg = replace(
        STRAPPED,
        reflex_gain=0.3,
        reflex_position_share=0.4,
        skin_share=0.3,
        goniometer_lag=0.004,
        goniometer_delay=0.003,
    )
    step, count = 0.002, 2048
    torque = np.zeros(count)
    torque[: TIME.size] = 17 * np.exp(-0.5 * ((TIME - 0.05) / 0.008) ** 2)
    frequency = np.fft.rfftfreq(count, step)
    s = 2j * np.pi * frequency
    strap = leg.strap_stiffness + leg.strap_damping * s
    reflex = 0.3 * K * (0.4 + 0.6 * 0.05 * s) * np.exp(-0.045 * s) / (1 + 0.04 * s) ** 2
    limb = J1 * s**2 + B * s + K + reflex + strap
    bone = strap / ((J2 * s**2 + strap) * limb - strap**2)
    device = bone * limb / strap
    seen = (0.7 * bone + 0.3 * device) * np.exp(-0.003 * s) / (1 + 0.004 * s)
    spectrum = np.fft.rfft(torque) * np.sinc(frequency * step) ** 2  # linear between samples
    response = simulate(leg, torque=torque[: TIME.size])
    for name, transfer in {"bone": bone, "device": device, "goniometer": seen}.items():
        expected = np.fft.irfft(spectrum * transfer, count)[: TIME.size]
        assert worst(response[name], expected) < 1e-5, name


def test_energy_balances():
    """Work of the torque = kinetic and elastic energy + losses in joint and strap."""
    time = np.arange(0, 0.08, 0.0005)
    torque = np.interp(time, [0, 0.02, 0.04], [0, 17, 0])
    leg = replace(STRAPPED, softening_angle=0.2, softening_power=2.0, gravity_stiffness=20.0)
    response = simulate(leg, torque=torque, time=time)
    x, x2 = response["bone"], response["device"]
    v, v2 = np.gradient(x, time), np.gradient(x2, time)
    work = np.trapezoid(torque * v2, time)
    losses = np.trapezoid(B * v**2 + leg.strap_damping * (v2 - v) ** 2, time)
    kinetic = 0.5 * (J1 * v[-2] ** 2 + J2 * v2[-2] ** 2)  # the last gradient is one-sided
    softened = (K - 20.0) * 0.2**2 * np.log1p((x[-2] / 0.2) ** 2)
    elastic = 0.5 * (20.0 * x[-2] ** 2 + softened + leg.strap_stiffness * (x2 - x)[-2] ** 2)
    assert work == pytest.approx(losses + kinetic + elastic, rel=2e-3)


def test_friction_at_high_speed_takes_its_share_of_the_load_only():
    pulse = np.abs(DOUBLET)
    leg = replace(STRAPPED, friction=2.0, load_friction=0.1, friction_velocity=0.01)
    response = simulate(leg, torque=pulse, velocity=50.0)
    assert worst(response["bone"], linear_response(STRAPPED, 0.9 * pulse, TIME)[0]) < 1e-6


def test_friction_far_below_its_velocity_is_a_damper_on_the_device():
    leg = replace(STRAPPED, friction=2000.0, friction_velocity=1000.0)
    bone, device = linear_response(STRAPPED, DOUBLET, TIME, device_damping=2.0)
    response = simulate(leg, velocity=1.0)
    assert worst(response["bone"], bone) < 1e-5
    assert worst(response["device"], device) < 1e-5


def test_stiffness_damping_and_inertia_change_with_time():
    """A rigid strap and another integrator: J(t) x'' + B(t) x' + K(t) x = tau."""
    rigid = IndependentLeg(J1, J2, strap_stiffness=2e5, strap_damping=200.0, inertia_slope=2.0)
    time = TIME[:51]

    def rates(state, t):
        x, v = state
        inertia = J1 * (1 + 2.0 * (t - 0.06)) + J2
        return v, (17.0 - (2 + 30 * t) * v - (60 + 400 * t) * x) / inertia

    expected = odeint(rates, [0.0, 0.0], time, rtol=1e-9, atol=1e-11)[:, 0]
    response = independent_response(
        time,
        np.full(time.size, 17.0),
        stiffness=lambda t: 60 + 400 * t,
        damping=lambda t: 2 + 30 * t,
        velocity=lambda _t: 0.0,
        leg=rigid,
    )
    assert worst(response["bone"], expected) < 1e-3


def test_a_negative_reflex_is_scaled_by_its_asymmetry():
    """A leg that stays on the negative side has the reflex gain g a."""
    pulse = np.interp(TIME, [0, 0.02, 0.04], [0, 17, 0])
    without = linear_response(STRAPPED, pulse, TIME)[0]
    leg = replace(STRAPPED, reflex_gain=0.5, reflex_asymmetry=0.6)
    negative = simulate(leg, torque=-pulse)["bone"]
    positive = simulate(replace(STRAPPED, reflex_gain=0.3), torque=pulse)["bone"]
    early = leg.reflex_latency > TIME
    assert worst(negative, -positive) < 1e-6
    assert worst(positive[early], without[early]) < 1e-6
    assert worst(positive, without) > 1e-3


def test_without_torque_nothing_moves():
    response = simulate(FULL, torque=np.zeros(31), time=TIME[:31], velocity=1.0)
    assert all(np.all(channel == 0) for channel in response.values())


def test_the_curves_run_from_the_first_sample():
    curves = {
        "stiffness": lambda t: 60 + 100 * t,
        "damping": lambda t: 2 + 5 * t,
        "velocity": lambda t: np.cos(8 * t),
    }
    early = independent_response(TIME[:31], DOUBLET[:31], leg=FULL, **curves)
    late = independent_response(TIME[:31] + 3.0, DOUBLET[:31], leg=FULL, **curves)
    for name, channel in early.items():
        np.testing.assert_allclose(late[name], channel, atol=1e-8)
