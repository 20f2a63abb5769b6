"""The printed numbers of chapter III against each other: every audit note is recomputed."""

import itertools
from collections.abc import Mapping

import numpy as np
import pytest

from jointz.reference import Printed, chapter3


def every_printed(value):
    """Walk through mappings and tuples down to the numbers."""
    if isinstance(value, Printed):
        yield value
    elif isinstance(value, tuple):
        yield from itertools.chain.from_iterable(map(every_printed, value))
    elif isinstance(value, Mapping):
        yield from itertools.chain.from_iterable(map(every_printed, value.values()))


def test_every_number_names_its_source():
    numbers = [n for value in vars(chapter3).values() for n in every_printed(value)]
    assert len(numbers) > 30
    assert all(n.source for n in numbers)
    assert all(d.source and d.citations and d.low <= d.high for d in chapter3.OTHER_DEVICES)


def test_models_have_the_terms_of_their_equations():
    terms = {name: set(model) for name, model in chapter3.TORQUE_MODELS.items()}
    current = {"bias", "gear_ratio", "torque_constant"}
    assert terms["3.1"] == current
    assert terms["3.2"] == current | {"viscous_friction", "rotor_inertia"}
    assert terms["3.3"] == current | {"coulomb_friction", "gear_friction", "rotor_inertia"}


def test_more_terms_err_less():
    rms = [chapter3.TORQUE_RMS[name].value for name in ("3.1", "3.2", "3.3")]
    assert rms == sorted(rms, reverse=True)
    assert chapter3.CHIRP_RMS.value < rms[-1] < chapter3.TORQUE_ERROR_LIMIT.value


def test_inertia_of_model_2_is_flagged_as_not_physical():
    inertia = {n: m["rotor_inertia"] for n, m in chapter3.TORQUE_MODELS.items() if n != "3.1"}
    assert inertia["3.2"].value / inertia["3.3"].value > 20
    assert "not physical" in inertia["3.2"].note
    assert "not fitted" in inertia["3.3"].note


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
    assert "looks exchanged" in second["viscous_friction"].note


def test_dynamic_error_is_neither_the_signed_nor_the_absolute_mean():
    truth = chapter3.DITHER_STIFFNESS.value
    pulses = (chapter3.POSITIVE_PULSE_STIFFNESS, chapter3.NEGATIVE_PULSE_STIFFNESS)
    errors = [100 * (p.value / truth - 1) for p in pulses]
    signed, absolute = sum(errors) / 2, sum(map(abs, errors)) / 2

    assert (round(signed, 2), round(absolute, 2)) == (5.10, 5.96)
    printed = chapter3.DYNAMIC_STIFFNESS_ERROR
    assert round(signed, 2) < printed.value < round(absolute, 2)
    assert "5.10 %" in printed.note
    assert "5.96 %" in printed.note


def test_two_springs_in_parallel_are_not_what_was_measured():
    assert abs(chapter3.DITHER_STIFFNESS.value - 2 * 150) > 150
    assert "parallel" in chapter3.DITHER_STIFFNESS.note


def test_mean_vaf_of_the_pilot_is_that_of_its_two_people():
    vaf = chapter3.PILOT_VAF
    assert vaf["mean"].value == pytest.approx((vaf["1"].value + vaf["2"].value) / 2, abs=0.05)


def test_ranges_of_the_pilot_run_from_largest_to_smallest():
    assert all(high.value > low.value for high, low in chapter3.PILOT_RANGES.values())


def test_static_error_lies_below_the_range_of_other_devices_but_for_one():
    torque, sagittal, frontal = chapter3.OTHER_DEVICES
    static, dynamic = chapter3.STATIC_STIFFNESS_ERROR, chapter3.DYNAMIC_STIFFNESS_ERROR
    assert frontal.low < static.value < sagittal.low < dynamic.value < sagittal.high
    assert chapter3.CHIRP_RMS.value < torque.high
