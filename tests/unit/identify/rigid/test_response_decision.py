"""From moments to rows: intervals, limits at the bound, refusals."""

from dataclasses import dataclass

import numpy as np
import pytest

from jointz.core.study import Calibrated, CalibrationSpec
from jointz.identify.preparation.cell_data import PARAMETERS
from jointz.identify.rigid.response_decision import (
    Decision,
    NaturalSize,
    decided_parameters,
    error_budget,
)
from jointz.identify.rigid.response_model import CellResponse
from jointz.identify.rigid.response_posterior import Moments


@dataclass
class Found:
    """A posterior of one point with given means and sds."""

    K: tuple[float, float] = (60.0, 4.0)
    B: tuple[float, float] = (2.5, 0.1)
    inertia_log: tuple[float, float] = (float(np.log(0.06)), 0.05)

    def stiffness(self, _):
        return Moments(self.K[0], {"noise": self.K[1] ** 2})

    def damping(self, _):
        return Moments(self.B[0], {"noise": 0.64 * self.B[1] ** 2, "lag": 0.36 * self.B[1] ** 2})

    def log_inertia(self, _):
        return Moments(self.inertia_log[0], {"noise": self.inertia_log[1] ** 2})


NATURAL = NaturalSize(60.0, 3.0, 0.15)


def decision(*, mass_kg=70.0, subtract=PARAMETERS, natural=NATURAL, **known):
    entries = {name: Calibrated(value=v, sd=sd) for name, (v, sd) in known.items()}
    return Decision(CalibrationSpec(**entries), subtract, mass_kg, natural)


def rows(found=None, **more):
    return {p.name: p for p in decided_parameters(0, found or Found(), decision(**more))}


def test_a_value_far_from_the_bound_has_the_plain_interval():
    p = rows()["stiffness"]
    assert (p.status, p.value, p.unbounded) == ("ok", 60.0, 60.0)
    assert (p.ci_low, p.ci_high) == pytest.approx((60.0 - 1.96 * 4.0, 60.0 + 1.96 * 4.0), abs=1e-3)


def test_an_interval_of_more_than_half_the_value_each_way_decides_nothing():
    p = rows(Found(K=(60.0, 60.0 / 3.9)))["stiffness"]
    assert (p.status, p.value, p.ci_low, p.ci_high, p.unbounded) == (
        "undecided",
        None,
        None,
        None,
        60.0,
    )
    assert rows(Found(K=(60.0, 60.0 / 4.0)))["stiffness"].status == "ok"


@pytest.mark.parametrize("mean", [-5.0, 0.0, 3.0])
def test_near_zero_there_is_a_one_sided_limit(mean):
    p = rows(Found(K=(mean, 6.0)))["stiffness"]
    assert (p.status, p.ci_low, p.value, p.unbounded) == ("at_bound", 0.0, max(mean, 0.0), mean)
    assert p.ci_high > 3.0


def test_a_limit_that_is_no_small_one_decides_nothing():
    assert rows(Found(K=(5.0, 20.0)))["stiffness"].status == "undecided"


def test_errors_of_the_gains_count_for_all_and_not_for_the_budget_of_noise():
    known = {"torque_gain": (1.0, 0.03), "angle_gain": (2.0, 0.08)}
    relative = np.hypot(0.03, 0.04)
    p = rows(**known)["damping"]
    expected = 1.96 * np.hypot(0.1, relative * 2.5)
    assert p.ci_high - p.value == pytest.approx(expected, rel=1e-3)
    budget = error_budget(0, Found(), decision(**known))
    assert budget["damping"]["gain"] == pytest.approx(relative * 2.5)
    assert budget["damping"]["noise"] == pytest.approx(0.08)
    assert budget["damping"]["lag"] == pytest.approx(0.06)


def test_intrinsic_impedance_is_subtracted_where_it_is_still_in():
    known = {"intrinsic_stiffness": (10.0, 3.0)}
    kept = rows(subtract=(), **known)["stiffness"]
    out = rows(**known)["stiffness"]
    assert (kept.value, out.value) == (60.0, 50.0)
    assert out.ci_high - out.value == pytest.approx(1.96 * 5.0, rel=1e-3)


def test_each_part_of_the_intrinsic_impedance_is_subtracted_where_it_alone_is_still_in():
    known = {"intrinsic_stiffness": (10.0, 0.0), "intrinsic_damping": (0.5, 0.0)}
    found = rows(subtract=("stiffness",), **known)
    assert (found["stiffness"].value, found["damping"].value) == (50.0, 2.5)


def test_the_interval_of_inertia_is_that_of_its_logarithm():
    p = rows()["inertia"]
    assert p.value == pytest.approx(0.06)
    assert np.log(p.ci_high / p.value) == pytest.approx(1.96 * 0.05, rel=1e-3)
    assert p.ci_high * p.ci_low == pytest.approx(p.value**2)


def test_values_per_kg_follow_and_need_a_mass():
    assert rows()["stiffness_per_mass"].value == pytest.approx(60.0 / 70.0)
    assert rows(mass_kg=None)["damping_per_mass"].status == "failed:mass_missing"


def test_natural_sizes_are_those_that_alone_would_have_moved_as_far():
    time = np.arange(51) * 0.002
    torque = np.stack([np.full(51, 10.0), np.full(51, -1.0)])
    response = CellResponse("A", 2.0 * time, torque, np.eye(51), 0.002, 0.1, 1.1)
    size = NaturalSize.of(response)
    assert size.stiffness == pytest.approx(9.0 / 0.2)
    assert size.damping == pytest.approx(size.stiffness * 0.05)
    assert size.inertia == pytest.approx(size.stiffness * 0.005)


def test_a_limit_that_is_the_priors_decides_nothing():
    @dataclass
    class Assumed(Found):
        def stiffness(self, _):
            return Moments(8.0, {"noise": 20.0, "prior": 16.0})

    assert rows(Assumed())["stiffness"].status == "undecided"
    told = {"noise": 36.0 - 8.0, "prior": 8.0}

    @dataclass
    class Told(Found):
        def stiffness(self, _):
            return Moments(8.0, told)

    assert rows(Told())["stiffness"].status == "at_bound"


def test_a_value_below_zero_by_more_than_its_error_contradicts_the_calibration():
    p = rows(intrinsic_stiffness=(90.0, 3.0))["stiffness"]
    assert (p.status, p.value, p.unbounded) == ("failed:below_zero", None, -30.0)
    p = rows(intrinsic_inertia=(0.3, 0.01))["inertia"]
    assert (p.status, p.ci_high, p.unbounded) == ("failed:below_zero", None, pytest.approx(-0.24))
