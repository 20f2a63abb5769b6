"""The safety gate: each rule by the torque it sends, and in how many ticks."""

from math import inf, isnan, nan
from pathlib import Path

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from jointz.core.codes import Trip
from jointz.core.limits import SafetyLimits
from jointz.core.session_log import Flag
from jointz.rig.devices.interface import ActuatorSample
from jointz.rig.experiment.safety import SafetyGate

PERIOD_S = 0.002
LIMITS = SafetyLimits(
    torque_nm=30.0,
    torque_rate_nm_s=4000.0,
    current_a=30.0,
    angle_min_rad=-0.2,
    angle_max_rad=1.9,
    velocity_rad_s=12.0,
    temperature_c=80.0,
    sensor_age_s=0.02,
    pulse_count=3,
    pulse_duty=0.3,
    consecutive_overruns=5,
    fade_s=0.05,
)
STEP_NM = 8.0  # 4000 N*m/s over 2 ms
FADE_STEP_NM = 1.2  # 30 N*m over 25 ticks
AGE_TICKS = 10  # 0.02 s


class Walk:
    """A gate and the healthy samples that a tick changes one by one."""

    def __init__(self, *, torque_per_ampere=1.0, **limits):
        self.gate = SafetyGate(
            LIMITS.model_copy(update=limits),
            control_period_s=PERIOD_S,
            torque_per_ampere=torque_per_ampere,
        )
        self.ticks = 0

    def tick(self, requested=0.0, *, sample=True, angle=None, age_s=0.0, steady=True, pulse=False,
             displacement=None, **measured):  # fmt: skip
        """Return what is sent when all is well but for what is given."""
        self.ticks += 1
        moving = 0.3 + 0.001 * (self.ticks % 7)
        fields = {"device_time_ns": self.ticks * 2_000_000, "angle": moving, **measured}
        healthy = ActuatorSample(0, 0, 0.0, 1.0, 0.1, 48.0, 30.0, 0)._replace(**fields)
        return self.gate.check(
            requested,
            healthy if sample else None,
            angle=moving if angle is None else angle,
            age_s=age_s,
            steady=steady,
            pulse_active=pulse,
            displacement=displacement,
        )

    def ticks_until_trip(self, most=2000, **changed):
        """Return how many ticks with a change it takes to trip."""
        for count in range(1, most):
            sent = self.tick(5.0, **changed)
            if self.gate.tripped is not None:
                assert sent == 0.0
                return count
        raise AssertionError("never tripped")


@pytest.fixture
def walk():
    return Walk()


def under_torque(walk, torque=17.0):
    """Let a pulse rise to its torque."""
    for _ in range(5):
        sent = walk.tick(torque, pulse=True)
    assert sent == torque
    return walk


# --- nothing wrong, and clamps -------------------------------------------------------------------


def test_a_request_within_all_limits_passes_unchanged(walk):
    assert [walk.tick(torque) for torque in (0.3, -1.5, 4.0)] == [0.3, -1.5, 4.0]
    # Nor does it matter that no sample came, that all are as old as is allowed, or, between
    # pulses, that gait is not steady.
    for harmless in ({"sample": False}, {"age_s": 0.02}, {"steady": False}):
        assert walk.tick(1.0, **harmless) == 1.0
    assert walk.gate.flags == 0
    assert walk.gate.tripped is None


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_torque_is_clamped_to_its_limit_and_climbs_there_at_the_rate_limit(walk, sign):
    sent = [walk.tick(sign * 100.0) for _ in range(6)]
    assert sent == [sign * value for value in (8.0, 16.0, 24.0, 30.0, 30.0, 30.0)]
    assert walk.gate.flags == Flag.CLAMPED
    walk.tick(sign * 30.0)
    assert walk.gate.flags == 0


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_the_limit_of_current_clamps_torque(sign):
    walk = Walk(torque_per_ampere=0.5)
    assert [walk.tick(sign * 100.0) for _ in range(3)][-1] == sign * 15.0


def test_a_change_of_sign_is_limited_in_rate_through_zero(walk):
    walk.tick(6.0)
    assert [walk.tick(-6.0) for _ in range(2)] == [-2.0, -6.0]
    assert walk.gate.flags == 0


# --- trips: zero in the very tick ----------------------------------------------------------------


