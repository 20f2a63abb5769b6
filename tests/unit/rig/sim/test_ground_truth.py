"""The truth about a simulated condition."""

from dataclasses import replace

import numpy as np
import pandas as pd
import pytest
from scipy.integrate import solve_ivp
from scipy.optimize import least_squares

from jointz.core.gait_phases import TIMING_POINTS
from jointz.core.protocols.pulse_models import PulseSpec
from jointz.rig.devices.interface import Stretch
from jointz.rig.sim.ground_truth import window_weights
from jointz.rig.sim.people import draw_person
from jointz.rig.sim.presets import JointSettings, preset
from jointz.rig.sim.rig import SimulatedRig, simulated_rig
from jointz.rig.sim.walking.impedance_curves import impedance_over_cycle

COLUMNS = ["pulse", "onset_s", "duration_s", "amplitude_nm", "timing_point", "completed"]
WHOLE = (Stretch(0, 0.0, 30.0),)
PARAMETERS = ("stiffness", "damping", "inertia")
RATE_HZ = 2000.0
TIMES = np.arange(201) / RATE_HZ
CENTRE_S = 0.05
LATE_S = 0.006
# Residuals of a sum that is an integral: the last sample counts half.
FOLD = np.append(np.ones(TIMES.size - 1), 0.5**0.5)
#: A joint whose parameters all change within the window.
VARYING = {
    "K": lambda t: 60.0 + 100.0 * t,
    "B": lambda t: 3.0 - 10.0 * t,
    "J": lambda t: 0.05 + 0.1 * t,
}


def pulses_at(rig, share, *, offset_s=0.0, strides=(3, 7), segment=0, amplitude_nm=17.0):
    """Return pulses at a share of some strides."""
    motion = rig.motion("perturbed", segment)
    walk = [motion.next() for _ in range(max(strides) + 1)]
    rows = []
    for number, i in enumerate(strides, start=1):
        fine = np.linspace(0.0, walk[i].duration_s, 20001)
        into = np.interp(share, walk[i].cycles(walk[i].start_s + fine), fine)
        onset = walk[i].start_s + into + offset_s
        rows.append((number, onset, 0.25, amplitude_nm, "LRE", True))
    return pd.DataFrame(rows, columns=COLUMNS)


def truth_of(rig, pulses, *, stretches=WHOLE, **more):
    return rig.truth("perturbed", worn=True, stretches=stretches, pulses=pulses, **more)


def test_heel_strikes_are_those_that_were_walked_with_the_offset_added():
    rig = simulated_rig(0)
    nothing = pd.DataFrame(columns=COLUMNS)
    stretches = (Stretch(0, 5.0, 20.0),)
    truth = truth_of(rig, nothing, stretches=stretches)
    motion = rig.motion("perturbed", 0)
    starts = np.array([motion.next().start_s for _ in range(40)])
    expected = starts[(starts >= 0) & (starts <= 20.0)] + 5.0
    np.testing.assert_allclose(truth["heel_strike_s"], expected, rtol=0, atol=1e-12)
    assert truth["pulses"] == []


def test_a_pulse_that_was_broken_off_is_no_truth():
    rig = simulated_rig(2)
    pulses = pulses_at(rig, 0.07)
    pulses.loc[0, "completed"] = False
    truth = truth_of(rig, pulses)
    assert [row["pulse"] for row in truth["pulses"]] == [2]


def test_ramps_delay_the_response_that_weighs():
    rig = simulated_rig(2)
    shape = PulseSpec(
        amplitude_nm=17.0, duration_s=0.25, ramp_up_s=0.075, hold_s=0.1, ramp_down_s=0.075
    )
    step, ramp = (truth_of(rig, pulses_at(rig, 0.73), shapes=s) for s in (None, {"": shape}))
    for a, b in zip(step["pulses"], ramp["pulses"], strict=True):
        assert abs(b["displacement_rad"]) < 0.8 * abs(a["displacement_rad"])
        assert b["stiffness"] != pytest.approx(a["stiffness"], rel=1e-3)


