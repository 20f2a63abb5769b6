"""The forward model against an independent simulator, and against what it must not depend on."""

import numpy as np
import pytest
from scipy.signal import lsim
from scipy.special import expit
from tests.unit.identify.walking.independent_leg import IndependentLeg, independent_response
from tests.unit.identify.walking.prior_draws import DOUBLET, PULSES, TIME_S, simulated_person

from jointz.identify.walking.coupling import STRAP
from jointz.identify.walking.estimands import ESTIMANDS, log_moments
from jointz.identify.walking.leg_model import REFLEX, SHANK, LegModel
from jointz.identify.walking.posterior import explain
from jointz.kernels import strapped_leg as columns
from jointz.results.value_scale import LOGARITHM, ValueScale


def drawn(seed, shapes, **more):
    model, priors, _ = simulated_person(seed, shapes=shapes, n_pulses=10, window_s=0.2, **more)
    prior = priors.build(model, STRAP.hypotheses[2])
    rng = np.random.default_rng(seed)
    return model, rng.multivariate_normal(prior.mean, 0.5 * prior.covariance)


def simulated_apart(model, theta, point):
    """Return the deviations that the first shape causes by the independent simulator."""
    layout = model.layout
    stiffness, damping, leg = model.natural(theta[None], point)
    limb = model.limb_inertia(theta[None], point, TIME_S)

    def shared(name):
        return theta[layout.shared(name)]

    since = TIME_S - TIME_S[0]
    velocity = model.points[point].velocity
    inertia, share = np.exp(shared("inertia")), np.clip(np.exp(shared("device_share")), 0.01, 0.6)
    reduced, turn = inertia * share * (1.0 - share), 2 * np.pi * np.exp(shared("strap_hz"))
    independent = IndependentLeg(
        inertia_device=inertia * share,
        strap_stiffness=reduced * turn**2,
        strap_damping=2 * np.exp(shared("strap_damping")) * reduced * turn,
        softening_angle=np.exp(shared("half_angle_rad")),
        softening_power=np.clip(shared("softening_power"), 0.7, 3.5),
        gravity_stiffness=leg[0, columns.GRAVITY_STIFFNESS],
        reflex_gain=np.exp(shared("reflex_gain") + theta[layout.own(point, REFLEX)]),
        reflex_latency=np.clip(np.exp(shared("reflex_latency_s")), 0.015, 0.15),
        reflex_time=np.clip(np.exp(shared("reflex_time_s")), 0.008, 0.2),
        reflex_position_share=expit(shared("reflex_position")),
        reflex_asymmetry=expit(shared("reflex_shortening")),
        friction=np.exp(shared("friction_nm")),
        friction_velocity=0.08,
        torque_gain_error=shared("torque_error"),
        skin_share=expit(shared("skin_share")),
        goniometer_lag=np.exp(shared("sensor_lag_s")),
        goniometer_delay=np.exp(shared("sensor_delay_s")),
    )
    return independent_response(
        since,
        model.points[point].shapes[0].torque,
        stiffness=lambda t: np.interp(t, since, stiffness[0]),
        damping=lambda t: np.interp(t, since, damping[0]),
        inertia=lambda t: np.interp(t, since, limb[0]),
        velocity=lambda t: np.interp(t, since, velocity),
        leg=independent,
    )


@pytest.mark.parametrize("seed", [1, 2, 3])
def test_responses_are_those_of_an_independent_simulator(seed):
    model, theta = drawn(seed, (DOUBLET,))
    point, layout = seed, model.layout
    theta[[layout.shared("goniometer_hz"), layout.shared("goniometer_damping")]] = np.log(
        [150, 0.3]
    )
    theta[layout.shared("goniometer_gain")] = 0.0
    expected = simulated_apart(model, theta, point)

    bone, shown = model.bone(theta[None], point)[0, 0], model.responses(theta[None], point)[0]
    assert np.abs(bone - expected["bone"]).max() < 0.01 * np.abs(expected["bone"]).max()
    assert np.abs(shown - expected["goniometer"]).max() < 0.01 * np.abs(shown).max()


def on_tissue(time_s, motion, log_hz, log_damping):
    """Motion of a mass on a spring and a damper between it and the moving bone."""
    w, z = 2 * np.pi * np.exp(log_hz), np.exp(log_damping)
    return lsim(([2 * z * w, w * w], [1, 2 * z * w, w * w]), motion, time_s)[1]


