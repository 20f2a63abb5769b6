"""Torque at run time: equation 4.1 by hand, friction that is not felt, and trapezoids."""

from math import exp, isnan, nan, pi

import pytest
from hypothesis import given
from hypothesis import strategies as st

from jointz.core.protocols.pulse_models import (
    DoubletPulse,
    PulseSpec,
    SampledPulse,
    TrapezoidPulse,
)
from jointz.core.protocols.pulse_waveform import PulseWaveform
from jointz.core.study import TorqueModelSpec
from jointz.rig.experiment.trial import AppliedTorque, ZeroTorque

MODEL = TorqueModelSpec(
    gear_ratio=9.0,
    torque_constant=0.14,
    bias=0.05,
    viscous_friction=0.12,
    coulomb_friction=0.38,
    gear_friction=0.09,
    rotor_inertia=0.03,
)
PERIOD_S = 0.002


def settled(model, current, velocity):
    """Return the torque after so many samples that the acceleration is nothing."""
    torque = AppliedTorque(model, sample_period_s=PERIOD_S)
    return [torque.update(current, velocity) for _ in range(500)][-1]


# --- equation 4.1 -------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("current", "velocity", "by_hand"),
    [
        (10.0, 0.0, 0.05 + 1.26 * 10),
        (10.0, 2.0, 0.05 + 12.6 - (0.38 + 0.09 * 10) - 0.12 * 2),
        (10.0, -2.0, 0.05 + 12.6 + (0.38 + 0.09 * 10) + 0.12 * 2),
        (-10.0, 2.0, 0.05 - 12.6 - (0.38 + 0.09 * 10) - 0.12 * 2),
        (0.0, 0.0, 0.05),
    ],
)
def test_torque_at_constant_velocity_is_equation_4_1(current, velocity, by_hand):
    assert settled(MODEL, current, velocity) == pytest.approx(by_hand, abs=1e-12)


def test_the_first_sample_knows_no_acceleration():
    torque = AppliedTorque(MODEL, sample_period_s=PERIOD_S)
    assert torque.update(0.0, 5.0) == pytest.approx(0.05 - 0.38 - 0.12 * 5.0, abs=1e-12)


def test_a_constant_acceleration_takes_the_torque_of_the_rotor():
    torque = AppliedTorque(MODEL, sample_period_s=PERIOD_S)
    for i in range(500):
        velocity = 0.001 + 40.0 * i * PERIOD_S
        found = torque.update(0.0, velocity)
    assert found == pytest.approx(0.05 - 0.38 - 0.12 * velocity - 0.03 * 40.0, abs=1e-9)


@pytest.mark.parametrize("period_s", [0.001, 0.002, 0.005])
def test_acceleration_follows_as_a_first_order_low_pass_of_20_hz(period_s):
    torque = AppliedTorque(
        TorqueModelSpec(gear_ratio=1.0, torque_constant=1.0, rotor_inertia=1.0),
        sample_period_s=period_s,
    )
    torque.update(0.0, 0.0)
    for i in range(1, 20):
        acceleration = -torque.update(0.0, 7.0 * i * period_s)
        assert acceleration == pytest.approx(7.0 * (1.0 - exp(-2 * pi * 20.0 * i * period_s)))


# --- zero torque --------------------------------------------------------------------------------


def felt(model, wanted, velocity):
    """Return what the joint feels where the motor gives the current for the request."""
    request = ZeroTorque(model).request(wanted, velocity)
    return settled(model, request / (model.gear_ratio * model.torque_constant), velocity)


@given(velocity=st.floats(-12.0, 12.0), wanted=st.floats(-20.0, 20.0))
def test_compensation_never_drives_the_joint_by_itself(velocity, wanted):
    model = MODEL.model_copy(update={"bias": 0.0})
    # What is felt beyond what was wanted brakes: it takes power from the joint.
    assert (felt(model, wanted, velocity) - wanted) * velocity <= 1e-9


