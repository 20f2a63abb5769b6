"""The compiled plant against the equations of motion, written a second time and solved by scipy."""

from bisect import bisect_right
from cmath import exp as turned
from dataclasses import replace
from itertools import pairwise
from math import exp, pi, radians, sin, tanh

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from jointz.core.clock import VirtualClock
from jointz.core.gait_phases import TIMING_POINTS
from jointz.rig.sim.people import draw_instruments, draw_person
from jointz.rig.sim.presets import BodySettings, JointSettings, Preset, ReflexSettings, preset
from jointz.rig.sim.rig import SimulatedRig
from jointz.rig.sim.walking.impedance_curves import impedance_over_cycle, leg_of
from jointz.rig.sim.walking.layout import Gait, Noise
from jointz.rig.sim.walking.plant_build import Grid, build_plant

SECONDS = 1.3
PULSES = ((0.10, 17.0), (0.60, -12.0), (0.95, 17.0))
PULSE_S = 0.25
EXACT = 1e-6  # rad
STRETCH = 10  # samples that scipy solves in one go: shorter than any reflex latency


def exact(name, *, torque_error=0.0):
    """Return a preset without quanta and white noise: what is left is physics."""
    one = preset(name)
    return replace(
        one,
        actuator=replace(
            one.actuator,
            angle_step_rad=0.0,
            velocity_step_rad_s=0.0,
            current_step_a=0.0,
            torque_error_sd_nm=torque_error,
        ),
        goniometer=replace(
            one.goniometer, white_sd_rad=0.0, coloured_sd_rad=0.0, torsion_rad_nm=0.0
        ),
    )


def walk(settings):
    """Return the rig, device time and the angles of exoskeleton and goniometer."""
    rig = SimulatedRig(draw_person(2, seed=5), settings, grid=Grid(500.0))
    clock = VirtualClock()
    devices = rig.open("perturbed", worn=True, segment=0, clock=clock)
    for device in devices.all():
        device.configure()
        device.activate()
    actuator, angle = [], []
    for k in range(round(SECONDS * 500.0)):
        clock.wait_until_ns(k * 2_000_000)
        actuator += devices.actuator.read()
        angle += devices.angle.read()
        devices.actuator.command_torque(commanded(k / 500.0))
    time = np.array([s.device_time_ns for s in actuator]) * 1e-9
    return rig, time, np.array([s.angle for s in actuator]), np.array([s.value for s in angle])


def commanded(time_s):
    # The microsecond keeps the edges of pulses on their samples.
    return sum(a for at, a in PULSES if at <= time_s + 1e-6 < at + PULSE_S)


class Path:
    """The unperturbed knee, from the strides' polynomials and Fourier series."""

    def __init__(self, motion):
        self.strides = [motion.next() for _ in range(6)]
        self.starts = [s.start_s for s in self.strides]
        self.rows = [s.row.tolist() for s in self.strides]

    def phase(self, t):
        which = bisect_right(self.starts, t) - 1
        T, row = self.strides[which].duration_s, self.rows[which]
        u = (t - self.starts[which]) / T
        c1, c3, c4, c5 = (row[i] for i in (Gait.LINEAR, Gait.CUBIC, Gait.QUARTIC, Gait.QUINTIC))
        return (
            row,
            c1 * u + c3 * u**3 + c4 * u**4 + c5 * u**5,
            (c1 + 3 * c3 * u**2 + 4 * c4 * u**3 + 5 * c5 * u**4) / T,
            (6 * c3 * u + 12 * c4 * u**2 + 20 * c5 * u**3) / T**2,
        )

    def __call__(self, t):
        row, p, p1, p2 = self.phase(t)
        a, b = [0.0] * 3, [0.0] * 3
        for h in range(7):
            d = 2j * pi * h
            turn = turned(d * p)
            for n in range(3):
                a[n] += ((row[Gait.COSINES + h] - 1j * row[Gait.SINES + h]) * d**n * turn).real
                change = row[Gait.COSINE_CHANGES + h] - 1j * row[Gait.SINE_CHANGES + h]
                b[n] += (change * d**n * turn).real
        w = 6 * p**5 - 15 * p**4 + 10 * p**3
        w1 = 30 * p**4 - 60 * p**3 + 30 * p**2
        w2 = 120 * p**3 - 180 * p**2 + 60 * p
        slope = a[1] + w1 * b[0] + w * b[1]
        bend = a[2] + w2 * b[0] + 2 * w1 * b[1] + w * b[2]
        return a[0] + w * b[0], slope * p1, bend * p1**2 + slope * p2


