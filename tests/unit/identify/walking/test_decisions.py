"""Values, limits and statuses that follow from a posterior."""

from types import SimpleNamespace

import numpy as np
import pytest
from tests.unit.identify.walking.prior_draws import DOUBLET, PULSES, simulated_person

from jointz.core.codes import Doubt, Failure
from jointz.core.priors import LogPrior
from jointz.core.study import Calibrated, CalibrationSpec
from jointz.identify.walking.body import Body, body_of
from jointz.identify.walking.checks import response_failure
from jointz.identify.walking.decisions import (
    Decision,
    decided_rows,
    doubts_of,
    holds_one_torque,
    unlikely_instruments,
    unlikely_lag,
)
from jointz.identify.walking.estimands import ESTIMANDS, LogMoments
from jointz.identify.walking.leg_model import Layout
from jointz.results.value_scale import ValueScale

NAMES = ["stiffness", "damping", "inertia", "stiffness_per_mass", "damping_per_mass",
         "stiffness_onset", "damping_onset"]  # fmt: skip
NARROW, WIDE = 0.1, 0.4  # half-widths of 20 % and 87 %


def moments(sds, values=(60.0, 2.0, 0.3, 80.0, 2.0)):
    """Posterior with sds (estimand, point) of the logarithms."""
    sds = np.asarray(sds, dtype=float)
    mean = np.repeat(np.log(values), sds.shape[1])
    zeros = np.zeros(mean.size)
    return LogMoments(mean, np.diag(sds.ravel() ** 2), zeros, np.eye(mean.size))


def same(sd, points=5):
    return np.full((len(ESTIMANDS), points), sd)


def rows(sds, point=0, *, doubts=(), known=None, subtract=(), mass=70.0):
    decision = Decision(known or CalibrationSpec(), mass, subtract)
    return {p.name: p for p in decided_rows(point, moments(sds), decision, doubts)}


def test_narrow_values_are_ok_with_their_intervals():
    found = rows(same(NARROW))

    assert list(found) == NAMES
    assert {p.status for p in found.values()} == {"ok"}
    assert found["stiffness"].ci == pytest.approx(
        (60 * np.exp(-0.196), 60 * np.exp(0.196)), rel=1e-3
    )
    assert found["stiffness_per_mass"].value == pytest.approx(60.0 / 70.0)


def test_a_cell_that_alone_is_narrow_is_undecided():
    sds = same(WIDE)
    sds[:, 0] = NARROW
    found = rows(sds)

    # The geometric mean of 20 and 87 % is below 50 %: enough for B, not for K.
    assert found["damping"].status == "ok"
    assert found["stiffness"].status == found["stiffness_onset"].status == "undecided"
    assert found["stiffness"].value is None


def test_an_undecided_value_has_one_sided_limits_further_out_if_nothing_is_decided():
    sds = same(NARROW)
    sds[:, 0] = WIDE
    one, all_wide = rows(sds)["damping"], rows(same(WIDE))["damping"]

    assert one.status == all_wide.status == "undecided"
    sd = np.hypot(WIDE, 0.08)  # of B, with the error of its model
    assert one.ci == pytest.approx((2 * np.exp(-1.645 * sd), 2 * np.exp(1.645 * sd)), rel=1e-3)
    assert all_wide.ci_low == pytest.approx(2 * np.exp(-2 * 1.645 * sd), rel=1e-3)


@pytest.mark.parametrize(
    ("doubt", "undecided"),
    [
        (Doubt.RESPONSES_MISFIT, set(NAMES) - {"inertia"}),
        (Doubt.INERTIA_UNLIKE_AT_POINT, set(NAMES) - {"inertia"}),
        (Doubt.INERTIA_UNLIKE_BODY, set(NAMES)),
        (Doubt.INSTRUMENTS_UNLIKELY, set(NAMES)),
        (Doubt.RESPONSES_UNLIKE_SIZE, set(NAMES)),
    ],
)
def test_a_doubt_leaves_no_value_and_no_limit(doubt, undecided):
    found = rows(same(NARROW), doubts={doubt})

    assert {name for name, p in found.items() if p.status == "undecided"} == undecided
    assert all(found[name].ci == (None, None) for name in undecided)


def test_gains_and_the_device_itself_are_taken_into_account():
    known = CalibrationSpec(
        torque_gain=Calibrated(value=1.0, sd=0.1),
        intrinsic_inertia=Calibrated(value=0.1, sd=0.02),
    )
    plain, found = rows(same(NARROW)), rows(same(NARROW), known=known, subtract=("inertia",))

    assert found["inertia"].value == pytest.approx(0.2)
    width = np.log(found["stiffness"].ci_high / found["stiffness"].ci_low)
    assert width == pytest.approx(2 * 1.96 * np.hypot(NARROW, 0.1), rel=1e-3)
    assert plain["stiffness"].value == found["stiffness"].value
    gone = rows(same(NARROW), known=CalibrationSpec(intrinsic_inertia=Calibrated(value=0.5, sd=0)),
                subtract=("inertia",))  # fmt: skip
    assert gone["inertia"].status == "undecided"


