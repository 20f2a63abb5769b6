"""Gravity of limb and device against a swinging pendulum, another table and sampled bodies."""

import math
from dataclasses import replace

import numpy as np
import pandas as pd
import pytest
from scipy.integrate import solve_ivp

from jointz.core.study import DeviceSpec, ParticipantSpec
from jointz.identify.walking.gravity import (
    CORRECTED_STIFFNESS,
    POSTURE_SD_RAD,
    GravityStiffness,
    HangingMass,
    corrected_stiffness,
    gravity_stiffness,
    hanging_masses,
    limb_gravity,
    thigh_angle,
)
from jointz.results.estimates import ParameterEstimate

MASS_KG, HEIGHT_M = 73.0, 1.74
GRAVITY = 9.81
BOB = HangingMass(2.0, 0.3, 0.0, "bob")
PERSON = ParticipantSpec(id="S01", mass_kg=MASS_KG, height_m=HEIGHT_M)
FRAME = DeviceSpec(mass_kg=2.0, centre_m=0.18)


def at(masses, angle_rad, *, gait_pct=81.0, **options) -> GravityStiffness:
    found = gravity_stiffness(
        masses, **({"joint": "knee", "angle_rad": angle_rad, "gait_pct": gait_pct} | options)
    )
    assert found is not None
    return found


def apparent(value, low, high, status="ok", **more) -> ParameterEstimate:
    return ParameterEstimate("stiffness", value, low, high, status, **more)


# --- the stiffness -------------------------------------------------------------------------------


@pytest.mark.parametrize("knee", [0.1, 0.6, 1.1])
def test_a_pendulum_on_a_spring_swings_as_fast_as_the_corrected_stiffness_says(knee):
    """A shank on a spring of known K, held in a posture: its period gives the apparent K."""
    spring, inertia, gait_pct = 20.0, 0.2, 70.0
    thigh = thigh_angle(gait_pct)

    def slopes(_, state):
        moved, rate = state
        weight = BOB.mass_kg * GRAVITY * BOB.centre_m
        gravity = weight * (math.sin(knee + moved - thigh) - math.sin(knee - thigh))
        return rate, -(spring * moved + gravity) / inertia

    def returns(_, state):
        return state[1]

    returns.direction = -1.0
    # From -1e-4 rad the joint is back at its other end, speed falling through 0, in half a period.
    swing = solve_ivp(slopes, (0.0, 2.0), (-1e-4, 0.0), events=returns, rtol=1e-10, atol=1e-14)
    half_period = next(t for t in swing.t_events[0] if t > 1e-3)
    seen = inertia * (math.pi / half_period) ** 2

    taken_off = at([BOB], knee, gait_pct=gait_pct).value

    assert seen - taken_off == pytest.approx(spring, abs=0.01)  # N*m/rad


def test_gravity_adds_most_when_the_segment_hangs_straight_and_nothing_when_it_lies():
    thigh = thigh_angle(81.0)

    assert at([BOB], thigh).value == pytest.approx(2.0 * GRAVITY * 0.3)
    assert at([BOB], thigh + math.pi / 2).value == pytest.approx(0.0, abs=1e-12)
    assert at([BOB], thigh + math.pi).value == pytest.approx(-2.0 * GRAVITY * 0.3)


def test_turning_the_study_round_changes_nothing():
    flexed = at([BOB], 0.8)

    assert at([BOB], -0.8, positive="extension") == flexed


def test_the_hip_hangs_from_an_upright_trunk_whatever_the_phase():
    leg = limb_gravity(MASS_KG, HEIGHT_M, joint="hip")
    assert leg is not None

    found = [at([leg], 0.4, joint="right hip", gait_pct=pct).value for pct in (65.0, 90.0)]

    assert found == pytest.approx([leg.moment_nm * math.cos(0.4)] * 2)


