"""A weight on the shank and a spring across the knee of a simulated walker."""

from dataclasses import replace
from math import cos, radians

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.optimize import least_squares

from jointz.core.gait_phases import TIMING_POINTS
from jointz.core.protocols.protocol_models import LoadSpec
from jointz.core.protocols.pulse_models import PulseSpec
from jointz.rig.devices.interface import Stretch
from jointz.rig.sim.direct_walk import WalkPlan, walk_directly
from jointz.rig.sim.people import draw_person
from jointz.rig.sim.presets import preset
from jointz.rig.sim.rig import SimulatedRig
from jointz.rig.sim.walking.impedance_curves import added_inertia, impedance_over_cycle, leg_of
from jointz.rig.sim.walking.knee_joint import knee_angle
from jointz.rig.sim.walking.known_addition import draw_addition
from jointz.rig.sim.walking.plant_build import Grid

CUFF = LoadSpec(
    name="cuff",
    mass_kg={"value": 2.0, "sd": 0.02},
    distance_m={"value": 0.25, "sd": 0.005},
)
BAND = LoadSpec(name="band", stiffness={"value": 30.0, "sd": 0.6})
PERSON = draw_person(1, seed=3)
CONDITION = "perturbed"
RATE_HZ, WINDOW = 2000.0, 180  # samples: 90 ms, within the plateaus of K and B


def frictionless():
    """Return a preset whose device passes on the torque of its current and nothing else."""
    one = preset("clean")
    actuator = replace(
        one.actuator,
        coulomb_friction=0.0,
        gear_friction=0.0,
        angle_step_rad=0.0,
        current_step_a=0.0,
    )
    return replace(one, actuator=actuator)


def rig_with(load, settings, **arguments):
    loads = {} if load is None else {CONDITION: load}
    return SimulatedRig(PERSON, settings, loads=loads, **arguments)


def plan(amplitude_nm):
    pulse = PulseSpec(amplitude_nm=amplitude_nm, duration_s=0.1, hold_s=0.1)
    return WalkPlan(pulse=pulse, per_point=1)


def fitted_impedance(load, *, weight_nm=0.0):
    """Return timing point -> K, B, J of device and joint, by an ODE and least squares.

    K is without the gravity of a weight, m g d times the cosine of the shank's angle.
    """
    settings = frictionless()
    rig = rig_with(load, settings, grid=Grid(RATE_HZ))
    walk, level = (walk_directly(rig, CONDITION, plan=plan(size)) for size in (1.0, 1e-9))
    per_ampere = settings.actuator.gear_ratio * settings.actuator.torque_constant
    time = np.arange(WINDOW) / RATE_HZ
    impedance = {}
    for pulse in walk.pulses.to_dict("records"):
        at = round(pulse["onset_s"] * RATE_HZ) + np.arange(WINDOW)
        moved = (walk.channels["motor_angle"] - level.channels["motor_angle"])[at]
        torque = per_ampere * (walk.channels["current"] - level.channels["current"])[at]
        phase = TIMING_POINTS[pulse["timing_point"]] / 100.0 + time / PERSON.stride_time_s
        thigh = impedance_over_cycle(PERSON, settings, phase)[3]
        gravity = weight_nm * np.cos(level.channels["motor_angle"][at] - thigh)
        impedance[pulse["timing_point"]] = fit(time, torque, moved, gravity)
    return impedance


def fit(time, torque, moved, gravity):
    def errors(values):
        K, B, J = values

        def slope(t, state):
            applied, beside = np.interp(t, time, torque), np.interp(t, time, gravity)
            return state[1], (applied - B * state[1] - (K + beside) * state[0]) / J

        x = solve_ivp(slope, (0.0, time[-1]), (0.0, 0.0), t_eval=time, max_step=1e-3).y[0]
        return 1e4 * (x - moved)

    return least_squares(errors, (40.0, 2.0, 0.1), x_scale=(40.0, 2.0, 0.1)).x


@pytest.fixture(scope="module")
def without():
    return fitted_impedance(None)


def test_the_free_response_with_a_weight_has_its_inertia_and_gravity(without):
    loaded = fitted_impedance(CUFF, weight_nm=2.0 * 9.81 * 0.25)
    added = {point: found - without[point] for point, found in loaded.items()}

    assert [J for _, _, J in added.values()] == pytest.approx([2.0 * 0.25**2] * 6, rel=0.01)
    assert [B for _, B, _ in added.values()] == pytest.approx([0.0] * 6, abs=0.03)
    assert [K for K, _, _ in added.values()] == pytest.approx([0.0] * 6, abs=0.1)


def test_the_free_response_with_a_spring_has_its_stiffness(without):
    added = {point: found - without[point] for point, found in fitted_impedance(BAND).items()}

    assert [K for K, _, _ in added.values()] == pytest.approx([30.0] * 6, rel=0.01)
    assert [J for _, _, J in added.values()] == pytest.approx([0.0] * 6, abs=0.001)


def test_the_path_of_the_person_stays_the_same():
    settings = preset("realistic")
    own, loaded = (
        walk_directly(rig_with(load, settings), CONDITION, plan=plan(1e-9)).channels["angle"]
        for load in (None, CUFF)
    )
    # Friction of the device moves the leg by a little, by less with the weight.
    assert np.abs(loaded - own).max() < radians(0.5)