class Reference:
    """The equations of motion, and scipy's solution with dense output for delays."""

    def __init__(self, rig):
        self.preset, self.person = rig.preset, rig.person
        self.tools = draw_instruments(rig.person, rig.preset)
        self.gravity = leg_of(rig.person).gravity_nm
        self.path = Path(rig.motion("perturbed", 0))
        self.solutions, self.ends = [], []
        self.curves = build_plant(rig.person, rig.preset, grid=rig.grid, worn=True).curves.tolist()
        a = self.preset.actuator
        keep = exp(-rig.grid.period_s / a.torque_error_time_s)
        drive = a.torque_error_sd_nm * (1 - keep**2) ** 0.5
        normal = rig.person.stream("noise perturbed", 0).standard_normal((4096, len(Noise)))
        self.errors = [0.0]
        for one in normal[1:, Noise.TORQUE_ERROR]:
            self.errors.append(keep * self.errors[-1] + drive * one)
        self.period_s = rig.grid.period_s

    def error(self, t):
        k = t / self.period_s
        i = int(k)
        return self.errors[i] + (k - i) * (self.errors[i + 1] - self.errors[i])

    def impedance(self, phase):
        """Return K, B, J, thigh out of the table, whose own test compares it with the curves."""
        place = phase % 1.0 * len(self.curves)
        row, r = self.curves[int(place)], place % 1.0
        return [
            row[j] + r * row[j + 1] + r**2 * row[j + 2] + r**3 * row[j + 3] for j in (0, 4, 8, 12)
        ]

    def stretch(self, t):
        reflex = self.preset.joint.reflex
        if reflex is None or t <= reflex.latency_s:
            return 0.0
        then = t - reflex.latency_s
        x, v = self.solutions[bisect_right(self.ends, then - 1e-12)](then)[:2]
        return max(0.0, reflex.velocity_time_s * v if reflex.kind == "velocity" else x)

    def rhs(self, t, s, wanted):
        x, v, i, g, r, rd, y, yd, xe, ve = s.tolist()
        a, joint, body = self.preset.actuator, self.preset.joint, self.preset.body
        theta, rate, bend = self.path(t)
        K, B, J, thigh = self.impedance(self.path.phase(t)[1])
        friction = self.tools.friction_gain * (a.coulomb_friction + a.gear_friction * abs(i))
        torque = a.gear_ratio * a.torque_constant / self.tools.torque_gain * i + self.error(t)
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
            held += self.gravity * (sin(theta + x - thigh) - sin(theta - thigh))
            stiffness = self.tools.strap_stiffness
            strap = stiffness * (xe - x) + stiffness * body.strap_damping_time_s * (ve - v)
            acceleration = (strap - held) / J
            torque -= friction * tanh((rate + ve) / a.sign_velocity_rad_s)
            weight = body.frame_mass_kg * 9.81 * body.frame_distance_m
            torque -= weight * sin(theta + xe - thigh) + strap
            exo = torque / (a.rotor_inertia + body.frame_mass_kg * body.frame_distance_m**2) - bend
        tissue, shown = 0.0, theta + x
        if self.preset.goniometer.tissue_range_hz is not None:
            w = 2 * pi * self.tools.tissue_hz
            damper = 2 * self.preset.goniometer.tissue_damping * w
            tissue = w**2 * (theta + x - y) + damper * (rate + v - yd)
            shown = y
        lag = self.tools.angle_lag_s - self.preset.goniometer.delay_s
        lagged = (shown - g) / lag if lag > 0 else 0.0
        return [
            v,
            acceleration,
            (wanted - i) / a.time_constant_s,
            lagged,
            rd,
            twitch,
            yd,
            tissue,
            ve,
            exo,
        ]

    def joint_torque(self, t, state):
        """Return the torque on a joint without strap, softening and reflex, N*m."""
        K, B, J, _ = self.impedance(self.path.phase(t)[1])
        return J * self.rhs(t, state, 0.0)[1] + B * state[1] + K * state[0]

    def solve(self, times):
        """Return the state at all times; stretches end where an input has a corner."""
        a = self.preset.actuator
        theta, rate, _ = self.path(0.0)
        state = np.array([0, 0, 0, theta, 0, 0, theta, rate, 0, 0], dtype=float)
        states, edges = [state], {t + a.delay_s for at, _ in PULSES for t in (at, at + PULSE_S)}
        every = 1 if a.torque_error_sd_nm else STRETCH
        for first in range(0, times.size - 1, every):
            inside = times[first : first + every + 1]
            corners = [
                c for c in (*self.path.starts, *edges) if inside[0] + 1e-9 < c < inside[-1] - 1e-9
            ]
            borders = [inside[0], *sorted(corners), inside[-1]]
            found = {}
            for t0, t1 in pairwise(borders):
                wanted = commanded(0.5 * (t0 + t1) - a.delay_s) / (a.gear_ratio * a.torque_constant)
                solved = solve_ivp(
                    self.rhs,
                    (t0, t1),
                    state,
                    method="DOP853",
                    rtol=1e-11,
                    atol=1e-13,
                    dense_output=True,
                    args=(wanted,),
                )
                state = solved.y[:, -1]
                self.solutions.append(solved.sol)
                self.ends.append(t1)
                found |= {t: solved.sol(t) for t in inside if t0 < t <= t1}
            states += [found[t] for t in inside[1:]]
        return np.array(states)


