"""The compiled plant against the equations of motion, written a second time and solved by scipy."""

from bisect import bisect_right
from dataclasses import replace
from math import cos, exp, pi, sin, tanh

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from jointz.core.clock import VirtualClock
from jointz.sim.curves import impedance_over_cycle, leg_of
from jointz.sim.layout import Gait, Param, describe
from jointz.sim.people import draw_instruments, draw_person
from jointz.sim.plant_build import Grid, build_plant
from jointz.sim.presets import (
    BodySettings,
    GaitSettings,
    GoniometerSettings,
    JointSettings,
    ReflexSettings,
    preset,
)
from jointz.sim.rig import SimulatedRig

SECONDS = 2.6
PULSES = ((0.30, 17.0), (0.95, -12.0), (1.50, 17.0), (2.05, 8.0))
PULSE_S = 0.25
EXACT = 1e-6  # rad
CONTACT_SHARE_END = 2.0 * pi


def exact(name):
    """Return a preset without quanta and white noise: what is left is physics."""
    one = preset(name)
    return replace(
        one,
        actuator=replace(
            one.actuator, angle_step_rad=0.0, velocity_step_rad_s=0.0, current_step_a=0.0
        ),
        goniometer=replace(one.goniometer, white_sd_rad=0.0, coloured_sd_rad=0.0),
    )


def walk(settings, *, seconds=SECONDS, pulses=PULSES, number=2, seed=5, rate_hz=500.0):
    """Return device time and the exoskeleton's and goniometer's angles of a short walk."""
    rig = SimulatedRig(draw_person(number, seed=seed), settings, grid=Grid(rate_hz))
    clock = VirtualClock()
    devices = rig.open("perturbed", segment=0, clock=clock)
    for device in devices.all():
        device.configure()
        device.activate()
    actuator, angle = [], []
    period_ns = rig.grid.period_ns
    for k in range(round(seconds * rate_hz)):
        clock.wait_until_ns(k * period_ns)
        actuator += devices.actuator.read()
        angle += devices.angle.read()
        devices.actuator.command_torque(commanded(k / rate_hz, pulses))
    time = np.array([s.device_time_ns for s in actuator]) * 1e-9
    return (
        rig,
        time,
        np.array([s.angle for s in actuator]),
        np.array([s.value for s in angle]),
    )


def commanded(time_s, pulses):
    # The microsecond keeps the edges of pulses on their samples.
    return sum(a for at, a in pulses if at <= time_s + 1e-6 < at + PULSE_S)


class Path:
    """The unperturbed knee, from the strides' polynomials and Fourier series."""

    def __init__(self, motion):
        self.strides = [motion.next() for _ in range(12)]
        self.starts = [s.start_s for s in self.strides]

    def stride(self, t):
        return self.strides[bisect_right(self.starts, t) - 1]

    def phase(self, t):
        stride = self.stride(t)
        u = (t - stride.start_s) / stride.duration_s
        r = stride.row
        poly = np.polynomial.Polynomial(
            [0, r[Gait.LINEAR], 0, r[Gait.CUBIC], r[Gait.QUARTIC], r[Gait.QUINTIC]]
        )
        T = stride.duration_s
        return poly(u), poly.deriv()(u) / T, poly.deriv(2)(u) / T**2

    def __call__(self, t):
        row = self.stride(t).row
        p, p1, p2 = self.phase(t)
        h = np.arange(7)
        turn = np.exp(2j * pi * h * p)
        base = row[Gait.COSINES : Gait.COSINES + 7] - 1j * row[Gait.SINES : Gait.SINES + 7]
        more = (
            row[Gait.COSINE_CHANGES : Gait.COSINE_CHANGES + 7]
            - 1j * row[Gait.SINE_CHANGES : Gait.SINE_CHANGES + 7]
        )
        w = 6 * p**5 - 15 * p**4 + 10 * p**3
        w1 = 30 * p**4 - 60 * p**3 + 30 * p**2
        w2 = 120 * p**3 - 180 * p**2 + 60 * p
        d = 2j * pi * h
        a0, a1, a2 = ((base * d**n * turn).sum().real for n in range(3))
        b0, b1, b2 = ((more * d**n * turn).sum().real for n in range(3))
        slope = a1 + w1 * b0 + w * b1
        bend = a2 + w2 * b0 + 2 * w1 * b1 + w * b2
        return a0 + w * b0, slope * p1, bend * p1**2 + slope * p2