ASINH = ValueScale(8.0)


def scaled_rows(stiffness, sd, *, doubts=(), natural=100.0, prior_sd=1.0, mass=70.0):
    """Return the estimates of a stiffness that may be zero, with its sd on the scale."""
    plain = moments(same(NARROW))
    mean, variances = plain.mean.copy(), np.diag(plain.covariance).copy()
    for name in ("stiffness", "stiffness_onset"):
        own = slice(5 * ESTIMANDS.index(name), 5 * ESTIMANDS.index(name) + 5)
        mean[own], variances[own] = ASINH.of(stiffness), sd**2
    scaled = LogMoments(mean, np.diag(variances), plain.prior_mean,
                        prior_sd**2 * np.eye(mean.size), ASINH)  # fmt: skip
    decision = Decision(CalibrationSpec(), mass, (), natural_stiffness=natural)
    return {p.name: p for p in decided_rows(0, scaled, decision, doubts)}


def test_a_stiffness_on_another_scale_has_the_interval_of_that_scale():
    found = scaled_rows(60.0, NARROW)["stiffness"]

    assert found.status == "ok"
    ends = ASINH.value(ASINH.of(60.0) + 1.96 * NARROW * np.array([-1.0, 1.0]))
    assert found.ci == pytest.approx(tuple(ends), rel=1e-3)


@pytest.mark.parametrize("stiffness", [3.0, 0.0, -3.0])
def test_a_stiffness_whose_interval_reaches_zero_is_at_its_bound_or_undecided(stiffness):
    found = scaled_rows(stiffness, 0.4)
    small, per_kg = found["stiffness"], found["stiffness_per_mass"]

    assert small.status == per_kg.status == found["stiffness_onset"].status == "at_bound"
    assert (small.value, small.ci_low) == (pytest.approx(max(stiffness, 0.0)), 0.0)
    assert stiffness < small.ci_high < 20.0
    assert per_kg.ci_high == pytest.approx(small.ci_high / 70.0)
    for other in (
        scaled_rows(stiffness, 0.4, natural=small.ci_high),  # that is no small limit
        scaled_rows(stiffness, 0.4, natural=0.0),
        scaled_rows(stiffness, 0.4, prior_sd=0.6),  # of which the prior says most
        scaled_rows(stiffness, 0.4, doubts={Doubt.HELD_TORQUE}),
    ):
        assert (other["stiffness"].status, other["stiffness"].value) == ("undecided", None)
        assert other["stiffness"].ci_low == 0.0
        assert other["stiffness"].ci_high > 0.0


def test_a_stiffness_far_below_zero_is_undecided():
    found = scaled_rows(-60.0, NARROW)["stiffness"]
    assert (found.status, found.ci) == ("undecided", (None, None))


BOTH_WAYS = np.repeat([17.0, -17.0, 0.0], 40)
HELD = np.full(120, 17.0)
SHORT = np.repeat([17.0, 0.0, 0.0], 40)


def pulses(*torques):
    return SimpleNamespace(shapes=[SimpleNamespace(torque=torque) for torque in torques])


@pytest.mark.parametrize(
    ("torques", "held"),
    [
        ((HELD,), True), ((HELD, -HELD), True), ((HELD, 0.5 * HELD), False),
        ((SHORT,), False), ((BOTH_WAYS,), False), ((HELD, SHORT), False),
    ],
)  # fmt: skip
def test_pulses_that_hold_one_torque_to_the_end_are_told_from_others(torques, held):
    assert holds_one_torque(pulses(*torques)) is held


def test_after_a_held_torque_inertia_alone_is_decided():
    found = rows(same(NARROW), doubts={Doubt.HELD_TORQUE})

    decided = {name for name, p in found.items() if p.status == "ok"}
    assert decided == {"inertia"}
    assert found["stiffness"].ci == pytest.approx(
        (60 * np.exp(-2 * 0.1645), 60 * np.exp(2 * 0.1645)), rel=1e-3
    )


def posterior(misfits, *, off_sd=0.0, of=("sensor_delay_s",), sensors=()):
    layout = Layout(len(misfits), 2, sensors)
    theta = np.zeros(layout.size)
    theta[[layout.shared(name) for name in of]] = 0.8 * off_sd
    prior = SimpleNamespace(mean=np.zeros(layout.size), sd=np.full(layout.size, 0.8))
    return SimpleNamespace(
        model=SimpleNamespace(points=[pulses(BOTH_WAYS)] * len(misfits), layout=layout),
        best=SimpleNamespace(misfits=misfits, theta=theta, prior=prior),
    )


