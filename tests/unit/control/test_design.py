"""Requirements of a profile, and passive, clutched and motorised joints for it."""

import json
from dataclasses import replace

import numpy as np
import pytest
from scipy.optimize import brentq, nnls

from jointz.control.design import JointDesign, design_joint
from jointz.control.motor import Motor, built_in_motor, read_motor
from jointz.control.profile_file import write_profile
from jointz.core.errors import DataError
from jointz.core.study import TorqueModelSpec

MOTOR = """
resistance_ohm = 0.2
supply_v = 36.0
peak_current_a = 25.0
continuous_current_a = 8.0

[torque_model]
gear_ratio = 9
torque_constant = 0.11
coulomb_friction = 0.38
gear_friction = 0.09
rotor_inertia = 0.0092
"""


def only(profile, **options):
    return design_joint({"walk": profile}, **options).profiles[0]


def acceleration(profile):
    step_s = profile.stride_s / profile.angle.size
    angle = profile.angle
    return (np.roll(angle, 1) - 2.0 * angle + np.roll(angle, -1)) / step_s**2


def ideal_motor(**limits):
    model = TorqueModelSpec(gear_ratio=10.0, torque_constant=0.1, rotor_inertia=0.01)
    usual = {"supply_v": 1e3, "peak_current_a": 1e3, "continuous_current_a": 1e3}
    return Motor(resistance_ohm=0.5, torque_model=model, **(usual | limits))


def test_requirements_are_sums_over_the_phases(profile):
    design = only(profile, efficiency=0.5)
    power = [float(m * v) for m, v in zip(profile.moment, profile.velocity, strict=True)]
    step_s = profile.stride_s / len(power)
    negative = step_s * sum(p for p in power if p < 0.0)
    expected = {
        "torque_max": max(profile.moment),
        "torque_min": min(profile.moment),
        "torque_rms": np.sqrt(sum(m * m for m in profile.moment) / len(power)),
        "power_max": max(power),
        "power_min": min(power),
        "positive_work": step_s * sum(p for p in power if p > 0.0),
        "negative_work": negative,
        "net_work": profile.energy_j,
        "regenerated": -0.5 * negative,
    }
    for name, value in expected.items():
        assert design.value(name) == pytest.approx(value, rel=1e-12), name


def test_spring_and_damper_are_found_exactly(profile):
    moment = 80.0 * (0.3 - profile.angle) - 1.5 * profile.velocity
    design = only(replace(profile, moment=moment))
    found = [design.value(f"passive_{name}") for name in ("stiffness", "damping", "rest_angle")]
    assert found == pytest.approx([80.0, 1.5, 0.3])
    assert design.value("passive_error_rms") == pytest.approx(0.0, abs=1e-9)
    assert design.value("passive_missing_work") == pytest.approx(0.0, abs=1e-9)


def test_negative_stiffness_is_not_passive(profile):
    moment = 80.0 * (profile.angle - 0.3) + 1.5 * profile.velocity
    design = only(replace(profile, moment=moment))
    assert design.value("passive_stiffness") >= 0.0
    assert design.value("passive_damping") == 0.0
    assert abs(design.value("passive_rest_angle")) <= np.pi
    assert design.value("passive_missing_work") > 0.0


@pytest.mark.parametrize(("first", "last"), [(20, 55), (90, 30)])
def test_clutched_spring_is_found_exactly(profile, first, last):
    part = np.arange(first, last + 1 + 100 * (last < first)) % 100
    rest, moment = profile.angle[first], -0.4 * profile.velocity
    moment[part] = 60.0 * (rest - profile.angle[part]) - 1.2 * profile.velocity[part]
    design = only(replace(profile, moment=moment))
    names = ("engaged", "released", "stiffness", "rest_angle", "damping_engaged", "damping_free")
    found = [design.value(f"clutch_{name}") for name in names]
    assert found == pytest.approx([first, last, 60.0, rest, 1.2, 0.4])
    loss = 30.0 * (profile.angle[last] - rest) ** 2
    assert design.value("clutch_loss") == pytest.approx(loss)
    balance = design.value("clutch_stored") - design.value("clutch_returned")
    assert balance == pytest.approx(loss)
    np.testing.assert_allclose(design.clutch_torque, moment, atol=1e-9)


