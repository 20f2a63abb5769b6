"""People of the preset ``realistic``: what is drawn for each, and what the truth says of it."""

import json
from dataclasses import replace

import numpy as np
import pytest

from jointz.rig.session.simulate_study import simulate_study
from jointz.rig.sim.direct_walk import WalkPlan
from jointz.rig.sim.own_truth import cell_truth
from jointz.rig.sim.people import draw_instruments, draw_person, personal_preset
from jointz.rig.sim.presets import preset
from jointz.rig.sim.rig import SimulatedRig
from jointz.rig.sim.walking.impedance_curves import impedance_over_cycle, leg_of, thigh_share

PEOPLE = [draw_person(number, seed=4) for number in range(60)]


def own(person):
    return personal_preset(person, preset("realistic"))


def test_settings_are_drawn_within_their_ranges_and_differ():
    settings = [own(person) for person in PEOPLE]
    softening = np.degrees([s.joint.softening_rad for s in settings])
    latency = np.array([s.joint.reflex.latency_s for s in settings])
    shape = np.degrees([s.gait.shape_sd_rad for s in settings])
    gain = np.array([s.joint.reflex.gain for s in settings])
    tissue = np.array([s.goniometer.tissue_range_hz[0] for s in settings])
    for values, low, high in (
        (softening, 12.0, 40.0),
        (latency, 0.025, 0.070),
        (shape, 0.5, 1.4),
        (gain, 0.0, 0.6),
        (tissue, 10.0, 40.0),
    ):
        assert (values >= low).all()
        assert (values <= high).all()
        assert np.ptp(values) > 0.7 * (high - low)
        assert len(np.unique(values)) == len(PEOPLE)
    # Log-uniform: as many below the geometric middle as above.
    assert 0.3 < np.mean(softening < np.sqrt(12.0 * 40.0)) < 0.7


def test_a_person_is_the_same_every_time_and_in_the_rig():
    person = PEOPLE[3]
    rig = SimulatedRig(person, preset("realistic"))
    assert own(person) == own(draw_person(3, seed=4)) == rig.preset
    assert personal_preset(person, rig.preset) == rig.preset
    assert personal_preset(person, preset("nominal")) is preset("nominal")


def test_strap_resonates_where_it_was_drawn():
    for person in PEOPLE[:10]:
        body, actuator = own(person).body, own(person).actuator
        inertia = actuator.rotor_inertia + body.frame_mass_kg * body.frame_distance_m**2
        stiffness = draw_instruments(person, preset("realistic")).strap_stiffness
        assert 10.0 <= np.sqrt(stiffness / inertia) / (2.0 * np.pi) <= 40.0
        ratio = 0.5 * body.strap_damping_time_s * np.sqrt(stiffness / inertia)
        assert 0.1 <= ratio <= 0.6


def test_legs_by_sex_have_the_inertia_of_de_leva():
    sexes = {person.sex for person in PEOPLE}
    assert sexes == {"female", "male"}
    for person in PEOPLE:
        leg = leg_of(person, preset("realistic").body)
        shank_m = 0.253 * person.height_m
        assert 0.015 < leg.inertia / (person.mass_kg * shank_m**2) < 0.035
        share = leg.mass_kg / person.mass_kg
        assert share == pytest.approx({"female": 0.0610, "male": 0.0570}[person.sex])


def test_truth_has_onset_mean_and_secant(tmp_path):
    study = simulate_study(tmp_path / "study", preset="realistic", plan=WalkPlan(per_point=1))
    truth = json.loads((study / "ground_truth.json").read_text())["participants"]["S01"]
    pulses = truth["perturbed"]["pulses"]
    assert truth["perturbed"]["person"]["sex"] in ("female", "male")
    for pulse in pulses:
        # Softening makes the secant smaller than what small motion would have met.
        assert 0.0 < pulse["stiffness_secant"] < 1.5 * pulse["stiffness_window_mean"]
        assert pulse["damping_onset"] > 0.0
        assert abs(pulse["inertial_stiffness"]) < 12.0
        assert -2.0 < pulse["inertia_rate"] < 2.0
    by_point = truth["perturbed"]["timing_points"]
    assert by_point["MST"]["inertial_stiffness"] == 0.0  # in stance only dJ/dt is known
    assert by_point["MST"]["inertia_rate"] < -0.1
    assert by_point["ISW"]["inertial_stiffness"] < -1.0
    soft = [p["stiffness_secant"] / p["stiffness_window_mean"] for p in pulses]
    assert np.median(soft) < 0.98
    # K of an estimate contains gravity and the chain, B does not contain dJ/dt (docs/run.md).
    for point, own_values in cell_truth(truth["perturbed"]).items():
        means = by_point[point]
        around = means["gravity_stiffness"] + means["inertial_stiffness"]
        assert own_values["stiffness"] == pytest.approx(means["stiffness"] + around)
        assert own_values["damping"] == pytest.approx(means["damping"])


def test_truth_of_rigid_people_has_no_softening(tmp_path):
    study = simulate_study(tmp_path / "study", preset="clean", plan=WalkPlan(per_point=1))
    truth = json.loads((study / "ground_truth.json").read_text())["participants"]["S01"]
    for pulse in truth["perturbed"]["pulses"]:  # on a plateau all three are one number
        if pulse["timing_point"] in ("MST", "TST"):
            assert pulse["stiffness_onset"] == pytest.approx(pulse["stiffness_secant"], rel=0.02)


def test_thigh_turns_back_by_a_share_of_the_knee():
    cycles = np.linspace(0.0, 1.0, 50, endpoint=False)
    share = thigh_share(PEOPLE[0], preset("realistic"), cycles)
    assert (share > 0.1).all()
    assert (share < 0.6).all()
    assert not thigh_share(PEOPLE[0], preset("nominal"), cycles).any()


def test_stiffness_and_damping_change_by_10_to_30_percent_in_100_ms():
    cycles = np.arange(2000) / 2000.0
    changes = {0: [], 1: []}
    for person in PEOPLE:
        curves = impedance_over_cycle(person, preset("realistic"), cycles)
        steps = round(0.001 * 2000 / person.stride_time_s)
        asked = own(person).joint
        for which, limit in ((0, asked.stiffness_change), (1, asked.damping_change)):
            logs = np.log(curves[which])
            rate = np.abs(np.roll(logs, -steps) - logs) / (steps / 2000 * person.stride_time_s)
            changes[which].append(0.1 * np.median(rate))
            assert changes[which][-1] < 1.05 * limit
        # The drawn values of K always change faster than that: it is the limit that is met.
        assert changes[0][-1] == pytest.approx(asked.stiffness_change, rel=0.05)
    for which in (0, 1):
        assert min(changes[which]) > 0.06
        assert np.ptp(changes[which]) > 0.1


def test_curves_never_go_beyond_the_values_without_a_limit():
    person = PEOPLE[1]
    free = replace(own(person).joint, stiffness_change=None)
    cycles = np.linspace(0.0, 1.0, 400, endpoint=False)
    drawn = impedance_over_cycle(person, own(person), cycles)[0]
    full = impedance_over_cycle(person, replace(own(person), joint=free), cycles)[0]
    assert np.ptp(np.log(drawn)) <= np.ptp(np.log(full)) + 1e-12
    assert np.log(drawn).mean() == pytest.approx(np.log(full).mean())
    assert full[cycles.searchsorted(0.26)] == pytest.approx(
        person.mass_kg * person.stiffness_per_mass["MST"], rel=0.02
    )