def test_truth_on_a_plateau_is_the_persons_value():
    rig = simulated_rig(2)
    truth = truth_of(rig, pulses_at(rig, 0.07))
    person = rig.person
    assert len(truth["pulses"]) == 2
    for row in truth["pulses"]:
        assert row["onset_gait_pct"] == pytest.approx(7.0, abs=1e-4)
        assert row["stiffness"] == pytest.approx(person.mass_kg * person.stiffness_per_mass["LRE"])
        assert row["damping"] == pytest.approx(person.mass_kg * person.damping_per_mass["LRE"])
        assert row["inertia"] == pytest.approx(person.inertia)
        assert 0.05 < row["displacement_rad"] < 0.6
    assert truth["timing_points"]["LRE"]["inertia"] == pytest.approx(person.inertia)


def constant(value):
    return lambda _: value


def refitted(joint, name):
    """Return the value of one parameter that fits the angle of a joint best; the others known.

    An own simulation (scipy) and least squares over the window, by the trapezoidal rule.
    """
    reached, _ = solved(joint)
    size = abs(reached).max() / FOLD

    def residual(share):
        value = share[0] * joint[name](CENTRE_S)
        return (solved({**joint, name: constant(value)})[0] - reached) / size

    return joint[name](CENTRE_S) * fitted(residual, 1.0)


def looked_up(times, values):
    """Return the straight lines through evenly spaced values, quicker than numpy's."""
    per_s, values = (times.size - 1) / times[-1], [*values.tolist(), values[-1]]

    def at(t):
        place = t * per_s
        i = int(place)
        return values[i] + (place - i) * (values[i + 1] - values[i])

    return at


def fitted(residual, guess):
    tight = {"xtol": 1e-13, "ftol": 1e-13, "gtol": 1e-13}
    return least_squares(residual, [guess], diff_step=1e-4, x_scale=0.1, **tight).x[0]


def solved(joint):
    """Return deviation and rate at TIMES under 17 N*m behind 6 ms and a first order of 12 ms."""

    def rhs(t, state):
        torque = -17.0 * np.expm1(-(t - LATE_S) / 0.012)
        return [
            state[1],
            (torque - joint["B"](t) * state[1] - joint["K"](t) * state[0]) / joint["J"](t),
        ]

    after = TIMES > LATE_S
    states = np.zeros((2, TIMES.size))
    states[:, after] = solve_ivp(
        rhs,
        (LATE_S, TIMES[-1]),
        [0.0, 0.0],
        method="DOP853",
        t_eval=TIMES[after],
        rtol=1e-9,
        atol=1e-12,
        max_step=0.005,
    ).y
    return states


def weights_of(joint, name):
    x, v = solved(joint)
    K, B, J = (np.array([joint[one](t) for t in TIMES]) for one in "KBJ")
    torque = -17.0 * np.expm1(-np.maximum(TIMES - LATE_S, 0.0) / 0.012)
    motion = {"K": x, "B": v, "J": (torque - B * v - K * x) / J}[name]
    return window_weights(motion, K, B, J, rate_hz=RATE_HZ)


@pytest.mark.parametrize("at_s", [0.02, 0.045, 0.075])
@pytest.mark.parametrize("name", ["K", "B", "J"])
def test_a_change_in_a_narrow_stretch_moves_a_fit_of_the_angle_by_its_weight(name, at_s):
    unit = VARYING[name](CENTRE_S)

    def change(t):
        return np.exp(-0.5 * ((t - at_s) / 0.004) ** 2)

    def shifted(size):
        """Return what a constant added to the parameter has to be for the joint that changed."""
        changed = {**VARYING, name: lambda t: VARYING[name](t) + size * unit * change(t)}
        reached, _ = solved(changed)

        def residual(share):
            joint = {**VARYING, name: lambda t: VARYING[name](t) + share[0] * unit}
            return (solved(joint)[0] - reached) * FOLD / abs(reached).max()

        return fitted(residual, 0.0)

    # Up and down: what is left is linear in the change.
    moved = (shifted(0.02) - shifted(-0.02)) / 0.04
    assert moved == pytest.approx(weights_of(VARYING, name) @ change(TIMES), rel=1e-3)