def test_no_other_part_fits_better(published):
    """Every part once more, by another solver."""
    angle, velocity, moment = published.angle, published.velocity, published.moment
    best = np.inf
    for first in range(100):
        turn = (np.arange(100) + first) % 100
        for nodes in range(2, 100):
            part, rest = turn[:nodes], turn[nodes:]
            columns = np.column_stack([angle[first] - angle[part], -velocity[part]])
            inside = nnls(columns, moment[part])[1]
            outside = nnls(-velocity[rest][:, None], moment[rest])[1]
            best = min(best, inside**2 + outside**2)
    assert only(published).value("clutch_error_rms") == pytest.approx(np.sqrt(best / 100.0))


def test_gear_of_a_pure_inertia_matches_it(profile):
    """The least heat is at the square root of load over rotor inertia."""
    load = replace(profile, moment=0.16 * acceleration(profile))
    design = only(load, motor=ideal_motor(), efficiency=1.0)
    assert design.value("gear_ratio") == 40.0  # rotor 0.01 / 10^2
    assert (design.value("gear_ratio_low"), design.value("gear_ratio_high")) == (1.0, 200.0)
    current = 2.0 * 0.16 / 40.0 * acceleration(profile) / 0.1
    assert design.value("motor_current_max") == pytest.approx(np.abs(current).max())
    heat = 0.5 * np.mean(current**2) * profile.stride_s
    assert design.value("motor_energy") == pytest.approx(heat)


def test_current_solves_the_torque_model(profile):
    design = only(profile)
    ratio, model = design.value("gear_ratio"), built_in_motor().torque_model
    scale = ratio / model.gear_ratio

    def torque(current, velocity, bend):
        friction = scale * (model.coulomb_friction + model.gear_friction * abs(current))
        inertia = scale**2 * model.rotor_inertia * bend
        return ratio * model.torque_constant * current - friction * np.sign(velocity) - inertia

    currents = np.array([
        brentq(lambda i, m=m, v=v, a=a: torque(i, v, a) - m, -100.0, 100.0, xtol=1e-12)
        for m, v, a in zip(profile.moment, profile.velocity, acceleration(profile), strict=True)
    ])  # fmt: skip
    voltage = 0.2 * currents + model.torque_constant * ratio * profile.velocity
    power = voltage * currents
    energy = np.where(power > 0.0, power, 0.6 * power).sum() * profile.stride_s / 100.0
    assert design.value("motor_current_max") == pytest.approx(np.abs(currents).max())
    assert design.value("motor_current_rms") == pytest.approx(np.sqrt(np.mean(currents**2)))
    assert design.value("motor_voltage_max") == pytest.approx(np.abs(voltage).max())
    assert design.value("motor_energy") == pytest.approx(energy)


@pytest.mark.parametrize(
    ("limit", "name"),
    [
        ({"peak_current_a": 0.1, "continuous_current_a": 0.1}, "peak current"),
        ({"continuous_current_a": 0.1}, "continuous current"),
        ({"supply_v": 0.01}, "supply voltage"),
    ],
)
def test_limit_that_no_gear_keeps_is_named(profile, limit, name):
    design = design_joint({"walk": profile}, motor=ideal_motor(**limit))
    assert design.ratio is None
    assert design.profiles[0].value("gear_ratio") is None
    assert f"{name} " in design.summary().partition("no gear ratio")[2]
    assert JointDesign.from_dict(design.to_dict()) == design


def test_intervals_follow_the_error_of_the_moment(profile):
    table = design_joint({"walk": profile}).to_frame().set_index("quantity")
    both = table.dropna(subset=["low"])
    assert ((both["low"] <= both["value"]) & (both["value"] <= both["high"])).all()
    assert (table.loc["net_work", ["low", "high"]] == profile.energy_low_j).iloc[0]
    error = 1.5 / np.sqrt(60.0)  # SD between strides over the root of their number
    width = np.ptp(table.loc["torque_max", ["low", "high"]]) / (2.0 * 1.96 * error)
    assert width == pytest.approx(1.0, rel=0.2)
    assert table.loc["torque_max", "stride_95"] == pytest.approx(
        profile.moment.max() + 1.6449 * 1.5, rel=1e-5
    )
    assert table.loc["torque_min", "stride_95"] == pytest.approx(
        profile.moment.min() - 1.6449 * 1.5, rel=1e-5
    )