@pytest.mark.parametrize(("seed", "gyroscope"), [(1, "joint_velocity"), (2, "shank_velocity")])
def test_encoder_and_gyroscope_show_device_and_bone(seed, gyroscope):
    model, theta = drawn(seed, (DOUBLET,), sensors=("joint_encoder", gyroscope))
    layout, since = model.layout, TIME_S - TIME_S[0]
    state = simulated_apart(model, theta, seed)["state"]

    def shared(name):
        return theta[layout.shared(name)]

    _, encoder, shown = model.responses(theta[None], seed).reshape(3, -1)
    late = shared("encoder_delay_s")
    # At the end an early sensor would show what is not simulated.
    device = np.array([state(max(t - late, 0.0))[2] for t in since[:-1]])
    expected = (1.0 + shared("encoder_gain")) * device
    assert np.abs(encoder[:-1] - expected).max() < 0.01 * np.abs(device).max()

    fine = np.arange(0.0, since[-1], 1e-4)
    speeds = np.array([state(t)[1] for t in fine])
    share = expit(theta[layout.own(seed, SHANK)])
    mounted = share * on_tissue(fine, speeds, shared("shank_hz"), shared("shank_damping"))
    if gyroscope == "joint_velocity":
        thigh = on_tissue(fine, speeds, shared("thigh_hz"), shared("thigh_damping"))
        mounted = mounted + (1.0 - share) * thigh
    late = shared("gyroscope_delay_s")
    expected = (1.0 + shared("gyroscope_gain")) * np.interp(since - late, fine, mounted)
    inside = since - late < fine[-1]
    assert np.abs(shown - expected)[inside].max() < 0.01 * np.abs(expected).max()


def test_shapes_are_simulated_apart_and_points_do_not_share_their_own_parameters():
    model, theta = drawn(4, PULSES)
    changed = theta.copy()
    changed[model.layout.stiffness(2)] += 0.5

    responses = model.responses(np.stack([theta, changed]), 2).reshape(2, len(PULSES), -1)
    assert np.abs(responses[0] - responses[1]).max() > 1e-4
    others = model.responses(np.stack([theta, changed]), 3)
    assert np.array_equal(others[0], others[1])
    # A pulse of twice the torque moves the joint further, one of the other sign the other way.
    small, large = responses[0, 2], responses[0, 3]
    assert np.abs(large).max() > np.abs(small).max()
    assert (responses[0, 0] * responses[0, 3]).sum() < 0.0


def test_the_inertia_of_a_point_leaves_its_strap_alone():
    model, theta = drawn(5, (DOUBLET,))
    heavier = theta.copy()
    heavier[model.layout.inertia(1)] += 0.7
    both = np.stack([theta, heavier])
    _, _, leg = model.natural(both, 1)
    limb = model.limb_inertia(both, 1, TIME_S)

    # Between knots the curve is drawn to the person's level a little.
    assert limb[1] == pytest.approx(np.exp(0.7) * limb[0], rel=0.05)
    for column in (columns.DEVICE_INERTIA, columns.STRAP_STIFFNESS, columns.STRAP_DAMPING):
        assert leg[0, column] == leg[1, column]


def test_a_stiffness_of_another_scale_may_be_zero_and_less():
    """Then neither gravity nor a reflex has a part of it."""
    logarithmic, theta = drawn(1, (DOUBLET,), labels=("MST",))
    scale, layout = ValueScale(8.0), logarithmic.layout
    scaled = LegModel(
        logarithmic.points, window_s=0.2, gravity_stiffness=20.0, stiffness_scale=scale
    ).with_points(logarithmic.points)
    below = theta.copy()
    below[layout.stiffness(0)] = scale.of(-5.0)
    deaf = below.copy()
    deaf[layout.shared("reflex_gain")] = -20.0

    stiffness, _, leg = scaled.natural(below[None], 0)

    np.testing.assert_allclose(stiffness, -5.0, rtol=0.1)
    assert leg[0, columns.GRAVITY_STIFFNESS] == 0.0
    angles = [scaled.responses(t[None], 0) for t in (below, deaf)]
    np.testing.assert_array_equal(*angles)
    assert np.isfinite(angles[0]).all()


def test_both_scales_of_the_stiffness_give_the_same_estimates_where_it_is_large():
    measured, priors, _ = simulated_person(
        1, shapes=(DOUBLET,), n_pulses=30, window_s=0.2, labels=("MST",)
    )
    gravity = priors.body.gravity_stiffness
    found = []
    for scale in (LOGARITHM, ValueScale(8.0)):
        model = LegModel(
            measured.points, window_s=0.2, gravity_stiffness=gravity, stiffness_scale=scale
        )
        moments = log_moments(explain(model, priors, STRAP.hypotheses[2:3]))
        found.append([moments.value(name, 0) for name in ESTIMANDS])
    np.testing.assert_allclose(found[0], found[1], rtol=0.05)