@pytest.mark.parametrize(
    ("code", "changed"),
    [
        (Trip.POSTURE, {"angle": 1.95}),
        (Trip.POSTURE, {"angle": -0.25}),
        (Trip.SENSOR_NOT_FINITE, {"angle": nan}),
        (Trip.SENSOR_NOT_FINITE, {"angle": inf}),
        (Trip.VELOCITY, {"velocity": 12.1}),
        (Trip.VELOCITY, {"velocity": -12.1}),
        (Trip.TEMPERATURE, {"temperature_c": 80.5}),
        (Trip.DEVICE_FAULT, {"faults": 4}),
        (Trip.SENSOR_NOT_FINITE, {"velocity": nan}),
        (Trip.SENSOR_NOT_FINITE, {"current": inf}),
        (Trip.SENSOR_NOT_FINITE, {"temperature_c": nan}),
        (Trip.SENSOR_STALE, {"age_s": 0.021}),
    ],
)
def test_what_is_measured_out_of_bounds_takes_the_torque_away_in_the_same_tick(walk, code, changed):
    under_torque(walk)
    assert walk.tick(17.0, pulse=True, **changed) == 0.0
    assert walk.gate.tripped is code
    assert walk.gate.flags == Flag.TRIPPED
    assert [walk.tick(17.0, pulse=True) for _ in range(20)] == [0.0] * 20
    assert walk.gate.tripped is code


@pytest.mark.parametrize(
    ("angle", "code"),
    [
        (1.95, Trip.POSTURE),
        (-0.25, Trip.POSTURE),
        (nan, Trip.SENSOR_NOT_FINITE),
        (-0.2, None),
        (1.9, None),
    ],
)
def test_the_encoder_is_held_to_the_same_range_and_may_be_at_its_end(walk, angle, code):
    sample = ActuatorSample(1, 1, angle, 0.0, 0.0, 48.0, 30.0, 0)
    sent = walk.gate.check(1.0, sample, angle=0.3, age_s=0.0, steady=True, pulse_active=False)
    assert walk.gate.tripped is code
    assert sent == (0.0 if code else 1.0)


@pytest.mark.parametrize("requested", [nan, inf, -inf])
def test_a_request_that_is_no_number_trips(walk, requested):
    under_torque(walk)
    assert walk.tick(requested, pulse=True) == 0.0
    assert walk.gate.tripped is Trip.REQUEST_NOT_FINITE


def test_faults_count_even_where_the_clock_of_the_device_stands_still(walk):
    walk.tick(1.0, device_time_ns=500)
    assert walk.tick(1.0, device_time_ns=500, faults=1) == 0.0
    assert walk.gate.tripped is Trip.DEVICE_FAULT


def test_the_first_trip_stands(walk):
    walk.tick(0.0, velocity=13.0, temperature_c=200.0)
    walk.gate.trip(Trip.POSTURE, "later")
    walk.tick(nan, faults=1)
    walk.gate.overran(100)
    assert walk.gate.tripped is Trip.VELOCITY


def test_a_trip_from_outside_stops_the_next_tick(walk):
    under_torque(walk)
    walk.gate.trip(Trip.NO_STRIDES, "20 s")
    assert walk.tick(17.0, pulse=True) == 0.0
    assert walk.gate.detail == f"{Trip.NO_STRIDES.meaning}: 20 s"


# --- age, frozen sensors -------------------------------------------------------------------------


def test_a_clock_that_stands_still_trips_when_it_is_too_old(walk):
    walk.tick(1.0, device_time_ns=10**9)
    assert walk.ticks_until_trip(device_time_ns=10**9) == AGE_TICKS + 1
    assert walk.gate.tripped is Trip.SENSOR_FROZEN


