"""Limits: a protocol tightens them and never loosens them."""

import pytest
from hypothesis import given
from hypothesis import strategies as st
from pydantic import ValidationError

from jointz.core.errors import ProtocolError
from jointz.core.limits import LimitsOverride, SafetyLimits, tightened
from jointz.core.protocols.device_limits import limits_on_device
from jointz.io.protocols import load_protocol

OWN = {
    "torque_nm": 30.0,
    "torque_rate_nm_s": 4000.0,
    "current_a": 25.0,
    "angle_min_rad": -0.2,
    "angle_max_rad": 1.9,
    "velocity_rad_s": 12.0,
    "temperature_c": 80.0,
    "sensor_age_s": 0.02,
    "pulse_count": 1000,
    "pulse_duty": 0.3,
    "consecutive_overruns": 5,
    "fade_s": 0.05,
    "displacement_rad": 0.3,
}


@pytest.fixture
def own():
    return SafetyLimits(**OWN)


def test_an_override_knows_every_limit_of_a_device():
    assert set(LimitsOverride.model_fields) == set(SafetyLimits.model_fields) == set(OWN)


def test_a_device_without_a_limit_of_displacement_takes_the_protocol_s():
    own = SafetyLimits(**{**OWN, "displacement_rad": None})
    assert tightened(own, LimitsOverride()).displacement_rad is None
    assert tightened(own, LimitsOverride(displacement_rad=0.2)).displacement_rad == 0.2
    with pytest.raises(ValidationError, match="less than or equal to 1"):
        LimitsOverride(displacement_rad=1.1)


@pytest.mark.parametrize("name", ["qdd-chirp", "calibration-spring"])
def test_a_device_s_limit_of_displacement_keeps_no_bench_from_running(name):
    own = SafetyLimits(**{**OWN, "torque_nm": 60.0, "torque_rate_nm_s": 1e5, "current_a": 60.0,
                          "angle_min_rad": -3.0, "angle_max_rad": 3.0, "velocity_rad_s": 30.0,
                          "sensor_age_s": 0.1, "consecutive_overruns": 10, "fade_s": 0.1,
                          "temperature_c": 100.0})  # fmt: skip
    assert limits_on_device(load_protocol(name), own, torque_per_ampere=10.0)


def test_a_device_s_limit_of_displacement_asks_walking_for_the_expected_joint():
    own = SafetyLimits(**{**OWN, "torque_rate_nm_s": 1e5})
    with pytest.raises(ProtocolError, match="expected_joint: missing"):
        limits_on_device(load_protocol("walking"), own, torque_per_ampere=10.0)


@pytest.mark.parametrize("name", ["fade_s", "sensor_age_s"])
def test_no_device_may_take_long_over_a_stop_or_a_lost_sensor(name):
    with pytest.raises(ValidationError, match="less than or equal to 1"):
        SafetyLimits(**{**OWN, name: 50.0})


@pytest.mark.parametrize("name", OWN)
def test_a_limit_can_be_tightened_and_touches_no_other(own, name):
    value = OWN[name]
    tighter = value + 0.1 if name == "angle_min_rad" else value - 1 if value > 1 else value / 2
    tighter = type(value)(tighter)

    made = tightened(own, LimitsOverride(**{name: tighter}))

    assert made.model_dump() == {**OWN, name: tighter}
    assert (
        tightened(own, LimitsOverride(**{name: value})) == own == tightened(own, LimitsOverride())
    )


def test_every_limit_that_would_be_loosened_is_named(own):
    override = LimitsOverride(torque_nm=31.0, current_a=20.0, pulse_duty=0.5, angle_min_rad=-0.3)

    with pytest.raises(ProtocolError, match="looser than the device's own") as caught:
        tightened(own, override)

    assert [p.split(":")[0] for p in caught.value.problems] == [
        "safety.torque_nm",
        "safety.angle_min_rad",
        "safety.pulse_duty",
    ]


@given(
    st.fixed_dictionaries(
        {}, optional={n: st.floats(0.001, 100.0) for n in OWN if isinstance(OWN[n], float)}
    ).filter(lambda v: v.get("pulse_duty", 0) <= 1)
)
def test_whatever_a_protocol_says_no_limit_comes_out_looser(values):
    try:
        made = tightened(SafetyLimits(**OWN), LimitsOverride(**values))
    except (ProtocolError, ValidationError):
        return
    for name, value in made.model_dump().items():
        tighter = value >= OWN[name] if name == "angle_min_rad" else value <= OWN[name]
        assert tighter


def test_an_empty_range_of_angles_is_refused():
    with pytest.raises(ValidationError, match="angle_min_rad"):
        SafetyLimits(**{**OWN, "angle_min_rad": 2.0})
    with pytest.raises(ValidationError, match=r"less than angle_max_rad = 0\.5"):
        LimitsOverride(angle_min_rad=0.6, angle_max_rad=0.5)


def test_a_range_of_angles_outside_the_device_s_is_refused(own):
    with pytest.raises(ProtocolError, match=r"safety.angle_min_rad: .* -0.2 to 1.9 rad"):
        tightened(own, LimitsOverride(angle_min_rad=2.0))


@pytest.mark.parametrize("name", [n for n in OWN if not n.startswith("angle")])
@pytest.mark.parametrize("value", [0, float("nan"), float("inf"), "20", True])
def test_a_limit_is_a_positive_number(name, value):
    with pytest.raises(ValidationError):
        LimitsOverride(**{name: value})