@pytest.mark.parametrize(
    ("of", "off_sd", "doubted"),
    [
        ("sensor_delay_s", -2.6, True),
        ("sensor_delay_s", 2.4, False),
        ("friction_nm", 2.6, True),
        ("friction_nm", -4.0, False),  # none is left in a torque that a load cell measures
    ],
)
def test_an_instrument_far_from_its_prior_is_a_doubt(of, off_sd, doubted):
    body = Body(LogPrior(median=0.3, log_sd=0.45), LogPrior(median=70, log_sd=1), 0, 0.45, True)
    unlikely = unlikely_instruments(far := posterior((0.8, 0.9), off_sd=off_sd, of=(of,)))
    found = doubts_of(far, moments(same(NARROW, points=2)), body, unlikely)

    assert [Doubt.INSTRUMENTS_UNLIKELY in doubts for doubts in found] == [doubted] * 2
    assert [(u.name, u.sds) for u in unlikely] == [(of, pytest.approx(abs(off_sd)))] * doubted


SEVERAL = ("joint_encoder", "joint_velocity")
INSTRUMENTS = tuple(
    name
    for name in Layout(1, 2, SEVERAL).shared_names
    if name.startswith(("sensor_", "encoder_", "gyroscope_", "shank_", "thigh_"))
)


@pytest.mark.parametrize(
    ("of", "off_sd", "doubted"),
    [
        (("goniometer_gain",), -3.4, []),
        (("goniometer_gain",), -3.6, ["goniometer_gain"]),
        (("reflex_latency_s",), -5.0, []),  # early reflexes speak against no sensor
        (INSTRUMENTS, 2.0, []),
        (INSTRUMENTS, 2.3, list(INSTRUMENTS)),
    ],
)
def test_several_sensors_may_each_be_farther_off_but_not_all_together(of, off_sd, doubted):
    far = posterior((0.8, 0.9), off_sd=off_sd, of=of, sensors=SEVERAL)

    assert sorted(u.name for u in unlikely_instruments(far)) == sorted(doubted)


def test_a_parameter_that_speaks_against_the_model_stands_as_the_priors_state_it():
    (late,) = unlikely_instruments(posterior((0.8,), off_sd=3.0))

    assert (late.value, late.expected) == pytest.approx((np.exp(2.4), 1.0))
    assert (late.low, late.high) == pytest.approx((np.exp(-1.568), np.exp(1.568)), rel=1e-3)
    assert str(late) == "sensor_delay_s is 11, expected 1 (0.208 to 4.8): 3.0 SDs off"


@pytest.mark.parametrize(("lag_s", "sd_s", "doubted"), [(0.0137, 3e-4, True), (0.0132, 3e-4, False),
                                                         (0.0137, 2e-3, False)])  # fmt: skip
def test_a_calibrated_lag_is_contradicted_beyond_its_sd_and_that_of_the_model(lag_s, sd_s, doubted):
    free = SimpleNamespace(lag_moments=lambda: (lag_s, 1e-4))

    assert bool(unlikely_lag(free, Calibrated(value=0.01, sd=sd_s))) is doubted


@pytest.mark.parametrize(
    ("median", "known", "expected"),
    [
        (0.3, True, [set(), {Doubt.RESPONSES_MISFIT}]),
        (0.9, True, [{Doubt.INERTIA_UNLIKE_BODY}] * 2),
        (0.9, False, [set(), {Doubt.RESPONSES_MISFIT}]),
    ],
)
def test_misfits_and_an_inertia_unlike_the_body_are_doubts(median, known, expected):
    body = Body(LogPrior(median=median, log_sd=0.45), LogPrior(median=70, log_sd=1), 0, 0.45, known)
    found = doubts_of(posterior((0.8, 2.5)), moments(same(NARROW, points=2)), body, ())

    assert [want <= doubts for want, doubts in zip(expected, found, strict=True)] == [True, True]
    assert (Doubt.INERTIA_UNLIKE_BODY in found[0]) is (median == 0.9 and known)


def test_the_body_gives_inertia_and_gravity_of_a_knee_only():
    person = SimpleNamespace(mass_kg=73.0, height_m=1.74)
    from jointz.core.priors import PriorsSpec

    assert body_of(person, "right knee", PriorsSpec()).known
    for stranger, joint in ((person, "ankle"), (None, "knee")):
        body = body_of(stranger, joint, PriorsSpec())
        assert not body.known
        assert body.inertia.median == 0.2


@pytest.mark.parametrize("shapes", [(DOUBLET,), PULSES])
def test_motion_against_the_torque_and_none_at_all_are_noticed(shapes):
    from dataclasses import replace

    model, _, _ = simulated_person(1, shapes=shapes, n_pulses=30, window_s=0.2)
    point = model.points[0]

    def scaled(factor):
        return replace(
            point,
            shapes=tuple(
                replace(s, sensor_signals=factor * s.sensor_signals) for s in point.shapes
            ),
        )

    assert response_failure(point) is None
    assert response_failure(scaled(-1.0)) is Failure.OPPOSITE_SIGN
    quiet = replace(scaled(0.0), prediction_errors=0.02 * point.prediction_errors)
    assert response_failure(quiet) is Failure.CONSTANT_ANGLE
