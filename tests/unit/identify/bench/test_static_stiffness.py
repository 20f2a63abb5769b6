"""Static stiffness: the slope comes back, its interval covers, and dead records are refused."""

import numpy as np
import pytest
from scipy.signal import lfilter

from jointz.core.errors import DataError, EstimationError
from jointz.identify.bench.static_stiffness import identify_static_stiffness

RATE, K = 100.0, 146.39
TIME = np.arange(6000) / RATE
#: Six cycles of 10 N*m in 60 s (3.2.2).
ANGLE = 10.0 / K * np.sin(2 * np.pi * 0.1 * TIME)


def slow_noise(seed, sd=0.3, share=0.9):
    """Return noise that stays correlated for about ten samples."""
    white = np.random.default_rng(seed).standard_normal(TIME.size)
    return sd * np.sqrt(1 - share**2) * lfilter([1.0], [1.0, -share], white)


def fitted(torque, angle=ANGLE, **options):
    return identify_static_stiffness(angle=angle, torque=torque, rate_hz=RATE, **options)


def test_a_spring_comes_back_whatever_the_offsets():
    fit = fitted(K * ANGLE - 0.58, ANGLE + 0.2)

    assert fit.parameter("stiffness").value == pytest.approx(K, rel=1e-12)
    assert fit.vaf_pct == pytest.approx(100.0)
    assert fit.excursion_rad == pytest.approx(20.0 / K, rel=1e-3)


def test_intervals_cover_under_noise_that_stays_correlated():
    found = [fitted(K * ANGLE + slow_noise(seed)).parameter("stiffness") for seed in range(40)]

    covered = sum(p.ci_low <= K <= p.ci_high for p in found)
    # 95 % of 40 is 38; 34 or fewer has a probability of 2 % at 95 %.
    assert covered >= 35
    spread = np.std([p.value for p in found], ddof=1)
    width = np.mean([p.ci_high - p.ci_low for p in found]) / (2 * 2.0)
    assert width == pytest.approx(spread, rel=0.3)
    slope = np.polyfit(ANGLE, K * ANGLE + slow_noise(1), 1)[0]
    assert found[1].value == pytest.approx(slope, rel=1e-10)


def test_friction_against_the_motion_is_taken_out_where_the_direction_is_known():
    way = np.sign(np.cos(2 * np.pi * 0.1 * TIME))
    spring = K * ANGLE
    # torque = spring + (0.38 + 0.1 |torque|) way, solved for the torque by its sign
    rest = spring + 0.38 * way
    torque = np.where(rest >= 0, rest / (1 - 0.1 * way), rest / (1 + 0.1 * way))

    with_friction = fitted(torque, direction=way)

    assert with_friction.parameter("stiffness").value == pytest.approx(K, rel=1e-9)
    assert with_friction.parameter("coulomb_friction").value == pytest.approx(0.38, rel=1e-9)
    assert with_friction.parameter("load_friction").value == pytest.approx(0.1, rel=1e-9)
    assert abs(fitted(torque).parameter("stiffness").value - K) > 0.5


def test_a_low_pass_leaves_the_slow_part():
    fast = 0.02 * np.sin(2 * np.pi * 5.0 * TIME)

    fit = fitted(K * ANGLE + 30.0 * fast, ANGLE + fast, cutoff_hz=5.0**0.5)

    assert fit.parameter("stiffness").value == pytest.approx(K, rel=1e-3)
    assert fit.n_samples == TIME.size - 2 * round(4.5 / 5.0**0.5 * RATE)


@pytest.mark.parametrize(
    ("changes", "code"),
    [
        ({"angle": np.full(6000, 0.3)}, "constant_angle"),
        ({"torque": np.zeros(6000)}, "constant_torque"),
        ({"angle": 1e-5 * np.random.default_rng(0).standard_normal(6000)}, "constant_angle"),
        ({"torque": K * np.sign(ANGLE), "direction": np.sign(ANGLE)}, "ill_conditioned"),
    ],
    ids=["still", "unloaded", "noise only", "one size of torque"],
)
def test_a_record_that_tells_nothing_is_refused(changes, code):
    given = {"angle": ANGLE, "torque": K * ANGLE + slow_noise(2)} | changes

    with pytest.raises(EstimationError) as refused:
        identify_static_stiffness(**given, rate_hz=RATE)

    assert refused.value.code == code


def test_noise_of_the_angle_is_told_by_its_share():
    noise = 0.1 * np.std(ANGLE) * np.random.default_rng(3).standard_normal(TIME.size)

    fit = fitted(K * ANGLE, ANGLE + noise)

    assert fit.settings["angle_noise_share"] == pytest.approx(0.01, rel=0.1)
    assert fit.parameter("stiffness").value == pytest.approx(K / 1.01, rel=2e-3)


def test_levels_held_for_a_moment_are_not_taken_for_noise():
    angle = np.repeat(np.linspace(-0.07, 0.07, 25), 4)

    assert fitted(K * angle, angle).parameter("stiffness").value == pytest.approx(K)


def test_a_turned_sign_has_no_value():
    fit = fitted(-K * ANGLE + slow_noise(4))

    assert fit.parameter("stiffness").value is None
    assert fit.parameter("stiffness").unbounded == pytest.approx(-K, rel=0.01)


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"ci_level": 1.0}, "ci_level"),
        ({"cutoff_hz": 60.0}, "50 Hz"),
        ({"cutoff_hz": 0.15}, "30 s"),
        ({"direction": np.ones(6000)}, "0 %"),
        ({"torque": ANGLE[:40], "angle": ANGLE[:40]}, "got 40"),
    ],
)
def test_requests_out_of_range_are_refused(options, message):
    with pytest.raises(DataError, match=message):
        fitted(**({"torque": K * ANGLE} | options))