def test_a_clock_that_moves_on_in_time_does_not_trip(walk):
    for k in range(100):
        walk.tick(1.0, device_time_ns=10**9 + k // AGE_TICKS)
    assert walk.gate.tripped is None


def test_a_goniometer_that_repeats_a_value_while_the_joint_moves_is_frozen(walk):
    walk.tick(1.0, angle=0.3)
    assert walk.ticks_until_trip(angle=0.3) == AGE_TICKS + 1
    assert walk.gate.tripped is Trip.SENSOR_FROZEN
    assert "goniometer" in walk.gate.detail


def test_a_goniometer_may_stand_still_while_the_joint_does(walk):
    for _ in range(1000):
        walk.tick(1.0, angle=0.3, velocity=0.4)
    assert walk.gate.tripped is None


def test_moving_time_adds_up_over_rests_until_the_value_changes(walk):
    for k in range(15):
        walk.tick(1.0, angle=0.3, velocity=1.0 if k % 2 else 0.0)
    assert walk.gate.tripped is None
    walk.tick(1.0, angle=0.31)
    walk.tick(1.0, angle=0.3)
    assert walk.ticks_until_trip(angle=0.3) == AGE_TICKS + 1


def test_devices_at_half_the_rate_in_alternate_ticks_are_not_frozen(walk):
    for k in range(200):
        walk.tick(1.0, sample=bool(k % 2), angle=0.3 + 0.01 * (k // 2 % 5), age_s=PERIOD_S)
    assert walk.gate.tripped is None


def test_an_encoder_that_repeats_a_value_while_the_goniometer_moves_is_frozen(walk):
    gate = walk.gate
    angles = [0.3 + 0.03 * k for k in range(6)]
    sent = []
    for k, angle in enumerate(angles):
        sample = ActuatorSample(k, 0, 0.3, 0.0, 0.0, 48.0, 30.0, 0)
        sent.append(
            gate.check(1.0, sample, angle=angle, age_s=0.0, steady=True, pulse_active=False)
        )
    assert sent == [1.0, 1.0, 1.0, 1.0, 0.0, 0.0]
    assert gate.tripped is Trip.SENSOR_FROZEN
    assert "encoder" in gate.detail


def test_nothing_is_sent_until_every_sensor_has_given_a_sample(walk):
    # Before the first sample the controller has no velocity, so its request is no number.
    first = [walk.tick(nan, sample=False, angle=nan, age_s=inf) for _ in range(500)]
    assert first == [0.0] * 500
    assert walk.gate.flags == Flag.CLAMPED
    assert walk.gate.tripped is None
    assert walk.tick(1.0) == 1.0


def test_a_sensor_that_never_gives_a_sample_trips_after_a_second(walk):
    assert walk.ticks_until_trip(age_s=inf) == 501
    assert walk.gate.tripped is Trip.SENSOR_STALE
    assert walk.gate.flags == Flag.TRIPPED


def test_a_fault_trips_while_the_sensors_are_waited_for(walk):
    assert walk.tick(0.0, age_s=inf, faults=1) == 0.0
    assert walk.gate.tripped is Trip.DEVICE_FAULT
    assert walk.gate.flags == Flag.TRIPPED


# --- overruns ------------------------------------------------------------------------------------


def test_many_slots_missed_at_once_trip(walk):
    under_torque(walk)
    walk.gate.overran(5)
    assert walk.tick(17.0, pulse=True) == 0.0
    assert walk.gate.tripped is Trip.OVERRUN


def test_slots_missed_tick_after_tick_add_up(walk):
    sent = []
    for _ in range(3):
        walk.gate.overran(2)
        sent.append(walk.tick(1.0))
    assert sent == [1.0, 1.0, 0.0]


def test_a_tick_in_time_starts_the_count_anew(walk):
    for _ in range(50):
        walk.gate.overran(4)
        walk.tick(1.0)
        walk.tick(1.0)
    assert walk.gate.tripped is None


# --- pulses: fade, count, duty -------------------------------------------------------------------


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_a_pulse_is_faded_to_zero_in_the_stated_time_when_gait_becomes_unsteady(walk, sign):
    under_torque(walk, sign * 17.0)
    sent = [walk.tick(sign * 17.0, pulse=True, steady=False)]
    assert walk.gate.fading
    assert walk.gate.flags == Flag.FADING
    # The phase is back, but the pulse is not taken up again.
    sent += [walk.tick(sign * 17.0, pulse=True) for _ in range(30)]
    expected = [max(17.0 - FADE_STEP_NM * k, 0.0) for k in range(1, 32)]
    assert sent == pytest.approx([sign * value for value in expected], abs=1e-12)
    assert sent[14] == 0.0
    assert walk.gate.tripped is None


def test_even_the_largest_torque_is_gone_within_the_time_to_fade(walk):
    under_torque(walk, 30.0)
    sent = [walk.tick(30.0, pulse=True, steady=False) for _ in range(26)]
    assert sent[-1] == 0.0
    assert sent[-3] > 0.0  # 25 ticks of 2 ms, but for rounding


def test_a_fade_ends_with_the_pulse_where_gait_is_steady(walk):
    under_torque(walk)
    for _ in range(20):
        walk.tick(17.0, pulse=True, steady=False)
    assert walk.tick(0.4) == 0.4
    assert not walk.gate.fading
    assert walk.tick(3.0, pulse=True) == 3.0


def test_a_fade_outlasts_the_pulse_until_gait_is_steady(walk):
    under_torque(walk)
    walk.tick(17.0, pulse=True, steady=False)
    sent = [walk.tick(0.4, steady=False) for _ in range(20)]
    assert sent == pytest.approx([max(17.0 - FADE_STEP_NM * k, 0.0) for k in range(2, 22)])
    assert walk.tick(0.4) == 0.4


def test_a_trip_during_a_fade_takes_the_rest_away(walk):
    under_torque(walk)
    walk.tick(17.0, pulse=True, steady=False)
    assert walk.tick(17.0, pulse=True, steady=False, faults=1) == 0.0
    assert not walk.gate.fading
    assert walk.gate.flags == Flag.TRIPPED


def test_a_request_that_is_no_number_trips_during_a_fade(walk):
    under_torque(walk)
    walk.tick(17.0, pulse=True, steady=False)
    assert walk.tick(nan, pulse=True) == 0.0
    assert walk.gate.tripped is Trip.REQUEST_NOT_FINITE


def test_one_pulse_more_than_allowed_trips_before_its_torque(walk):
    for _ in range(3):
        under_torque(walk)
        for _ in range(5):
            walk.tick(0.0)
    assert walk.tick(5.0, pulse=True) == 0.0
    assert walk.gate.tripped is Trip.PULSE_COUNT


def test_a_stop_after_the_last_pulse_that_is_allowed_fades_the_torque_of_a_bench(walk):
    for _ in range(3):
        under_torque(walk)
        for _ in range(5):
            walk.tick(6.0)
    # A bench fades all of its torque on a stop, as if it were a pulse.
    sent = [walk.tick(6.0, pulse=True, steady=False) for _ in range(6)]
    assert sent == pytest.approx([max(6.0 - FADE_STEP_NM * k, 0.0) for k in range(1, 7)])
    assert walk.gate.tripped is None


def pulses_sent(walk, *, on, off, count):
    """Run pulses of so many ticks; return the ticks under torque and whether any was faded."""
    under, faded = [], False
    for _ in range(count):
        for _ in range(on):
            under.append(walk.tick(5.0, pulse=True) != 0.0)
            faded = faded or walk.gate.fading
        under += [walk.tick(0.0) != 0.0 for _ in range(off)]
    return under, faded


def test_pulses_within_their_duty_are_all_let_through():
    under, faded = pulses_sent(Walk(pulse_count=1000), on=120, off=300, count=60)
    assert sum(under) == 60 * 120
    assert not faded


def test_pulses_above_their_duty_are_faded_and_any_ten_seconds_hold_no_more():
    walk = Walk(pulse_count=1000)
    under, faded = pulses_sent(walk, on=300, off=200, count=60)
    assert faded
    most, fade = 0.3 * 5000, 5.0 / FADE_STEP_NM + 1
    window = sum(under[:5000])
    for k in range(5000, len(under)):
        window += under[k] - under[k - 5000]
        assert window <= most + fade * 10  # a pulse that is refused may still be fading
    assert walk.gate.tripped is None


def test_one_pulse_that_lasts_too_long_is_faded_after_its_share_of_ten_seconds(walk):
    sent = [walk.tick(5.0, pulse=True) for _ in range(1600)]
    assert sent[1499] == 5.0
    assert sent[1500] == pytest.approx(5.0 - FADE_STEP_NM)
    assert sent[1505:] == [0.0] * 95


def test_the_share_of_pulses_is_free_again_after_ten_seconds(walk):
    for _ in range(1600):
        walk.tick(5.0, pulse=True)
    for _ in range(5000):
        walk.tick(0.0)
    under_torque(walk)
    assert not walk.gate.fading


# --- displacement by a pulse -------------------------------------------------------------------


@pytest.mark.parametrize("displacement", [0.151, -0.151, nan, inf])
def test_a_pulse_that_displaces_the_joint_too_far_has_no_torque_from_the_same_tick_on(displacement):
    walk = under_torque(Walk(displacement_rad=0.15))
    assert walk.tick(17.0, pulse=True, displacement=0.15) == 17.0
    assert walk.tick(17.0, pulse=True, displacement=displacement) == 0.0
    assert walk.gate.cut
    assert walk.gate.flags == Flag.CUT
    # The joint comes back, and a doublet passes through zero: the pulse is not taken up again.
    back = [
        walk.tick(torque, pulse=torque != 0.0, displacement=0.0) for torque in (17.0, 0.0, -9.0)
    ]
    assert back == [0.0] * 3
    assert walk.gate.tripped is None


def test_after_its_end_a_pulse_that_was_cut_holds_nothing_up():
    walk = under_torque(Walk(displacement_rad=0.15))
    walk.tick(17.0, pulse=True, displacement=0.2)
    assert walk.tick(0.4) == 0.4
    assert not walk.gate.cut
    assert walk.tick(5.0, pulse=True, displacement=0.0) == 5.0


def test_a_cut_takes_what_a_fade_has_left_and_a_trip_goes_before_it():
    walk = under_torque(Walk(displacement_rad=0.15))
    assert walk.tick(17.0, pulse=True, steady=False, displacement=0.0) > 0.0
    assert walk.tick(17.0, pulse=True, steady=False, displacement=0.2) == 0.0
    assert walk.gate.flags == Flag.CUT
    assert walk.tick(17.0, pulse=True, displacement=0.2, faults=1) == 0.0
    assert walk.gate.flags == Flag.TRIPPED
    assert not walk.gate.cut


def test_without_a_limit_no_displacement_cuts_a_pulse(walk):
    under_torque(walk)
    assert walk.tick(17.0, pulse=True, displacement=3.0) == 17.0


# --- properties ----------------------------------------------------------------------------------

any_float = st.floats(allow_nan=True, allow_infinity=True, width=32)
mostly_well = st.fixed_dictionaries(
    {"requested": st.one_of(st.floats(-60.0, 60.0), st.floats(-60.0, 60.0), any_float)},
    optional={
        "sample": st.booleans(),
        "angle": st.floats(-0.2, 1.9),
        "age_s": st.sampled_from([0.0, 0.002, 0.02]),
        "steady": st.booleans(),
        "pulse": st.booleans(),
    },
)
anything = st.fixed_dictionaries(
    {"requested": any_float},
    optional={
        "angle": any_float,
        "age_s": st.sampled_from([0.0, 0.02, 0.03, inf]),
        "velocity": any_float,
        "current": any_float,
        "temperature_c": any_float,
        "faults": st.integers(0, 7),
        "device_time_ns": st.integers(0, 10),
        "overran": st.integers(1, 3),
    },
)
histories = st.lists(st.one_of(mostly_well, mostly_well, mostly_well, anything), max_size=60)


@settings(deadline=None, max_examples=300)
@given(histories, st.sampled_from([0.5, 1.0, 2.0]))
def test_no_history_gets_past_the_limits_and_a_trip_is_for_ever(history, torque_per_ampere):
    walk = Walk(torque_per_ampere=torque_per_ampere, pulse_count=1000)
    largest = min(30.0, 30.0 * torque_per_ampere)
    last, tripped = 0.0, None
    for given_tick in history:
        changed = dict(given_tick)
        missed = changed.pop("overran", 0)
        if missed:
            walk.gate.overran(missed)
        sent = walk.tick(changed.pop("requested"), **changed)
        assert abs(sent) <= largest
        assert sent == 0.0 or abs(sent - last) <= STEP_NM + 1e-9
        if walk.gate.fading:
            assert abs(sent) <= abs(last)
        if walk.gate.tripped is not None:
            assert sent == 0.0
            tripped = tripped or walk.gate.tripped
            assert walk.gate.tripped is tripped
            assert walk.gate.flags == Flag.TRIPPED
        assert not isnan(sent)
        last = sent


# --- the page ------------------------------------------------------------------------------------


def test_every_code_and_every_limit_stands_on_the_page():
    page = (Path(__file__).parents[4] / "docs" / "safety.md").read_text(encoding="utf-8")
    assert [name for name in (*Trip, *SafetyLimits.model_fields) if f"`{name}`" not in page] == []
