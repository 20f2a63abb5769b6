"""The printed numbers of chapter III against each other: every audit note is recomputed."""

import numpy as np
import pytest

from jointz.reference import chapter3


def test_the_j_of_model_2_is_the_b_that_the_friction_of_model_3_asks_for():
    levels, speeds = np.linspace(-10.0, 10.0, 7), np.array([-5.0, -3.0, -1.0, 1.0, 3.0, 5.0])
    third = {name: p.value for name, p in chapter3.TORQUE_MODELS["3.3"].items()}
    current = np.abs(levels) / (third["gear_ratio"] * third["torque_constant"])
    friction = third["coulomb_friction"] + third["gear_friction"] * current.mean()
    viscous = friction * np.abs(speeds).mean() / (speeds**2).mean()

    second = chapter3.TORQUE_MODELS["3.2"]
    assert viscous == pytest.approx(0.23, abs=0.005)
    assert viscous == pytest.approx(second["rotor_inertia"].value, rel=0.06)
    assert viscous > 60 * second["viscous_friction"].value


def test_mean_vaf_of_the_pilot_is_that_of_its_two_people():
    vaf = chapter3.PILOT_VAF
    assert vaf["mean"].value == pytest.approx((vaf["1"].value + vaf["2"].value) / 2, abs=0.05)