@pytest.mark.parametrize(
    "unknown", [{"joint": "ankle"}, {"joint": "spring"}, {"positive": "abduction"}, {"joint": ""}]
)
def test_where_the_posture_is_not_known_there_is_no_correction(unknown):
    given = {"joint": "knee", "angle_rad": 0.2, "gait_pct": 81.0} | unknown

    assert gravity_stiffness([BOB], **given) is None
    assert gravity_stiffness([], joint="knee", angle_rad=0.2, gait_pct=81.0) is None


@pytest.mark.parametrize(("angle_rad", "gait_pct"), [(math.nan, 81.0), (0.2, math.inf)])
def test_an_angle_or_phase_that_is_no_number_is_refused(angle_rad, gait_pct):
    with pytest.raises(ValueError, match="expected a finite angle and phase"):
        gravity_stiffness([BOB], joint="knee", angle_rad=angle_rad, gait_pct=gait_pct)


# --- its uncertainty -----------------------------------------------------------------------------


@pytest.mark.parametrize("knee_deg", [0.0, 65.0])
@pytest.mark.parametrize("zero_sd_rad", [0.0, 0.2])
def test_the_sd_is_that_of_sampled_bodies_postures_and_zeros_of_the_angle(knee_deg, zero_sd_rad):
    rng = np.random.default_rng(7)
    masses = hanging_masses("knee", PERSON, FRAME)
    claimed = at(masses, math.radians(knee_deg), angle_sd_rad=zero_sd_rad)
    n = 400_000
    sd_rad = math.hypot(POSTURE_SD_RAD, zero_sd_rad)
    posture = claimed.segment_angle_rad + sd_rad * rng.standard_normal(n)
    moments = sum(m.moment_nm * (1.0 + m.relative_sd * rng.standard_normal(n)) for m in masses)
    drawn = moments * np.cos(posture)

    assert claimed.sd == pytest.approx(drawn.std(), rel=0.0065 if zero_sd_rad == 0.0 else 0.01)
    # The value is that of the middle posture; the mean over postures is smaller.
    smaller = claimed.value * math.exp(-(sd_rad**2) / 2)
    assert drawn.mean() == pytest.approx(smaller, abs=5 * claimed.sd / n**0.5)


# --- masses --------------------------------------------------------------------------------------


#: Single segments of another table (Winter 2009, 4.1): share of mass, centre from the joint as a
#: share of height.
PARTS = {
    "knee": [(0.0465, 0.433 * 0.246), (0.0145, 0.246 + 0.02)],
    "hip": [(0.100, 0.433 * 0.245), (0.0465, 0.245 + 0.433 * 0.246), (0.0145, 0.491 + 0.02)],
}


@pytest.mark.parametrize("joint", PARTS)
def test_weight_times_distance_is_near_that_of_another_table(joint):
    whole = limb_gravity(1.0, 1.0, joint=joint)
    assert whole is not None

    one_by_one = GRAVITY * sum(mass * centre for mass, centre in PARTS[joint])
    assert whole.moment_nm == pytest.approx(one_by_one, rel=0.06)  # less than the sd claimed


def test_without_a_height_the_average_is_taken_and_paid_for():
    known = limb_gravity(MASS_KG, 1.70)
    guessed = limb_gravity(MASS_KG)

    assert known is not None
    assert guessed is not None
    assert guessed.moment_nm == known.moment_nm
    assert guessed.relative_sd == pytest.approx(math.hypot(0.10, 0.10 / 1.70))


@pytest.mark.parametrize(
    ("name", "known"), [("Knee", "knee"), ("left_knee", "knee"), ("hip-right", "hip")]
)
def test_the_free_name_of_a_joint_is_understood(name, known):
    assert limb_gravity(MASS_KG, joint=name) == limb_gravity(MASS_KG, joint=known)


@pytest.mark.parametrize(
    ("mass", "height", "key"), [(0.0, 1.7, "mass_kg"), (70.0, -1.0, "height_m"), (math.nan, 1, "m")]
)
def test_a_body_without_mass_or_height_is_refused(mass, height, key):
    with pytest.raises(ValueError, match=f"{key}.*: expected a number above 0"):
        limb_gravity(mass, height)


