"""The truth about a simulated condition."""

import json
from dataclasses import replace

import numpy as np
import pandas as pd
import pytest

from jointz.core.protocol import PulseSpec
from jointz.devices.interface import Stretch
from jointz.sim.people import draw_person
from jointz.sim.presets import JointSettings, preset
from jointz.sim.rig import SimulatedRig, simulated_rig

COLUMNS = ["pulse", "onset_s", "duration_s", "amplitude_nm", "timing_point", "completed"]
WHOLE = (Stretch(0, 0.0, 30.0),)
PARAMETERS = ("stiffness", "damping", "inertia")


def pulses_at(rig, share, *, offset_s=0.0, strides=(3, 7), segment=0, amplitude_nm=17.0):
    """Return pulses at a share of some strides."""
    motion = rig.motion("perturbed", segment)
    walk = [motion.next() for _ in range(max(strides) + 1)]
    rows = []
    for number, i in enumerate(strides, start=1):
        fine = np.linspace(0.0, walk[i].duration_s, 20001)
        into = np.interp(share, walk[i].cycles(walk[i].start_s + fine), fine)
        onset = walk[i].start_s + into + offset_s
        rows.append((number, onset, 0.25, amplitude_nm, "LRE", True))
    return pd.DataFrame(rows, columns=COLUMNS)


def test_heel_strikes_are_those_that_were_walked_with_the_offset_added():
    rig = simulated_rig(0)
    nothing = pd.DataFrame(columns=COLUMNS)
    stretches = (Stretch(0, 5.0, 20.0),)
    truth = rig.truth("perturbed", worn=True, stretches=stretches, pulses=nothing)
    motion = rig.motion("perturbed", 0)
    starts = np.array([motion.next().start_s for _ in range(40)])
    expected = starts[(starts >= 0) & (starts <= 20.0)] + 5.0
    np.testing.assert_allclose(truth["heel_strike_s"], expected, rtol=0, atol=1e-12)
    assert truth["pulses"] == []


def test_a_stretch_that_left_no_log_moves_no_strike_of_the_next():
    rig = simulated_rig(0)
    nothing = pd.DataFrame(columns=COLUMNS)
    second = rig.truth("perturbed", worn=True, stretches=(Stretch(1, 0.0, 20.0),), pulses=nothing)
    motion = rig.motion("perturbed", 1)
    starts = np.array([motion.next().start_s for _ in range(40)])
    expected = starts[(starts >= 0) & (starts <= 20.0)]
    np.testing.assert_allclose(second["heel_strike_s"], expected, rtol=0, atol=1e-12)


def test_a_pulse_that_was_broken_off_is_no_truth():
    rig = simulated_rig(2)
    pulses = pulses_at(rig, 0.07)
    pulses.loc[0, "completed"] = False
    truth = rig.truth("perturbed", worn=True, stretches=WHOLE, pulses=pulses)
    assert [row["pulse"] for row in truth["pulses"]] == [2]


def test_ramps_delay_the_response_that_weighs():
    rig = simulated_rig(2)
    shape = PulseSpec(
        amplitude_nm=17.0, duration_s=0.25, ramp_up_s=0.075, hold_s=0.1, ramp_down_s=0.075
    )
    step, ramp = (
        rig.truth("perturbed", worn=True, stretches=WHOLE, pulses=pulses_at(rig, 0.73), shape=s)
        for s in (None, shape)
    )
    for a, b in zip(step["pulses"], ramp["pulses"], strict=True):
        assert abs(b["displacement_rad"]) < 0.8 * abs(a["displacement_rad"])
        assert b["stiffness"] != pytest.approx(a["stiffness"], rel=1e-3)


def test_truth_on_a_plateau_is_the_persons_value():
    rig = simulated_rig(2)
    truth = rig.truth("perturbed", worn=True, stretches=WHOLE, pulses=pulses_at(rig, 0.07))
    person = rig.person
    assert len(truth["pulses"]) == 2
    for row in truth["pulses"]:
        assert row["onset_gait_pct"] == pytest.approx(7.0, abs=1e-4)
        assert row["stiffness"] == pytest.approx(person.mass_kg * person.stiffness_per_mass["LRE"])
        assert row["damping"] == pytest.approx(person.mass_kg * person.damping_per_mass["LRE"])
        assert row["inertia"] == pytest.approx(person.inertia)
        assert 0.05 < row["displacement_rad"] < 0.6
    assert truth["timing_points"]["LRE"]["inertia"] == pytest.approx(person.inertia)


