"""The internal moment of the simulated knee against the truth and the balance of momentum."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.interpolate import CubicSpline

from jointz.core.errors import DataError
from jointz.rig.devices.interface import Stretch
from jointz.rig.sim.direct_walk import WalkPlan, walk_directly
from jointz.rig.sim.people import draw_person
from jointz.rig.sim.presets import JointSettings, MomentSettings, ReflexSettings, preset
from jointz.rig.sim.rig import SimulatedRig
from jointz.rig.sim.walking.impedance_curves import impedance_over_cycle
from jointz.rig.sim.walking.internal_moment import internal_moment
from jointz.rig.sim.walking.knee_joint import knee_angle
from jointz.rig.sim.walking.layout import Param

PERIOD_S = 0.002
PLAN = WalkPlan(per_point=2)
REFLEX_SOFTENING_VOLUNTARY = JointSettings(
    reflex=ReflexSettings(gain=1.0), softening_rad=0.2, voluntary_sd_nm=2.0
)


def rig_with(name="clean", **changes):
    return SimulatedRig(draw_person(3, seed=11), replace(preset(name), **changes))


def truth_of(rig, walk):
    stretches = [Stretch(0, 0.0, walk.end_s)]
    return rig.truth("perturbed", worn=True, stretches=stretches, pulses=walk.pulses)


def path_moment(truth, cycles):
    curve = truth["curves"]
    spline = CubicSpline(np.array(curve["gait_pct"]) / 100.0, curve["moment"], bc_type="periodic")
    return spline(cycles % 1.0)


def cycles_of(rig, time_s):
    """Return the phase of ``clean`` strides, which all last as long."""
    stride = rig.motion("perturbed", 0).next()
    return (time_s - stride.start_s) / stride.duration_s, stride.duration_s


def test_in_a_clean_walk_the_moment_is_that_of_the_path_minus_stiffness_and_damping():
    rig = rig_with()
    walk = walk_directly(rig, "perturbed", plan=PLAN)
    cycles, stride_s = cycles_of(rig, walk.time_s)
    K, B, _, _ = impedance_over_cycle(rig.person, rig.preset, cycles % 1.0)
    step = 1e-4
    path_rate = (knee_angle(cycles + step) - knee_angle(cycles - step)) / (2.0 * step * stride_s)
    x = walk.channels["angle"] - knee_angle(cycles)
    v = walk.channels["motor_velocity"] - path_rate
    expected = path_moment(truth_of(rig, walk), cycles) - K * x - B * v
    assert np.abs(K * x).max() > 10.0
    np.testing.assert_allclose(walk.channels["joint_moment"], expected, rtol=0, atol=0.05)


@pytest.mark.parametrize("joint", [JointSettings(), REFLEX_SOFTENING_VOLUNTARY])
def test_motor_and_moment_together_give_the_change_of_momentum(joint):
    rig = rig_with(joint=joint)
    walk = walk_directly(rig, "perturbed", plan=PLAN)
    params, current = rig.build(worn=True).params, walk.channels["current"]
    velocity = walk.channels["motor_velocity"]
    friction = params[Param.COULOMB_FRICTION] + params[Param.GEAR_FRICTION] * np.abs(current)
    motor = params[Param.TORQUE_PER_AMPERE] * current
    motor -= friction * np.tanh(velocity * params[Param.SIGN_RATE])
    cycles, stride_s = cycles_of(rig, walk.time_s)
    added = walk.channels["joint_moment"] - path_moment(truth_of(rig, walk), cycles)
    step = 1e-4
    path_rate = (knee_angle(cycles + step) - knee_angle(cycles - step)) / (2.0 * step * stride_s)
    rotor = params[Param.EXO_INERTIA]
    momentum = rig.person.inertia * (velocity - path_rate) + rotor * velocity
    total = motor + added
    for onset_s in walk.pulses["onset_s"]:
        first = round(onset_s / PERIOD_S)
        pulse = slice(first, first + 200)
        impulse = np.sum(0.5 * (total[pulse][1:] + total[pulse][:-1])) * PERIOD_S
        change = momentum[pulse][-1] - momentum[pulse][0]
        assert impulse == pytest.approx(change, abs=0.005)  # N*m*s, of 4 by the motor


def test_people_have_the_curve_of_able_bodied_adults_in_sizes_and_timings_of_their_own():
    cycles = np.linspace(0.0, 1.0, 201)
    people = [draw_person(number, seed=7) for number in range(200)]
    curves = np.array([internal_moment(p, cycles) / p.mass_kg for p in people])
    mean = -curves.mean(axis=0)  # extension positive
    peak = int(mean.argmax())
    assert 12.0 <= 100.0 * cycles[peak] <= 16.0
    assert mean[peak] == pytest.approx(0.6, abs=0.05)
    for low, high, value in ((0, 5, -0.28), (36, 46, -0.2), (88, 97, -0.3)):
        inside = (100.0 * cycles >= low) & (100.0 * cycles <= high)
        assert mean[inside].min() == pytest.approx(value, abs=0.05)
    push_off = (100.0 * cycles >= 55) & (100.0 * cycles <= 66)
    assert mean[push_off].max() == pytest.approx(0.2, abs=0.05)
    sizes, timings = curves.min(axis=1), cycles[curves.argmin(axis=1)]
    assert sizes.std() / abs(sizes.mean()) == pytest.approx(0.2, rel=0.2)
    assert timings.std() == pytest.approx(0.015, rel=0.25)
    np.testing.assert_allclose(curves[:, 0], curves[:, -1], rtol=0, atol=1e-12)


class TestMeasurement:
    @pytest.mark.parametrize(
        ("name", "noise_nm"),
        [("clean", 0.0), ("nominal", 1.0), ("hard", 2.0), ("anthropometric", 1.0)],
    )
    def test_noise_is_as_large_as_the_preset_says_and_changes_nothing_else(self, name, noise_nm):
        noisy, exact = (
            walk_directly(rig, "perturbed", plan=PLAN)
            for rig in (rig_with(name), rig_with(name, moment=MomentSettings(noise_sd_nm=0.0)))
        )
        noise = noisy.channels["joint_moment"] - exact.channels["joint_moment"]
        assert noise.std() == pytest.approx(noise_nm, rel=0.03)
        for channel, values in exact.channels.items():
            if channel != "joint_moment":
                assert np.array_equal(noisy.channels[channel], values)

    def test_a_gain_error_belongs_to_the_person_and_is_in_the_truth(self):
        rig = rig_with(moment=MomentSettings(gain_error_sd=0.05, noise_sd_nm=0.0))
        measured = walk_directly(rig, "perturbed", plan=PLAN)
        exact = walk_directly(rig_with(), "perturbed", plan=PLAN).channels["joint_moment"]
        gain = truth_of(rig, measured)["instruments"]["moment_gain"]
        assert 0.001 < abs(gain - 1.0) < 0.15
        np.testing.assert_allclose(measured.channels["joint_moment"], gain * exact, rtol=1e-12)

    def test_the_same_walk_comes_back_sample_for_sample(self):
        one, two = (walk_directly(rig_with("hard"), "perturbed", plan=PLAN) for _ in range(2))
        assert np.array_equal(one.channels["joint_moment"], two.channels["joint_moment"])

    def test_negative_errors_are_refused(self):
        with pytest.raises(DataError, match="noise_sd_nm >= 0, got 0 and -1 N"):
            MomentSettings(noise_sd_nm=-1.0)