def test_a_limb_that_was_weighed_stands_over_the_table():
    person = PERSON.model_copy(update={"limb_mass_kg": 4.0, "limb_centre_m": 0.25})

    assert hanging_masses("knee", person) == (HangingMass(4.0, 0.25, 0.05, "limb as given"),)


def test_limb_and_device_hang_together():
    masses = hanging_masses("knee", PERSON, FRAME)

    assert at(masses, 0.5).value == pytest.approx(sum(at([mass], 0.5).value for mass in masses))


@pytest.mark.parametrize(
    ("joint", "person"), [("knee", ParticipantSpec(id="S01")), ("spring", PERSON)]
)
def test_a_device_on_a_limb_that_nobody_knows_is_no_half_correction(joint, person):
    assert hanging_masses(joint, person, FRAME) == ()


# --- correction ----------------------------------------------------------------------------------


GRAVITY_STIFFNESS = GravityStiffness(9.0, 2.0, -0.5, "table")


def test_the_corrected_stiffness_is_less_and_less_certain():
    estimate = apparent(25.0, 20.0, 32.0, unbounded=25.5)

    corrected = corrected_stiffness(estimate, GRAVITY_STIFFNESS)

    widening = 1.959964 * 2.0
    assert corrected == replace(
        estimate,
        name=CORRECTED_STIFFNESS,
        value=16.0,
        ci_low=pytest.approx(16.0 - math.hypot(5.0, widening)),
        ci_high=pytest.approx(16.0 + math.hypot(7.0, widening)),
        unbounded=16.5,
    )


def test_at_a_bound_the_bound_moves_and_only_the_limit_widens():
    estimate = apparent(0.0, 0.0, 6.0, "at_bound", share_at_bound=0.8, unbounded=-3.0)

    corrected = corrected_stiffness(estimate, GRAVITY_STIFFNESS)

    assert (corrected.value, corrected.ci_low, corrected.unbounded) == (-9.0, -9.0, -12.0)
    assert corrected.ci_high == pytest.approx(-9.0 + math.hypot(6.0, 1.644854 * 2.0))
    assert (corrected.status, corrected.share_at_bound) == ("at_bound", 0.8)


@pytest.mark.parametrize("status", ["undecided", "failed:no_pulses"])
def test_what_was_not_estimated_is_not_corrected(status):
    estimate = apparent(None, None, None, status)

    assert corrected_stiffness(estimate, GRAVITY_STIFFNESS) == replace(
        estimate, name=CORRECTED_STIFFNESS
    )


def test_only_the_stiffness_of_a_joint_is_corrected():
    with pytest.raises(ValueError, match="expected the estimate 'stiffness', got 'damping'"):
        corrected_stiffness(ParameterEstimate("damping", 1, 0, 2, "ok"), GRAVITY_STIFFNESS)


# --- posture -------------------------------------------------------------------------------------


def test_the_thigh_is_ahead_at_heel_strike_and_behind_before_push_off():
    cycle = np.degrees([thigh_angle(pct) for pct in np.arange(100.0)])

    assert thigh_angle(100.0) == pytest.approx(thigh_angle(0.0))
    assert 15.0 < cycle[0] < 25.0
    assert 48 <= int(cycle.argmin()) <= 56
    assert -15.0 < cycle.min() < -8.0


@pytest.mark.real_data
def test_the_thigh_is_winters_hip_angle_to_a_degree(real_data):
    table = pd.read_csv(real_data / "winter_normal" / "winter_normal_tidy.csv")
    ours = np.degrees([thigh_angle(pct) for pct in table["gait_percent"]])

    apart = ours - table["hip_angle_deg"]

    assert float(np.sqrt(np.mean(apart**2))) < 0.35  # deg
    assert float(np.abs(apart).max()) < 1.0