def test_the_truth_of_a_pulse_is_what_a_fit_of_the_angle_finds():
    # Stiffness and damping change between loading response and mid-stance (18 to 21 %).
    person = draw_person(2, seed=1)
    points = {"LRE": 1.1, "MST": 0.95}
    person = replace(
        person,
        stiffness_per_mass=dict.fromkeys(TIMING_POINTS, 1.0) | points,
        damping_per_mass=dict.fromkeys(TIMING_POINTS, 0.04)
        | {name: 0.04 * share for name, share in points.items()},
    )
    rig = SimulatedRig(person, preset("hard"))
    pulses = pulses_at(rig, 0.14, strides=(3,))
    row = truth_of(rig, pulses)["pulses"][0]
    motion = rig.motion("perturbed", 0)
    stride = [motion.next() for _ in range(4)][3]
    fine = np.linspace(0.0, TIMES[-1], 1001)
    phase = stride.cycles(float(pulses["onset_s"].iloc[0]) + fine)
    curves = dict(zip("KBJ", impedance_over_cycle(person, rig.preset, phase), strict=False))
    curves["J"] = curves["J"] + rig.preset.actuator.rotor_inertia
    joint = {name: looked_up(fine, curve) for name, curve in curves.items()}
    assert row["stiffness"] == pytest.approx(refitted(joint, "K"), rel=2e-3)
    assert row["damping"] == pytest.approx(refitted(joint, "B"), rel=2e-3)
    moved = row["inertia"] + rig.preset.actuator.rotor_inertia
    assert moved == pytest.approx(refitted(joint, "J"), rel=2e-3)
    # Each parameter has a middle of its own: the inertia early, the stiffness late.
    weights = {name: weights_of(joint, name) for name in "KBJ"}
    after_pct = np.interp(TIMES, fine, 100.0 * (phase - phase[0]))
    for name, parameter in zip("KBJ", PARAMETERS, strict=True):
        centre = weights[name] @ after_pct
        assert row[f"{parameter}_centre_pct"] == pytest.approx(centre, rel=2e-3)
    assert 0 < row["inertia_centre_pct"] < row["damping_centre_pct"] < row["stiffness_centre_pct"]
    assert row["stiffness_centre_pct"] < after_pct[-1]


def test_truth_does_not_depend_on_the_sign_or_the_size_of_a_pulse():
    rig = simulated_rig(2, preset="hard")
    rows = [truth_of(rig, pulses_at(rig, 0.5, amplitude_nm=a)) for a in (17.0, -5.0)]
    for name in PARAMETERS:
        one, two = (r["pulses"][0][name] for r in rows)
        assert one == pytest.approx(two, rel=1e-9)


def test_a_softening_joint_is_truly_softer_for_larger_pulses():
    soft = replace(preset("nominal"), joint=JointSettings(softening_rad=0.3))
    rig = SimulatedRig(draw_person(2, seed=1), soft)
    small, large = (truth_of(rig, pulses_at(rig, 0.07, amplitude_nm=a)) for a in (0.1, 17.0))
    stiff = rig.person.mass_kg * rig.person.stiffness_per_mass["LRE"]
    assert small["pulses"][0]["stiffness"] == pytest.approx(stiff, rel=1e-4)
    assert large["pulses"][0]["stiffness"] < 0.97 * stiff


def test_stretches_have_strides_of_their_own_also_when_another_process_ran_them():
    rig = simulated_rig(1)
    offsets = (0.0, 60.0)
    stretches = tuple(Stretch(i, offset, 50.0) for i, offset in enumerate(offsets))
    pulses = pd.concat(
        [
            pulses_at(rig, 0.07, strides=(4,)),
            pulses_at(rig, 0.07, strides=(4,), segment=1, offset_s=60.0),
        ]
    )
    truth = truth_of(rig, pulses, stretches=stretches)
    strikes = np.array(truth["heel_strike_s"])
    assert [row["onset_gait_pct"] for row in truth["pulses"]] == pytest.approx([7.0, 7.0], abs=1e-4)
    for segment, offset in enumerate(offsets):
        first = rig.motion("perturbed", segment)
        first.next()
        assert np.abs(strikes - offset - first.next().start_s).min() < 1e-12
    assert (np.diff(strikes) > 0).all()


def test_gravity_adds_to_the_stiffness_of_an_anthropometric_leg_only():
    rig = simulated_rig(0, preset="anthropometric")
    truth = truth_of(rig, pulses_at(rig, 0.07))
    # SCIENCE 3.8: about 11 N*m/rad for shank and exoskeleton.
    assert truth["pulses"][0]["gravity_stiffness"] == pytest.approx(11.0, rel=0.35)
    gravities = [row["gravity_stiffness"] for row in truth["pulses"]]
    assert truth["timing_points"]["LRE"]["gravity_stiffness"] == pytest.approx(np.mean(gravities))
    rigid = simulated_rig(0)
    truth = truth_of(rigid, pulses_at(rigid, 0.07))
    assert truth["pulses"][0]["gravity_stiffness"] == 0.0