def test_values_that_vary_are_weighted_by_the_response():
    rig = SimulatedRig(draw_person(2, seed=1), preset("hard"))
    # Across the step of stiffness between loading response and mid-stance: 18 to 21 %.
    row = rig.truth("perturbed", worn=True, stretches=WHOLE, pulses=pulses_at(rig, 0.14))["pulses"][
        0
    ]
    person = rig.person
    before, after = (person.mass_kg * person.stiffness_per_mass[p] for p in ("LRE", "MST"))
    assert min(before, after) < row["stiffness"] < max(before, after)
    # The displacement is large late in the window, the acceleration early.
    assert abs(row["stiffness"] - after) < abs(row["stiffness"] - before)
    early = person.inertia * (1 + 0.15 * np.cos(2 * np.pi * 0.155))
    assert row["inertia"] == pytest.approx(early, rel=0.02)


def test_truth_does_not_depend_on_the_sign_or_the_size_of_a_pulse():
    rig = simulated_rig(2, preset="hard")
    rows = [
        rig.truth(
            "perturbed", worn=True, stretches=WHOLE, pulses=pulses_at(rig, 0.5, amplitude_nm=a)
        )
        for a in (17.0, -5.0)
    ]
    for name in PARAMETERS:
        one, two = (r["pulses"][0][name] for r in rows)
        assert one == pytest.approx(two, rel=1e-9)


def test_a_softening_joint_is_truly_softer_for_larger_pulses():
    soft = replace(preset("nominal"), joint=JointSettings(softening_rad=0.3))
    rig = SimulatedRig(draw_person(2, seed=1), soft)
    small, large = (
        rig.truth(
            "perturbed", worn=True, stretches=WHOLE, pulses=pulses_at(rig, 0.07, amplitude_nm=a)
        )
        for a in (0.1, 17.0)
    )
    stiff = rig.person.mass_kg * rig.person.stiffness_per_mass["LRE"]
    assert small["pulses"][0]["stiffness"] == pytest.approx(stiff, rel=1e-4)
    assert large["pulses"][0]["stiffness"] < 0.97 * stiff


def test_stretches_have_strides_of_their_own_also_when_another_process_ran_them():
    rig = simulated_rig(1)
    offsets = (0.0, 60.0)
    stretches = tuple(Stretch(i, offset, 50.0) for i, offset in enumerate(offsets))
    pulses = pd.concat(
        [
            pulses_at(rig, 0.07, strides=(4,)),
            pulses_at(rig, 0.07, strides=(4,), segment=1, offset_s=60.0),
        ]
    )
    truth = rig.truth("perturbed", worn=True, stretches=stretches, pulses=pulses)
    strikes = np.array(truth["heel_strike_s"])
    assert [row["onset_gait_pct"] for row in truth["pulses"]] == pytest.approx([7.0, 7.0], abs=1e-4)
    for segment, offset in enumerate(offsets):
        first = rig.motion("perturbed", segment)
        first.next()
        assert np.abs(strikes - offset - first.next().start_s).min() < 1e-12
    assert (np.diff(strikes) > 0).all()


def test_gravity_adds_to_the_stiffness_of_an_anthropometric_leg_only():
    rig = simulated_rig(0, preset="anthropometric")
    truth = rig.truth("perturbed", worn=True, stretches=WHOLE, pulses=pulses_at(rig, 0.07))
    # SCIENCE 3.8: about 11 N*m/rad for shank and exoskeleton.
    assert truth["pulses"][0]["gravity_stiffness"] == pytest.approx(11.0, rel=0.35)
    rigid = simulated_rig(0)
    truth = rigid.truth("perturbed", worn=True, stretches=WHOLE, pulses=pulses_at(rigid, 0.07))
    assert truth["pulses"][0]["gravity_stiffness"] == 0.0


def test_truth_is_ready_for_json_and_names_everything():
    rig = simulated_rig(0, preset="anthropometric")
    truth = rig.truth("perturbed", worn=True, stretches=WHOLE, pulses=pulses_at(rig, 0.07))
    again = json.loads(json.dumps(truth))
    assert json.dumps(again) == json.dumps(truth)
    assert len(again["curves"]["stiffness"]) == len(again["curves"]["gait_pct"]) == 101
    assert again["instruments"]["strap_stiffness"] >= 300.0
    assert again["settings"]["name"] == "anthropometric"
    assert again["plant"]["strap_stiffness"] == again["instruments"]["strap_stiffness"]
    assert again["person"]["stiffness_per_mass"].keys() == rig.person.stiffness_per_mass.keys()