def test_without_spread_all_strides_are_the_mean(profile):
    table = design_joint({"walk": replace(profile, moment_sd=np.zeros(100))}).to_frame()
    table = table[table["quantity"] != "net_work"].dropna()
    np.testing.assert_allclose(table["low"], table["high"])
    np.testing.assert_allclose(table["stride_95"], table["value"])


def test_one_gear_for_several_profiles(profile, published):
    design = design_joint({"made": profile, "book": published})
    assert list(design.to_frame()["profile"].unique()) == ["made", "book"]
    lows, highs = (
        [p.value(f"gear_ratio_{end}") for p in design.profiles] for end in ("low", "high")
    )
    assert max(lows) <= design.ratio <= min(highs)
    assert sum(line.strip().startswith(("made ", "book ")) for line in _lines(design)) == 2
    assert JointDesign.from_dict(json.loads(json.dumps(design.to_dict()))) == design
    assert design.plot().get_ylabel() == "power (W)"


def _lines(design):
    return design.summary().splitlines()


def test_bad_input_of_a_design(profile):
    with pytest.raises(DataError, match="at least one"):
        design_joint({})
    with pytest.raises(DataError, match="0 to 1"):
        design_joint({"a": profile}, efficiency=float("nan"))
    with pytest.raises(DataError, match="one joint"):
        design_joint({"a": profile, "b": replace(profile, joint="ankle")})
    with pytest.raises(DataError, match="zero everywhere"):
        design_joint({"a": replace(profile, moment=np.zeros(100))})


def test_motor_file(tmp_path):
    file = tmp_path / "motor.toml"
    file.write_text(MOTOR)
    assert read_motor(file) == built_in_motor().model_copy(update={"source": ""})


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("supply_v = 36.0\n", "", "supply_v"),
        ("supply_v", "supply", "supply"),
        ("supply_v = 36.0", "supply_v = -1", "supply_v"),
        ("supply_v = 36.0", "supply_v = inf", "supply_v"),
        ("continuous_current_a = 8.0", "continuous_current_a = 80", "at most peak_current_a, 25"),
        ("gear_friction = 0.09", "gear_friction = 2", "less than gear_ratio"),
        ("coulomb_friction = 0.38", "coulomb_friction = -1", "coulomb_friction"),
        ("torque_constant = 0.11", "torque_constant = 0", "torque_constant"),
        ("[torque_model]", "[torque_model", "TOML"),
    ],
)
def test_bad_motor_file(tmp_path, old, new, message):
    file = tmp_path / "motor.toml"
    file.write_text(MOTOR.replace(old, new, 1))
    with pytest.raises(DataError, match=message):
        read_motor(file)
    with pytest.raises(DataError, match="no such file"):
        read_motor(tmp_path / "none.toml")


@pytest.fixture
def file(profile, tmp_path):
    return write_profile(profile, tmp_path / "S01.json")


def test_command(profile, file, tmp_path, jointz):
    motor, figure = tmp_path / "motor.toml", tmp_path / "design.svg"
    motor.write_text(MOTOR)
    outcome = jointz(
        "control", "design", file, "--motor", motor, "--figure", figure, "--json"
    )  # fmt: skip
    printed = json.loads(outcome.out)
    assert (outcome.code, printed.pop("status")) == (0, "ok")
    expected = design_joint({"S01": profile}, motor=read_motor(motor))
    assert JointDesign.from_dict(printed) == expected
    assert figure.read_text().startswith("<?xml")
    again = jointz("control", "design", file, "--figure", figure)
    assert (again.code, "exists" in again.err) == (2, True)


def test_command_without_a_feasible_gear(file, tmp_path, jointz):
    motor = tmp_path / "weak.toml"
    motor.write_text(MOTOR.replace("36.0", "0.01"))
    outcome = jointz("control", "design", file, "--motor", motor)
    assert outcome.code == 1
    assert "supply voltage" in outcome.out


def test_command_refuses_bad_input(file, jointz):
    outcome = jointz("control", "design", file, file)
    assert (outcome.code, "more than once" in outcome.err) == (2, True)
    outcome = jointz("control", "design", file, "--efficiency", 2, "--quiet")
    assert (outcome.code, outcome.out, "0 to 1" in outcome.err) == (2, "", True)