@pytest.mark.parametrize("distance_m", [0.1, 0.25, 0.4])
def test_a_free_leg_feels_a_weight_as_two_links_with_a_point_mass(distance_m):
    settings, cycles = preset("realistic"), np.array([0.75, 0.8, 0.85])
    leg, mass_kg = leg_of(PERSON, settings.body), 2.0
    spec = CUFF.model_copy(
        update={"distance_m": CUFF.distance_m.model_copy(update={"value": distance_m, "sd": 0.0})}
    )
    load = draw_addition(spec, PERSON, settings)
    mass_kg = load.mass_kg

    def felt(mass, q):
        """Return the knee's inertia with a hip free of torque, from the mass matrix."""
        L, d, own = leg.thigh_length_m, distance_m, leg.mass_kg
        # Velocities of thigh and shank in space: columns (thigh, knee) -> (phi', phi' - q').
        segments = np.array([[1.0, 0.0], [1.0, -1.0]])
        above = leg.thigh_inertia + (own + mass) * L**2
        coupling = (own * leg.centre_m + mass * d) * L * cos(q)
        space = np.array([[above, coupling], [coupling, leg.inertia + mass * d**2]])
        matrix = segments.T @ space @ segments
        return 1.0 / np.linalg.inv(matrix)[1, 1]

    expected = [felt(mass_kg, q) - felt(0.0, q) for q in knee_angle(cycles)]
    assert added_inertia(PERSON, settings, load, cycles) == pytest.approx(expected, rel=1e-9)


def test_a_leg_that_stands_feels_a_weight_by_how_far_its_place_moves():
    settings, cycles = preset("realistic"), np.array([0.1, 0.215, 0.405])
    leg, load = leg_of(PERSON, settings.body), draw_addition(CUFF, PERSON, settings)
    L, S = leg.thigh_length_m, leg.shank_length_m

    def place(q):
        """Return where the weight is: the ankle at 0, the hip on the vertical through it."""
        reach = np.sqrt(L**2 + S**2 + 2.0 * L * S * np.cos(q))
        tilt = np.arcsin(L * np.sin(q) / reach)  # of the shank
        return (S - load.distance_m) * np.array([np.sin(tilt), np.cos(tilt)])

    knee, tiny = knee_angle(cycles), 1e-6
    speed = np.hypot(*(place(knee + tiny) - place(knee - tiny)) / (2.0 * tiny))
    expected = load.mass_kg * speed**2
    assert added_inertia(PERSON, settings, load, cycles) == pytest.approx(expected, rel=1e-6)
    assert (expected < 0.3 * load.inertia).all()


def truth_with(load, name):
    rig = rig_with(load, preset(name))
    walk = walk_directly(rig, CONDITION, plan=plan(12.0))
    stretches = [Stretch(0, 0.0, walk.end_s)]
    return rig.truth(CONDITION, worn=True, stretches=stretches, pulses=walk.pulses)


@pytest.mark.parametrize("name", ["nominal", "realistic"])
def test_the_truth_states_the_addition_beside_the_persons_own_values(name):
    own, cuff, band = (truth_with(load, name) for load in (None, CUFF, BAND))

    for loaded in (cuff, band):
        for curve, values in own["curves"].items():
            assert loaded["curves"][curve] == values
        for point, means in own["timing_points"].items():
            # Weights within the window differ with the response; the values do not.
            for key in ("stiffness", "damping", "inertia"):
                assert loaded["timing_points"][point][key] == pytest.approx(means[key], rel=0.15)
    assert "load" not in own
    assert cuff["load"]["inertia"] == pytest.approx(2.0 * 0.25**2, rel=0.15)
    assert cuff["load"]["inertia"] != 2.0 * 0.25**2
    assert cuff["load"]["gravity_nm"] == pytest.approx(
        9.81 * cuff["load"]["mass_kg"] * cuff["load"]["distance_m"]
    )
    band_stiffness = band["load"]["stiffness"]
    assert 28.0 < band_stiffness < 32.0
    for means in band["timing_points"].values():
        assert means["added_stiffness"] == pytest.approx(band_stiffness)
        assert means["added_inertia"] == 0.0


def test_what_is_mounted_scatters_as_the_stated_errors_do():
    drawn = [draw_addition(CUFF, draw_person(n, seed=1), preset("nominal")) for n in range(400)]
    inertia, gravity = CUFF.added_inertia, CUFF.gravity_nm

    assert np.std([one.inertia for one in drawn]) == pytest.approx(inertia.sd, rel=0.12)
    assert np.std([one.gravity_nm for one in drawn]) == pytest.approx(gravity.sd, rel=0.12)
    assert draw_addition(CUFF, PERSON, preset("clean")).inertia == inertia.value


def test_gyroscopes_show_a_thigh_that_follows_the_heavier_shank():
    settings = preset("realistic")
    own, loaded = (
        walk_directly(rig_with(load, settings), CONDITION, plan=plan(12.0)).channels
        for load in (None, CUFF)
    )
    assert np.abs(own["thigh_velocity"] - loaded["thigh_velocity"]).max() > 0.01