class Reference:
    """The equations of the module's docstring, in Python, with dense output for delays."""

    def __init__(self, rig):
        self.rig, self.preset = rig, rig.preset
        self.person = rig.person
        self.tools = draw_instruments(rig.person, rig.preset)
        self.path = Path(rig._motion("perturbed", 0))
        self.ends, self.solutions = [], []
        noise = rig.person.stream("noise perturbed", 0).standard_normal((4096, 5))
        a = self.preset.actuator
        keep = exp(-rig.grid.period_s / a.torque_error_time_s)
        error = [0.0]
        for row in noise[1:]:
            error.append(
                keep * error[-1] + a.torque_error_sd_nm * (1 - keep**2) ** 0.5 * row[0]
            )
        self.error = np.array(error)
        self.error_at = np.arange(4096) * rig.grid.period_s

    def wanted_current(self, t):
        a = self.preset.actuator
        return commanded(t - a.delay_s, PULSES) / (a.gear_ratio * a.torque_constant)

    def past(self, t, j):
        """Return a state at a time before: dense output of earlier stretches."""
        if t <= 0.0:
            return 0.0
        return self.solutions[bisect_right(self.ends, t - 1e-12)](t)[j]

    def stretch(self, t):
        reflex = self.preset.joint.reflex
        if reflex is None:
            return 0.0
        if reflex.kind == "velocity":
            return reflex.velocity_time_s * max(0.0, self.past(t - reflex.latency_s, 1))
        return max(0.0, self.past(t - reflex.latency_s, 0))

    def rhs(self, t, s, wanted):
        x, v, i, g, r, rd, y, yd, xe, ve = s
        a, joint, body = self.preset.actuator, self.preset.joint, self.preset.body
        theta, rate, bend = self.path(t)
        phase = np.array([self.path.phase(t)[0] % 1.0])
        K, B, J, thigh = (float(c[0]) for c in impedance_over_cycle(self.person, self.preset, phase))
        gain = a.gear_ratio * a.torque_constant / self.tools.torque_gain
        friction = self.tools.friction_gain * (a.coulomb_friction + a.gear_friction * abs(i))
        torque = gain * i + np.interp(t, self.error_at, self.error)
        soft = 1.0 if joint.softening_rad is None else 1.0 / (1.0 + (x / joint.softening_rad) ** 2)
        held = K * x * soft + B * v
        twitch = 0.0
        if joint.reflex is not None:
            held += joint.reflex.gain * K * r
            w = 1.0 / joint.reflex.twitch_s
            twitch = w**2 * (self.stretch(t) - r) - 2 * w * rd
        if body is None:
            torque -= friction * tanh((rate + v) / a.sign_velocity_rad_s)
            acceleration = (torque - held - a.rotor_inertia * bend) / (J + a.rotor_inertia)
            exo = 0.0
        else:
            leg = leg_of(self.person).gravity_nm
            held += leg * (sin(theta + x - thigh) - sin(theta - thigh))
            stiffness = self.tools.strap_stiffness
            strap = stiffness * (xe - x) + stiffness * body.strap_damping_time_s * (ve - v)
            acceleration = (strap - held) / J
            torque -= friction * tanh((rate + ve) / a.sign_velocity_rad_s)
            weight = body.frame_mass_kg * 9.81 * body.frame_distance_m
            torque -= weight * sin(theta + xe - thigh) + strap
            inertia = a.rotor_inertia + body.frame_mass_kg * body.frame_distance_m**2
            exo = torque / inertia - bend
        shown, tissue = theta + x, 0.0
        if body is not None:
            w = 2 * pi * self.tools.tissue_hz
            tissue = w**2 * (theta + x - y) - 2 * body.tissue_damping * w * yd
            shown = y
        lag = self.tools.angle_lag_s - self.preset.goniometer.delay_s
        return (
            v,
            acceleration,
            (wanted - i) / a.time_constant_s,
            (shown - g) / lag if lag > 0 else 0.0,
            rd,
            twitch,
            yd,
            tissue,
            ve,
            exo,
        )

    def solve(self, times):
        theta, rate, _ = self.path(0.0)
        state = np.array([0, 0, 0, theta, 0, 0, theta, rate, 0, 0], dtype=float)
        states = [state]
        for begin, end in zip(times[:-1], times[1:], strict=True):
            cut = [s for s in self.path.starts if begin < s < end]
            points = [begin, *cut, end]
            for t0, t1 in zip(points[:-1], points[1:], strict=True):
                solved = solve_ivp(
                    self.rhs,
                    (t0, t1),
                    state,
                    method="DOP853",
                    rtol=1e-11,
                    atol=1e-13,
                    dense_output=self.preset.joint.reflex is not None,
                    args=(self.wanted_current(0.5 * (begin + end)),),
                )
                state = solved.y[:, -1]
                self.solutions.append(solved.sol)
                self.ends.append(t1)
            states.append(state)
        return np.array(states)


STILL = GaitSettings(
    **{name: 0.0 for name in GaitSettings.__slots__ if "_sd" in name}
)
CASES = {
    "nominal": exact("nominal"),
    "hard": exact("hard"),
    "clean": exact("clean"),
    "anthropometric": exact("anthropometric"),
    "velocity reflex and softening": replace(
        exact("nominal"), joint=JointSettings(reflex=ReflexSettings(), softening_rad=0.3)
    ),
    "position reflex, smooth curves, soft strap": replace(
        exact("anthropometric"),
        joint=JointSettings(reflex=ReflexSettings(gain=1.0, kind="position"), smooth=True),
        body=BodySettings(strap_range_nm_rad=(300.0, 300.0), tissue_range_hz=(20.0, 20.0)),
    ),
}


@pytest.mark.parametrize("name", CASES)
def test_the_compiled_plant_solves_the_equations_of_motion(name):
    rig, time, angle, shown = walk(CASES[name])
    reference = Reference(rig)
    states = reference.solve(time)
    theta = np.array([reference.path(t)[0] for t in time])
    exo = states[:, 0] if rig.preset.body is None else states[:, 8]
    assert np.abs(exo).max() > 0.15  # the pulses moved it
    print(name, np.abs(angle-theta-exo).max(), np.abs(exo).max())
    np.testing.assert_allclose(angle, theta + exo, rtol=0, atol=EXACT)
    tools, settings = reference.tools, rig.preset.goniometer
    lagged = states[:, 3] if tools.angle_lag_s > 0 else theta + states[:, 0]
    late = round(settings.delay_s * 500.0)
    expected = tools.angle_gain * np.concatenate([np.full(late, lagged[0]), lagged])[: time.size]
    if settings.torsion_rad_nm == 0.0:
        np.testing.assert_allclose(shown, expected, rtol=0, atol=EXACT)