def instrumented(one: Preset, **settings):
    return replace(one, goniometer=replace(one.goniometer, **settings))


SMOOTH = JointSettings(smooth=True)
CASES = {
    "nominal, with torque error": exact("nominal", torque_error=0.25),
    "hard": exact("hard"),
    "anthropometric": exact("anthropometric"),
    "soft tissue on a rigid leg, torsion, gain": instrumented(
        exact("nominal"),
        tissue_range_hz=(20.0, 40.0),
        torsion_rad_nm=radians(0.5) / 17.0,
        gain_error=0.03,
    ),
    "soft tissue and a delay only, velocity reflex, softening": replace(
        instrumented(exact("nominal"), tissue_range_hz=(40.0, 40.0), lag_range_s=(0.002, 0.002)),
        joint=JointSettings(reflex=ReflexSettings(), softening_rad=0.3),
    ),
    "position reflex, smooth curves, soft strap": replace(
        instrumented(exact("anthropometric"), tissue_range_hz=(20.0, 20.0)),
        joint=JointSettings(reflex=ReflexSettings(gain=1.0, kind="position"), smooth=True),
        body=BodySettings(strap_range_nm_rad=(300.0, 300.0)),
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
    np.testing.assert_allclose(angle, theta + exo, rtol=0, atol=EXACT)
    tools, goniometer = reference.tools, rig.preset.goniometer
    late = round(goniometer.delay_s * 500.0)
    followed = theta + states[:, 0] if goniometer.tissue_range_hz is None else states[:, 6]
    lagged = states[:, 3] if tools.angle_lag_s > goniometer.delay_s else followed
    expected = np.concatenate([np.full(late, lagged[0]), lagged])[: time.size]
    expected *= tools.angle_gain
    if goniometer.torsion_rad_nm:
        torque = [reference.joint_torque(t, state) for t, state in zip(time, states, strict=True)]
        expected += goniometer.torsion_rad_nm * np.array(torque)
        shown, expected = shown[1:], expected[1:]  # nothing accelerates at the first sample
    np.testing.assert_allclose(shown, expected, rtol=0, atol=EXACT)


@pytest.mark.parametrize("name", ["nominal", "hard", "anthropometric"])
def test_the_packed_curves_are_the_curves_of_the_person(name):
    person, settings = draw_person(4, seed=2), preset(name)
    curves = build_plant(person, settings, grid=Grid(), worn=True).curves
    cycles = np.linspace(0.0, 1.0, 5001)[:-1]
    place = cycles * len(curves)
    row, r = curves[place.astype(int)], place % 1.0
    for j, wanted in enumerate(impedance_over_cycle(person, settings, cycles)):
        got = sum(row[:, 4 * j + n] * r**n for n in range(4))
        # The corners of stance and swing of the leg lie inside pieces: 0.1 % of its inertia.
        np.testing.assert_allclose(got, wanted, rtol=1e-3 if j == 2 else 1e-6)


def test_smooth_curves_meet_the_persons_values_in_the_middle_of_the_windows_of_100_ms():
    person, settings = draw_person(0, seed=1), replace(preset("nominal"), joint=SMOOTH)
    middles = np.array(list(TIMING_POINTS.values())) + 100.0 * 0.05 / 1.1
    found = impedance_over_cycle(person, settings, middles / 100.0)
    for per_mass, got in ((person.stiffness_per_mass, 0), (person.damping_per_mass, 1)):
        wanted = person.mass_kg * np.array(list(per_mass.values()))
        # The middle is known to 0.05 % of the cycle.
        np.testing.assert_allclose(found[got], wanted, rtol=0.01)
    cycles = np.linspace(0.0, 1.0, 2001)
    stiffness, damping = impedance_over_cycle(person, settings, cycles % 1.0)[:2]
    for curve in (stiffness, damping):
        assert (curve > 0.0).all()
        assert np.abs(np.diff(curve)).max() < 0.01 * curve.max()  # no step, not at heel strike
        assert np.count_nonzero(np.abs(np.diff(curve)) < 1e-9 * curve.max()) == 0  # no plateau


def test_a_knee_with_a_free_hip_feels_the_two_links_equations_of_motion():
    leg = leg_of(replace(draw_person(0, seed=3), mass_kg=73.0, height_m=1.74))
    for knee in np.radians([0.0, 20.0, 62.0]):
        coupling = leg.mass_kg * leg.thigh_length_m * leg.centre_m * np.cos(knee)
        thigh = leg.thigh_inertia + leg.mass_kg * leg.thigh_length_m**2
        masses = [[thigh, coupling], [coupling, leg.inertia]]
        # 1 N*m between the links, absolute angles of the links.
        first, second = np.linalg.solve(masses, [-1.0, 1.0])
        assert leg.free_inertia(np.array([knee]))[0] == pytest.approx(1.0 / (second - first))


def test_the_inertia_over_the_cycle_is_that_of_a_closed_chain_in_stance_and_two_links_in_swing():
    person = replace(draw_person(0, seed=3), mass_kg=73.0, height_m=1.74)
    cycles = np.linspace(0.0, 1.0, 201)[:-1]
    inertia = impedance_over_cycle(person, preset("anthropometric"), cycles)[2]
    stance, swing = inertia[cycles < 0.62], inertia[(cycles > 0.67) & (cycles < 0.95)]
    # Measured ranges, kg*m^2: 0.17-0.43 in stance, 0.10-0.21 in swing; proportions differ by 10 %.
    assert 0.17 * 0.9 < stance.min() < stance.max() < 0.43 * 1.1
    assert 0.10 * 0.9 < swing.min() < swing.max() < 0.21 * 1.1