@pytest.mark.parametrize("wanted", [17.0, -17.0, 5.0])
@pytest.mark.parametrize("velocity", [3.0, -3.0])
def test_a_pulse_is_felt_as_wanted_but_for_a_fifth_of_the_friction(wanted, velocity):
    model = MODEL.model_copy(update={"bias": 0.0})
    friction = 0.38 + 0.09 * abs(wanted) / 1.26 + 0.12 * 3.0
    lost = abs(felt(model, wanted, velocity) - wanted)
    assert lost == pytest.approx(0.2 * friction, abs=0.09 * friction / 1.26)


def test_a_joint_at_rest_is_asked_for_what_is_wanted():
    assert ZeroTorque(MODEL).request(7.0, 0.0) == 7.0
    assert ZeroTorque(MODEL).request(0.0, 0.0) == 0.0


def test_an_unknown_velocity_asks_for_no_number():
    assert isnan(ZeroTorque(MODEL).request(0.0, nan))


# --- trapezoid ----------------------------------------------------------------------------------


def trapezoid(up, hold, down):
    return PulseWaveform(
        PulseSpec(
            amplitude_nm=7.0,
            ramp_up_s=up,
            hold_s=hold,
            ramp_down_s=down,
            duration_s=up + hold + down,
        )
    )


@pytest.mark.parametrize(
    ("elapsed_ms", "share"),
    [
        (-1, 0.0), (0, 0.0), (15, 0.2), (75, 1.0), (100, 1.0), (174, 1.0), (175, 1.0),
        (190, 0.8), (249, 1 / 75), (250, 0.0), (1000, 0.0),
    ],
)  # fmt: skip
def test_the_pulse_of_chapter_two_ramps_holds_and_ramps(elapsed_ms, share):
    assert trapezoid(0.075, 0.1, 0.075).share(elapsed_ms * 1_000_000) == pytest.approx(share)


parts = st.integers(0, 200)


@given(parts, st.integers(1, 200), parts)
def test_its_area_is_that_of_a_trapezoid(up_ms, hold_ms, down_ms):
    shape = trapezoid(up_ms * 1e-3, hold_ms * 1e-3, down_ms * 1e-3)
    assert shape.duration_ns == (up_ms + hold_ms + down_ms) * 1_000_000
    middles = range(500_000, shape.duration_ns, 1_000_000)
    shares = [shape.share(middle) for middle in middles]
    assert all(0.0 <= share <= 1.0 for share in shares)
    assert sum(shares) == pytest.approx(up_ms / 2 + hold_ms + down_ms / 2, abs=1e-6)


# --- other shapes --------------------------------------------------------------------------------

BOTH = {"name": "a", "amplitudes_nm": (7.0,)}


@pytest.mark.parametrize(
    ("elapsed_ms", "share"),
    [(-1, 0.0), (0, 1.0), (39, 1.0), (40, -0.5), (59, -0.5), (60, 0.0), (100, 0.0)],
)
def test_a_doublet_has_two_levels(elapsed_ms, share):
    pulse = DoubletPulse(**BOTH, kind="doublet", durations_s=(0.04, 0.02), second_level=-0.5)
    assert PulseWaveform(pulse).share(elapsed_ms * 1_000_000) == share


def test_samples_are_joined_by_straight_lines_and_torque_ends_with_them():
    pulse = SampledPulse(**BOTH, kind="samples", times_s=(0.0, 0.1, 0.12), shares=(0.0, 1.0, -0.2))
    course = PulseWaveform(pulse)
    found = [course.share(ms * 1_000_000) for ms in (0, 25, 100, 110, 119, 120)]
    assert found == pytest.approx([0.0, 0.25, 1.0, 0.4, -0.14, 0.0])
    assert course.duration_ns == 120_000_000


def test_without_hold_and_ramp_down_it_is_a_ramp():
    course = PulseWaveform(TrapezoidPulse(**BOTH, kind="trapezoid", ramp_up_s=0.1))
    assert [course.share(ms * 1_000_000) for ms in (0, 50, 99, 100)] == [0.0, 0.5, 0.99, 0.0]
